"""What a filter, ours or another, states over time: estimates, their covariance, innovations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray

BLOCKS = ("position", "velocity", "attitude", "gyro_bias", "accel_bias")
"""Parts of the error, three components each, in the order of a covariance."""


@dataclass(frozen=True)
class TakenAxes:
    """Axes that a file was taken in before its values were turned into ours.

    Attributes
    ----------
    positions, velocities : str
        Of the world, by three letters.
    attitudes : str or None
        Of the world; None where no three letters state it: angles, or ECEF.
    body : str
        Of the body, by three letters.
    """

    positions: str = "NED"
    velocities: str = "NED"
    attitudes: str | None = "NED"
    body: str = "FRD"


@dataclass(frozen=True)
class FilterOutput:
    """Estimates of a filter, or a truth, in north-east-down and forward-right-down axes (SI); NaN where absent.

    Attributes
    ----------
    name : str
        Of the file.
    t : ndarray, shape (n,)
        s, strictly increasing.
    llh : ndarray, shape (n, 3), or None
        Latitude, longitude, rad, height, m.
    local : ndarray, shape (n, 3), or None
        Metres north, east, down of an origin that is not known; where there is no `llh`.
    vel_n : ndarray, shape (n, 3)
        m/s.
    quat_nb : ndarray, shape (n, 4)
        Attitude.
    bias : ndarray, shape (n, 6)
        Gyro and accelerometer biases: what is to be subtracted from the samples.
    covariance : ndarray, shape (n, 15, 15)
        Of the errors of position (m), velocity, attitude (rotation vector about north, east, down) and biases.
    correlated : bool
        Whether the covariance is known beyond the sds.
    innovation, innovation_covariance : ndarray, shapes (n, 6), (n, 6, 6)
        Fix minus prediction, position and velocity; NaN at epochs without a fix.
    outages : ndarray, shape (w, 2)
        Begin and end of outages that the file marks, s.
    vel_of_body : bool
        Whether the covariance of the velocity is of its components along the axes of the body, free of errors of the
        attitude; it is turned north-east-down with the estimated attitude like the velocity.
    notes : tuple of str
        How the file was understood.
    axes : TakenAxes
        What the file was taken in.
    """

    name: str
    t: FloatArray
    llh: FloatArray | None
    local: FloatArray | None
    vel_n: FloatArray
    quat_nb: FloatArray
    bias: FloatArray
    covariance: FloatArray
    correlated: bool
    innovation: FloatArray
    innovation_covariance: FloatArray
    outages: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    notes: tuple[str, ...] = ()
    vel_of_body: bool = False
    axes: TakenAxes = TakenAxes()

    def __len__(self) -> int:
        return len(self.t)

    @property
    def has_innovations(self) -> bool:
        """Whether there are innovations with their covariance."""
        sd = np.einsum("kii->ki", self.innovation_covariance)
        return bool((np.isfinite(self.innovation) & np.isfinite(sd)).any())

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> FilterOutput:
        """Return some of the epochs."""
        return replace(
            self,
            t=self.t[which],
            llh=None if self.llh is None else self.llh[which],
            local=None if self.local is None else self.local[which],
            vel_n=self.vel_n[which],
            quat_nb=self.quat_nb[which],
            bias=self.bias[which],
            covariance=self.covariance[which],
            innovation=self.innovation[which],
            innovation_covariance=self.innovation_covariance[which],
        )


def filter_output(
    name: str,
    t: FloatArray,
    *,
    llh: FloatArray | None = None,
    local: FloatArray | None = None,
    vel_n: FloatArray | None = None,
    quat_nb: FloatArray | None = None,
    bias: FloatArray | None = None,
    covariance: FloatArray | None = None,
    correlated: bool = False,
    innovation: FloatArray | None = None,
    innovation_covariance: FloatArray | None = None,
    outages: FloatArray | None = None,
    notes: tuple[str, ...] = (),
    axes: TakenAxes | None = None,
) -> FilterOutput:
    """Return a filter output with NaN for all that is not given."""
    n = len(t)

    def whole(value: FloatArray | None, *shape: int) -> FloatArray:
        return np.broadcast_to(np.nan, (n, *shape)) if value is None else np.asarray(value, dtype=float)

    return FilterOutput(
        name,
        np.asarray(t, dtype=float),
        llh,
        local,
        whole(vel_n, 3),
        whole(quat_nb, 4),
        whole(bias, 6),
        whole(covariance, 15, 15),
        correlated,
        whole(innovation, 6),
        whole(innovation_covariance, 6, 6),
        np.zeros((0, 2)) if outages is None else outages,
        notes,
        axes=axes or TakenAxes(),
    )
