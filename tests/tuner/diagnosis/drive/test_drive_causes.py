"""Declarations of causes of drives: complete, consistent with their effects, and open to further ones."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
import pytest

from models.effects.drive import EFFECTS
from models.effects.drive.base import AXES, DriveEffect
from models.registry import RegistryError
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.causes.base import (
    DRIVE_CAUSES,
    ConstantCause,
    constant_causes,
    constant_parameters,
)
from tuner.diagnosis.drive.causes.registry import FALSE_ALARM_PROBABILITY, significance_threshold

CROSS_COUPLING = 0.02


@dataclass(frozen=True)
class AccelCrossCoupling(DriveEffect):
    """An accelerometer along x that feels the force along y."""

    name: ClassVar[str] = "accel_cross_coupling"
    stage: ClassVar[int] = AXES
    is_constant: ClassVar[bool] = True
    xy: float = 0.0

    @classmethod
    def sensor_error(cls, name):
        error = np.zeros((6, 6))
        error[3, 4] = 1.0
        return error

    def apply(self, drive, rng):
        return drive.felt(drive.truth @ (self.xy * self.sensor_error("xy")).T)

    @classmethod
    def draw(cls, rng, drive):
        return cls(rng.uniform(-0.01, 0.01))


class CrossCoupling(ConstantCause):
    """The cause of a package that knows this effect."""

    cause = "accel_cross_coupling"
    effect = AccelCrossCoupling
    channels = ("accel",)
    meaning = "an accelerometer feels the force along another axis"
    consequence = "calibrate"
    units = dict.fromkeys(("xy",), "1")
    prior_sd, largest = 5e-3, 0.1


def test_a_further_constant_is_named_estimated_and_compensated(simulated, drive_config):
    """Its declaration is all that the diagnosis, the compensation and the simulator need."""
    before = significance_threshold()
    with DRIVE_CAUSES.added(CrossCoupling):
        assert significance_threshold() < before
        drive = simulated(3, values={"accel_cross_coupling.xy": CROSS_COUPLING})
        diagnosis = diagnose_drive(drive, drive_config)
    (finding,) = diagnosis.findings
    assert finding.cause == "accel_cross_coupling"
    low, high = finding.parameters["xy"].interval
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    assert abs(middle - CROSS_COUPLING) < 2.5 * half
    assert half < 0.25 * CROSS_COUPLING
    assert diagnosis.compensation.value("accel_cross_coupling", "xy") == pytest.approx(middle, abs=half)
    assert "accel_cross_coupling" not in DRIVE_CAUSES
    assert "accel_cross_coupling" not in EFFECTS


def test_parameters_of_constants_are_those_of_their_effects():
    for code, cause in constant_causes().items():
        assert tuple(cause.units) == tuple(f.name for f in fields(cause.effect)), code
        assert all(cause.effect.is_parameter_of_compensation(name) for name in cause.units), code
        assert 0.0 < cause.prior_sd < cause.largest


def test_the_false_alarm_probability_is_shared_out():
    shares = sum(cause.shares for cause in DRIVE_CAUSES.values())
    assert shares * significance_threshold() == pytest.approx(FALSE_ALARM_PROBABILITY)
    assert len(constant_parameters()) == len(set(constant_parameters()))


def test_incomplete_and_unknown_causes_are_refused_in_one_line():
    class Incomplete(ConstantCause):
        cause = "incomplete"
        channels = ("gnss",)

    needed = "the class needs meaning, consequence, effect, units, prior_sd, largest"
    with pytest.raises(RegistryError, match=needed):
        DRIVE_CAUSES.add(Incomplete)
    unknown = re.escape("unknown cause of a drive 'lever_arms' (did you mean 'lever_arm'?)")
    with pytest.raises(RegistryError, match=unknown):
        DRIVE_CAUSES["lever_arms"]
