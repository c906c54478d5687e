"""What a reference says of a drive that its innovations cannot: errors of the fixes themselves, and of the heading.

Innovations are differences between fixes and a filter that follows them: an offset of all positions, errors that stay
for minutes and a heading that stays wrong do not show in them. Against a reference they do. A delay between the clocks
of receiver and reference, which moves fixes along the velocity, is fitted and taken out first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from models.arrays import FloatArray
from models.earth import ned_between
from models.robust import normal_sd
from tuner.consistency.drive_scores import differences, reference_at
from tuner.consistency.reference_attitude import without_wrong_attitude
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.types import GnssNoise, Unexplained
from tuner.types.records import SOLUTIONS, Drive, Reference

MIN_FIXES = 30
"""Fixes with a reference from which their errors are known to 13 %."""
LEAST_BLOCK = 30.0
"""Least length of a block, s: a vehicle leaves the reflections of one place."""
MIN_BLOCKS = 5
"""Blocks of a drive, each longer than the errors stay, from which the scatter of their means is known."""
MAX_P_VALUE = 1e-4
"""p value of three directions below which an offset is reported, which must not be chance: no finding shows it."""
MAX_STATED_SDS = 3.0
"""Offset in stated sds of positions up to which it is an error of the receiver: single points err alike for an hour."""
MIN_OFFSET = 0.05
"""Least offset that is reported, m: the antenna is measured no better."""
MIN_HEADING_RATIO, MIN_HEADING = 4.0, np.radians(0.5)
"""Heading error ÷ its stated sd, and heading error, rad, from which it is reported: a reference is aligned better."""
DIRECTIONS = ("north", "east", "down")


@dataclass(frozen=True)
class FixErrors:
    """Errors of k fixes against a reference, the delay between both clocks taken out.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s.
    position, velocity : ndarray, shape (k, 3)
        North, east, down, m and m/s; NaN where unknown.
    delay : float
        By which the fixes are later than the reference, s.
    """

    t: FloatArray
    position: FloatArray
    velocity: FloatArray
    delay: float


def errors_of_fixes(drive: Drive, reference: Reference) -> FixErrors:
    """Return the errors of the fixes of a drive, NaN outside of the reference and in its gaps."""
    gnss = drive.gnss
    llh, vel, _ = reference_at(reference, gnss.t)
    position = ned_between(gnss.llh, llh)
    good = np.isfinite(position[:, :2]).all(axis=1) & np.isfinite(vel[:, :2]).all(axis=1)
    delay = 0.0
    weight = np.ones(np.count_nonzero(good))
    e, v = (
        x[good, :2] - np.median(x[good, :2], axis=0) if good.any() else x[good, :2] for x in (position, vel)
    )
    for _ in range(5):
        norm = float(np.sum(weight[:, None] * v**2))
        delay = -float(np.sum(weight[:, None] * v * e)) / norm if norm > 0.0 else 0.0
        left = np.linalg.norm(e + delay * v, axis=1)
        weight = 1.0 / np.maximum(left, 2.0 * np.median(left) + 1e-6) if len(left) else weight
    return FixErrors(gnss.t, position + delay * vel, gnss.vel_n - vel, delay)


def against_reference(
    drive: Drive, final: FilterRun, receiver: GnssNoise | None
) -> tuple[tuple[str, ...], tuple[Unexplained, ...]]:
    """Return in words how large the errors of fixes are, and what stays unexplained; nothing without a reference.

    Parameters
    ----------
    drive : Drive
        In any axes.
    final : FilterRun
        The run with all causes in it.
    receiver : GnssNoise or None
        As configured: errors that stay are no offset up to their sd.
    """
    notes = [drive.judged] if drive.judged else []
    reference = drive.reference
    if reference is None:
        return tuple(notes), ()
    errors = errors_of_fixes(drive, reference)
    good = np.asarray(np.isfinite(errors.position).all(axis=1))
    if np.count_nonzero(good) < MIN_FIXES:
        return tuple(notes), ()
    stay = staying_time(errors.t[good], errors.position[good])
    solution = drive.gnss.solution
    sizes = [
        _sizes(drive, errors, good & (solution == number), SOLUTIONS.get(int(number), "another"))
        for number in np.unique(solution[good & np.isfinite(solution)])
        if np.count_nonzero(good & (solution == number)) >= MIN_FIXES
    ]
    if len(sizes) < 2:
        sizes = [_sizes(drive, errors, good, "")]
    sizes[-1] += f"; errors of positions stay for some {stay:.0f} s"
    stated = _stated_sds(drive.gnss.position_sd[good], receiver)
    reference, turned = without_wrong_attitude(reference, final.stretches, final.solutions)
    found = (_offset(errors, good, stay, stated), _heading(reference, final))
    return (*notes, *([turned] if turned else []), *sizes), tuple(one for one in found if one is not None)


def staying_time(t: FloatArray, error: FloatArray) -> float:
    """Return the time in which the autocorrelation of errors (k, 3), outliers limited, falls to 1/e, s."""
    centred = error[:, :2] - np.median(error[:, :2], axis=0)
    limit = 3.0 * normal_sd(centred) + 1e-9
    centred = np.clip(centred, -limit, limit)
    step = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1], step)
    x = np.stack([np.interp(even, t, column) for column in centred.T], axis=-1)
    power = float(np.sum(x**2))
    lag = 1
    while lag < len(x) // 4 and np.sum(x[lag:] * x[:-lag]) > power / math.e:
        lag = max(lag + 1, int(1.1 * lag))
    return lag * step


def _robust(values: FloatArray) -> float:
    """Return the sd of numbers about zero, whatever their outliers."""
    known = values[np.isfinite(values)]
    return float(normal_sd(known)) if len(known) else np.nan


def _sizes(drive: Drive, errors: FixErrors, rows: NDArray[np.bool_], name: str) -> str:
    """Return in words the sds of the errors of some fixes beside the reported ones."""
    gnss, parts = drive.gnss, []
    for label, unit, error, reported in (
        ("positions", "m", errors.position, gnss.position_sd),
        ("velocities", "m/s", errors.velocity, gnss.velocity_sd),
    ):
        for columns, direction in (([0, 1], "horizontally"), ([2], "down")):
            true = _robust(error[rows][:, columns])
            known = reported[rows][:, columns]
            known = known[known > 0.0]
            if not np.isfinite(true):
                continue
            stated = float(np.median(known)) if len(known) else np.nan
            beside = f" (reported {stated:.2g}: {true / stated:.2g} of it)" if np.isfinite(stated) else ""
            parts.append(f"{label} {direction} {true:.2g} {unit}{beside}")
    of = f" of class '{name}'" if name else ""
    return f"errors of fixes{of} against the reference, sds without outliers: {', '.join(parts)}"


def _stated_sds(reported: FloatArray, receiver: GnssNoise | None) -> FloatArray:
    """Return the sds of positions north, east, down, from those of fixes (k, 3) and errors that stay as configured."""
    configured = np.zeros(3) if receiver is None else np.array(receiver.position_sd)
    known = [column[column > 0.0] for column in reported.T]
    sds = np.array([np.median(x) if len(x) else sd for x, sd in zip(known, configured, strict=True)])
    stays = 0.0 if receiver is None else np.sqrt(np.sum([state.sd**2 for state in receiver.correlated]))
    return np.asarray(
        np.hypot(sds, stays * np.array([1.0, 1.0, 1.0 if receiver is None else receiver.correlated_down]))
    )


def _offset(
    errors: FixErrors, good: NDArray[np.bool_], stay: float, stated: FloatArray
) -> Unexplained | None:
    """Return a constant offset of the positions beyond their sds, where blocks longer than the errors stay agree."""
    t, e = errors.t[good], errors.position[good]
    block = ((t - t[0]) // max(3.0 * stay, LEAST_BLOCK)).astype(int)
    means = np.stack([np.median(e[block == one], axis=0) for one in np.unique(block)])
    if len(means) < MIN_BLOCKS:
        return None
    mean, sd = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))
    p_value = 3.0 * 2.0 * student.sf(np.abs(mean) / np.maximum(sd, 1e-9), len(means) - 1)
    half = float(student.ppf(0.975, len(means) - 1)) * sd
    offsets = [
        f"{mean[i]:+.2f} ({mean[i] - half[i]:+.2f} … {mean[i] + half[i]:+.2f}) m {DIRECTIONS[i]}"
        for i in range(3)
        if p_value[i] < MAX_P_VALUE and abs(mean[i]) > max(MIN_OFFSET, MAX_STATED_SDS * stated[i])
    ]
    if not offsets:
        return None
    text = (
        f"fixes lie {', '.join(offsets)} of the reference all the time: another datum or height system, another point "
        "of the vehicle, or an error of the receiver that outlasts the drive; no innovation shows it"
    )
    return Unexplained(text, ("gnss",), float(p_value.min()))


def _heading(reference: Reference, final: FilterRun) -> Unexplained | None:
    """Return a heading that differs from the reference by more than its sd, one rotation of the bodies taken out."""
    left, stated = [], []
    for solution, stretch in zip(final.solutions, final.stretches, strict=True):
        rows = np.flatnonzero(solution.t >= stretch.settled)
        if len(rows) < MIN_FIXES:
            continue
        left.append(differences(reference, solution, rows)[:, 8])
        stated.append(solution.covariance[rows, 8, 8])
    if not left:
        return None
    error, sd = _robust(np.concatenate(left)), float(np.sqrt(np.median(np.concatenate(stated))))
    if not np.isfinite(error) or error < max(MIN_HEADING_RATIO * sd, MIN_HEADING):
        return None
    text = (
        f"the heading differs from that of the reference by {np.degrees(error):.1f}° (sd, beside one rotation of the "
        f"bodies), {error / sd:.1f} times the {np.degrees(sd):.1f}° that the filter states"
    )
    return Unexplained(text, ("imu",), 0.0)
