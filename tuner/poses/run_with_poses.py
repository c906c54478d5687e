"""What a run with poses shows of the noise of a unit: four numbers in motion, and what makes them larger than at rest.

The noise is fitted beside errors of scale and axes, which it must not contain. A filter of white noise and a random
walk meets those errors too: where there are any, its numbers are those whose predictions over `SHOWN_WINDOWS` have the
best expected score (`tuner.poses.noise_beside_causes.sizes`) with the errors as fitted left in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.probability import chi2_beyond, normal_reach
from tuner.limits import HONEST_RATIO, SHOWN_CHANGE
from tuner.poses.misfit import (
    Inertial,
    Poses,
    Turns,
    accel_misfit,
    first_alignment,
    gyro_misfit,
    scale_matrix,
)
from tuner.poses.noise_beside_causes import Fitted, Misfit, fitted, sizes
from tuner.synthesis import inflate
from tuner.synthesis.projection import CAMERA, Projected, pooled, projected
from tuner.synthesis.rest_and_motion import with_rest_and_motion
from tuner.types import LEVEL, Coefficient, Enlargement, FilterConfig, Quantity
from tuner.types.coefficient import times
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError, Record

SHORTEST_INTERVAL, LONGEST_INTERVAL = 0.05, 0.25
"""Time between poses that are compared, s: closer ones add their own errors only; those further apart, other turns."""
FEWEST_POSES = 400
"""Poses below which the noise of a triad has an interval wider than a factor of two."""
LEAST_CORRELATION = 0.5
"""Correlation of the sizes of rotations below which poses and gyroscopes are not of one motion, or it hardly turns."""
ALIGNMENT_TURNS = 3
"""Turns of delay and rotation: the delay then changes by less than its sd."""
FALSE_ALARM = 1e-3
"""Chance with which a sound sensor is said to have a cause."""
SHOWN_WINDOWS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Times over which errors of the prediction are shown, s."""
FEWEST_WINDOWS = 8
"""Windows side by side of which an error is shown."""
CAUSE_UNITS = {"scale": "1", "turn": "rad", "delay": "s"}
"""Units of what causes are."""
LEAST_FACTOR = 1.0 + SHOWN_CHANGE
GYRO_GEOMETRY = ("bias", "turn", "clock")
"""What of the gyroscopes against the poses is no error of theirs: the filter knows biases, the rest is of the poses."""
ACCEL_GEOMETRY, ACCEL_CAUSES = ("bias", "gravity", "arm"), ("turn", "scale", "delay")
"""The same of the accelerometers, and what is an error of theirs: the gyroscopes have axes and clock of the unit."""
UNITS = {"gyro": ("rad/s/√Hz", "rad/s/√s", "rad"), "accel": ("m/s^2/√Hz", "m/s^2/√s", "m")}
"""Units of N, K and the sd of the poses."""
DECLARED_PARTS = slice(6, 9), slice(0, 3)
"""Attitude and position in a `FilterOutput.covariance`."""
SETTING_FIELDS = {"white": "white_density", "walk": "random_walk_density"}
"""Numbers of a fit, and settings that they are."""


@dataclass(frozen=True)
class Cause:
    """What makes a sensor err in motion.

    Attributes
    ----------
    name : str
        ``scale``: errors of scale and right angles; ``turn``: of its axes against the gyroscopes'; ``delay``: against
        their clock.
    largest : Coefficient
        Of its parts the largest.
    factor : float
        White noise with it ÷ beside it.
    """

    name: str
    largest: Coefficient
    factor: float


@dataclass(frozen=True)
class SensorInRun:
    """Noise of one sensor in a run.

    Attributes
    ----------
    sensor : str
        ``gyro`` or ``accel``.
    rest : Projected
        The two numbers of the settings, at rest.
    beside : Fitted
        Its noise beside all causes.
    causes : tuple of Cause
        Those that change the white noise.
    whole : Projected
        The two numbers of a filter that knows none of the causes, of what is explained: the causes, and white noise
        where the samples scatter as much more; not below those at rest.
    growth : mapping of float to ndarray, shape (3,)
        By window, s: error of angle or velocity of each axis ÷ what the settings at rest and the poses predict.
    scatter : float
        Scatter of the samples about their neighbours, as white noise ÷ that at rest.
    """

    sensor: str
    rest: Projected
    beside: Fitted
    causes: tuple[Cause, ...]
    whole: Projected
    growth: Mapping[float, FloatArray]
    scatter: float

    @property
    def follows(self) -> bool:
        """Whether the poses agree with the sensor better than its noise at rest allows: they were made with it."""
        white = self.beside.white
        highest = white.upper if white.interval is None else white.interval[1]
        return highest is not None and highest * HONEST_RATIO < self.rest.white_density

    @property
    def factors(self) -> Mapping[str, Coefficient]:
        """Noise in the run beside all causes ÷ that at rest, by number."""
        return {
            "white": times(self.beside.white, 1.0 / self.rest.white_density, "1"),
            "walk": times(self.beside.walk, 1.0 / self.rest.bias, "1"),
        }

    @property
    def larger(self) -> Mapping[str, float]:
        """Factors above one that are explained."""
        ratios = {
            "white": self.whole.white_density / self.rest.white_density,
            "walk": self.whole.bias / self.rest.bias,
        }
        return {name: one for name, one in ratios.items() if one > LEAST_FACTOR}

    @property
    def shaken(self) -> bool:
        """Whether the samples themselves scatter by as much more than at rest as their errors are larger."""
        return _is_shaken(self.factors["white"], self.scatter)

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Numbers that are above those at rest, which errors of the poses that last would look like."""
        explained = ("white",) * self.shaken
        return tuple(
            name for name, one in self.factors.items() if _is_above_one(one) and name not in explained
        )


@dataclass(frozen=True)
class RunWithPoses:
    """A run beside poses.

    Attributes
    ----------
    name : str
        Of the run.
    span, interval : float
        What was compared, and the time between poses, s.
    delay : Coefficient
        What must be added to the stamps of the poses in the middle of the run, s.
    drift : Coefficient
        By how much more a second.
    gyro, accel : SensorInRun
        The sensors.
    left_out : float
        Share of the poses that are not used, as they lie beyond a gap or the samples.
    declared : (float, float)
        `Poses.declared`.
    """

    name: str
    span: float
    interval: float
    delay: Coefficient
    drift: Coefficient
    gyro: SensorInRun
    accel: SensorInRun
    left_out: float
    declared: tuple[float, float]

    @property
    def dependent(self) -> bool:
        """Whether the poses were made with the unit: what they show of it is then no measurement."""
        return self.gyro.follows or self.accel.follows

    @property
    def sensors(self) -> tuple[SensorInRun, SensorInRun]:
        """Both sensors."""
        return self.gyro, self.accel


def compare_with_poses(
    records: Sequence[Record], poses: Poses, config: FilterConfig, name: str, at_rest: Sequence[Record] = ()
) -> RunWithPoses:
    """Return what a run shows of the noise of its unit.

    Parameters
    ----------
    records : sequence of Record
        Gyroscopes and accelerometers in the run.
    poses : Poses
        On the same clock within a second.
    config : FilterConfig
        Settings from a log at rest.
    name : str
        Of the run, for messages.
    at_rest : sequence of Record, optional
        Samples at rest that the settings are of; without them their scatter is that of the white noise.

    Raises
    ------
    DataError
        Where a sensor is missing, the poses are too few or too far apart, or they are of another motion.
    """
    imu = _inertial(records, name)
    used = _within(poses, imu, name)
    turns = Turns(imu)
    delay, matrix, correlation = first_alignment(turns, used)
    if not correlation > LEAST_CORRELATION:
        raise DataError(
            f"{name}: expected gyroscopes that turn as the poses do, found a correlation of {correlation:.2f}: the run "
            "needs turns that are larger than the errors of the poses, and stamps of both on one clock within a second"
        )
    stamps = used.t
    used = replace(used, t=stamps + delay)
    for _ in range(ALIGNMENT_TURNS):
        of_gyro = gyro_misfit(imu, turns, used, matrix)
        gyro = fitted(of_gyro, (*GYRO_GEOMETRY, "scale"), UNITS["gyro"])
        (late, drift), spread = gyro.causes["clock"]
        used = replace(used, t=used.t - late - drift * (used.t - 0.5 * (used.t[0] + used.t[-1])))
        matrix = rotation.mat_from_rotvec(gyro.causes["turn"][0]) @ matrix
    moved = used.t - stamps
    offset, rate = 0.5 * float(moved[0] + moved[-1]), float((moved[-1] - moved[0]) / (stamps[-1] - stamps[0]))
    reach = normal_reach(LEVEL) * np.sqrt(np.diag(spread))
    right = replace(imu, rate=imu.rate - imu.rate @ scale_matrix(gyro.causes["scale"][0]).T)
    of_accel = accel_misfit(right, Turns(right), used, matrix, gyro.reference.value or 0.0)
    rest = {sensor: _at_rest(config, sensor, name) for sensor in UNITS}
    still = {one.name: _scatter(one.y, one.interval) for one in at_rest}
    scatter = {
        sensor: _scatter(samples, imu.interval) / still.get(sensor, rest[sensor].white_density)
        for sensor, samples in (("gyro", imu.rate), ("accel", imu.force))
    }
    return RunWithPoses(
        name,
        float(used.t[-1] - used.t[0]),
        of_gyro.interval,
        Coefficient.known(offset, offset - float(reach[0]), offset + float(reach[0]), "s"),
        Coefficient.known(rate, rate - float(reach[1]), rate + float(reach[1]), "1"),
        _sensor("gyro", rest["gyro"], of_gyro, GYRO_GEOMETRY, ("scale",), scatter["gyro"]),
        _sensor("accel", rest["accel"], of_accel, ACCEL_GEOMETRY, ACCEL_CAUSES, scatter["accel"]),
        1.0 - len(used.t) / max(1, len(_thinned(poses).t)),
        poses.declared,
    )


def poses_of(output: FilterOutput) -> Poses:
    """Return the poses of a file.

    Raises
    ------
    DataError
        Where it lacks positions in metres, or attitudes.
    """
    if output.local is None or not np.isfinite(output.quat_nb).all():
        raise DataError(
            f"{output.name}: expected poses, x, y, z in m and a quaternion, in every row, found no "
            f"{'positions in m' if output.local is None else 'attitude in some'}"
        )
    variances = np.einsum("nii->ni", output.covariance)
    attitude, place = (float(np.sqrt(np.median(variances[:, part].mean(axis=1)))) for part in DECLARED_PARTS)
    return Poses(output.t, output.local, output.quat_nb, (attitude, place))


def with_run(config: FilterConfig, run: RunWithPoses) -> FilterConfig:
    """Return settings with the noise that a run shows where it is larger than at rest."""
    larger = []
    for one in () if run.dependent else run.sensors:
        for number, factor in one.larger.items():
            causes = (*(cause.name for cause in one.causes), *(("vibration",) * one.shaken))
            reason = f"the errors of {run.name} beside its poses, {run.span:.0f} s in motion"
            fields = (SETTING_FIELDS[number],) if number == "white" else (SETTING_FIELDS[number], "markov")
            owner = Quantity(one.sensor, fields[0])
            larger += [Enlargement(replace(owner, field=field), factor, reason, causes) for field in fields]
    return with_rest_and_motion(config, inflate(config, larger)) if larger else config


def _inertial(records: Sequence[Record], name: str) -> Inertial:
    """Return the longest stretch of samples without a gap."""
    triads = {one.name: one for one in records if len(one.axes) == 3}
    if missing := [sensor for sensor in ("gyro", "accel") if sensor not in triads]:
        raise DataError(
            f"{name}: expected three gyroscopes and three accelerometers, found no {' and no '.join(missing)}"
        )
    gyro, accel = triads["gyro"], triads["accel"]
    if len(gyro.t) != len(accel.t):
        raise DataError(
            f"{name}: expected gyroscopes and accelerometers with common stamps, found {len(gyro.t)} and "
            f"{len(accel.t)} samples"
        )
    begin, end = max(gyro.segments, key=lambda one: one[1] - one[0])
    return Inertial(gyro.t[begin:end], gyro.y[begin:end], accel.y[begin:end], gyro.interval)


def _thinned(poses: Poses) -> Poses:
    """Return poses that are `SHORTEST_INTERVAL` apart or more."""
    step = max(1, math.ceil(SHORTEST_INTERVAL / float(np.median(np.diff(poses.t))) - 0.01))
    return Poses(poses.t[::step], poses.place[::step], poses.quat[::step])


def _within(poses: Poses, imu: Inertial, name: str) -> Poses:
    """Return the longest run of poses without a gap that lies within the samples, however their clocks are apart."""
    thin = _thinned(poses)
    inside = (thin.t > imu.t[0] + 1.0) & (thin.t < imu.t[-1] - 1.0)
    interval = float(np.median(np.diff(thin.t)))
    breaks = np.flatnonzero((np.diff(thin.t) > 1.5 * interval) | ~inside[1:] | ~inside[:-1])
    edges = np.concatenate([[-1], breaks, [len(thin.t) - 1]])
    longest = int(np.argmax(np.diff(edges)))
    begin, end = int(edges[longest]) + 1, int(edges[longest + 1]) + 1
    if end - begin < FEWEST_POSES or interval > LONGEST_INTERVAL:
        raise DataError(
            f"{name}: expected {FEWEST_POSES} poses or more without a gap within the samples, {LONGEST_INTERVAL:g} s "
            f"apart or less, found {end - begin}, {interval:.3g} s apart; samples from {imu.t[0]:.3f} to "
            f"{imu.t[-1]:.3f} s, poses from {poses.t[0]:.3f} to {poses.t[-1]:.3f} s"
        )
    return Poses(thin.t[begin:end], thin.place[begin:end], thin.quat[begin:end])


def _at_rest(config: FilterConfig, sensor: str, name: str) -> Projected:
    """Return the two numbers of a sensor at rest."""
    channels = tuple(one for axis, one in config.channels.items() if axis.startswith(f"{sensor}_"))
    if not channels:
        raise DataError(f"{name}: expected settings of {sensor}, found none: the log at rest lacks it")
    return projected(pooled(channels), CAMERA)


def _scatter(samples: FloatArray, interval: float) -> float:
    """Return the white noise that second differences of samples (n, 3) show, unit/√Hz."""
    return float(np.sqrt(np.mean(np.diff(samples, 2, axis=0) ** 2) / 6.0 * interval))


def _sensor(
    sensor: str,
    rest: Projected,
    misfit: Misfit,
    nuisance: tuple[str, ...],
    causes: tuple[str, ...],
    scatter: float,
) -> SensorInRun:
    """Return noise and causes of a sensor; nuisances are no errors of it."""
    beside = fitted(misfit, (*nuisance, *causes), UNITS[sensor])
    found = []
    for cause in causes:
        values, spread = beside.causes[cause]
        if chi2_beyond(float(values @ np.linalg.pinv(spread) @ values), len(values)) > FALSE_ALARM:
            continue
        others = [one for one in causes if one != cause]
        factor = _size(fitted(misfit, (*nuisance, *others), UNITS[sensor]).white) / _size(beside.white)
        if factor > LEAST_FACTOR:
            found.append(Cause(cause, _largest(values, spread, CAUSE_UNITS[cause]), factor))
    alone, named = (
        fitted(misfit, (*nuisance, *more), UNITS[sensor]) for more in ((), [one.name for one in found])
    )
    lags = [
        lag
        for lag in (round(w / misfit.interval) for w in SHOWN_WINDOWS)
        if 1 <= lag <= len(misfit.y) // FEWEST_WINDOWS
    ]
    windows = misfit.interval * np.array(lags)[:, None]
    ends = np.stack([_of_poses(misfit, lag, (beside.reference.value or 0.0) ** 2) for lag in lags])
    basis = np.stack(np.broadcast_arrays(windows, windows**3 / 3.0, ends)[:2], axis=-1)
    shaken = _is_shaken(times(beside.white, 1.0 / rest.white_density, "1"), scatter)
    whole = Projected((shaken and beside.white.value) or rest.white_density, rest.bias)
    if found:
        left_in = _squares(_values(misfit, named) - _values(misfit, alone), misfit.interval, lags)
        expected = basis @ [whole.white_density**2, whole.bias**2] + ends + left_in
        white, walk = np.sqrt(sizes(expected, basis, ends))
        whole = Projected(max(whole.white_density, float(white)), max(whole.bias, float(walk)))
    squares = _squares(misfit.y - _values(misfit, alone), misfit.interval, lags)
    ratios = np.sqrt(squares / (basis @ [rest.white_density**2, rest.bias**2] + ends))
    growth = dict(zip(windows.ravel().tolist(), ratios, strict=True))
    return SensorInRun(sensor, rest, beside, tuple(found), whole, growth, scatter)


def _values(misfit: Misfit, of: Fitted) -> FloatArray:
    """Return what causes add to a series by their fitted values; (n, 3)."""
    return np.asarray(
        sum(np.tensordot(values, misfit.causes[name], 1) for name, (values, _) in of.causes.items())
    )


def _squares(y: FloatArray, interval: float, lags: Sequence[int]) -> FloatArray:
    """Return mean squares of the integral over windows by their length in steps; (w, 3)."""
    integral = np.vstack([np.zeros(3), np.cumsum(y * interval, axis=0)])
    return np.stack([np.mean((integral[lag:] - integral[:-lag]) ** 2, axis=0) for lag in lags])


def _size(one: Coefficient) -> float:
    """Return a value, or the limit where there is none."""
    return one.value if one.value is not None else one.upper or math.inf


def _largest(values: FloatArray, spread: FloatArray, unit: str) -> Coefficient:
    """Return the value furthest from zero."""
    at = int(np.argmax(np.abs(values)))
    reach = normal_reach(LEVEL) * math.sqrt(float(spread[at, at]))
    return Coefficient.known(float(values[at]), float(values[at]) - reach, float(values[at]) + reach, unit)


def _is_shaken(white: Coefficient, scatter: float) -> bool:
    """Return whether white noise is above that at rest, and the samples scatter by a like factor more than there."""
    return _is_above_one(white) and white.interval is not None and scatter * HONEST_RATIO > white.interval[0]


def _is_above_one(one: Coefficient) -> bool:
    """Return whether a factor is above one but with `FALSE_ALARM`."""
    if one.value is None or one.interval is None:
        return False
    sd = math.log(one.interval[1] / one.value) / normal_reach(LEVEL)
    return math.log(one.value) > normal_reach(1.0 - 2.0 * FALSE_ALARM) * sd


def _of_poses(misfit: Misfit, lag: int, size: float) -> FloatArray:
    """Return the variance of a sum over some steps that errors of the poses make, on each axis; (3,)."""
    autocovariance = size * np.pad(misfit.reference, ((0, 0), (0, 3 - misfit.reference.shape[1])))
    autocovariance = autocovariance + np.pad(misfit.known, ((0, 0), (0, 3 - misfit.known.shape[1])))
    weights = np.array([lag, *(2 * max(0, lag - one) for one in (1, 2))])
    return np.asarray(autocovariance @ weights * misfit.interval**2)
