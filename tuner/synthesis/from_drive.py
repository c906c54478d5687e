"""Noise of an inertial unit from a drive alone: white noise at rest, bias terms of a similar unit.

A second counts as stationary where the fixes show so and both triads are about as calm as in the calmer of those
seconds. There the Allan deviation at `ALLAN_TAU` gives the white noise of each axis, N = σ(τ) √τ; where a quantizer
makes as much of noise that it hides, that is a limit. Of slower noise a drive contains too little: bias terms are those
of the built-in grade with the nearest white noise.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.arrays import BoolArray, FloatArray
from models.earth import distance_along
from models.noise import White
from models.robust import normal_sd
from tuner.catalogue.grades import (
    DEFAULT_RECEIVER,
    grade_identification,
    grade_names,
    load_gnss,
    load_grade,
)
from tuner.readers.value_checks import WELL_DITHERED
from tuner.synthesis.load_config import load_config
from tuner.synthesis.synthesize import synthesize
from tuner.types import Coefficient, Compensation, FilterConfig, GnssNoise, Identification, TermEstimate
from tuner.types.borrowed import with_borrowed
from tuner.types.coefficient import HIDDEN
from tuner.types.records import Drive

ALLAN_TAU = 0.25
"""Cluster time at which the white noise is read, s."""
MIN_STATIONARY = 5.0
"""Stationary time from which noise is read, s."""
STATIONARY_SPEED = 0.3
"""Speed below which a vehicle is stationary, m/s."""
MAX_CALM_VARIANCE_RATIO = 2.0
"""Variance of a second over that of the calmer quarter, geometric mean over a triad, up to which it counts."""
MIN_DISTANCE_SCATTERS = 4.0
"""Time between positions that give a speed, in units of their scatter ÷ `STATIONARY_SPEED`."""
UNKNOWN_UNIT_GRADE = "mpu9250"
"""Grade of a unit of which nothing is known: the noisiest built-in consumer unit."""
UNITS = {f"{sensor}_{x}": unit for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s^2")) for x in "xyz"}
"""Units of the samples of a drive, by axis."""
FROM_FIXES = "medians of the sds that the fixes report"
"""Reference of a receiver whose noise is what its fixes report."""


@dataclass(frozen=True)
class StationaryNoise:
    """Noise of a unit in the stationary parts of a drive.

    Attributes
    ----------
    seconds : float
        Stationary time.
    white : mapping of str to Coefficient
        White density of each axis, rad/s/√Hz or m/s^2/√Hz; empty where the drive is stationary too briefly.
    """

    seconds: float
    white: Mapping[str, Coefficient]


def stationary_noise(drive: Drive) -> StationaryNoise:
    """Return the noise of the unit of a drive at rest."""
    dt = float(np.median(np.diff(drive.imu_t)))
    size = max(4, round(1.0 / dt))
    count = len(drive.rates) // size
    blocks = drive.rates[: count * size].reshape(count, size, 6)
    t = drive.imu_t[: count * size].reshape(count, size)
    whole = t[:, -1] - t[:, 0] < 1.5 * size * dt
    slow = whole & (_speed(drive, t.mean(axis=1)) < STATIONARY_SPEED)
    step = np.repeat([_quantizer_step(drive.rates[:, :3]), _quantizer_step(drive.rates[:, 3:])], 3)
    still = slow & _calm(blocks, slow, step**2 / 12.0)
    seconds = float(np.count_nonzero(still) * size * dt)
    if seconds < MIN_STATIONARY:
        return StationaryNoise(seconds, {})
    m = max(1, round(ALLAN_TAU / dt))
    density = np.sqrt(_allan(blocks[still], m) * m * dt)
    share = 1.96 / np.sqrt(4.0 * seconds / ALLAN_TAU / 3.0)  # three axes have 2 T/τ degrees of freedom
    white = {}
    for axis, n, q in zip(UNITS, density.tolist(), step.tolist(), strict=True):
        (unit,) = White(1.0).units(UNITS[axis])
        hidden = Coefficient.bounded(
            q * float(np.sqrt((WELL_DITHERED**2 + 1.0 / 12.0) * dt)), unit, f"{HIDDEN}: steps of {q:.4g}"
        )
        seen = Coefficient.known(n, n * (1.0 - share), n * (1.0 + share), unit)
        white[axis] = seen if n > (hidden.upper or 0.0) else hidden
    return StationaryNoise(seconds, white)


def identification_of_drive(drive: Drive, found: StationaryNoise) -> Identification:
    """Return the noise of a unit of which nothing is known beforehand; its first note gives the reasons.

    Parameters
    ----------
    drive : Drive
        The drive.
    found : StationaryNoise
        Noise in its stationary parts.
    """
    interval = float(np.median(np.diff(drive.imu_t)))
    if not found.white:
        why = (
            f"nothing is known of the unit, and the drive stands for {found.seconds:.0f} s only: it is taken for "
            f"{UNKNOWN_UNIT_GRADE}, a noisy one, so that the filter trusts it too little rather than too much"
        )
        grade = grade_identification(load_grade(UNKNOWN_UNIT_GRADE))
        at_its_rate = {axis: replace(channel, interval=interval) for axis, channel in grade.channels.items()}
        source = with_borrowed({**grade.source, "name": drive.name}, at_its_rate, UNKNOWN_UNIT_GRADE)
        return replace(grade, source=source, channels=at_its_rate, notes=(why,))
    known = {axis: one.value for axis, one in found.white.items() if one.value is not None}
    name = nearest_grade(known) if known else UNKNOWN_UNIT_GRADE
    grade = grade_identification(load_grade(name))
    channels = {}
    for axis, channel in grade.channels.items():
        white = TermEstimate("white", {"density": found.white[axis]})
        terms = tuple(white if t.name == "white" else t for t in channel.terms)
        channels[axis] = replace(channel, terms=terms, span=found.seconds, interval=interval)
    why = (
        f"white noise is that of {found.seconds:.0f} s at rest in this drive; bias terms are those of {name}, the "
        f"built-in grade with the nearest white noise, since a drive is too short to show them"
    )
    source = with_borrowed({**grade.source, "name": drive.name}, channels, name)
    return replace(grade, source=source, channels=channels, notes=(why,))


def config_of_drive(drive: Drive, found: StationaryNoise, *, gnss: GnssNoise | None = None) -> FilterConfig:
    """Return a configuration from a drive alone; `gnss` is for fixes that report no standard deviations."""
    return synthesize(identification_of_drive(drive, found), name=drive.name, gnss=gnss or receiver_of(drive))


def config_for_drive(
    drive: Drive, config: FilterConfig | str | Path, *, gnss: GnssNoise | str | None = None
) -> FilterConfig:
    """Return the configuration to filter a drive with; a grade gets the receiver that the fixes of the drive report.

    What is taken out of a drive already is not taken out again.

    Parameters
    ----------
    drive : Drive
        The drive.
    config : FilterConfig, str or Path
        A configuration, its file, or the name of a built-in grade.
    gnss : GnssNoise or str, optional
        Receiver, or the name of a built-in one, in place of that of the configuration.
    """
    receiver = load_gnss(gnss) if isinstance(gnss, str) else gnss
    if isinstance(config, FilterConfig):
        found = config if receiver is None else replace(config, gnss=receiver)
    else:
        found = load_config(config, gnss=receiver, default_gnss=receiver_of(drive))
    return replace(found, compensation=Compensation()) if drive.compensated else found


def receiver_of(drive: Drive) -> GnssNoise:
    """Return the noise that is assumed of a receiver nobody names.

    The median of the reported sds is its typical sd, and then no correlated part is assumed: an RTK receiver has none
    of that of a single-point one.
    """
    single, fixes = load_gnss(DEFAULT_RECEIVER), drive.gnss
    position, velocity = _typical(fixes.position_sd), _typical(fixes.velocity_sd)
    if position is None:
        return single
    return replace(
        single,
        position_sd=position,
        velocity_sd=velocity or single.velocity_sd,
        interval=float(np.median(np.diff(fixes.t))),
        correlated=(),
        reference=FROM_FIXES,
    )


def _typical(reported: FloatArray) -> tuple[float, float, float] | None:
    """Return the medians of reported sds north, east, down, (k, 3); None where an axis has none."""
    columns = [column[column > 0.0] for column in reported.T]
    if not all(column.size for column in columns):
        return None
    north, east, down = (float(np.median(column)) for column in columns)
    return north, east, down


def nearest_grade(white: Mapping[str, float], names: Collection[str] = ()) -> str:
    """Return the built-in grade, of all or of those named, whose white densities are the nearest by their logs.

    `white` is by sensor or by axis.
    """

    def distance(name: str) -> float:
        triads = {triad.kind: triad for triad in (load_grade(name).gyro, load_grade(name).accel)}
        logs = []
        for owner, value in white.items():
            density = triads[owner.partition("_")[0]].white
            if density is None:
                return float("inf")
            logs.append(np.log(value / density.value))
        return float(np.sum(np.square(logs)))

    return min(names or grade_names(), key=distance)


def _speed(drive: Drive, t: FloatArray) -> FloatArray:
    """Return the speed of the fixes at times, m/s; where they have no velocities, from positions some time apart.

    These are so far apart that their scatter s, from second differences, makes √2 s/T ≪ `STATIONARY_SPEED`.
    """
    gnss = drive.gnss
    speed, known = np.linalg.norm(np.nan_to_num(gnss.vel_n), axis=1), gnss.has_velocity
    if np.count_nonzero(known) > 2:
        return np.asarray(np.interp(t, gnss.t[known], speed[known], left=np.inf, right=np.inf))
    metres = distance_along(gnss.llh)[:, :2]
    bends = np.abs(metres[2:] - 2.0 * metres[1:-1] + metres[:-2])
    scatter = float(normal_sd(bends)) / np.sqrt(6.0) if len(bends) else 0.0
    apart = max(2.0, MIN_DISTANCE_SCATTERS * scatter / STATIONARY_SPEED)
    begin = np.clip(gnss.t - 0.5 * apart, gnss.t[0], max(gnss.t[0], gnss.t[-1] - apart))
    first = np.searchsorted(gnss.t, begin)
    last = np.minimum(np.searchsorted(gnss.t, begin + apart), len(gnss) - 1)
    speed = np.linalg.norm(metres[last] - metres[first], axis=1) / np.maximum(
        gnss.t[last] - gnss.t[first], 1e-3
    )
    speed[gnss.t[last] - gnss.t[first] < 0.5 * apart] = np.inf
    return np.asarray(np.interp(t, gnss.t, speed, left=np.inf, right=np.inf))


def _quantizer_step(samples: FloatArray) -> float:
    """Return the quantization step of the samples of a triad, the coarsest of its axes."""
    levels = [np.unique(column) for column in samples.T]
    return max((float(np.min(np.diff(one))) for one in levels if len(one) > 1), default=0.0)


def _calm(blocks: FloatArray, slow: BoolArray, least: FloatArray) -> BoolArray:
    """Return which blocks are as calm as the calmer quarter of slow ones; `least` is the quantization variance."""
    if not slow.any():
        return slow
    least = np.maximum(least, 1e-30)
    variance = np.maximum(blocks.var(axis=1), least)
    usual = np.quantile(variance[slow], 0.25, axis=0)
    ratio = np.log(variance / usual).reshape(-1, 2, 3).mean(axis=2).max(axis=1)
    return np.asarray(ratio < np.log(MAX_CALM_VARIANCE_RATIO))


def _allan(blocks: FloatArray, m: int) -> FloatArray:
    """Return the Allan variance of m samples from differences within blocks, by axis."""
    sums = np.cumsum(blocks, axis=1)
    means = (sums[:, m:] - sums[:, :-m]) / m
    return np.asarray(0.5 * np.mean((means[:, m:] - means[:, :-m]) ** 2, axis=(0, 1)))
