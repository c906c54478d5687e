"""A mount that gives way: the measured vector turns in the axes of the sensor.

The three channels f_b of a triad at rest hold one constant vector, gravity in an accelerometer. A mount that
rolls by φ(t), growing evenly from 0 to `tilt` over the block, makes of it::

    f_x' = f_x,   f_y' = f_y cos φ + f_z sin φ,   f_z' = f_z cos φ − f_y sin φ

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
   ch. 2 (rotation about the x axis).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.base import Effect, Samples, Scale, log_uniform, require_finite, sign


@dataclass(frozen=True)
class Attitude(Effect):
    """Slow tilt of the mount about the x axis of the sensor.

    Attributes
    ----------
    tilt : float
        Tilt reached at the end of the block, rad.
    """

    name: ClassVar[str] = "attitude"
    home: ClassVar[str | None] = "accel"
    one_for_all: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("start",)
    positive: ClassVar[tuple[str, ...]] = ("duration",)
    tilt: float

    def __post_init__(self) -> None:
        require_finite(tilt=self.tilt)

    def signal(self, t: FloatArray, vec_b: FloatArray) -> FloatArray:
        """Return the change of the vector `vec_b` (3,) at times `t`, shape (n, 3)."""
        phi = self.tilt * (t - t[0]) / (t[-1] - t[0])
        _, y, z = vec_b
        lost, turned = 1.0 - np.cos(phi), np.sin(phi)
        return np.column_stack([np.zeros_like(t), z * turned - y * lost, -y * turned - z * lost])

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Turn the mean vector of a triad (three channels)."""
        if block.y.shape[1] != 3:
            raise ValueError(f"'{self.name}' needs the three channels of a triad, got {block.y.shape[1]}")
        return block.add(self.signal(block.t, block.y.mean(axis=0)))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of tilt ± 0.001 … 0.1 rad."""
        return cls(sign(rng) * log_uniform(rng, 1e-3, 0.1))
