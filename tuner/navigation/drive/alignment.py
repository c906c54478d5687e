"""Alignment of a drive: attitude and biases at its start, from windows of motion and from standing still.

In windows of ten seconds the unit predicts positions and velocities up to its attitude and biases
(`tuner.examination.windows`); what all windows have in common is the attitude at the start and the biases
(`tuner.navigation.drive.common_attitude`), whatever the mounting. Where the fixes stand still, the mean of the gyros
less the Earth rate is their bias, or that and a turn about the vertical: fixes do not show who turns on the spot. The
likelier of both is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import blake2b

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import distance_along
from tuner.examination.fit import LEAST_READINGS, fit
from tuner.examination.streams import Streams, receiver_streams
from tuner.examination.windows import WINDOW_LENGTH, Inertial, averaged, windows_of
from tuner.navigation.data import Steps
from tuner.navigation.drive.common_attitude import Attitude, BiasPrior, attitude_at
from tuner.navigation.drive.steady_rest import steady_steps
from tuner.types.records import DataError, Gnss

STATIONARY_SPEED = 0.3
"""Speed below which a vehicle is stationary, m/s, if the receiver is no noisier."""
STATIONARY_MARGIN = 2.0
"""Time cut from the end of a stationary part, s: speeds lag behind the first motion."""
MAX_STATIONARY = 120.0
"""Longest part of a stationary period that is used, s."""
MIN_SECONDS_AT_REST = 4
"""Seconds at rest from which their mean is one of the gyros."""
SURE_SECONDS_AT_REST = 30
"""Seconds at rest from which their scatter gives the sds of the biases of gyros."""
FIRST_MOTION = 60.0
"""Time in motion that the alignment uses first, s; doubled as long as the heading is not sure."""
GOOD_HEADING_SD, MAX_HEADING_SD = math.radians(3.0), math.radians(30.0)
"""Sd of the heading below which no more motion is looked at, and above which no filter is linear in it, rad."""
TURN_RATE, TURN_COST = 0.3, 3.0
"""Sd of the rate of who turns on the spot, rad/s, and how much less likely that is than a rest, nats."""
MOST_PASSES, SMALL_CHANGE = 10, 0.03
"""Windows are linear in biases: they are integrated anew without those found until these change by less, in sds."""
SPANS_KNOWN = 8
"""Spans whose attitude is remembered: hypotheses of a drive differ in what does not change it."""
LEAST_BIAS_SD = 1e-6
"""Least prior sd of a bias, rad/s or m/s²."""


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
        rad/s.
    delay : float
        Delay of the fixes that was taken out, s: positive where their stamps are late.
    still : float
        Time it was stationary before, s.
    accel_bias : ndarray, shape (3,)
        m/s².
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


def align(steps: Steps, gnss: Gnss, *, bias_sd: FloatArray) -> Alignment:
    """Align with one, two, four, … minutes of motion, until they make the heading sure.

    Parameters
    ----------
    steps : Steps
        Increments of the sensor.
    gnss : Gnss
        Fixes on the same clock, within the steps.
    bias_sd : ndarray, shape (6,)
        Prior sds of the biases of gyros, rad/s, and accelerometers, m/s².

    Raises
    ------
    DataError
        Where motion does not determine the heading: with its sd and the speeds of the fixes; where no window holds
        enough fixes.
    """
    still_end = stationary_until(gnss)
    ends = steps.ends()[1:]
    begin = float(ends[np.argmin(np.abs(ends - max(float(gnss.t[0]), still_end - MAX_STATIONARY)))])
    seconds = _seconds_at_rest(steps, begin, still_end)
    sd = np.maximum(np.append(bias_sd[3:], bias_sd[:3]), LEAST_BIAS_SD)
    found: Attitude | None = None
    heading_sd, moving, end = math.inf, FIRST_MOTION, begin
    while end < gnss.t[-1] and heading_sd > GOOD_HEADING_SD:
        end, moving = still_end + moving, 2.0 * moving
        found, rested = _likeliest(_Span.of(steps, gnss, (begin, end), sd, seconds))
        heading_sd = math.inf if found is None else math.sqrt(found.covariance[2, 2])
    if found is None:
        raise DataError(
            f"expected {WINDOW_LENGTH:g} s of inertial samples without a gap that hold {LEAST_READINGS} fixes or more, "
            f"found none: fixes come every {float(np.median(np.diff(gnss.t))):.3g} s, inertial samples last "
            f"{float(steps.dt.sum()):.3g} s, their longest step is {float(steps.dt.max()):.3g} s"
        )
    if heading_sd > MAX_HEADING_SD:
        raise DataError(_no_heading(heading_sd, gnss))
    sure = rested and len(seconds) >= SURE_SECONDS_AT_REST
    return Alignment(
        found.t,
        rotation.quat_from_mat(found.mat),
        heading_sd,
        math.sqrt(float(np.diag(found.covariance)[:2].mean())),
        found.bias[3:],
        0.0,
        float(len(seconds)),
        found.bias[:3],
        np.sqrt(np.diag(_mean_at_rest(seconds)[1])) if sure else np.full(3, np.inf),
    )


def _no_heading(sd: float, gnss: Gnss) -> str:
    """Return why there is no heading: its sd, rad, and the speeds of the fixes."""
    low, high = np.percentile(np.hypot(*velocities(gnss)[:, :2].T), [2.5, 97.5])
    known = (
        "no part of the drive determines the heading"
        if sd > math.pi
        else f"specific force and fixes together determine the heading to {math.degrees(sd):.3g}°"
    )
    return (
        f"the heading cannot be found from the motion: {known}, {math.degrees(MAX_HEADING_SD):.3g}° or less are "
        f"needed; the speed of the fixes is {low:.3g} to {high:.3g} m/s"
    )


@dataclass(frozen=True)
class _Span:
    """Samples and readings of a span, equal to others of the same content.

    Attributes
    ----------
    digest : bytes
        Of the content.
    unit : Inertial
        Samples.
    gnss : Gnss
        Fixes.
    sd : ndarray, shape (6,)
        Prior sds of the biases of accelerometers and gyros.
    seconds : ndarray, shape (s, 6)
        As of `_seconds_at_rest`.
    """

    digest: bytes
    unit: Inertial = field(compare=False)
    gnss: Gnss = field(compare=False)
    sd: FloatArray = field(compare=False)
    seconds: FloatArray = field(compare=False)

    @staticmethod
    def of(steps: Steps, gnss: Gnss, span: tuple[float, float], sd: FloatArray, seconds: FloatArray) -> _Span:
        ends = steps.ends()[1:]
        some = slice(*np.searchsorted(ends, span).tolist())
        unit = Inertial(ends[some], steps.increments[some] / steps.dt[some, None])
        own = gnss.rows((gnss.t >= span[0]) & (gnss.t <= span[1]))
        digest = blake2b()
        for x in (
            unit.t,
            unit.rates,
            own.t,
            own.llh,
            own.vel_n,
            own.position_sd,
            own.velocity_sd,
            sd,
            seconds,
        ):
            digest.update(np.ascontiguousarray(x).data)
        return _Span(digest.digest(), unit, own, sd, seconds)


@lru_cache(maxsize=SPANS_KNOWN)
def _likeliest(span: _Span) -> tuple[Attitude | None, bool]:
    """Return the likeliest attitude at the begin of a span, and whether the unit rested; None where none is known."""
    unit, sd, seconds = span.unit, span.sd, span.seconds
    receiver = receiver_streams(span.gnss)
    rests = _hypotheses(seconds) if len(seconds) >= MIN_SECONDS_AT_REST else {False: None}
    bias, found, rested = np.zeros(6), None, False
    for _ in range(MOST_PASSES):
        less = replace(unit, rates=unit.rates - np.append(bias[3:], bias[:3]))
        streams = Streams(less, *receiver)
        windows = windows_of(averaged(less))
        own = fit(streams, windows)
        tried = []
        for kind, rest in rests.items():
            left = None if rest is None else (rest[0] - bias[3:], rest[1])
            one = attitude_at(streams, windows, own, float(unit.t[0]), BiasPrior(-bias, sd, left))
            if one is None:
                return None, False
            tried.append((one.cost + (0.0 if kind else TURN_COST), kind, one))
        _, rested, one = min(tried, key=lambda x: x[0])
        bias = bias + one.bias
        found = replace(one, bias=bias)
        if np.all(np.abs(one.bias) < SMALL_CHANGE * np.sqrt(np.diag(one.covariance)[3:])):
            break
    return found, rested


def _seconds_at_rest(steps: Steps, begin: float, end: float) -> FloatArray:
    """Return the mean rates and forces of each second at rest between two times, s; shape (s, 6)."""
    quiet = steady_steps(steps, slice(*np.searchsorted(steps.ends(), [begin, end]).tolist()))
    second = max(1, round(1.0 / float(np.median(steps.dt))))
    count = len(quiet) // second
    rates = (steps.increments[quiet] / steps.dt[quiet, None])[: count * second]
    return np.asarray(rates.reshape(count, second, 6).mean(axis=1))


def _mean_at_rest(seconds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the gyros over seconds at rest, rad/s, and its covariance."""
    scatter = np.var(seconds[:, :3], axis=0, ddof=1) / len(seconds)
    return seconds[:, :3].mean(axis=0), np.diag(scatter + LEAST_BIAS_SD**2)


def _hypotheses(seconds: FloatArray) -> dict[bool, tuple[FloatArray, FloatArray] | None]:
    """Return the mean of the gyros and its covariance as a bias, by whether the unit rests or turns."""
    mean, covariance = _mean_at_rest(seconds)
    up = seconds[:, 3:].mean(axis=0)
    return {
        True: (mean, covariance),
        False: (mean, covariance + TURN_RATE**2 * np.outer(up, up) / (up @ up)),
    }
