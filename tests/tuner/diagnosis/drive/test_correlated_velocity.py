"""Velocities of a receiver that err for a while: named with their size, and seldom where they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.filter_states.built_in import CORRELATED_VELOCITY
from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.causes.correlated_velocity import correlated_velocity, exchanged
from tuner.diagnosis.drive.hypothesis import Hypothesis, run_filter
from tuner.linear_run.likelihood import as_configured, evaluate

SD, TIME, DURATION = 0.15, 40.0, 700.0
"""Of the errors, m/s and s, in a drive that lasts so long."""
REPLICAS = 30


@pytest.fixture(scope="module")
def erring(simulated):
    """A drive whose velocities err by a Gauss–Markov process, beside their white noise of 0.06 m/s."""
    drive, rng = simulated(11, duration=DURATION), np.random.default_rng(2)
    phi, errors = np.exp(-1.0 / TIME), SD * rng.standard_normal((len(drive.gnss), 3))
    for k in range(1, len(errors)):
        errors[k] = phi * errors[k - 1] + np.sqrt(1.0 - phi**2) * errors[k]
    return replace(drive, gnss=replace(drive.gnss, vel_n=drive.gnss.vel_n + errors))


def test_velocities_that_err_for_a_while_are_named_alone(erring, drive_config):
    """Half of the correlation times of a drive are 17: the sd is known to a sixth, the time to a third."""
    found = diagnose_drive(erring, drive_config)
    (finding,) = found.findings
    assert finding.cause == "correlated_velocity"
    assert finding.parameters["sd"].value == pytest.approx(SD, rel=0.5)
    assert finding.parameters["sd"].unit == "m/s"
    assert TIME / 3.0 < finding.parameters["time_constant"].value < 3.0 * TIME
    state = CORRELATED_VELOCITY.name
    assert found.after.constants[state] == pytest.approx(finding.parameters["sd"].value, rel=0.2)
    assert found.gain.nats > 0.0


def test_the_state_in_the_model_is_that_in_the_filter(simulated, drive_config):
    """Kalman recursion over Φ, Q and H gives the innovation covariances of the filter that has the state."""
    drive, state = simulated(3), CORRELATED_VELOCITY.name
    config = replace(drive_config, constants={state: SD}, time_constants={state: TIME})
    run = run_filter(drive, Hypothesis.first(drive, config))
    linearized, p = run.linearized, run.linearized.initial.copy()
    for i in range(60):
        p = linearized.transition[i] @ p @ linearized.transition[i].T
        p += sum(linearized.noise.values())[i]
        h = linearized.H[i]
        s = h @ p @ h.T + np.diag(linearized.sd[i] ** 2)
        np.testing.assert_allclose(s, run.solutions[0].innovation_covariance[i], rtol=1e-9, atol=1e-12)
        p = p - p @ h.T @ np.linalg.solve(s, h @ p)


def test_rows_are_exchanged_and_back(simulated, drive_config):
    drive = simulated(3)
    noise = as_configured(run_filter(drive, Hypothesis.first(drive, drive_config)).linearized)
    assert evaluate(exchanged(noise)).value == pytest.approx(evaluate(noise).value, rel=1e-9)
    np.testing.assert_array_equal(
        exchanged(exchanged(noise)).linearized.innovation, noise.linearized.innovation
    )


def test_p_values_of_clean_drives_are_not_too_small(simulated, drive_config):
    """Of 30 replicas 1.5 are expected below 0.05: more than 8 have a probability of 3e-5."""
    drive = simulated(3)
    source = Source.of(as_configured(run_filter(drive, Hypothesis.first(drive, drive_config)).linearized))
    rng = np.random.default_rng(5)
    p = [correlated_velocity(as_configured(source.draw(rng))).result.p_value for _ in range(REPLICAS)]
    assert np.count_nonzero(np.array(p) < 0.05) <= 8
    assert min(p) > 1e-5
