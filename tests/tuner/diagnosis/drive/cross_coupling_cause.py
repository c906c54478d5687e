"""A cause of another package: an accelerometer along x that feels the force along y."""

from dataclasses import dataclass

import numpy as np

from models.effects.drive.base import AXES_STAGE, DriveEffect
from tuner.diagnosis.drive.causes.base import ConstantCause


@dataclass(frozen=True)
class AccelCrossCouplingEffect(DriveEffect):
    """f_x + xy · f_y."""

    name = "accel_cross_coupling"
    stage = AXES_STAGE
    is_constant = True
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


class AccelCrossCoupling(ConstantCause):
    """Cross-coupling of the forward accelerometer."""

    cause = "accel_cross_coupling"
    effect = AccelCrossCouplingEffect
    channels = ("accel",)
    meaning = "an accelerometer feels the force along another axis, by {}"
    consequence = "calibrate the axes of the accelerometers"
    units = dict.fromkeys(("xy",), "1")
    prior_sd, largest = 1e-2, 0.1
