"""Wrong readings: samples that stand alone, far from those beside them, more often than any noise puts them there.

A law of noise of finite variance falls off at least as the power −3 of the distance d: beyond a level L it has at most
a third of the samples between L/2 and L. So where m₁ samples lie beyond L, and m₂ between L/2 and L, the chance is
that of

    m₁ or more of m₁ + m₂ in a binomial law of probability 1/4

for any noise whose tails have begun there, and with L/2ʲ in place of L/2 that of probability 1/4ʲ: L has to lie beyond
6 sds of all that is left. d is the distance from the medians of the samples before and behind it, the smaller of both,
in units of the usual distance of neighbours near by that differ: neither steps nor slow noise nor noise that swells
takes part. A sample is alone where most of those beside it are right: what lasts is a motion, or a burst. Where many
lie side by side, or all of these take longer than a hand may move, nothing is said.

Readings that the reader left out as no sensor makes them count among those beyond L: few that are left of many are
judged with these.

A filter meets a wrong reading as an outlier, for its gate; it is no noise, and no motion. Where wrong readings have a
share of the variance that changes the noise, they are left out before either is judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import bdtrc

from models.arrays import BoolArray, FloatArray, IntArray
from models.probability import normal_reach
from tuner.formats.customary_units import percent, range_text
from tuner.limits import SHOWN_CHANGE
from tuner.segments.error_codes import with_other_rows
from tuner.types.records import Record

SAMPLES_BESIDE = 4
"""Samples on either side by whose medians one is judged."""
TRIED_WIDTHS = (1, 4, 16)
"""Samples of a wrong reading: a filter behind it spreads a single one over some."""
RINGING_ROUNDS = 3
"""Times that the noise beside the ringing of a filter is taken again."""
SHORTEST_MOVEMENT = 1.0
"""Time that a movement by hand takes, s."""
NEAR_BY = 256
"""Samples whose neighbours have one usual distance."""
TRIED_LEVELS = 8.0 * math.sqrt(2.0) ** np.arange(24)
"""Distances L that are tried, in usual ones: nearer ones lie within what a law of noise may have."""
LEAST_JUMP = 3.0
"""Distance from a neighbour, in usual ones, that a sample at half the nearest L has."""
MIN_ALONE, MAX_SHARE = 0.7, 0.05
"""Share of the samples beyond L that stand alone, and of all samples that are beyond: more are a process of its own."""
LEAST_SDS = 6.0
"""Distance of a wrong reading in sds of all that is left."""
NORMAL_CHANGE = math.sqrt(2.0) * normal_reach(0.5)
"""Median distance of neighbours ÷ sd of normal samples."""
MAX_P_VALUE = 1e-6
"""Chance of wrong readings in noise: with all levels and axes of a log a thousandth at most."""
HEAVIEST_TAIL = 0.25
"""Largest share of the samples beyond L/2 that lie beyond L, in noise of finite variance."""
EMPTY_OCTAVES = range(1, 12)
"""Octaves of the distance that are judged at once: where several are empty below few readings, these are far apart."""


@dataclass(frozen=True)
class WrongReadings:
    """Rows in which an axis holds wrong readings.

    Attributes
    ----------
    axis : str
        Which.
    rows : ndarray of bool, shape (n,)
        Their rows.
    sizes : ndarray, shape (m,)
        Distances from the samples beside them, unit.
    p_value : float
        Chance of so many in noise.
    """

    axis: str
    rows: BoolArray
    sizes: FloatArray
    p_value: float

    def describe(self, record: Record) -> str:
        """Return how many they are and how far off."""
        count = len(self.sizes)
        return (
            f"{count} readings, {percent(float(np.mean(self.rows)), 3)} of all samples, are off by "
            f"{range_text([float(np.median(self.sizes))], record.unit)} (median)"
        )


def find_wrong_readings(record: Record) -> tuple[WrongReadings, ...]:
    """Return the axes of a record that have wrong readings, and where: single ones, or some side by side."""
    widths = [
        width for width in TRIED_WIDTHS if 2 * SAMPLES_BESIDE * width * record.interval <= SHORTEST_MOVEMENT
    ]
    if len(record) <= NEAR_BY:
        return ()
    return tuple(one for axis in record.axes if (one := _narrowest(axis, record, widths)) is not None)


def _narrowest(axis: str, record: Record, widths: Sequence[int]) -> WrongReadings | None:
    """Return the wrong readings of an axis, the narrowest that leave as little noise as wider ones."""
    found = [one for width in widths if (one := _wide(axis, record, width)) is not None]
    if len(found) < 2:
        return found[0] if found else None
    about, best, least = _about_level(record.column(axis)), None, math.inf
    for one in found:
        left = float(np.std(about[~one.rows]))
        if (1.0 + SHOWN_CHANGE) * left < least:
            best, least = one, left
    return best


def _wide(axis: str, record: Record, width: int) -> WrongReadings | None:
    """Return the wrong readings of an axis that last so many samples, by their means; a motion shows in other axes."""
    y = record.column(axis)
    if width == 1:
        return _of_axis(axis, y, *record.broken.get(axis, ()))
    if len(record.axes) < 2 or len(y) <= width * NEAR_BY:
        return None

    def means(name: str) -> FloatArray:
        return np.asarray(record.column(name)[: len(y) // width * width].reshape(-1, width).mean(axis=1))

    one = _of_axis(axis, means(axis))
    if one is None:
        return None
    for other in record.axes:
        mean = means(other)
        change = np.abs(np.diff(mean, append=mean[-1:]))
        if other != axis and np.median(change[one.rows]) > LEAST_JUMP * np.median(change):
            return None
    reached = np.convolve(one.rows, np.ones(3), "same") > 0.0  # a pulse reaches beside its mean
    rows = np.zeros(len(y), dtype=bool)
    rows[: len(reached) * width] = np.repeat(reached, width)
    about = _about_level(y)
    rows = _with_ringing(rows, about, width)
    off = about[rows][np.abs(about[rows]) > one.sizes.min()]
    return None if len(off) and _cut_off(off, about[~rows]) else replace(one, rows=rows)


def _with_ringing(rows: BoolArray, about: FloatArray, width: int) -> BoolArray:
    """Return the rows of wrong readings with those close by that are no noise: how a filter rings and decays."""
    for _ in range(RINGING_ROUNDS):  # without some of it the noise is smaller, and more of it shows
        far = rows | (np.abs(about) > LEAST_SDS * float(np.std(about[~rows])))
        places = np.flatnonzero(far)
        begins = np.append(0, np.flatnonzero(np.diff(places) > width) + 1)
        struck = np.logical_or.reduceat(rows[places], begins)
        ends = np.append(begins[1:], len(places)) - 1
        change = np.zeros(len(rows) + 1, dtype=int)
        np.add.at(change, places[begins[struck]], 1)
        np.add.at(change, places[ends[struck]] + 1, -1)
        rows = np.cumsum(change[:-1]) > 0
    return rows


def without_wrong_readings(record: Record, found: Sequence[WrongReadings]) -> Record:
    """Return a record in which other rows near by stand in place of wrong readings, and says so."""
    notes = [
        f"{one.axis}: {one.describe(record)}: wrong readings, left out: other rows near by stand there"
        for one in found
    ]
    return with_other_rows(record, [(one.rows, (one.axis,)) for one in found], notes)


def _of_axis(axis: str, y: FloatArray, gone: int = 0, size: float = 0.0) -> WrongReadings | None:
    """Return the wrong readings of samples (n,), of which so many of a size are gone; None where none matter."""
    new = np.append(True, np.diff(y) != 0.0)
    values = y[new]  # what repeats the sample before is no reading of its own
    if len(values) <= NEAR_BY:
        return None
    change = np.abs(np.diff(values))
    usual = _usual(change)
    jump = np.maximum(np.append(change, 0.0), np.append(0.0, change))
    near = np.arange(-SAMPLES_BESIDE, SAMPLES_BESIDE + 1)

    def off_at(places: IntArray) -> FloatArray:
        """Return the distances from the samples before and behind, the smaller of both; 0 between two levels."""
        middle = np.clip(places, SAMPLES_BESIDE, len(values) - 1 - SAMPLES_BESIDE)[:, None]
        before, behind = (
            values[places] - np.median(values[middle + side], axis=1)
            for side in (near[:SAMPLES_BESIDE], near[SAMPLES_BESIDE + 1 :])
        )
        smaller = np.where(np.abs(before) < np.abs(behind), before, behind)
        return np.asarray(np.where(before * behind > 0.0, smaller, 0.0))

    far = np.flatnonzero(jump > LEAST_JUMP * usual)
    far = far[np.abs(off_at(far)) > 0.5 * TRIED_LEVELS[0] * usual[far]]
    far = np.unique(np.clip(far[:, None] + near, 0, len(values) - 1))  # the middle of a bump has no jump
    off = off_at(far)
    runs = np.diff(np.flatnonzero(new), append=len(y))
    lasts = runs[far] > SAMPLES_BESIDE * np.median(runs)  # a stuck register
    distance = np.where(lasts, 0.0, np.abs(off) / usual[far])
    is_far = np.zeros(len(values), dtype=bool)
    is_far[far] = distance > 0.5 * TRIED_LEVELS[0]
    many = np.convolve(is_far, np.ones(len(near)), "same")[far] - is_far[far]
    alone = is_far[far] & (many < SAMPLES_BESIDE)
    known = np.full(gone, size / float(np.median(usual)))
    every, ordered = np.sort(np.append(distance, known)), np.sort(np.append(distance[alone], known))
    far, off, distance = far[alone], off[alone], distance[alone]
    beyond, chance = _beyond(ordered, 1.0), np.ones(len(TRIED_LEVELS))
    for octaves in EMPTY_OCTAVES:
        judged = (beyond > 0) & (0.5**octaves * TRIED_LEVELS >= 0.5 * TRIED_LEVELS[0])
        tail = bdtrc(beyond - 1.0, np.maximum(_beyond(ordered, 0.5**octaves), 1), HEAVIEST_TAIL**octaves)
        chance = np.where(judged, np.minimum(chance, tail), chance)
    single = (beyond >= MIN_ALONE * _beyond(every, 1.0)) & (beyond <= MAX_SHARE * len(values))
    for level in TRIED_LEVELS[(chance < MAX_P_VALUE) & single]:
        rows = np.zeros(len(values), dtype=bool)
        rows[far[distance > level]] = True
        noise = 0.5 * float(np.mean(np.square(change[~(rows[1:] | rows[:-1])])))
        if level * float(np.median(usual)) > LEAST_SDS * math.sqrt(noise):  # apart from all that is left
            break
    else:
        return None
    wrong = distance > level
    more = float(np.sum(np.square(off[wrong]))) / (noise * len(y))
    left = _about_level(values)[~is_far]
    if math.sqrt(1.0 + more) < 1.0 + SHOWN_CHANGE or _cut_off(off[wrong], left):
        return None
    rows = rows[np.cumsum(new) - 1]  # with what repeats them
    return WrongReadings(axis, rows, np.abs(off[wrong]), float(chance[level == TRIED_LEVELS][0]))


def _beyond(ordered: FloatArray, factor: float) -> IntArray:
    """Return how many of sorted distances lie beyond each level, or a part of it."""
    return len(ordered) - np.searchsorted(ordered, factor * TRIED_LEVELS, side="right")


def _cut_off(wrong: FloatArray, right: FloatArray) -> bool:
    """Return whether all wrong ones come from one side, on which right ones end before their tail on the other does.

    So it is where a register overflows. Of symmetrical noise each sample beyond all of one side is on the other side
    by a chance of 1/2.
    """
    side = np.sign(wrong[0])
    if np.any(np.sign(wrong) != side):
        return False
    beyond = int(np.count_nonzero(side * right > -np.min(side * right)))
    return 0.5**beyond < MAX_P_VALUE


def _usual(change: FloatArray) -> FloatArray:
    """Return the usual distance of neighbours at each of them, in sds of normal samples; shape (n + 1,)."""
    blocks = len(change) // NEAR_BY
    each = np.median(change[: blocks * NEAR_BY].reshape(blocks, NEAR_BY), axis=1) / NORMAL_CHANGE
    return np.asarray(each[np.minimum(np.arange(len(change) + 1) // NEAR_BY, blocks - 1)])


def _about_level(values: FloatArray) -> FloatArray:
    """Return samples less the median of those near by."""
    pieces = np.array_split(values, len(values) // NEAR_BY)
    return np.concatenate([piece - np.median(piece) for piece in pieces])
