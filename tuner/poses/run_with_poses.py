"""What a run with poses shows of the noise of a unit: four numbers in motion, and what makes them larger than at rest.

The noise is fitted beside errors of scale and axes, which it must not contain. A filter of white noise and a random
walk meets those errors too: where there are any, its numbers are those whose predictions over `SHOWN_WINDOWS` have the
best expected score (`tuner.poses.noise_beside_causes.sizes`) with the errors as fitted left in.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.probability import chi2_beyond, normal_reach
from models.units import STANDARD_GRAVITY
from tuner.limits import HONEST_RATIO, LOCAL_GRAVITY, PRIOR_SHARE, SHOWN_CHANGE
from tuner.poses.misfit import (
    LONGEST_DELAY,
    MIXING,
    Inertial,
    Poses,
    Turns,
    accel_misfit,
    first_alignment,
    gyro_misfit,
)
from tuner.poses.noise_beside_causes import (
    PRIOR_SDS,
    SHORTEST_STRETCH,
    Fitted,
    Misfit,
    fitted,
    fitted_causes,
    hann,
    sizes,
    without_wild,
)
from tuner.synthesis import inflate
from tuner.synthesis.projection import CAMERA, Projected, pooled, projected
from tuner.synthesis.rest_and_motion import with_rest_and_motion
from tuner.types import LEVEL, Coefficient, Enlargement, FilterConfig, Quantity
from tuner.types.coefficient import times
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError, Record

SHORTEST_INTERVAL, LONGEST_INTERVAL = 0.05, 0.2
"""Time between poses that are compared, s: closer ones add their own errors only; those further apart, other turns."""
FEWEST_POSES = 400
"""Poses below which the noise of a triad has an interval wider than a factor of two."""
LEAST_CORRELATION = 0.5
"""Correlation of the sizes of rotations below which poses and gyroscopes are not of one motion, or it hardly turns."""
ALIGNMENT_TURNS = 3
"""Turns of delay and rotation: the delay then changes by less than its sd."""
SPECTRUM_LENGTH = 256
"""Samples of a spectrum: a line is in few of its frequencies."""
LEAST_FREQUENCY = 0.125
"""Frequency × interval of samples above which a unit that is moved has no motion."""
FALSE_ALARM = 1e-3
"""Chance with which a sound sensor is said to have a cause."""
SHOWN_WINDOWS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Times over which errors of the prediction are shown, s."""
FEWEST_WINDOWS = 8
"""Windows side by side of which an error is shown."""
CAUSE_UNITS = {"scale": "1", "turn": "rad", "delay": "s", "filter": "s^2"}
"""Units of what causes are."""
LEAST_FACTOR = 1.0 + SHOWN_CHANGE
GYRO_GEOMETRY, GYRO_CAUSES = ("turn", "clock"), ("scale", "filter")
"""What of the gyroscopes against the poses is no error of theirs, and what is."""
ACCEL_GEOMETRY, ACCEL_CAUSES = ("gravity", "arm"), ("turn", "scale", "delay", "filter")
"""The same of the accelerometers, and what is an error of theirs: the gyroscopes have axes and clock of the unit."""
UNITS = {"gyro": ("rad/s/√Hz", "rad/s/√s", "rad"), "accel": ("m/s^2/√Hz", "m/s^2/√s", "m")}
"""Units of N, K and the sd of the poses."""
DECLARED_PARTS = slice(6, 9), slice(0, 3)
"""Attitude and position in a `FilterOutput.covariance`."""
SETTING_FIELDS = {"white": ("white_density",), "walk": ("random_walk_density", "markov")}
"""Numbers of a fit, and settings that they are."""


@dataclass(frozen=True)
class Cause:
    """What makes a sensor err in motion.

    Attributes
    ----------
    name : str
        ``scale``: errors of scale and right angles; ``turn``: of its axes against the gyroscopes'; ``delay``: against
        their clock; ``filter``: a low-pass, by half of its squared time constant, s².
    size : Coefficient
        Of its parts the surest.
    factor : float
        White noise with it ÷ beside it.
    """

    name: str
    size: Coefficient
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
        White noise of the samples above motion ÷ that at rest.
    unexplained : tuple of str
        Numbers that are above those at rest, as errors of the poses that last would look.
    """

    sensor: str
    rest: Projected
    beside: Fitted
    causes: tuple[Cause, ...]
    whole: Projected
    growth: Mapping[float, FloatArray]
    scatter: float
    unexplained: tuple[str, ...]

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
        """Whether the samples scatter more than at rest, and their errors do."""
        return self.scatter > LEAST_FACTOR and "white" in self.larger


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
    sampling : float
        Interval of the samples, s.
    size : Coefficient
        Distances of the poses ÷ true ones, by which they were divided where it is not one: gravity as it was measured.
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
    sampling: float
    size: Coefficient
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
    rest = {sensor: _at_rest(config, sensor, name) for sensor in UNITS}
    turns = Turns(imu)
    delay, matrix, correlation = first_alignment(turns, used)
    if not correlation > LEAST_CORRELATION:
        raise DataError(
            f"{name}: expected gyroscopes that turn as the poses do, found a correlation of {correlation:.2f}: the run "
            "needs turns that are larger than the errors of the poses, and stamps of both on one clock within a second"
        )
    stamps = used.t
    used = replace(used, t=stamps + delay)
    white = rest["gyro"].white_density
    for _ in range(ALIGNMENT_TURNS):
        of_gyro = gyro_misfit(imu, turns, used, matrix)
        _expect_enough(of_gyro, name)
        of_gyro = without_wild(of_gyro, fitted(of_gyro, (*GYRO_GEOMETRY, *GYRO_CAUSES), UNITS["gyro"], white))
        gyro = fitted(of_gyro, (*GYRO_GEOMETRY, *GYRO_CAUSES), UNITS["gyro"], white)
        (late, drift), spread = gyro.causes["clock"]
        used = replace(used, t=used.t - late - drift * (used.t - 0.5 * (used.t[0] + used.t[-1])))
        matrix = rotation.mat_from_rotvec(gyro.causes["turn"][0]) @ matrix
    if np.linalg.eigvalsh(gyro.causes["turn"][1])[-1] > (PRIOR_SHARE * PRIOR_SDS["turn"]) ** 2:
        raise DataError(
            f"{name}: expected a run that turns about two axes or more, found turns about one: poses and unit have no "
            "common axes"
        )
    moved = used.t - stamps
    offset, rate = 0.5 * float(moved[0] + moved[-1]), float((moved[-1] - moved[0]) / (stamps[-1] - stamps[0]))
    reach = normal_reach(LEVEL) * np.sqrt(np.diag(spread))
    right = replace(
        imu, rate=imu.rate - imu.rate @ np.tensordot(gyro.causes["scale"][0], MIXING["scale"], 1).T
    )
    turns, attitude_sd = Turns(right), gyro.reference.value or 0.0
    usable, size = of_gyro.kept, 1.0
    for _ in range(ALIGNMENT_TURNS):
        of_accel = accel_misfit(right, turns, used, matrix, attitude_sd, usable)
        for _ in range(2):
            accel = fitted(
                of_accel, (*ACCEL_GEOMETRY, *ACCEL_CAUSES), UNITS["accel"], rest["accel"].white_density
            )
            of_accel = without_wild(of_accel, accel)
        of_poses = _size_of_positions(accel)
        low, high = of_poses.interval or (1.0, 1.0)
        if size == 1.0 and low <= 1.0 <= high:
            break
        size *= of_poses.value or 1.0
        used = replace(used, place=used.place / (of_poses.value or 1.0))
    still = {one.name: _scatter(one.y, one.interval) for one in at_rest}
    scatter = {
        sensor: _scatter(samples, imu.interval) / still.get(sensor, rest[sensor].white_density)
        for sensor, samples in (("gyro", imu.rate), ("accel", imu.force))
    }
    by_gravity = LOCAL_GRAVITY**2 * (size != 1.0) * np.outer([1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0])
    shared = {"turn": gyro.causes["turn"][1], "scale": by_gravity}
    of_gyroscopes = _sensor("gyro", rest["gyro"], of_gyro, GYRO_GEOMETRY, GYRO_CAUSES, scatter["gyro"], {})
    accel_causes = () if of_gyroscopes.unexplained else ACCEL_CAUSES  # the gyroscopes turn the specific force
    return RunWithPoses(
        name,
        float(np.sum(of_gyro.kept)) * of_gyro.interval,
        of_gyro.interval,
        Coefficient.known(offset, offset - float(reach[0]), offset + float(reach[0]), "s"),
        Coefficient.known(rate, rate - float(reach[1]), rate + float(reach[1]), "1"),
        imu.interval,
        times(of_poses, size / (of_poses.value or 1.0), "1"),
        of_gyroscopes,
        _sensor("accel", rest["accel"], of_accel, ACCEL_GEOMETRY, accel_causes, scatter["accel"], shared),
        1.0 - float(np.mean(of_accel.kept)),
        poses.declared,
    )


def poses_of(output: FilterOutput) -> Poses:
    """Return the poses of a file.

    Raises
    ------
    DataError
        Where it has no positions in metres, or no attitudes; rows without one are left out.
    """
    known = np.isfinite(output.quat_nb).all(axis=1)
    if output.local is None or not known.any():
        raise DataError(
            f"{output.name}: expected poses, x, y, z in m and a quaternion, found no "
            f"{'positions in m' if output.local is None else 'attitude'}"
        )
    variances = np.einsum("nii->ni", output.covariance)
    attitude, place = (float(np.sqrt(np.median(variances[:, part].mean(axis=1)))) for part in DECLARED_PARTS)
    return Poses(output.t[known], output.local[known], output.quat_nb[known], (attitude, place))


def with_run(config: FilterConfig, run: RunWithPoses) -> FilterConfig:
    """Return settings with the noise that a run shows where it is larger than at rest."""
    larger = []
    for one in () if run.dependent else run.sensors:
        for number, factor in one.larger.items():
            causes = (*(cause.name for cause in one.causes), *(("vibration",) * one.shaken))
            reason = f"the errors of {run.name} beside its poses, {run.span:.0f} s in motion"
            larger += [
                Enlargement(Quantity(one.sensor, field), factor, reason, causes)
                for field in SETTING_FIELDS[number]
            ]
    if not math.isclose(config.interval, run.sampling, rel_tol=SHOWN_CHANGE):
        note = f"figures a sample are those at {1.0 / run.sampling:.4g} Hz, as in {run.name}"
        config = replace(config, interval=run.sampling, notes=(*config.notes, note))
    return with_rest_and_motion(config, inflate(config, larger)) if larger else config


def _inertial(records: Sequence[Record], name: str) -> Inertial:
    """Return samples of three gyroscopes and three accelerometers with common stamps."""
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
    gaps = [(gyro.t[a - 1], gyro.t[b]) for (_, a), (b, _) in itertools.pairwise(gyro.segments)]
    return Inertial(gyro.t, gyro.y, accel.y, gyro.interval, np.array(gaps).reshape(-1, 2))


def _within(poses: Poses, imu: Inertial, name: str) -> Poses:
    """Return poses within the samples that differ from the one before, `SHORTEST_INTERVAL` apart or more."""
    moved = np.any(np.diff(np.column_stack([poses.place, poses.quat]), axis=0) != 0.0, axis=1)
    inside = (poses.t > imu.t[0] + LONGEST_DELAY) & (poses.t < imu.t[-1] - LONGEST_DELAY)
    fresh = np.flatnonzero(inside & np.concatenate([[True], moved]))
    usual = float(np.median(np.diff(poses.t[fresh]))) if len(fresh) > 1 else SHORTEST_INTERVAL
    chosen = fresh[:: max(1, round(SHORTEST_INTERVAL / usual))]
    if len(chosen) < FEWEST_POSES:
        raise DataError(
            f"{name}: expected {FEWEST_POSES} poses or more within the samples that differ from the one before, found "
            f"{len(chosen)}; samples from {imu.t[0]:.3f} to {imu.t[-1]:.3f} s, poses from {poses.t[0]:.3f} to "
            f"{poses.t[-1]:.3f} s"
        )
    return Poses(poses.t[chosen], poses.place[chosen], poses.quat[chosen])


def _expect_enough(misfit: Misfit, name: str) -> None:
    """Refuse a run with too few poses in a row, or poses too far apart."""
    rows = sum(one.stop - one.start for one in misfit.stretches)
    if rows < FEWEST_POSES or misfit.interval > LONGEST_INTERVAL * LEAST_FACTOR:
        raise DataError(
            f"{name}: expected {FEWEST_POSES} poses or more, evenly {LONGEST_INTERVAL:g} s apart or less, in stretches "
            f"of {SHORTEST_STRETCH} without a gap of poses or samples, found {rows}, {misfit.interval:.3g} s apart"
        )


def _size_of_positions(accel: Fitted) -> Coefficient:
    """Return gravity as a run shows it ÷ standard gravity: distances of its poses ÷ true ones, unless it is local."""
    gravity, spread = accel.causes["gravity"]
    size = float(np.linalg.norm(gravity))
    sd = math.sqrt(float(gravity @ spread @ gravity)) / size
    ratio, reach = size / STANDARD_GRAVITY, LOCAL_GRAVITY + normal_reach(LEVEL) * sd / STANDARD_GRAVITY
    return Coefficient.known(ratio, ratio - reach, ratio + reach, "1")


def _at_rest(config: FilterConfig, sensor: str, name: str) -> Projected:
    """Return the two numbers of a sensor at rest."""
    channels = tuple(one for axis, one in config.channels.items() if axis.startswith(f"{sensor}_"))
    if not channels:
        raise DataError(f"{name}: expected settings of {sensor}, found none: the log at rest lacks it")
    return projected(pooled(channels), CAMERA)


def _scatter(samples: FloatArray, interval: float) -> float:
    """Return the white noise of samples (n, 3) above motion, unit/√Hz: the median of their spectrum, free of lines."""
    blocks = samples[: len(samples) // SPECTRUM_LENGTH * SPECTRUM_LENGTH].reshape(-1, SPECTRUM_LENGTH, 3)
    taken = (blocks - blocks.mean(axis=1, keepdims=True)) * hann(SPECTRUM_LENGTH)[:, None]
    power = np.mean(np.abs(np.fft.rfft(taken, axis=1)) ** 2, axis=(0, 2)) * interval
    above = np.fft.rfftfreq(SPECTRUM_LENGTH) > LEAST_FREQUENCY
    return float(np.sqrt(np.median(power[above])))


def _sensor(
    sensor: str,
    rest: Projected,
    misfit: Misfit,
    nuisance: tuple[str, ...],
    causes: tuple[str, ...],
    scatter: float,
    shared: Mapping[str, FloatArray],
) -> SensorInRun:
    """Return noise and causes of a sensor; nuisances are no errors of it.

    `shared` are covariances of what causes hold beside errors of the sensor: the turn between poses and gyroscopes, and
    the scale of poses that is known by gravity alone.

    Where beside all causes more is left than the noise at rest or the scatter of the samples, the poses or the sensor
    err in a way that is not known, and errors of scale that such errors look like are not named.
    """

    def fit(names: Sequence[str]) -> Fitted:
        return fitted(misfit, (*nuisance, *names), UNITS[sensor], rest.white_density)

    beside = fit(causes)
    white = times(beside.white, 1.0 / rest.white_density, "1")
    shaken = max(1.0, min(scatter, white.value or white.upper or 1.0)) if scatter > LEAST_FACTOR else 1.0
    above = {
        "white": _is_above(white, HONEST_RATIO * shaken if shaken > 1.0 else 1.0),
        "walk": _is_above(times(beside.walk, 1.0 / rest.bias, "1"), 1.0),
    }
    unexplained = tuple(name for name, is_above in above.items() if is_above)
    found = []
    for cause in () if unexplained else causes:
        values, spread = beside.causes[cause]
        spread = spread + shared.get(cause, 0.0)
        known = np.flatnonzero(np.sqrt(np.diag(spread)) < PRIOR_SHARE * PRIOR_SDS.get(cause, math.inf))
        values, spread = values[known], spread[np.ix_(known, known)]
        if (
            not len(known)
            or chi2_beyond(float(values @ np.linalg.solve(spread, values)), len(known)) > FALSE_ALARM
        ):
            continue
        if cause == "filter" and values[0] < 0.0:
            continue  # the poses are smoothed, not the samples
        factor = _size(fit([one for one in causes if one != cause]).white) / _size(beside.white)
        if factor > LEAST_FACTOR:
            found.append(Cause(cause, _surest(values, spread, CAUSE_UNITS[cause]), factor))
    alone, named = fit(()), fit([one.name for one in found])
    longest, rows = max(one.stop - one.start for one in misfit.stretches), int(np.sum(misfit.kept))
    every = (round(window / misfit.interval) for window in SHOWN_WINDOWS)
    lags = [lag for lag in every if 1 <= lag <= min(longest, rows // FEWEST_WINDOWS)]
    windows = misfit.interval * np.array(lags)[:, None]
    ends = np.stack([_of_poses(misfit, lag, (beside.reference.value or 0.0) ** 2) for lag in lags])
    basis = np.stack(np.broadcast_arrays(windows, windows**3 / 3.0, ends)[:2], axis=-1)
    whole = Projected(shaken * rest.white_density, rest.bias)
    if found:
        errors = fitted_causes(misfit, named) - fitted_causes(misfit, alone)
        left_in = _squares(misfit, errors - errors[misfit.kept].mean(axis=0), lags)
        expected = basis @ [whole.white_density**2, whole.bias**2] + ends + left_in
        white, walk = np.sqrt(sizes(expected, basis, ends))
        whole = Projected(max(whole.white_density, float(white)), max(whole.bias, float(walk)))
    y = misfit.y - fitted_causes(misfit, alone)
    squares = _squares(misfit, y - y[misfit.kept].mean(axis=0), lags)
    ratios = np.sqrt(squares / (basis @ [rest.white_density**2, rest.bias**2] + ends))
    growth = dict(zip(windows.ravel().tolist(), ratios, strict=True))
    return SensorInRun(sensor, rest, beside, tuple(found), whole, growth, scatter, unexplained)


def _squares(misfit: Misfit, y: FloatArray, lags: Sequence[int]) -> FloatArray:
    """Return mean squares of the integral of (n, 3) over windows of so many rows that are kept; (w, 3)."""
    integral = np.vstack(
        [np.zeros(3), np.cumsum(np.where(misfit.kept[:, None], y, 0.0) * misfit.interval, axis=0)]
    )
    number = np.concatenate([[0], np.cumsum(misfit.kept)])
    found = []
    for lag in lags:
        whole = number[lag:] - number[:-lag] == lag
        found.append(np.mean((integral[lag:] - integral[:-lag])[whole] ** 2, axis=0))
    return np.stack(found)


def _size(one: Coefficient) -> float:
    """Return a value, or the limit where there is none."""
    return one.value if one.value is not None else one.upper or math.inf


def _surest(values: FloatArray, spread: FloatArray, unit: str) -> Coefficient:
    """Return the value that is furthest from zero in its sds."""
    at = int(np.argmax(np.abs(values) / np.sqrt(np.diag(spread))))
    reach = normal_reach(LEVEL) * math.sqrt(float(spread[at, at]))
    return Coefficient.known(float(values[at]), float(values[at]) - reach, float(values[at]) + reach, unit)


def _is_above(one: Coefficient, bound: float) -> bool:
    """Return whether a factor is above a bound but with `FALSE_ALARM`."""
    if one.value is None or one.interval is None:
        return False
    sd = math.log(one.interval[1] / one.value) / normal_reach(LEVEL)
    return math.log(one.value / bound) > normal_reach(1.0 - 2.0 * FALSE_ALARM) * sd


def _of_poses(misfit: Misfit, lag: int, size: float) -> FloatArray:
    """Return the variance of a sum over some steps that errors of the poses make, on each axis; (3,)."""
    weights = misfit.interval**2 * np.array([lag, *(2 * max(0, lag - one) for one in (1, 2))])
    parts = (size * misfit.reference, misfit.known)
    return np.asarray(sum(one @ weights[: one.shape[1]] for one in parts))
