"""What was measured: evenly sampled records of one sensor, free of file formats and foreign units.

A `Record` holds the samples of one triad (or of any columns that share a clock) on a uniform time base,
cut into gap-free segments. Readers make records; every statistic takes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import without_jumps
from tuner.types.clock import Clock
from tuner.types.one_line import printable
from tuner.types.repair import Repair


class DataError(ValueError):
    """Input that cannot be used: one line that says file, place, expected, found and what to do."""

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


@dataclass(frozen=True)
class ShortClusters:
    """Allan variances of adjoining clusters of 1, 2, 4, … samples, each below the next.

    Attributes
    ----------
    m : tuple of int
        Cluster sizes, in samples of the log.
    variance : tuple of float
        Allan variances, unit².
    differences : tuple of int
        Differences of neighbouring clusters behind each.
    """

    m: tuple[int, ...]
    variance: tuple[float, ...]
    differences: tuple[int, ...]


@dataclass(frozen=True)
class Record:
    """Samples of one sensor in SI units.

    Attributes
    ----------
    name : str
        Sensor: ``gyro``, ``accel`` or a free name.
    t : ndarray, shape (n,)
        Time of each sample, s, strictly increasing.
    y : ndarray, shape (n, k), Fortran order
        Samples: rad/s or m/s² (increments have been divided by the interval by the reader).
    axes : tuple of str
        Channel names, one a column, such as ``gyro_x``.
    unit : str
        ``rad/s`` or ``m/s^2``.
    interval : float
        Sampling interval, s.
    segments : tuple of (start, stop)
        Sample ranges without a gap; estimators never difference across them.
    covariates : mapping of str to ndarray, shape (n,)
        Further channels on the same clock, such as ``temperature`` in °C.
    source, digest : str
        Name of the file and SHA-256 of its content.
    notes : tuple of str
        Every repair that was made, with its count.
    timing : mapping of str to float
        What the stamps said: ``gap_count``, ``missing``, ``bridged``, ``duplicates``, ``disordered``
        (counts), ``jitter_sd`` (s) and
        ``clock_ratio`` (stated ÷ measured rate); empty where there were no stamps.
    assumptions : tuple of str
        What nobody stated and was assumed of the log, such as the unit of a sensor; among the notes, too.
    contradicted : tuple of str
        What of the log the samples speak against as it is read, and how: exceptions of every verdict on it.
    unit_unstated : bool
        Whether neither the log, the user nor the samples tell its unit, which was assumed.
    samples_a_mean : int
        Samples of the log in each sample of the record: 1, or a power of two where the log is long.
    short_clusters : mapping of str to ShortClusters
        By axis, the Allan variances of clusters shorter than the interval, from all samples of such a log.
    limiting_steps : mapping of str to float
        Quantizer step of each axis whose noise it hides, unit.
    broken : mapping of str to (int, float)
        By axis, readings that no sensor makes and that count as missing: how many, and how far off, unit (median).
    stamp_course : ndarray, shape (k, 4), optional
        What a figure shows of the stamps, in pieces of time: time, smallest and largest distance of a stamp from the
        even clock, s, samples that are missing.
    """

    name: str
    t: FloatArray
    y: FloatArray
    axes: tuple[str, ...]
    unit: str
    interval: float
    segments: tuple[tuple[int, int], ...] = ()
    covariates: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    source: str = ""
    digest: str = ""
    notes: tuple[str, ...] = ()
    timing: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    assumptions: tuple[str, ...] = ()
    contradicted: tuple[str, ...] = ()
    unit_unstated: bool = False
    samples_a_mean: int = 1
    short_clusters: Mapping[str, ShortClusters] = field(default_factory=lambda: MappingProxyType({}))
    limiting_steps: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    broken: Mapping[str, tuple[int, float]] = field(default_factory=lambda: MappingProxyType({}))
    stamp_course: FloatArray | None = None

    def __post_init__(self) -> None:
        y = np.asfortranarray(np.atleast_2d(np.asarray(self.y, dtype=float).T).T)
        t = np.asarray(self.t, dtype=float)
        if y.ndim != 2 or t.shape != (y.shape[0],):
            raise ValueError(f"'t' and 'y' must have shapes (n,) and (n, k), got {t.shape} and {y.shape}")
        if len(self.axes) != y.shape[1]:
            raise ValueError(f"'axes' must name each of the {y.shape[1]} columns, got {self.axes}")
        if not self.interval > 0:
            raise ValueError(f"'interval' must be positive, got {self.interval}")
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "segments", tuple(self.segments) or ((0, len(t)),))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def unusable(self) -> str:
        """Why no function can use it, in words; empty where one can."""
        if not self.y.size:
            return "without samples"
        return _about_samples(self.t, self.y)

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return 1.0 / self.interval

    @property
    def span(self) -> float:
        """Time covered by samples, s (gaps not counted)."""
        return self.interval * sum(stop - start for start, stop in self.segments)

    def column(self, axis: str) -> FloatArray:
        """Return the samples of one axis, shape (n,)."""
        return self.y[:, self.axes.index(axis)]

    def pieces(self, axis: str) -> tuple[FloatArray, ...]:
        """Return the samples of one axis as one contiguous array a segment."""
        column = self.column(axis)
        return tuple(column[start:stop] for start, stop in self.segments)


def _about_samples(t: FloatArray, y: FloatArray) -> str:
    """Say what is wrong with samples, if anything."""
    if not np.isfinite(np.sum(y)):
        return "with samples that are not finite"
    return "" if np.all(np.diff(t) > 0.0) else "whose stamps do not increase"


SOLUTIONS: Mapping[int, str] = MappingProxyType(
    {
        1: "single point",
        2: "differential",
        3: "precise point",
        4: "RTK fixed",
        5: "RTK float",
        6: "dead reckoning",
    }
)
"""Classes of solution by their number: the quality of a GGA sentence (NMEA 0183), with 3 as RTKLIB uses it."""


def velocity_known(vel_n: FloatArray) -> NDArray[np.bool_]:
    """Return which velocities, shape (k, 3), are known: all of them or, of speed and course, north and east; (k,)."""
    return np.asarray(np.isfinite(vel_n[:, :2]).all(axis=1))


@dataclass(frozen=True)
class Gnss:
    """Fixes of a satellite receiver (SI), in order of time.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Stamps, s, on the clock of the inertial record.
    llh : ndarray, shape (k, 3)
        Latitude, longitude, rad, height, m; made without jumps at the date line.
    vel_n : ndarray, shape (k, 3)
        North, east, down, m/s; NaN where there is none, down alone where speed and course are all there is.
    position_sd, velocity_sd : ndarray, shape (k, 3)
        As the receiver reports them, north, east, down; NaN where it does not.
    solution : ndarray, shape (k,)
        Class of solution as the receiver states it, by its number in `SOLUTIONS`; NaN where it does not.
    """

    t: FloatArray
    llh: FloatArray
    vel_n: FloatArray
    position_sd: FloatArray
    velocity_sd: FloatArray
    solution: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        object.__setattr__(self, "llh", without_jumps(self.llh))
        if len(self.solution) != len(self.t):
            object.__setattr__(self, "solution", np.full(len(self.t), np.nan))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def has_velocity(self) -> NDArray[np.bool_]:
        """Which fixes have a velocity, shape (k,)."""
        return velocity_known(self.vel_n)

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Gnss:
        """Return some of the fixes."""
        return Gnss(
            self.t[which],
            self.llh[which],
            self.vel_n[which],
            self.position_sd[which],
            self.velocity_sd[which],
            self.solution[which],
        )


@dataclass(frozen=True)
class Reference:
    """A better solution to compare with (SI): angles are roll, pitch, yaw of its own body, rad; NaN if unknown.

    Longitudes are made without jumps at the date line.
    `sd` (n, 9) is what it states of its position, velocity and angles, None or NaN where it states nothing.
    """

    t: FloatArray
    llh: FloatArray
    vel_n: FloatArray
    rpy: FloatArray
    sd: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "llh", without_jumps(self.llh))

    def rows(self, which: NDArray[np.intp] | slice) -> Reference:
        """Return some of the rows."""
        sd = None if self.sd is None else self.sd[which]
        return Reference(self.t[which], self.llh[which], self.vel_n[which], self.rpy[which], sd)


@dataclass(frozen=True)
class Start:
    """Position, velocity and attitude of a vehicle as a file states them for one time (SI).

    Attributes
    ----------
    t : float
        Time, s, on the clock of the inertial record.
    llh : ndarray, shape (3,)
        Latitude, longitude, rad, height, m.
    vel_n : ndarray, shape (3,)
        North, east, down, m/s.
    rpy : ndarray, shape (3,)
        Roll, pitch, yaw, rad.
    """

    t: float
    llh: FloatArray
    vel_n: FloatArray
    rpy: FloatArray


@dataclass(frozen=True)
class BodyVelocity:
    """Velocities of a vehicle in its own axes, as wheels measure them (SI).

    Attributes
    ----------
    t : ndarray, shape (k,)
        Stamps, s, on the clock of the inertial record, strictly increasing.
    v, sd : ndarray, shape (k, 3)
        Forward, right, down, m/s, and sds as they are stated; NaN where there is none.
    """

    t: FloatArray
    v: FloatArray
    sd: FloatArray


@dataclass(frozen=True)
class Drive:
    """A measured drive: inertial samples, fixes and perhaps a reference.

    Attributes
    ----------
    name : str
        What it is called.
    imu_t : ndarray, shape (n,)
        Stamps of the inertial samples, s, strictly increasing; a sample is the mean since the one before.
    rates : ndarray, shape (n, 6)
        Angular rates, rad/s, and specific forces, m/s², in the axes of the sensor.
    gnss : Gnss
        The fixes.
    reference : Reference or None
        A better solution.
    origin : float
        Time of t = 0 on the clock of the file, s.
    lever_arm : tuple of 3 floats or None
        From the inertial unit to the antenna, in the axes of `mounting`, m.
    mounting : ndarray, shape (3, 3), or None
        Rotates vehicle axes (forward, right, down) into those of the sensor.
    source, digest : str
        Name of the file and SHA-256 of its content.
    notes : tuple of str
        Every repair that was made, with its count.
    repairs : tuple of Repair
        What was wrong with the streams and has been mended.
    clock : Clock
        Delays that its stamps have, as far as an examination knows them.
    start : Start or None
        Where the vehicle is at a time, as the file states it; None: to be found by an alignment.
    compensated : bool
        Whether what a configuration takes out of a drive is taken out of this one.
    judged : str or None
        When its reference is wrong, in words, and left out; None where nobody has looked.
    wheels : BodyVelocity or None
        Velocities of wheels.
    """

    name: str
    imu_t: FloatArray
    rates: FloatArray
    gnss: Gnss
    reference: Reference | None = None
    origin: float = 0.0
    lever_arm: tuple[float, float, float] | None = None
    mounting: FloatArray | None = None
    source: str = ""
    digest: str = ""
    notes: tuple[str, ...] = ()
    repairs: tuple[Repair, ...] = ()
    clock: Clock = field(default_factory=Clock)
    start: Start | None = None
    compensated: bool = False
    judged: str | None = None
    wheels: BodyVelocity | None = None

    @property
    def sensor_from_vehicle(self) -> FloatArray:
        """The mounting, shape (3, 3); where none is stated, axes of the sensor are those of the vehicle."""
        return np.eye(3) if self.mounting is None else self.mounting

    @property
    def unusable(self) -> str:
        """Why no function can use it, in words; empty where one can."""
        if len(self.imu_t) < 2 or self.rates.shape != (len(self.imu_t), 6):
            return f"with {len(self.imu_t)} inertial samples of shape {self.rates.shape}"
        if not len(self.gnss):
            return "without fixes"
        return _about_samples(self.imu_t, self.rates)
