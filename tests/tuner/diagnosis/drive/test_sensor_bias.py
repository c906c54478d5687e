"""Biases beyond their priors are named where they are, not where a compensation removed them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.causes.base import constant_parameters
from tuner.diagnosis.drive.causes.sensor_bias import _like_vertical_bias
from tuner.diagnosis.drive.hypothesis import Hypothesis, Jump
from tuner.diagnosis.drive.rivals_of_biases import rivals_of_bias
from tuner.linear_run.likelihood import as_configured
from tuner.types import Coefficient, Parameter


def test_a_gyro_bias_beyond_its_prior_is_named_with_what_it_may_be(simulated, drive_config):
    drive = simulated(21)
    off = np.array([0.0, 0.015, 0.0, 0.0, 0.0, 0.0])  # 15 prior sds; beyond 20 it is withdrawn
    diagnosis = diagnose_drive(replace(drive, rates=drive.rates + off), drive_config)
    findings = {finding.cause: finding for finding in diagnosis.findings}
    assert findings["sensor_bias"].parameters["gyro_y"].value == pytest.approx(0.015, abs=5e-3)
    assert [one.cause for one in findings["sensor_bias"].alternatives] == ["g_sensitivity"]
    assert ("sensor_bias", "g_sensitivity") in {one.causes for one in diagnosis.inseparable}


@pytest.mark.parametrize(
    ("axis", "value", "names"),
    [
        ("accel_z", 0.1, ["accel_scale"]),
        ("accel_z", 0.004, ["gravity"]),
        ("accel_x", 0.1, []),
        ("accel_z", 3.0, []),
    ],
)
def test_a_bias_of_the_vertical_accelerometer_may_be_its_scale_factor(drive_config, axis, value, names):
    """A bias of 0.1 m/s² at a stated 0.001 is a scale factor of 1 %; nothing explains 3 m/s², or 0.1 across."""
    channels = {a: replace(c, constant_sd=1e-3) for a, c in drive_config.channels.items()}
    start = SimpleNamespace(quat_nb=np.array([[1.0, 0.0, 0.0, 0.0]]), llh=np.array([[0.8, 0.1, 100.0]]))
    run = SimpleNamespace(solutions=[SimpleNamespace(state=start)])
    found = _like_vertical_bias(
        run, replace(drive_config, channels=channels), {axis: Coefficient.known(value, value, value, "m/s^2")}
    )
    assert {one.cause for one in found} >= set(names)
    assert bool(found) == bool(names)


def test_a_badly_known_scale_leaves_no_bias(simulated, drive_config):
    """A scale factor of the vertical accelerometer is inseparable from its bias: its error is no finding."""
    drive = simulated(7, duration=500.0, values={"accel_scale.x": 0.012})
    assert [finding.cause for finding in diagnose_drive(drive, drive_config).findings] == ["accel_scale"]


def test_a_jump_at_the_same_place_again_is_no_further_jump(simulated, drive_config):
    once = Jump(100.0, "accel", np.array([0.0, -0.06, 0.0]))
    one = replace(Hypothesis.first(simulated(21), drive_config), jumps=(once,))
    assert replace(one, jumps=(once, replace(once, size=0.9 * once.size))).is_equivalent_to(one)
    assert not replace(one, jumps=(once, replace(once, time=130.0))).is_equivalent_to(one)
    assert not replace(one, jumps=(once, replace(once, sensor="gyro"))).is_equivalent_to(one)


def test_a_bias_that_innovations_do_not_show_is_none_and_constants_that_they_show_are_listed(short_drive):
    """Before a filter has settled its biases take up a scale factor at once, or one wrong fix."""
    bias = Coefficient.known(0.01, 0.009, 0.011, "rad/s")
    one = SimpleNamespace(parameters={"gyro_z": bias}, value=7.0, alternatives=())
    names = constant_parameters()
    wide = replace(
        short_drive,
        parameters=names,
        **{
            key: np.stack(
                [
                    of[:, :, short_drive.parameters.index(name)]
                    if name in short_drive.parameters
                    else np.zeros(of.shape[:2])
                    for name in names
                ],
                axis=-1,
            )
            for key, of in (("B", short_drive.B), ("D", short_drive.D))
        },
    )
    values = np.zeros(len(names))
    for size, listed in ((0.0, set()), (0.05, {"gyro_scale"})):
        values[names.index(Parameter("gyro_scale", "z"))] = size
        drawn = Source.of(as_configured(wide)).draw(np.random.default_rng(3), values)
        drawn.correction[5, 11] += 0.01
        found = rivals_of_bias(SimpleNamespace(final=SimpleNamespace(linearized=drawn), shifts=()), one)
        assert found.shown == bool(listed)
        assert {a.cause for a in found.alternatives} >= listed
        assert listed or not found.alternatives
    drawn.correction[5, 11] -= 0.01
    at_rest = rivals_of_bias(SimpleNamespace(final=SimpleNamespace(linearized=drawn), shifts=()), one)
    assert at_rest.shown
    assert not at_rest.alternatives
