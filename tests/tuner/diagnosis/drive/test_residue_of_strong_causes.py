"""What a strong, time-varying cause leaves behind is not named as a weak one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.cause_test import CauseTest
from tuner.diagnosis.drive.causes.bias_jump import MAX_JUMP_SIZE, bias_jump, with_jump
from tuner.diagnosis.drive.hypothesis_tests import Candidate
from tuner.diagnosis.drive.residue_of_strong_causes import (
    MAX_WEAK_GAIN,
    N_PARTS,
    causes_stronger_than_jump,
    explained_by_stronger,
    jump_remains,
    model_error_note,
    with_piecewise_constants,
)
from tuner.diagnosis.drive.score_tests import ScoreTest, retest
from tuner.diagnosis.drive.search import _best
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.linear_run.whitened_innovations import whiten
from tuner.types import Compensation, Parameter

KNOWN = ("time_offset", "lever_arm")
THRESHOLD = 1e-4
DELAY = 0.5


def passed(linearized: LinearizedRun, theta: dict[Parameter, float], seed: int):
    """Return a run over a replica with constants that nothing compensates."""
    values = np.array([theta.get(name, 0.0) for name in linearized.parameters])
    drawn = Source.of(as_configured(linearized)).draw(np.random.default_rng(seed), values)
    shorter = replace(drawn, parameters=drawn.parameters[:7], B=drawn.B[:, :, :7], D=drawn.D[:, :, :7])
    return SimpleNamespace(
        linearized=shorter,
        whitened=whiten(as_configured(shorter)),
        hypothesis=SimpleNamespace(compensation=Compensation()),
    )


def weak(run) -> ScoreTest:
    """Return the test of the lever arm, as if it gained little."""
    names = run.linearized.parameters
    shorter = retest(run.whitened, names, KNOWN, "lever_arm", np.zeros(3))
    return replace(shorter, gain=0.5 * MAX_WEAK_GAIN)


def candidate(cause, gain):
    return Candidate(TestResult(cause, 1e-20, gain, 2.0 * gain, ""))


@pytest.mark.parametrize(
    ("jump", "noise", "first"),
    [(429.0, 433.0, "bias_jump"), (140.0, 165.0, "bias_jump"), (20.0, 299.0, "imu_noise_scale")],
)
def test_noise_does_not_take_the_place_of_a_jump_that_gains_as_much(jump, noise, first):
    """Gains of two jumps, and of gyros four times as noisy, on simulated drives."""
    assert _best([candidate("imu_noise_scale", noise), candidate("bias_jump", jump)]).cause == first
    assert _best([candidate("gnss_noise_scale", noise), candidate("bias_jump", jump)]).result.gain == noise


def test_constants_of_all_parts_together_are_the_constant(short_drive: LinearizedRun) -> None:
    piecewise = with_piecewise_constants(short_drive, ("time_offset",))
    extra = [piecewise.parameters.index(Parameter("time_offset", f"delay_{p}")) for p in range(1, N_PARTS)]
    assert len(piecewise.parameters) == 7 + N_PARTS - 1
    inside = (piecewise.D[:, :, extra] != 0.0).any(axis=1)
    assert inside.sum(axis=1).max() == 1  # parts do not overlap
    last = short_drive.t >= short_drive.t[0] + (1.0 - 1.0 / N_PARTS) * np.ptp(short_drive.t)
    np.testing.assert_array_equal(piecewise.D[last][:, :, extra[-1]], short_drive.D[last][:, :, 0])
    assert not piecewise.D[~last][:, :, extra[-1]].any()


def test_a_lever_arm_beside_a_steady_delay_stands(city_drive: LinearizedRun) -> None:
    run = passed(
        city_drive,
        {
            Parameter("time_offset", "delay"): DELAY,
            Parameter("lever_arm", "x"): 0.3,
            Parameter("lever_arm", "y"): 0.3,
        },
        1,
    )
    test = weak(run)
    assert test.p_value < THRESHOLD
    assert explained_by_stronger(run, KNOWN, test, THRESHOLD) == ()


def test_what_a_wandering_delay_leaves_is_reported_as_uncertain(city_drive: LinearizedRun) -> None:
    wandering = {Parameter("time_offset", f"delay_{p}"): 0.1 * DELAY * (-1.0) ** p for p in range(1, N_PARTS)}
    run = passed(
        with_piecewise_constants(city_drive, ("time_offset",)),
        {Parameter("time_offset", "delay"): DELAY, **wandering},
        2,
    )
    test = weak(run)
    assert explained_by_stronger(run, KNOWN, replace(test, statistic=10.0), THRESHOLD) == ("time_offset",)
    assert explained_by_stronger(run, KNOWN, replace(test, gain=2.0 * MAX_WEAK_GAIN), THRESHOLD) == ()
    assert "time_offset" in model_error_note("lever_arm", test.gain, ("time_offset",))


@pytest.mark.parametrize(("size", "still"), [(0.0, False), (0.02, True)])
def test_a_jump_is_tested_a_second_time(city_drive: LinearizedRun, size: float, still: bool) -> None:
    plain = as_configured(city_drive)
    jumped = with_jump(plain, 450, "accel").linearized
    theta = {Parameter("time_offset", "delay"): DELAY, Parameter("bias_jump", "accel_x"): size}
    run = passed(jumped, theta, 3)
    test = bias_jump(replace(as_configured(run.linearized), columns=(0,))).result
    assert jump_remains(run, ("time_offset",), ("time_offset",), THRESHOLD) == still
    shorter = replace(test, gain=0.5 * MAX_WEAK_GAIN, statistic=30.0)
    assert causes_stronger_than_jump(run, ("time_offset",), shorter) == ("time_offset",)


def test_a_jump_that_no_sensor_makes_is_rejected(city_drive: LinearizedRun) -> None:
    jumped = with_jump(as_configured(city_drive), 450, "gyro").linearized
    for size, credible in ((0.1 * MAX_JUMP_SIZE["gyro"], True), (3.0 * MAX_JUMP_SIZE["gyro"], False)):
        values = np.zeros(len(jumped.parameters))
        values[jumped.parameters.index(Parameter("bias_jump", "gyro_z"))] = size
        drawn = Source.of(as_configured(jumped)).draw(np.random.default_rng(4), values)
        linearized = replace(drawn, parameters=drawn.parameters[:7], B=drawn.B[:, :, :7], D=drawn.D[:, :, :7])
        test: CauseTest = bias_jump(as_configured(linearized))
        assert abs(evaluate(test.noise).theta[2]) == pytest.approx(size, rel=0.05)
        assert Candidate(test.result, test=test).credible == credible
