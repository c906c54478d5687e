"""Weak causes beside strong ones: what a delay that comes and goes leaves behind is none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.cause_test import Claim
from tuner.diagnosis.drive.causes.bias_jump import bias_jump, with_jump
from tuner.diagnosis.drive.hypothesis_tests import LARGEST, Candidate
from tuner.diagnosis.drive.linear_model.likelihood import as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import LinearRecord
from tuner.diagnosis.drive.linear_model.whitened_innovations import whitened
from tuner.diagnosis.drive.residue_of_strong_causes import (
    PARTS,
    WEAK,
    doubted,
    jump_left_by,
    jumps_still,
    left_by,
    loosened,
)
from tuner.diagnosis.drive.score_tests import Scored, retested

KNOWN = ("time_offset", "lever_arm")
THRESHOLD = 1e-4
DELAY = 0.5


def passed(record: LinearRecord, theta: dict[str, float], seed: int):
    """Return what `doubt` looks at of a pass over a replica with constants that nothing compensates."""
    values = np.array([theta.get(name, 0.0) for name in record.parameters])
    drawn = Source.of(as_configured(record)).draw(np.random.default_rng(seed), values)
    told = replace(
        drawn, parameters=drawn.parameters[:7], drive=drawn.drive[:, :, :7], seen=drawn.seen[:, :, :7]
    )
    return SimpleNamespace(
        record=told, whitened=whitened(as_configured(told)), hypothesis=SimpleNamespace(values={})
    )


def weak(found) -> Scored:
    """Return the test of the lever arm, as if it gained little."""
    names = found.record.parameters
    told = retested(found.whitened, names, KNOWN, "lever_arm", np.zeros(3))
    return replace(told, gain=0.5 * WEAK)


def test_constants_of_all_parts_together_are_the_constant(short_drive: LinearRecord) -> None:
    loose = loosened(short_drive, ("time_offset",))
    extra = [loose.parameters.index(f"time_offset.delay_{p}") for p in range(1, PARTS)]
    assert len(loose.parameters) == 7 + PARTS - 1
    inside = (loose.seen[:, :, extra] != 0.0).any(axis=1)
    assert inside.sum(axis=1).max() == 1  # parts do not overlap
    last = short_drive.t >= short_drive.t[0] + (1.0 - 1.0 / PARTS) * np.ptp(short_drive.t)
    np.testing.assert_array_equal(loose.seen[last][:, :, extra[-1]], short_drive.seen[last][:, :, 0])
    assert not loose.seen[~last][:, :, extra[-1]].any()


def test_a_lever_arm_beside_a_steady_delay_stands(city_drive: LinearRecord) -> None:
    found = passed(city_drive, {"time_offset.delay": DELAY, "lever_arm.x": 0.3, "lever_arm.y": 0.3}, 1)
    alarm = weak(found)
    assert alarm.p_value < THRESHOLD
    assert left_by(found, KNOWN, alarm, THRESHOLD) == ()


def test_what_a_wandering_delay_leaves_is_doubted(city_drive: LinearRecord) -> None:
    wandering = {f"time_offset.delay_{p}": 0.1 * DELAY * (-1.0) ** p for p in range(1, PARTS)}
    found = passed(loosened(city_drive, ("time_offset",)), {"time_offset.delay": DELAY, **wandering}, 2)
    alarm = weak(found)
    assert left_by(found, KNOWN, replace(alarm, statistic=10.0), THRESHOLD) == ("time_offset",)
    assert left_by(found, KNOWN, replace(alarm, gain=2.0 * WEAK), THRESHOLD) == ()
    assert "time_offset" in doubted("lever_arm", alarm.gain, ("time_offset",))


@pytest.mark.parametrize(("size", "still"), [(0.0, False), (0.02, True)])
def test_a_jump_is_asked_once_more(city_drive: LinearRecord, size: float, still: bool) -> None:
    plain = as_configured(city_drive)
    jumped = with_jump(plain, 450, "accel").record
    theta = {"time_offset.delay": DELAY, "bias_jump.accel_x": size}
    found = passed(jumped, theta, 3)
    alarm = bias_jump(replace(as_configured(found.record), columns=(0,))).alarm
    assert jumps_still(found, ("time_offset",), ("time_offset",), THRESHOLD) == still
    told = replace(alarm, gain=0.5 * WEAK, statistic=30.0)
    assert jump_left_by(found, ("time_offset",), told) == ("time_offset",)


def test_a_jump_that_no_sensor_makes_is_rejected(city_drive: LinearRecord) -> None:
    jumped = with_jump(as_configured(city_drive), 450, "gyro").record
    for size, credible in ((0.1 * LARGEST["gyro"], True), (3.0 * LARGEST["gyro"], False)):
        values = np.zeros(len(jumped.parameters))
        values[jumped.parameters.index("bias_jump.gyro_z")] = size
        drawn = Source.of(as_configured(jumped)).draw(np.random.default_rng(4), values)
        record = replace(
            drawn, parameters=drawn.parameters[:7], drive=drawn.drive[:, :, :7], seen=drawn.seen[:, :, :7]
        )
        claim: Claim = bias_jump(as_configured(record))
        assert abs(evaluate(claim.noise).theta[2]) == pytest.approx(size, rel=0.05)
        assert Candidate(claim.alarm, claim=claim).credible == credible
