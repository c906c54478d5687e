"""Error codes: one constant in place of a measurement, in rows that come now and then or at a period.

A driver that has no sample writes a number nevertheless: zero, the end of the range, the last sample before the loss.
One value v that comes m times is such a code where

- it lies apart: no other sample comes near it (`APART_DISTANCE` sds, and as many quantizer steps) but in motion, and
  samples before and after are as usual. Glitches of any size would rather lie elsewhere in the distance g to the next
  sample: m of them take one value, D wide, with the chance (D/g)^(m−1);
- or it comes more often than the values on both sides of it allow: Poisson, `MAX_CODE_RATIO` times the geometric mean
  of the most frequent on either side, as in a law without an edge, or of those on its one side. Nothing is said above
  a quantizer step of one sd, where values next to v are missing, as in a dead band, or where the tail of the noise
  beyond v may hold m samples: a rail.

At the end of all samples it is a rail, too, where outliers as many as a quarter of m lie next to it. More than one
such value is the work of a converter, but for two that lie apart at both ends of all samples: the full scale of a
register. Rows next to which samples change as noise does not are none: there the unit moves, and the value is a rail.

Axes of one sensor that have codes in the same rows have them together; in these rows an axis whose noise hides its code
has one if it takes one value there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from models.arrays import BoolArray, FloatArray, IntArray
from models.probability import normal_reach, poisson_at_least
from tuner.formats.customary_units import percent
from tuner.types.records import Record

DRAWING_SEED = 79
"""Seed of the samples that are looked at, and of those that take the place of a code."""
TRIED_SAMPLES = 8192
"""Samples, drawn anywhere, whose frequent values are looked at: a code of one sample in a thousand comes 8 times."""
TRIED_VALUES = 6
"""Values of these that are looked at, beside zero and both ends: those that most exceed their neighbours."""
MAX_DRAWN_SDS = 5.0
"""Sds, of a Poisson number, by which a code may come less often among them than `MAX_CODE_RATIO` requires."""
MAX_CODES = 1
"""Values that may come so often; more are codes of a converter under the means, or the interpolation, of a program."""
MIN_COUNT = 3
"""Least number of rows: two samples may coincide."""
APART_DISTANCE = 3.0
"""Distance to the next other sample, sds and quantizer steps, from which a value lies apart."""
SMALLER_SHARE, SMALLER_MEAN_SQUARE = 0.7, 0.31
"""Share of the differences that tell the sd, the larger ones being of codes, and mean square of that share, normal."""
NEAR_SDS = 0.25
"""Reach on either side of a value within which others tell how often one comes by chance, sds."""
NEAR_CODES = 2.5
"""The same in distances to the next: two codes, as one of them may be narrow."""
MAX_CODE_RATIO = 3.0
"""Number of samples of one value ÷ the geometric mean of the most frequent on its sides, by chance.

Normal noise on codes of one sd gives e^½, uneven widths and steeper laws more.
"""
TAIL_SHARE, MIN_TAIL_COUNT = 0.25, 4
"""Outer part of the distance from the level in which others lie, at rest, more than a quarter of m, where a tail of
outliers is cut off at v, the end of all: Cauchy noise has a third of what lies beyond, lighter tails more."""
QUARTILE_DISTANCE = 2.0 * normal_reach(0.5)
"""Distance of the quartiles of normal noise, sds."""
MAX_TAIL_EXCESS = 10.0
"""Factor by which tails may hold more than normal ones: more samples than that at an end are a code for an error.

Student's t₃₀ holds nine times as many beyond 4.5 sds, which one of 3e5 normal numbers exceeds.
"""
MAX_GAPS = 1.5, 10.0
"""Distance to the next other value ÷ that of others from each other, from which values lack beside it: a dead band.

Of codes, and of values that come once, whose distances are exponential.
"""
MAX_P_VALUE = 1e-12
"""Chance of a code that counts: the number of values in a log is a million at most."""
MIN_VALUE_SHARE = 1e-6
"""Share of a distance that one value takes at least: single precision has 1e-7 of the range."""
MAX_SHARE = 0.5
"""Largest share of rows that are codes: what the noise is, the others must show."""
MAX_RUN = 128
"""Longest run of codes, samples; in longer ones the readings are frozen, which is another test."""
MAX_NEIGHBOUR_SDS = 8.0
"""Distance of samples before and after a code from the level, and from each other, sds: beyond, the unit moves."""
MIN_ALONE = 0.7
"""Share of codes without one of the other end beside them, as where these are a twelfth of the rows at most: of shocks
that swing from rail to rail nearly all are beside one."""
MIN_SAME_ROWS = 0.9
"""Share of rows in common from which codes of two axes are one, and in which a hidden code takes one value."""
MIN_PERIODIC = 0.95
"""Share of distances between rows that are multiples of the shortest usual one, for a period."""
REACH_SAMPLES = 16, 512
"""Distance of the sample that takes the place of a code, samples: beyond the lags of tests of repetition, within the
time in which a bias stays."""


@dataclass(frozen=True)
class ErrorCodes:
    """Rows of one sensor in which axes hold a constant in place of a measurement.

    Attributes
    ----------
    values : mapping of str to float
        The constant of each axis, unit.
    rows : ndarray of bool, shape (n,)
        Rows in which they stand.
    p_value : float
        Chance of such samples in noise.
    """

    values: Mapping[str, float]
    rows: BoolArray
    p_value: float

    @cached_property
    def begins(self) -> NDArray[np.int64]:
        """Return the first row of each run."""
        return np.flatnonzero(self.rows & ~np.concatenate(([False], self.rows[:-1])))

    @property
    def longest(self) -> int:
        """Rows of the longest run."""
        ends = np.flatnonzero(self.rows & ~np.concatenate((self.rows[1:], [False])))
        return int((ends - self.begins).max()) + 1

    @cached_property
    def period(self) -> int:
        """Rows from one run to the next; 0 where they come at no period."""
        apart = np.diff(self.begins)
        if len(apart) < MIN_COUNT:
            return 0
        shortest = int(np.bincount(apart).argmax())
        return shortest if float(np.mean(apart % shortest == 0)) >= MIN_PERIODIC else 0

    def describe(self, record: Record) -> str:
        """Return which rows of a record they are, and what these read."""
        rows, values = int(np.count_nonzero(self.rows)), sorted(set(self.values.values()))
        often = f"every {self.period} rows" if self.period else f"{rows} rows"
        lasting = f", up to {self.longest} in a row" if self.longest > 1 else ""
        return (
            f"{often}{lasting}, {percent(rows / len(record), 3)} of all, "
            f"read {' or '.join(f'{v:.6g}' for v in values)} {record.unit}, "
            f"the first at {float(record.t[self.begins[0]]):.6g} s"
        )


def find_error_codes(record: Record) -> tuple[ErrorCodes, ...]:
    """Return the error codes of the axes of a record; of means of samples, those that mostly last over two of them.

    Single means repeat where samples have few values, as between two rails.
    """
    single = [(axis, one) for axis in record.axes for one in _codes(record.column(axis))]
    if record.samples_a_mean > 1:
        single = [(axis, one) for axis, one in single if _mean_run(one.rows) >= 2.0]
    groups: list[ErrorCodes] = []
    for axis, (value, rows, chance, _) in single:
        home = next(
            (at for at, one in enumerate(groups) if axis not in one.values and _alike(one.rows, rows)), None
        )
        if home is None:
            groups.append(ErrorCodes({axis: value}, rows, chance))
        else:
            one = groups[home]
            groups[home] = replace(
                one,
                values={**one.values, axis: value},
                rows=one.rows & rows,
                p_value=max(one.p_value, chance),
            )
    known = {axis for axis, _ in single}
    return tuple(_with_hidden(one, record, known) for one in groups)


def without_error_codes(record: Record, found: Sequence[ErrorCodes]) -> Record:
    """Return a record in which another row of the same axes, near by, stands in place of each code, and says so.

    Level, law, quantizer and correlation of the axes stay; N loses nothing by it, as the rows are drawn at random.
    """
    notes = [
        f"{', '.join(one.values)}: {one.describe(record)}: error codes, left out: other rows near by stand there"
        for one in found
    ]
    return with_other_rows(record, [(one.rows, tuple(one.values)) for one in found], notes)


def with_other_rows(
    record: Record, lost: Sequence[tuple[BoolArray, tuple[str, ...]]], notes: Sequence[str]
) -> Record:
    """Return a record in which another row of the same axes, near by, stands in place of each that is lost.

    It is the one before where the other axes of all lost rows repeat it: such rows hold no measurement of their own.

    Parameters
    ----------
    record : Record
        Samples.
    lost : sequence of (ndarray of bool, shape (n,), tuple of str)
        Rows, and the axes that they are lost of.
    notes : sequence of str
        What to say of them.
    """
    if not lost:
        return record
    y, noise = record.y.copy(order="F"), np.random.default_rng(DRAWING_SEED)
    good = np.flatnonzero(~np.any([rows for rows, _ in lost], axis=0))
    for these, axes in lost:
        rows = np.flatnonzero(these)
        apart = noise.integers(*REACH_SAMPLES, len(rows)) * noise.choice((-1, 1), len(rows))
        place = np.searchsorted(good, rows) + apart
        outside = (place < 0) | (place >= len(good))
        place = np.clip(np.where(outside, place - 2 * apart, place), 0, len(good) - 1)
        before = np.maximum(rows - 1, 0)
        others = [j for j, axis in enumerate(record.axes) if axis not in axes]
        if others and np.array_equal(record.y[rows][:, others], record.y[before][:, others]):
            place = np.searchsorted(good, before)
        for column in map(record.axes.index, axes):
            y[rows, column] = record.y[good[place], column]
    gone = {axis for _, axes in lost for axis in axes}
    short = {axis: clusters for axis, clusters in record.short_clusters.items() if axis not in gone}
    return replace(record, y=y, notes=(*record.notes, *notes), short_clusters=short)


class _Code(NamedTuple):
    """One value of one axis, its rows, the chance of it in noise, and whether it lies apart from all others."""

    value: float
    rows: BoolArray
    p_value: float
    apart: bool


def _codes(y: FloatArray) -> list[_Code]:
    """Return the error code of samples (n,), or those at both ends of all values; none where others come, too."""
    drawn = y[np.random.default_rng(DRAWING_SEED).integers(0, len(y), TRIED_SAMPLES)]
    values, number = np.unique(drawn, return_counts=True)
    if len(values) < MIN_COUNT:
        return []
    below, above = np.append(0, number[:-1]), np.append(number[1:], 0)
    most = np.argsort(-number / (np.maximum(below, above) + 1.0), kind="stable")[:TRIED_VALUES]
    often = number + MAX_DRAWN_SDS * np.sqrt(number) >= MAX_CODE_RATIO * np.sqrt(below * above)
    likely = most[often[most] & (number[most] >= MIN_COUNT)]
    ends = float(y.min()), float(y.max())
    tried = dict.fromkeys([*values[likely].tolist(), *ends, 0.0])
    step = _usual_step(values, number)
    found = [one for value in tried if (one := _judged(y, value, ends, drawn, step))]
    both = {one.value for one in found if one.apart} == set(ends) and len(found) == 2
    return found if both or len(found) <= MAX_CODES else []


def _usual_step(values: FloatArray, number: IntArray) -> float:
    """Return how far most samples lie from the next other value; `values` in order, and how many samples have each.

    Where most samples share their value with others, those that do not lie between the codes, as in bridges of gaps.
    """
    shared = number > 1
    if 2 * number[shared].sum() > number.sum():
        values, number = values[shared], number[shared]
    gaps = np.diff(values)
    nearer = np.minimum(np.append(gaps, np.inf), np.append(np.inf, gaps))
    return float(np.median(np.repeat(nearer, number)))


def _judged(
    y: FloatArray, value: float, ends: tuple[float, float], drawn: FloatArray, step: float
) -> _Code | None:
    """Return a value with its rows and its chance where it is an error code of samples (n,).

    `ends` are the least and the largest of them, `drawn` are some, in any order, whose values lie `step` apart.
    """
    rows = y == value
    count = int(np.count_nonzero(rows))
    if not MIN_COUNT <= count <= MAX_SHARE * len(y):
        return None
    level = float(np.median(drawn))
    sd = max(_difference_sd(y[:TRIED_SAMPLES]), 0.3 * step)
    away = np.abs(y - value)
    away[rows] = np.inf
    nearest = float(away.min())
    wide = max(sd, float(np.subtract(*np.quantile(drawn[drawn != value], (0.75, 0.25)))))
    reach, largest = APART_DISTANCE * max(sd, step), MAX_NEIGHBOUR_SDS * wide
    apart, far = nearest > reach, abs(value - level)
    if far > largest + reach or value in ends:
        others = _at_rest(np.abs(y - level), np.flatnonzero(away <= TAIL_SHARE * far), largest)
        normal = len(y) * float(ndtr(-(1.0 - TAIL_SHARE) * far * QUARTILE_DISTANCE / wide))
        if value in ends and len(others) > max(count / MIN_TAIL_COUNT, MAX_TAIL_EXCESS * normal):
            return None
        if not apart and far > largest + reach and (len(others) == 0 or away[others].min() > reach):
            apart, nearest = True, reach
    often = 0.0
    if not apart:
        if step > sd:
            return None
        near, number = np.unique(
            y[away <= max(NEAR_SDS * sd, NEAR_CODES * max(nearest, step))], return_counts=True
        )
        below, above = (float(number[side].max(initial=0)) for side in (near < value, near > value))
        if (below if value > level else above) == 0.0:
            return None
        often = float(np.sqrt(below * above)) if below and above else below + above
        gap = MAX_GAPS[0] if float(number.mean()) > 1.5 else MAX_GAPS[1]
        inside = min(below, above) > 0.0 and nearest <= gap * float(np.median(np.diff(near)))
        if not inside and _beyond(y, value, level) * MAX_TAIL_EXCESS >= count:
            return None

    def chance(times: int) -> float:
        if apart:
            return float(max(step / nearest, MIN_VALUE_SHARE) ** (times - 1))
        return poisson_at_least(times, MAX_CODE_RATIO * (often + 1.0))

    if chance(count) > MAX_P_VALUE:
        return None
    found, alone = (
        ErrorCodes(MappingProxyType({}), _in_rest(y, rows, codes, largest), 0.0) for codes in (ends, (value,))
    )
    if len(alone.begins) < MIN_ALONE * len(found.begins):
        return None
    times = len(found.begins)
    if times < MIN_COUNT or found.longest > MAX_RUN or (p_value := chance(times)) > MAX_P_VALUE:
        return None
    return _Code(value, found.rows, p_value, apart) if _near(y, found.rows, level, wide) else None


def _at_rest(distance: FloatArray, some: IntArray, largest: float) -> IntArray:
    """Return those of some samples whose neighbours lie within the largest distance from the level: none in motion."""
    beside = np.maximum(distance[np.maximum(some - 1, 0)], distance[np.minimum(some + 1, len(distance) - 1)])
    return np.asarray(some[beside <= largest])


def _in_rest(y: FloatArray, rows: BoolArray, codes: Sequence[float], largest: float) -> BoolArray:
    """Return the rows of a value without runs next to which samples change by more than `largest`: the unit moves.

    Samples on one of `codes` are no neighbours: they may be codes themselves, or the rail of a motion.
    """
    good = np.flatnonzero(~rows & np.all([y != code for code in codes], axis=0))
    begins = np.flatnonzero(rows & ~np.append(False, rows[:-1]))
    after = np.searchsorted(good, begins)
    moved = np.zeros(len(begins), bool)
    for first, second in ((after - 2, after - 1), (after, after + 1)):
        known = (first >= 0) & (second < len(good))
        moved[known] |= np.abs(y[good[second[known]]] - y[good[first[known]]]) > largest
    run = np.cumsum(rows & ~np.append(False, rows[:-1])) - 1
    kept: BoolArray = rows & ~moved[run]
    return kept


def _mean_run(rows: BoolArray) -> float:
    """Return how many rows in a row there are on average."""
    return float(np.count_nonzero(rows)) / float(np.count_nonzero(np.diff(rows, prepend=False) & rows))


def _difference_sd(y: FloatArray) -> float:
    """Return the sd of white samples by the smaller ones of their differences, as codes make the larger ones."""
    square = np.sort(np.diff(y) ** 2)[: int(SMALLER_SHARE * (len(y) - 1))]
    return float(np.sqrt(0.5 * np.mean(square) / SMALLER_MEAN_SQUARE))


def _near(y: FloatArray, rows: BoolArray, level: float, wide: float) -> bool:
    """Return whether samples before and after a code are mostly near the level."""
    beside = (np.append(rows[1:], False) | np.append(False, rows[:-1])) & ~rows
    return bool(np.median(np.abs(y[beside] - level)) < MAX_NEIGHBOUR_SDS * wide)


def _beyond(y: FloatArray, value: float, level: float) -> float:
    """Return how many samples normal noise, slow parts and all codes in it, would have beyond a value."""
    return float(len(y) * ndtr(-abs(value - level) / np.std(y)))


def _alike(rows: BoolArray, others: BoolArray) -> bool:
    """Return whether the codes of two axes stand in the same rows; noise of one may give a code of its own."""
    both = float(np.count_nonzero(rows & others))
    return bool(both >= MIN_SAME_ROWS * min(np.count_nonzero(rows), np.count_nonzero(others)))


def _with_hidden(one: ErrorCodes, record: Record, known: set[str]) -> ErrorCodes:
    """Return codes with those of axes whose noise hides them: they take one value in the same rows."""
    values = dict(one.values)
    for axis in record.axes:
        if axis in known:
            continue
        y = record.column(axis)
        there, number = np.unique(y[one.rows], return_counts=True)
        value, share = float(there[np.argmax(number)]), float(number.max()) / len(y[one.rows])
        if share >= MIN_SAME_ROWS and float(np.mean(y[~one.rows] == value)) < MAX_SHARE * share:
            values[axis] = value
    ordered = {axis: values[axis] for axis in record.axes if axis in values}
    return replace(one, values=ordered)
