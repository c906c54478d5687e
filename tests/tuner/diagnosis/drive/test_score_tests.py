"""Score tests of constants in a linear model: fixed noise, drift with time, runs of wrong fixes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.causes.gnss_outliers import mask
from tuner.diagnosis.drive.linear_model.noise_fit import maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import noise_parameters
from tuner.diagnosis.drive.score_tests import fit_constants, retest
from tuner.linear_run.likelihood import (
    NoiseHypothesis,
    as_configured,
    evaluate,
    with_constants_fixed,
)
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.linear_run.whitened_innovations import whiten
from tuner.types import Parameter

DELAY = Parameter("time_offset", "delay")


def drawn(linearized: LinearizedRun, seed: int) -> LinearizedRun:
    return Source.of(as_configured(linearized)).draw(np.random.default_rng(seed))


def late(linearized: LinearizedRun, delay: np.ndarray) -> LinearizedRun:
    """Let fixes come late by a delay (k,) that changes slowly."""
    seen = linearized.D[:, :, :1] * delay[:, None, None]
    pushed = replace(linearized, D=-seen, B=0.0 * linearized.B[:, :, :1], parameters=(DELAY,))
    return replace(linearized, innovation=linearized.innovation - pushed.D[:, :, 0])


def test_fixed_means_change_nothing_at_the_same_noise(short_drive: LinearizedRun) -> None:
    free = replace(as_configured(drawn(short_drive, 0)), columns=tuple(range(7)))
    assert evaluate(with_constants_fixed(free)).value == pytest.approx(evaluate(free).value, abs=1e-6)
    assert with_constants_fixed(free).columns == ()


def test_noise_is_fitted_beside_free_means(short_drive: LinearizedRun) -> None:
    """The fit with means fixed in turn is a maximum of the likelihood with the means profiled out."""
    wrong = replace(short_drive, sd=short_drive.sd * 2.0)
    data = replace(drawn(wrong, 1), sd=short_drive.sd)
    free = replace(as_configured(data), columns=(0, 1, 2, 3))
    fit = maximize_likelihood(free, noise_parameters(("position_horizontal", "velocity_horizontal")))

    def profile(x: np.ndarray) -> float:
        return evaluate(replace(fit.parameters.change(free, x), columns=free.columns)).value

    top = profile(fit.estimate)
    assert top == pytest.approx(fit.log_likelihood, abs=0.1)
    for step in 0.05 * np.vstack([np.eye(2), -np.eye(2)]):
        assert profile(fit.estimate + step) < top + 0.02


def test_a_drifting_clock_is_distinguished_from_a_constant_delay(city_drive: LinearizedRun) -> None:
    """Beside the constant delay; a drift of 2e-4 is some 20 sds of this drive."""
    drift = Parameter("clock_drift", "rate")
    since = city_drive.t - 0.5 * (city_drive.t[0] + city_drive.t[-1])
    linearized = drawn(city_drive, 2)
    for true in (0.0, 2e-4):
        moved = late(linearized, 0.02 + true * since)
        moved = replace(
            moved,
            D=np.concatenate([moved.D, moved.D[:, :, :1] * since[:, None, None]], axis=2),
            B=np.concatenate([moved.B, 0.0 * moved.B[:, :, :1]], axis=2),
            parameters=(*moved.parameters, drift),
        )
        fit = fit_constants(
            whiten(as_configured(moved)), moved.parameters, ("time_offset", drift.cause), np.zeros(8)
        )
        sd = float(np.sqrt(fit.covariance[1, 1]))
        assert abs(fit.value[1] - true) < 5.0 * sd
        test = retest(
            whiten(as_configured(moved)),
            moved.parameters,
            ("time_offset", drift.cause),
            drift.cause,
            np.zeros(1),
        )
        assert (test.p_value < 1e-6) == (true > 0.0)


def test_a_run_of_wrong_positions_is_left_out_at_once(city_drive: LinearizedRun) -> None:
    linearized = drawn(city_drive, 3)
    off = np.zeros((len(linearized.t), 6))
    off[300:340, :2] = 60.0 + 5.0 * np.random.default_rng(4).standard_normal((40, 2))
    noise: NoiseHypothesis = as_configured(replace(linearized, innovation=linearized.innovation + off))
    out = mask(noise).out[:, 0]
    assert out[300:340].all()
    assert np.count_nonzero(out) <= 42
