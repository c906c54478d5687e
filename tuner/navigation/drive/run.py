"""A measured drive run through the filter: stretches without gaps, alignment, fixes and their sds.

The filter's body frame is that of the vehicle where the mounting is known, else that of the sensor: alignment
from gravity and motion needs no mounting. Sampling gaps up to `MAX_BRIDGED_GAP` are bridged with constant rates; a
longer one ends a stretch, and the next one begins with an alignment of its own, biases and constants carried over.

A stretch begins at the position of its first fix, so that the errors of the start are those of the fix, lever arm,
clock and correlated error of the receiver included: with H of the fix, H_pv = I and the other states x_o::

    δ(r, v) = n − H_o δx_o        P = T diag(R, P_o) Tᵀ        T = I − (H_o above, 0 below)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import llh_displaced, ned_between
from models.effects.drive.gnss import without_drift
from models.error_state import Linearization
from models.imu_errors import calibration
from models.measurements import position_fix, velocity_fix
from models.strapdown import NavigationState
from tuner.formats.clock_words import clock_note, clock_words
from tuner.formats.customary_units import digits
from tuner.navigation import engine
from tuner.navigation.data import TIME_TOLERANCE, Constraints, Fixes, Solution, Steps, split_at
from tuner.navigation.drive.alignment import Alignment, align, velocities
from tuner.navigation.drive.sampling_rate import rate_note
from tuner.navigation.drive.velocity_latency import advanced, interpolated, velocities_at
from tuner.navigation.settings import FilterSettings
from tuner.types.clock import Clock
from tuner.types.named_cause import NamedCause
from tuner.types.records import DataError, Drive, Gnss, Start

MAX_BRIDGED_GAP = 0.5
"""Longest gap of the inertial samples that is bridged, s."""
MIN_FIXES = 10
"""Fixes from which a stretch is aligned."""
MIN_STRETCH = 20.0
"""Shortest stretch that is aligned, s."""
HEADING_FLOOR, TILT_FLOOR = np.radians(2.0), np.radians(0.5)
"""Least sds of an alignment, rad."""
START_AVERAGING_TIME = 0.5
"""Time over which the rates at a start are averaged, s."""
DIFFERENCED_VELOCITY_SD = 2.0
"""Sd of a velocity that is the difference of two positions, m/s."""
RECOVERY_TIME = 30.0
"""Time with fixes between two outages, s: in it the filter becomes as accurate as before."""
FARTHEST_START = 1e3
"""Distance from the first fix beyond which a stated position is that of another drive, m."""
SETTLING_TIME = 60.0
"""Time in motion during which the gate rejects no fixes, s: the start may be wrong, not they."""


@dataclass(frozen=True)
class Stretch:
    """A part of a drive without a gap, ready to be filtered.

    Attributes
    ----------
    steps : Steps
        In the body frame of the filter.
    fixes : Fixes
        On the clock of the inertial unit.
    start : NavigationState
        At the first fix, where `steps` begin.
    alignment : Alignment
        Where it comes from.
    lag : float
        How much later the receiver's velocities are than its positions, s; `navigate` mends it.
    constraints : Constraints or None
        What is known of the vehicle beside the fixes.
    reported_sd : ndarray, shape (k, 6)
        Sds of the fixes as the receiver reports them, NaN where it reports none.
    solution : ndarray, shape (k,)
        Classes of solution that it states, NaN where none.
    stated : bool
        Whether the start is that of the file, with the sds of the configuration, and no alignment's.
    """

    steps: Steps
    fixes: Fixes
    start: NavigationState
    alignment: Alignment
    lag: float = 0.0
    constraints: Constraints | None = None
    reported_sd: FloatArray = field(default_factory=lambda: np.full((0, 6), np.nan))
    solution: FloatArray = field(default_factory=lambda: np.zeros(0))
    stated: bool = False

    @property
    def settled(self) -> float:
        """Time from which the filter has settled, s."""
        return self.alignment.t + self.alignment.still + SETTLING_TIME


def _clock_note(clock: Clock, gnss: Gnss) -> str:
    """Return what is known of the clocks; what is taken out is a cause, with the errors that it makes."""
    effects, delay, lag = [], clock.delay.taken_out, clock.lag.taken_out
    if delay or clock.drift.certain:
        delay = max((one.value for one in clock.delays.values()), key=abs)
        speed = float(np.sqrt(np.mean(np.sum(velocities(gnss)[:, :2] ** 2, axis=1))))
        size = digits(abs(delay) * speed, 2)
        effects.append(f"{size} m along the track at {digits(speed, 2)} m/s, the rms speed of this drive")
    if lag:
        effects.append(f"velocities err by {digits(abs(lag), 2)} m/s a m/s² of acceleration")
    if not effects:
        return clock_note(clock)
    shift = "subtract it from" if (delay or lag) > 0.0 else "add it to"
    return NamedCause.of(
        f"{clock_words(clock)}, as the motion shows",
        "certain",
        ", ".join(effects),
        f"taken out of this run; the recording still has it: for another filter {shift} its stamps",
    )


def prepare(drive: Drive, settings: FilterSettings) -> tuple[tuple[Stretch, ...], tuple[str, ...]]:
    """Cut a drive into stretches and align each.

    Parameters
    ----------
    drive : Drive
        The drive; delays of its clock that are certain are taken out.
    settings : FilterSettings
        Lever arm and, where the receiver reports no sds, those of the configuration.

    Returns
    -------
    stretches : tuple of Stretch
        At least one.
    notes : tuple of str
        What was found and done.

    Raises
    ------
    DataError
        Where no stretch can be aligned.
    """
    notes: list[str] = []
    if known := _clock_note(drive.clock, drive.gnss):
        notes.append(known)
    gnss = replace(drive.gnss, t=without_drift(drive.gnss.t, drive.clock.drift.taken_out))
    mounting = drive.sensor_from_vehicle
    rates = np.hstack([drive.rates[:, :3] @ mounting, drive.rates[:, 3:] @ mounting])
    dt = np.diff(drive.imu_t)
    gaps = np.flatnonzero(dt > MAX_BRIDGED_GAP)
    if len(gaps):
        notes.append(
            f"{len(gaps)} gaps longer than {MAX_BRIDGED_GAP:g} s in the inertial record, the longest "
            f"{dt.max():.1f} s: aligned anew after each"
        )
    bias_sd = [settings.initial_sd[settings.model.layout[f"{sensor}_bias"]] for sensor in ("gyro", "accel")]
    if rare := rate_note(Steps(float(drive.imu_t[0]), dt, rates[1:] * dt[:, None]), np.concatenate(bias_sd)):
        notes.append(rare)
    edges = np.concatenate([[0], gaps + 1, [len(drive.imu_t)]])
    stretches: list[Stretch] = []
    failure = ""
    for first, last in pairwise(edges.tolist()):
        t = drive.imu_t[first:last]
        if len(t) < 2 or t[-1] - t[0] < MIN_STRETCH:
            notes.append(f"a stretch of {t[-1] - t[0]:.1f} s left out: too short to align")
            continue
        steps = Steps(float(t[0]), np.diff(t), rates[first + 1 : last] * np.diff(t)[:, None])
        try:
            stretch = _aligned_stretch(steps, gnss, settings, drive.clock, drive.start)
        except DataError as error:
            failure = str(error)
            notes.append(f"the stretch from {t[0]:.1f} to {t[-1]:.1f} s left out: {error}")
            continue
        stretches.append(stretch)
        a = stretch.alignment
        notes.append(
            f"position, velocity and attitude at {a.t:.1f} s as the file states them"
            if stretch.stated
            else f"attitude at {a.t:.1f} s from the motion{f' and {a.still:.0f} s at rest' * (a.still >= 1.0)}"
        )
    if not stretches:
        found = f"; {drive.repairs[0].stream} {drive.repairs[0].fault}" if drive.repairs else ""
        longest = max(float(drive.imu_t[b - 1] - drive.imu_t[a]) for a, b in pairwise(edges.tolist()))
        short = f"expected {MIN_STRETCH:g} s or more without a gap, found {longest:.1f} s at most; give a longer drive"
        raise DataError(
            f"{drive.source}: no stretch of the drive could be aligned: {failure or short}{found}"
        )
    return tuple(stretches), tuple(notes)


def navigate(
    stretches: tuple[Stretch, ...], settings: FilterSettings, windows: FloatArray
) -> tuple[Solution, ...]:
    """Filter all stretches, fixes inside windows (w, 2), s, withheld; biases and constants are carried over."""
    answers: list[Solution] = []
    for stretch in stretches:
        before = answers[-1] if answers else None
        one = replace(stretch, fixes=stretch.fixes.without(windows))
        answers.append(filtered(at_stamps(one, settings, before), settings, before))
    return tuple(answers)


def filtered(stretch: Stretch, settings: FilterSettings, before: Solution | None) -> Solution:
    """Filter a stretch that follows a solution, or none; velocities are those at the stamps."""
    x, p = initial_estimates(settings, stretch, before)
    start = initial_state(settings, stretch, x)
    return engine.run(
        settings,
        start,
        stretch.steps,
        stretch.fixes,
        parameters=x,
        covariance=p,
        constraints=stretch.constraints,
    )


def at_stamps(stretch: Stretch, settings: FilterSettings, before: Solution | None) -> Stretch:
    """Return a stretch whose velocities lag no more, with the attitude of a filter that interpolates them."""
    lag = settings.velocity_lag + stretch.lag
    if not lag:
        return stretch
    rough = filtered(replace(stretch, fixes=interpolated(stretch.fixes, lag)), settings, before)
    fixes = advanced(stretch.fixes, stretch.steps, rough, lag)
    return replace(stretch, fixes=fixes, lag=-settings.velocity_lag)


def expect_settled(any_fix: bool, source: str, spans: Sequence[float]) -> None:
    """Raise unless a fix is left to judge a filter by after it has settled; `spans` are those of the fixes, s."""
    if not any_fix:
        raise DataError(
            f"{source}: expected fixes beyond {SETTLING_TIME:g} s after the start or the stand, in which the filter "
            f"settles, found {max(spans, default=0.0):.0f} s of them: nothing is left to judge it by"
        )


def outage_windows(
    stretches: tuple[Stretch, ...], length: float, *, begin: float = -math.inf, end: float = math.inf
) -> list[tuple[float, float]]:
    """Return windows (begin, end), s, in which fixes are withheld, each after the filter settled or recovered.

    Parameters
    ----------
    stretches : tuple of Stretch
        Of a drive.
    length : float
        Of a window, s.
    begin, end : float
        Times between which the windows lie, s.
    """
    return [
        (first, first + length)
        for s in stretches
        for first in np.arange(
            max(begin, s.settled), min(end, s.fixes.t[-1]) - length, length + RECOVERY_TIME
        )
    ]


def initial_estimates(
    settings: FilterSettings, stretch: Stretch, before: Solution | None
) -> tuple[FloatArray, FloatArray]:
    """Return the other states (n,) and P (n, n) at the start of a stretch that follows a solution, or none."""
    if before is not None:
        x = before.final_parameters.copy()
        return x, _initial_covariance(before.final_covariance, settings, stretch, x)
    a, at = stretch.alignment, settings.model.layout
    x, p = np.zeros(settings.size), np.diag(settings.initial_sd**2)
    x[at["gyro_bias"]] = a.gyro_bias
    x[at["accel_bias"]] = a.accel_bias
    own = range(at["accel_bias"].start, at["accel_bias"].stop)
    p[own, own] = np.maximum(p[own, own], float(a.accel_bias @ a.accel_bias))
    gyros = range(at["gyro_bias"].start, at["gyro_bias"].stop)
    p[gyros, gyros] = np.minimum(p[gyros, gyros], a.gyro_bias_sd**2 + _wandering(settings))
    return x, _initial_covariance(p, settings, stretch, x)


def _wandering(settings: FilterSettings) -> FloatArray:
    """Return the variance of the Gauss–Markov biases of each gyro, (3,): a mean at rest holds what they were then."""
    at, model = settings.model.layout, settings.model
    variance = np.zeros(3)
    if "gyro_markov" in at:
        np.add.at(variance, np.array(model.gyro_markov_axes), settings.initial_sd[at["gyro_markov"]] ** 2)
    return variance


def initial_state(settings: FilterSettings, stretch: Stretch, parameters: FloatArray) -> NavigationState:
    """Return the start of a stretch where lever arm, delay and other states (n,) are known."""
    if stretch.stated:
        return stretch.start
    start, z = stretch.start, _first_fix(settings, stretch, parameters)[0]
    return NavigationState(llh_displaced(start.llh, z[:3]), start.vel_n + z[3:], start.quat_nb)


def _first_fix(
    settings: FilterSettings, stretch: Stretch, parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the distance of the start from its fix, (6,), and its derivative by the other states, (6, n)."""
    model, start, steps = settings.model, stretch.start, stretch.steps
    own = calibration(model, parameters)
    rates = own.true_rates(_first_rates(steps))
    mat_nb = rotation.mat_from_quat(start.quat_nb)
    at = Linearization(start.llh, start.vel_n, mat_nb, rates[:3], rates[3:], own)
    arm = np.array(settings.lever_arm)
    llh = llh_displaced(start.llh, mat_nb @ arm)
    position = position_fix(model, at, parameters, llh, lever_arm=arm)
    of_antenna = start.vel_n + mat_nb @ np.cross(rates[:3], arm)
    velocity = velocity_fix(model, at, parameters, of_antenna, lever_arm=arm)
    h = np.vstack([position.H, velocity.H])
    h[:, :6] = 0.0
    return np.concatenate([position.z, velocity.z]), h


def _first_rates(steps: Steps) -> FloatArray:
    """Return the mean angular rate and specific force as measured at the beginning, (6,)."""
    few = slice(0, max(1, int(np.searchsorted(np.cumsum(steps.dt), START_AVERAGING_TIME))))
    return np.asarray(steps.increments[few].sum(axis=0) / steps.dt[few].sum())


def _initial_covariance(
    covariance: FloatArray, settings: FilterSettings, stretch: Stretch, parameters: FloatArray
) -> FloatArray:
    """Return P at the start of a stretch: navigation states anew, the others as they are."""
    p = covariance.copy()
    p[:9, :] = 0.0
    p[:, :9] = 0.0
    if stretch.stated:
        p[range(9), range(9)] = settings.initial_sd[:9] ** 2
        return p
    at, a = settings.model.layout, stretch.alignment
    sd = stretch.fixes.sd[0]
    p[range(3), range(3)] = np.maximum(sd[:3], settings.initial_sd[at["position"]]) ** 2
    unknown = np.where(np.isfinite(stretch.fixes.vel_n[0]), 0.0, DIFFERENCED_VELOCITY_SD)
    p[range(3, 6), range(3, 6)] = np.maximum(sd[3:], settings.initial_sd[at["velocity"]]) ** 2 + unknown**2
    tilt = max(a.tilt_sd, TILT_FLOOR, float(settings.initial_sd[at["attitude"]][0]))
    p[6, 6] = p[7, 7] = tilt**2
    p[8, 8] = max(2.0 * a.heading_sd, HEADING_FLOOR) ** 2
    among = np.eye(settings.size)
    among[:6] -= _first_fix(settings, stretch, parameters)[1]
    return among @ p @ among.T


def _aligned_stretch(
    steps: Steps, gnss: Gnss, settings: FilterSettings, clock: Clock, stated: Start | None
) -> Stretch:
    """Align a stretch, its fixes on the clock of the inertial unit; one with a stated start begins there."""
    ends = steps.ends()
    inside = (gnss.t > ends[0]) & (gnss.t < ends[-1])
    own = gnss.rows(inside)
    if len(own) < MIN_FIXES:
        raise DataError(
            f"expected {MIN_FIXES} fixes or more between {ends[0]:.1f} and {ends[-1]:.1f} s of the IMU, found "
            f"{len(own)}; put the stamps of both on one clock, or give a longer drive"
        )
    at = settings.model.layout
    bias_sd = np.concatenate([settings.initial_sd[at["gyro_bias"]], settings.initial_sd[at["accel_bias"]]])
    together = own
    delay, lag = clock.delay.taken_out, clock.lag.taken_out
    if lag and np.count_nonzero(own.has_velocity) > 1:
        together = replace(own, vel_n=velocities_at(own.t, own.vel_n, own.t + lag))
    if stated is not None and ends[0] - TIME_TOLERANCE <= stated.t < ends[-1]:
        far = float(np.linalg.norm(ned_between(own.llh[0], stated.llh)))
        if far > FARTHEST_START:
            raise DataError(
                f"expected a start near the first fix, found the stated position (initpos) {far / 1e3:.3g} km from it"
            )
        tilt_sd, _, heading_sd = settings.initial_sd[at["attitude"]]
        quat = rotation.quat_from_rpy(stated.rpy)
        a = Alignment(stated.t, quat, heading_sd, tilt_sd, np.zeros(3), delay, 0.0, np.zeros(3))
        return _timed(steps, own, a, settings, lag, stated)
    a = align(steps, replace(together, t=own.t - delay), bias_sd=bias_sd)
    return _timed(steps, own, replace(a, delay=delay), settings, lag)


def _timed(
    steps: Steps, own: Gnss, a: Alignment, settings: FilterSettings, lag: float, stated: Start | None = None
) -> Stretch:
    """Put fixes on the clock of the inertial unit and cut the steps to begin with the first, or the stated start."""
    ends = steps.ends()
    t = own.t - a.delay
    keep = (t > (ends[0] if stated is None else stated.t)) & (t < ends[-1])
    own, t = own.rows(keep), t[keep]
    begin = t[0] if stated is None else stated.t + TIME_TOLERANCE
    first = max(0, int(np.searchsorted(ends, begin, side="right")) - 1)
    # The attitude holds at another step than the first fix may fall on: turn it by the gyros between.
    quat = _attitude_at(steps, a, first)
    steps = Steps(float(ends[first]), steps.dt[first:], steps.increments[first:])
    split, after = split_at(steps, t)
    settled = a.t + a.still + SETTLING_TIME
    raw = np.hstack([own.position_sd, own.velocity_sd])
    fixes = Fixes(t, after, own.llh, own.vel_n, assumed_sds(raw, own.solution, settings), trusted=t < settled)
    if stated is not None:
        start = NavigationState(stated.llh, stated.vel_n, quat)
        return Stretch(split, fixes, start, a, lag, reported_sd=raw, solution=own.solution, stated=True)
    mat_nb, vel = rotation.mat_from_quat(quat), velocities(own)[0]
    arm = np.array(settings.lever_arm)
    vel = vel - mat_nb @ np.cross(_first_rates(steps)[:3] - a.gyro_bias, arm)
    there = llh_displaced(own.llh[0], -mat_nb @ arm - vel * (t[0] - steps.start))
    start = NavigationState(there, vel, quat)
    return Stretch(split, fixes, start, a, lag, reported_sd=raw, solution=own.solution)


def _attitude_at(steps: Steps, a: Alignment, k: int) -> FloatArray:
    """Return the attitude of an alignment at the end of step k."""
    ends = steps.ends()
    have = int(np.argmin(np.abs(ends - a.t)))
    quat = a.quat_nb
    for i in range(min(have, k), max(have, k)):
        turn = rotation.quat_from_rotvec(steps.increments[i, :3] - a.gyro_bias * steps.dt[i])
        quat = rotation.quat_multiply(quat, turn if k > have else rotation.quat_conjugate(turn))
    return quat


def assumed_sds(raw: FloatArray, solution: FloatArray, settings: FilterSettings) -> FloatArray:
    """Return what the filter assumes of fixes: the receiver's sds (k, 6), where it has none the configuration's.

    Models of reported sds may tell stated classes of solution (k,) apart.
    """
    reported = _known(raw, settings)
    if settings.fix_sd_models is None:
        return reported if settings.position_sd is None else np.maximum(reported, _configured(settings))
    position, velocity = settings.fix_sd_models
    return np.hstack([position.sds(reported[:, :3], solution), velocity.sds(reported[:, 3:], solution)])


def reported_sds(gnss: Gnss, settings: FilterSettings) -> FloatArray:
    """Return the sds that the receiver reports, those of the configuration where it reports none; (k, 6)."""
    return _known(np.hstack([gnss.position_sd, gnss.velocity_sd]), settings)


def _known(raw: FloatArray, settings: FilterSettings) -> FloatArray:
    return np.where(raw > 0.0, raw, _configured(settings))


def _configured(settings: FilterSettings) -> FloatArray:
    return np.array([*(settings.position_sd or (3.0, 3.0, 5.0)), *(settings.velocity_sd or (0.1, 0.1, 0.2))])
