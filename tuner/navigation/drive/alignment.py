"""Alignment of a drive: attitude from gravity and motion, gyro bias from standing still.

Gravity determines the tilt, speed changes the heading, both at once: over windows of some seconds the specific force,
rotated by the gyros into the body frame b₀ of the start, must be the change of velocity less gravity, in the axes n of
the first fix, fixed to the Earth (`free_of_gravity`)::

    α_j = ∫ C_b0b f dt            β_j = Δv_j − γ Δt e_D            β_j = C_nb0 α_j        (Wahba)

The attitude follows by singular values [2]_, for any mounting of the unit. While the fixes stand still, the mean of the
gyros less the Earth rate is their bias; where they hardly do, the windows determine it beside the attitude
(`alignment_in_motion`).

References
----------
.. [1] M. Wu, Y. Wu, X. Hu, D. Hu, Optimization-based alignment for inertial navigation systems, Aerospace
       Science and Technology 15 (2011).
.. [2] F. L. Markley, Attitude determination using vector observations and the singular value decomposition,
       J. Astronautical Sciences 36 (1988).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import EARTH_RATE, distance_along, earth_rate, gravity
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment_in_motion import (
    BiasEstimate,
    RotatedSteps,
    biases_from_motion,
    outlier_limit,
    rotate_steps,
    wahba,
)
from tuner.navigation.drive.free_of_gravity import free_of_gravity
from tuner.navigation.drive.steady_rest import steady_steps
from tuner.types.records import DataError, Gnss

STATIONARY_SPEED = 0.3
"""Speed below which a vehicle is stationary, m/s, if the receiver is no noisier."""
STATIONARY_MARGIN = 2.0
"""Time cut from the end of a stationary part, s: speeds lag behind the first motion."""
WINDOW_DURATIONS = 2.0, 5.0, 10.0
"""Lengths of windows, s: short ones show quick turns, in long ones noisy positions determine a change of velocity."""
MIN_STATIONARY_POOR_GYROS, MIN_STATIONARY, SUFFICIENT_STATIONARY = 1.0, 4.0, 30.0
"""Stationary times, s, from which poor gyros' biases are estimated, good gyros' biases, and biases from rest alone."""
FIRST_MOTION = 60.0
"""Time in motion that the alignment uses first, s; doubled as long as that makes the heading surer."""
GOOD_HEADING_SD, MAX_HEADING_SD = math.radians(3.0), math.radians(60.0)
"""Sd of the heading below which no more motion is looked at, and above which there is no heading, rad."""
MAX_STATIONARY = 120.0
"""Longest part of a stationary period that is used, s."""
MIN_SECONDS_AT_REST = 10
"""Seconds at rest from which their scatter gives the sd of the mean of the gyros."""
MIN_BIAS_ROTATION = math.radians(2.0)
"""Rotation by the gyro biases from which they are estimated from motion, rad."""


KNOWN_BIAS_SD = np.zeros(6)
"""Sds of biases that are known."""


@dataclass(frozen=True)
class Alignment:
    """Attitude, biases and clock offset at the start of a drive.

    Attributes
    ----------
    t : float
        Time for which the attitude holds, s.
    quat_nb : ndarray, shape (4,)
        Attitude.
    heading_sd, tilt_sd : float
        rad.
    gyro_bias : ndarray, shape (3,)
        rad/s; zeros where the vehicle was never stationary.
    delay : float
        Delay of the fixes that was taken out, s: positive where their stamps are late.
    still : float
        Time it was stationary before, s.
    accel_bias : ndarray, shape (3,)
        Excess of the specific force at rest over gravity, along itself, m/s².
    gyro_bias_sd : ndarray, shape (3,)
        Sd of the gyro biases as measured at rest, rad/s; infinite where the vehicle hardly stood.
    """

    t: float
    quat_nb: FloatArray
    heading_sd: float
    tilt_sd: float
    gyro_bias: FloatArray
    delay: float
    still: float
    accel_bias: FloatArray
    gyro_bias_sd: FloatArray = field(default_factory=lambda: np.full(3, np.inf))


def velocities(gnss: Gnss) -> FloatArray:
    """Return the velocity at every fix, differences of positions where the receiver gives none; (k, 3).

    A vertical velocity alone that is missing is taken as zero: it changes less than noisy heights say.
    """
    slope = np.gradient(distance_along(gnss.llh), gnss.t, axis=0)
    return np.where(gnss.has_velocity[:, None], np.nan_to_num(gnss.vel_n), slope)


def stationary_until(gnss: Gnss) -> float:
    """Return until when the vehicle is stationary at the beginning, s; the time of the first fix where it is not."""
    sd = gnss.velocity_sd[:, :2]
    noise = float(np.nanmedian(sd)) if np.isfinite(sd).any() else 0.0
    speed = np.hypot(*velocities(gnss)[:, :2].T)
    limit = max(STATIONARY_SPEED, 5.0 * min(noise, 1.0))
    moving = speed > limit
    # Two fixes in a row: one alone may be an outlier.
    moving[:-1] &= moving[1:]
    first = int(np.argmax(moving)) if moving.any() else len(gnss) - 1
    return float(max(gnss.t[0], gnss.t[first] - STATIONARY_MARGIN))


def align(steps: Steps, gnss: Gnss, *, bias_sd: FloatArray = KNOWN_BIAS_SD) -> Alignment:
    """Align with one, two, four, … minutes of motion, as long as more of it makes the heading surer.

    Parameters
    ----------
    steps : Steps
        Increments of the sensor.
    gnss : Gnss
        Fixes on the same clock, within the steps.
    bias_sd : ndarray, shape (6,)
        Prior sds of the biases of gyros and accelerometers; motion determines them where the vehicle is hardly at rest.

    Raises
    ------
    DataError
        Where motion does not determine the heading: with its sd and the speeds of the fixes.
    """
    moving, length = FIRST_MOTION, float(gnss.t[-1] - gnss.t[0])
    found: Alignment | None = None
    while True:
        before = found
        tried = [
            align_once(steps, gnss, moving, bias_sd, by_position=by_position, duration=duration)
            for by_position in ([True, False] if gnss.has_velocity.any() else [True])
            for duration in WINDOW_DURATIONS
        ]
        found = min(filter(None, [found, *tried]), key=lambda one: one.heading_sd, default=None)
        best = math.inf if found is None else found.heading_sd
        if moving >= length or best < GOOD_HEADING_SD or (found is before and best < MAX_HEADING_SD):
            break
        moving *= 2.0
    if found is not None and best < MAX_HEADING_SD:
        return found
    speed = np.hypot(*velocities(gnss)[:, :2].T)
    low, high = np.percentile(speed, [2.5, 97.5])
    known = (
        "no part of the drive determines the heading"
        if best > math.pi
        else f"specific force and fixes together determine the heading to {np.degrees(best):.3g}°"
    )
    raise DataError(
        f"the heading cannot be found from the motion: {known}, {np.degrees(MAX_HEADING_SD):.3g}° are needed; the "
        f"speed of the fixes is {low:.3g} to {high:.3g} m/s"
    )


def align_once(
    steps: Steps,
    gnss: Gnss,
    moving: float,
    bias_sd: FloatArray = KNOWN_BIAS_SD,
    *,
    by_position: bool,
    duration: float,
) -> Alignment | None:
    """Return the alignment at the first fix from a given length of motion, s; None where no two fixes are apart.

    Changes of velocity over windows of a duration, s, are those of the velocities or second differences of positions.
    """
    if len(gnss) < 2:
        return None
    ends = steps.ends()
    still_end = stationary_until(gnss)
    begin = max(float(gnss.t[0]), still_end - MAX_STATIONARY)
    stop = min(still_end + STATIONARY_MARGIN + moving, float(gnss.t[-1]), float(ends[-1]))
    last = np.searchsorted(ends, stop + 0.1)
    # Biases that rotate the unit by less than an alignment resolves are not estimated.
    unknown = bias_sd if bias_sd[:3].max() * (stop - begin) > MIN_BIAS_ROTATION else KNOWN_BIAS_SD
    down = float(gravity(np.sin(gnss.llh[0, 0]), gnss.llh[0, 2]))
    whole = slice(*np.searchsorted(ends, [begin, still_end]).tolist())
    rest = _measured_at_rest(steps, whole, still_end - begin, down, bias_sd, unknown)
    unknown = rest.unknown_sd
    back = max(0, int(np.searchsorted(ends, begin)) - 1)
    window = slice(back, min(int(last), len(steps.dt)))
    inside = (gnss.t >= begin) & (gnss.t <= stop)
    fix_t = gnss.t[inside]
    position, velocity = free_of_gravity(fix_t, gnss.llh[inside], velocities(gnss)[inside], inertial=False)
    measured = position if by_position else velocity
    length = _length(fix_t, duration)
    windows = _windows(fix_t, 3 if by_position else 2, length)
    if not len(windows):
        return None
    span = fix_t[windows[:, 1]] - fix_t[windows[:, 0]]
    beta = _change(measured, windows, span)
    share, reported = float(np.median(np.diff(fix_t))) / length, _reported_variance(gnss, by_position, length)
    independent = share * len(windows)  # neighbours overlap
    if independent <= 1.0:
        return None

    def changes(rotated: RotatedSteps, *, derivative: bool = False) -> FloatArray:
        return _change(rotated.at(fix_t, position=by_position, derivative=derivative), windows, span)

    def felt(bias: FloatArray) -> tuple[FloatArray, FloatArray]:
        rotated = rotate_steps(steps, window, bias)
        return changes(rotated), changes(rotated, derivative=True)

    found = BiasEstimate(rest.bias, np.zeros((9, 9)))
    if unknown.any():
        times = fix_t[windows[:, -1]] - fix_t[0]
        found = biases_from_motion(felt, beta, times, rest.bias, unknown, share, reported)
    rotated = rotate_steps(steps, window, found.bias)
    alpha = changes(rotated)
    mat = wahba(alpha, beta)
    off = np.sum((beta - alpha @ mat.T) ** 2, axis=1)
    # The rotation takes three degrees of freedom, those of one window.
    cost = float(np.mean(np.minimum(off, outlier_limit(off)))) * independent / (independent - 1.0)
    # Speed changes determine the heading: stationary windows show the receiver's noise. Neighbouring
    # windows overlap, so a window counts by its share.
    level = np.sum(beta[:, :2] ** 2, axis=1)
    stationary = fix_t[windows[:, -1]] <= max(still_end, begin)
    noise = float(np.mean(level[stationary])) if np.count_nonzero(stationary) > 3 else 0.0
    change = float(np.sum(level - noise)) * share
    heading_sd = math.sqrt(cost / max(change, 0.1 * cost))
    k = int(np.argmin(np.abs(rotated.t - fix_t[0])))
    quat = rotation.quat_multiply(rotation.quat_from_mat(mat), rotated.quat[k])
    bias = found.bias[:3]
    if bias.any():  # the gyros feel the Earth turn
        lat = float(gnss.llh[0, 0])
        bias = bias - rotation.mat_from_quat(quat).T @ np.array(earth_rate(np.sin(lat), np.cos(lat)))
    misfit = float(np.sqrt(cost / 3.0))
    return Alignment(
        float(rotated.t[k]),
        quat,
        max(heading_sd, float(np.sqrt(found.covariance[2, 2]))),
        max(misfit / (9.8 * length), float(np.sqrt(np.diag(found.covariance)[:2].mean()))),
        bias,
        0.0,
        rest.duration,
        rest.accel_excess + found.bias[3:],
        rest.gyro_bias_sd,
    )


@dataclass(frozen=True)
class _AtRest:
    """What samples at rest show of the biases.

    Attributes
    ----------
    duration : float
        Time at rest, s, without the parts that are not steady.
    bias : ndarray, shape (6,)
        Means of the gyros, rad/s, and zeros; zeros throughout where the time is too short.
    accel_excess, gyro_bias_sd : ndarray, shape (3,)
        As `Alignment.accel_bias` and `Alignment.gyro_bias_sd`.
    unknown_sd : ndarray, shape (6,)
        Sds of what is left of the biases for the motion to determine; zeros where they are known.
    """

    duration: float
    bias: FloatArray
    accel_excess: FloatArray
    gyro_bias_sd: FloatArray
    unknown_sd: FloatArray


def _measured_at_rest(
    steps: Steps, still: slice, duration: float, down: float, prior_sd: FloatArray, unknown: FloatArray
) -> _AtRest:
    """Return what the samples of a stand-still show of biases, in gravity `down`, m/s².

    `prior_sd` and `unknown`, shape (6,), are the sds of the biases, and those that motion is to determine.
    """
    quiet = steady_steps(steps, still)
    rest = duration - float(steps.dt[still].sum() - steps.dt[quiet].sum())
    bias, excess, bias_sd = np.zeros(6), np.zeros(3), np.full(3, np.inf)
    if rest > MIN_STATIONARY or (rest >= MIN_STATIONARY_POOR_GYROS and unknown.any()):
        means = steps.increments[quiet].sum(axis=0) / steps.dt[quiet].sum()
        force = float(np.linalg.norm(means[3:]))
        # Who turns on the spot is not at rest: seconds scatter more than biases. Gyros feel the Earth turn, too.
        seconds = _seconds_at_rest(steps, quiet)
        prior = prior_sd[:3] ** 2 + EARTH_RATE**2
        unsure = seconds.var(axis=0) / len(seconds) if len(seconds) else 0.0
        bias[:3] = means[:3] * prior / (prior + unsure)
        if rest > SUFFICIENT_STATIONARY or not unknown.any():
            excess, unknown = means[3:] * (1.0 - down / force), KNOWN_BIAS_SD
            if len(seconds) >= MIN_SECONDS_AT_REST:
                bias_sd = np.std(seconds, axis=0, ddof=1) / math.sqrt(len(seconds))
        else:  # noise counts as one value a second: what shakes a unit at rest is not white
            scatter = np.std(steps.increments[quiet, :3] / steps.dt[quiet, None], axis=0)
            unknown = np.concatenate([np.minimum(unknown[:3], scatter / np.sqrt(rest)), unknown[3:]])
    return _AtRest(rest, bias, excess, bias_sd, unknown)


def _seconds_at_rest(steps: Steps, quiet: NDArray[np.intp]) -> FloatArray:
    """Return the mean rates of the gyros in each second at rest, shape (s, 3)."""
    second = max(1, round(1.0 / float(np.median(steps.dt[quiet])))) if steps.dt[quiet].size else 1
    count = len(quiet) // second
    rates = steps.increments[quiet][: count * second, :3] / steps.dt[quiet][: count * second, None]
    return np.asarray(rates.reshape(count, second, 3).mean(axis=1))


def _reported_variance(gnss: Gnss, by_position: bool, length: float) -> float:
    """Return the variance of a change of velocity by the reported sds, 0 where there are none."""
    sd, times = (gnss.position_sd, 6.0 / length**2) if by_position else (gnss.velocity_sd, 2.0)
    return float(np.nanmedian(sd[:, :2])) ** 2 * times if np.isfinite(sd[:, :2]).any() else 0.0


def _length(t: FloatArray, duration: float) -> float:
    """Return the length of windows: the number of fix intervals nearest to a duration, at least one, s."""
    interval = float(np.median(np.diff(t))) if len(t) > 1 else duration
    return interval * max(1, round(duration / interval))


def _windows(t: FloatArray, points: int, length: float) -> NDArray[np.intp]:
    """Return the fixes at the ends (and between) of neighbouring windows of a length, s, without gaps."""
    rows = [np.arange(len(t))]
    for i in range(1, points):
        rows.append(np.searchsorted(t, t + i * length - 1e-6))
    windows = np.stack(rows, axis=-1)
    windows = windows[windows[:, -1] < len(t)]
    lengths = np.diff(t[windows], axis=1)
    return windows[np.all(np.abs(lengths - length) < 0.25 * length, axis=1)]


def _change(y: FloatArray, windows: NDArray[np.intp], span: FloatArray) -> FloatArray:
    """Return the change over windows: of y, or, with three points, of its slope; shape (w, 3)."""
    if windows.shape[1] == 2:
        return np.asarray(y[windows[:, 1]] - y[windows[:, 0]])
    return np.asarray((y[windows[:, 2]] - 2.0 * y[windows[:, 1]] + y[windows[:, 0]]) / span[:, None])
