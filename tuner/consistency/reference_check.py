"""Where a reference contradicts inertial unit and receiver at once: there it is wrong, and nothing is judged by it.

A reference is the solution of another filter, which a false fix of its own pulls aside: its velocity then changes as
that of no vehicle. Changes of the velocity over a second by the inertial unit alone, Δv, by the fixes, Δv_f, and by the
reference, Δv_r, have errors of their own. The reference is wrong around a second in which, horizontally::

    |Δv_r − Δv| > MIN_CONTRADICTION Δt and MAX_SCATTERS of their usual difference      |Δv_f − Δv| < |Δv_r − Δv| / 3

The attitude is that of a filter; for Δv fixes are withheld by turns, so that none of them takes part. Of a reference
whose fixes have no velocities nothing is said: one of two is no majority. A drive has one reference, which is wrong at
one set of times: the filter is that which the drive alone gives, whatever settings are judged by what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.robust import normal_sd
from tuner.formats.reference_words import wrong_times_text
from tuner.navigation.data import WITHHELD
from tuner.navigation.drive.run import RECOVERY_TIME, Stretch, navigate, prepare
from tuner.navigation.settings import FilterSettings, filter_settings
from tuner.stages import stage
from tuner.synthesis.from_drive import config_of_drive, stationary_noise
from tuner.types.records import DataError, Drive, Reference

WITHHELD_TIME = 2.0
"""Time in which fixes are withheld by turns, s: the attitude of a filter with every other two seconds is as good."""
COMPARED_TIME = 1.0
"""Time over which velocities change, s: long against stamps and digits, short against drifts of the unit."""
MIN_CONTRADICTION = 1.0
"""Least difference of accelerations, m/s²: an attitude wrong by 6 degrees, or a bias of 0.1 g, which no fix shares."""
MAX_SCATTERS = 10.0
"""Differences in units of their robust sd from which they are none of the usual, of swinging antennas among others."""
MIN_RATIO = 3.0
"""Contradiction of the reference ÷ that of the fixes from which the reference is wrong and not the unit."""
MAX_CLOCK_OFFSET, CLOCK_STEP = 3.0, 0.1
"""Offsets of the reference's clock that are tried, and their spacing, s: a late reference is not a wrong one."""
MIN_TRUSTED_SHARE = 0.1
"""Share of its time from which a reference is used at all."""


def with_trusted_reference(drive: Drive) -> Drive:
    """Return an examined drive without those times of its reference at which it is wrong, which it says then."""
    if drive.judged is not None or drive.reference is None:
        return drive
    stage("finding where the reference is wrong", 0.5)
    arm = drive.lever_arm if drive.mounting is not None else None
    try:
        config = config_of_drive(drive, stationary_noise(drive))
        settings = filter_settings(config, lever_arm=arm or (0.0, 0.0, 0.0))
        reference, said = trusted_reference(drive.reference, prepare(drive, settings)[0], settings)
    except (DataError, np.linalg.LinAlgError):
        return drive
    return replace(drive, reference=reference, judged=said)


def trusted_reference(
    reference: Reference, stretches: Sequence[Stretch], settings: FilterSettings
) -> tuple[Reference | None, str]:
    """Return a reference without the times around contradictions, and in words what was left out, "" for nothing.

    Parameters
    ----------
    reference : Reference
        As read; None is returned where hardly anything of it is left.
    stretches : sequence of Stretch
        Of the drive, prepared.
    settings : FilterSettings
        A filter, which gives the attitude.
    """
    found, size = contradictions(reference, stretches, settings)
    if not len(found):
        return reference, ""
    # A reference recovers like any filter, and may have erred before.
    groups = np.split(found, np.flatnonzero(np.diff(found) > 2.0 * RECOVERY_TIME) + 1)
    spans = [(float(one[0]) - RECOVERY_TIME, float(one[-1]) + RECOVERY_TIME) for one in groups]
    keep = np.ones(len(reference.t), dtype=bool)
    for begin, end in spans:
        keep &= (reference.t < begin) | (reference.t > end)
    first, last = reference.t[[0, -1]].tolist()
    times = [(max(begin - first, 0.0), min(end, last) - first) for begin, end in spans]
    any_left = bool(keep.mean() >= MIN_TRUSTED_SHARE)
    text = wrong_times_text(len(found), size, times, any_left=any_left)
    return reference.rows(np.flatnonzero(keep)) if any_left else None, text


def contradictions(
    reference: Reference, stretches: Sequence[Stretch], settings: FilterSettings
) -> tuple[FloatArray, float]:
    """Return the times, s, at which a reference contradicts unit and fixes, and the largest contradiction, m/s."""
    if not stretches:
        return np.zeros(0), 0.0
    by_unit = _inertial_changes(tuple(stretches), settings)
    changes = [_changes(s, own) for s, own in zip(stretches, by_unit, strict=True)]
    first, last, unit, fixes = (np.concatenate(part) for part in zip(*changes, strict=True))
    if len(first) < 2:
        return np.zeros(0), 0.0
    reference_off = _nearest_clock(reference, first, last, unit) - unit
    size, others = (np.hypot(*x[:, :2].T) for x in (reference_off, fixes - unit))
    usual = float(normal_sd(size[np.isfinite(size)])) if np.isfinite(size).any() else np.inf
    least = np.maximum(MIN_CONTRADICTION * (last - first), MAX_SCATTERS * usual)
    wrong = (size > least) & (MIN_RATIO * others < size)
    return 0.5 * (first + last)[wrong], float(size[wrong].max(initial=0.0))


def _inertial_changes(stretches: tuple[Stretch, ...], settings: FilterSettings) -> list[FloatArray]:
    """Return the changes of the velocity from fix to fix by the inertial unit alone, (k, 3) of each stretch, m/s."""
    out = [np.full((len(s.fixes), 3), np.nan) for s in stretches]
    begin, end = float(stretches[0].fixes.t[0]), float(stretches[-1].fixes.t[-1])
    for first in (begin, begin + WITHHELD_TIME):
        begins = np.arange(first, end, 2.0 * WITHHELD_TIME)
        windows = np.stack([begins, begins + WITHHELD_TIME], axis=-1)
        for own, solution in zip(out, navigate(stretches, settings, windows), strict=True):
            k = np.flatnonzero(solution.use[1:, 0] == WITHHELD) + 1
            own[k] = solution.state.vel_n[k] - solution.state.vel_n[k - 1]
    return out


def _changes(stretch: Stretch, by_unit: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return begins and ends of about `COMPARED_TIME`, s, and the changes by unit and fixes between them."""
    t = stretch.fixes.t
    every = max(1, round(COMPARED_TIME / float(np.median(np.diff(t))))) if len(t) > 1 else 1
    first = np.arange(int(np.searchsorted(t, stretch.settled)), len(t) - every, every)
    last, known = first + every, np.isfinite(by_unit)
    whole = np.vstack([np.zeros(3), np.cumsum(np.where(known, by_unit, 0.0)[1:], axis=0)])
    lost = np.cumsum(~known[:, 0])
    unit = np.where((lost[last] == lost[first])[:, None], whole[last] - whole[first], np.nan)
    near = t[last] - t[first] < 2.0 * max(COMPARED_TIME, float(np.median(np.diff(t))))
    first, last, unit = first[near], last[near], unit[near]
    return t[first], t[last], unit, stretch.fixes.vel_n[last] - stretch.fixes.vel_n[first]


def _nearest_clock(reference: Reference, first: FloatArray, last: FloatArray, unit: FloatArray) -> FloatArray:
    """Return the changes of the reference's velocity between times, on the clock on which most agree with the unit."""

    def changes(late: float) -> FloatArray:
        at = [
            np.stack(
                [np.interp(t + late, reference.t, v, left=np.nan, right=np.nan) for v in reference.vel_n.T],
                axis=-1,
            )
            for t in (first, last)
        ]
        return np.asarray(at[1] - at[0])

    offsets = np.arange(-MAX_CLOCK_OFFSET, MAX_CLOCK_OFFSET + 0.5 * CLOCK_STEP, CLOCK_STEP)
    tried = [changes(float(late)) for late in offsets]
    moved = [np.linalg.norm(one - unit, axis=1) for one in tried]
    cost = [
        np.nanmean(np.minimum(one, MIN_CONTRADICTION)) if np.isfinite(one).any() else np.inf for one in moved
    ]
    return tried[int(np.argmin(cost))]
