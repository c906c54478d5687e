"""Frozen readings: stretches in which an axis gives one value over and over, as a stuck register does.

Noise through a quantizer of step D repeats a code with a chance q a sample, so that runs of equal values have a
geometric tail. A run of ℓ samples is frozen where both of two bounds on its chance are below `FROZEN_P_VALUE`::

    P(j | (j + K − 1) exp(−(ℓ − u)/(2 s)))   that j runs (Poisson) are as long as the j-th longest, u the K-th longest
                                of those after it, s their mean excess over it; of more than K runs, for the longest:
                                whatever the noise, its colour, its changes, a dead band or single repeated samples
    n q^(ℓ−1),  q = erf(w/(√8 σ))   the noise with its mean in the middle of the code all the time, w the distance
                                between the edges of the code: where no other code comes, as in a dead band, it is wide

The 2 allows for a tail that is a mixture of several. σ follows from the share of neighbours two codes and more apart,
which does not depend on slow noise, in the quietest tenth of the record::

    h(D/σ) = 1 − Σ p_c² − 2 Σ p_c p_(c+1)     the mean on a code or half-way between two, where it is larger

Where it is below `MIN_FAR_SHARE`, D above some 3 σ, runs of any length are natural, and nothing is
reported. A value at the end of all others, at which these pile up as well, is a rail, where the sensor saturated
(`tuner.diagnosis.data_quality.saturation`).
Nor is it where more than half of the samples would be frozen in several stretches.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import erf, gammainc, ndtr

from models.arrays import FloatArray, IntArray
from tuner.segments.quantizer import quantizer_step
from tuner.types.records import Record

Range = tuple[int, int]

FROZEN_P_VALUE = 1e-9
"""P-value of a run below which it is frozen.

Both bounds are exponential, so that a smaller value costs a few samples of length only; chosen far below the share of
the false-alarm budget because the tail of the runs is extrapolated.
"""
MIN_RUN_LENGTH = 16
"""Samples in the shortest run that is tested; shorter ones do a filter no more harm than repeated samples do."""
TAIL_RUN_COUNT = 50
"""Longest runs from which the tail is estimated, K; their mean excess is known to 1/√K = 14 %.

The record needs four times as many, so that these lie in the tail.
"""
MIN_FAR_SHARE = 0.01
"""Least share of neighbours two codes and more apart: below it, σ is under a third of the step and not estimable."""
QUIET_SHARE = 0.1
"""Share of the record that may be quieter than the σ that is used: its quantile over blocks.

Chosen low, so that a quieter part, where samples repeat more often, is not taken for a frozen one.
"""
BLOCK_PAIRS = 256
"""Pairs of neighbours in a block of which σ is estimated; at `MIN_FAR_SHARE` some three of them are far apart."""
UNREACHABLE_DISTANCE = 12.0
"""Distance of two values, σ, that noise does not cross in one step: beyond, a code in between is missing.

The difference of neighbours has the sd √2 σ: 12 σ are 8.5 of these, P = 2e-17.
"""
MAX_FROZEN_SHARE = 0.5
"""Largest share of a record that can be frozen in several stretches; a sensor that stops for good does so in one.

Chosen so that the samples that change are the majority: σ and the runs are those of the working sensor.
"""
MIN_DISTINCT_SHARE = 0.5
"""Least number of different values ÷ changes between samples in data without a quantizer.

Continuous data give 1, coarse codes nearly 0; half-way between.
"""
MIN_RAIL_SAMPLES = 3
"""Least number of samples at the end of all values that make it a rail: two may coincide by rounding."""
EDGE_TOLERANCE = 16
"""Samples by which the edges of a stretch may differ between axes that froze together.

Chosen as `MIN_RUN_LENGTH`: by chance an axis repeats its value for a few samples more at either end.
"""


@dataclass(frozen=True)
class Frozen:
    """Frozen stretches of one axis.

    Attributes
    ----------
    stretches : tuple of (int, int)
        First sample that has the value, and the first after that has not.
    p_value : float
        Largest p-value of them.
    slack : int
        Samples at either end that may equal the value by chance (97.5 %).
    """

    stretches: tuple[Range, ...]
    p_value: float
    slack: int

    @property
    def longest(self) -> Range:
        """The longest stretch."""
        return max(self.stretches, key=lambda stretch: stretch[1] - stretch[0])

    @property
    def repeated(self) -> int:
        """Number of samples that repeat the one before."""
        return sum(last - first - 1 for first, last in self.stretches)

    def alike(self, other: Frozen) -> bool:
        """Return whether another axis froze at the same times."""
        return len(self.stretches) == len(other.stretches) and all(
            abs(a - b) <= EDGE_TOLERANCE
            for mine, its in zip(self.stretches, other.stretches, strict=True)
            for a, b in zip(mine, its, strict=True)
        )


def frozen(record: Record, axis: str) -> Frozen | None:
    """Return the frozen stretches of an axis; None where there are none.

    Parameters
    ----------
    record : Record
        Samples of one sensor.
    axis : str
        One of its axes.
    """
    y = record.column(axis)
    places = slice(0, -1, MIN_RUN_LENGTH - 1), slice(1, None, MIN_RUN_LENGTH - 1)
    if not np.any(y[places[0]] == y[places[1]]):  # a run that long has one of these pairs
        return None
    first, length = _runs(y, record.segments)
    order = (
        np.argsort(-length, kind="stable")
        if np.any(length >= MIN_RUN_LENGTH)
        else np.zeros(0, dtype=np.int64)
    )
    chance = _beyond_the_tail(length[order])
    remarkable = np.flatnonzero(chance < FROZEN_P_VALUE)
    if not len(remarkable):
        return None
    number = int(remarkable[-1]) + 1
    candidates = np.sort(order[:number])
    ranges = [(int(first[i]), int(first[i] + length[i])) for i in candidates]
    rest = [y[start:stop] for start, stop in cut(record.segments, ranges)]
    repeating = _in_one_code(y[first[candidates]], rest)
    natural = repeating ** (length[candidates] - 1.0) * len(y)
    kept = np.flatnonzero(natural < FROZEN_P_VALUE)
    stretches = tuple(ranges[i] for i in kept)
    if not stretches:
        return None
    if len(stretches) > 1 and sum(stop - start for start, stop in stretches) > MAX_FROZEN_SHARE * len(y):
        return None
    pairs = sum(len(piece) - 1 for piece in rest)
    same = sum(int(np.count_nonzero(np.diff(piece) == 0.0)) for piece in rest) / pairs
    slack = math.ceil(math.log(0.025) / math.log(same)) if same > 0.025 else 0
    return Frozen(stretches, float(max(chance[number - 1], natural[kept].max())), slack)


def cut(segments: Sequence[Range], stretches: Sequence[Range]) -> tuple[Range, ...]:
    """Return what is left of segments without stretches of samples; pieces of two samples at least."""
    pieces = []
    for start, stop in segments:
        begin = start
        for first, last in sorted(one for one in stretches if one[0] < stop and one[1] > start):
            pieces.append((begin, first))
            begin = max(begin, last)
        pieces.append((begin, stop))
    return tuple((a, b) for a, b in pieces if b - a > 1)


def _runs(y: FloatArray, segments: Sequence[Range]) -> tuple[IntArray, IntArray]:
    """Return where runs of equal values begin, and their lengths."""
    begins, lengths = [], []
    for start, stop in segments:
        edges = np.concatenate(([0], np.flatnonzero(np.diff(y[start:stop]) != 0.0) + 1, [stop - start]))
        begins.append(edges[:-1] + start)
        lengths.append(np.diff(edges))
    return np.concatenate(begins).astype(np.int64), np.concatenate(lengths).astype(np.int64)


def _beyond_the_tail(length: IntArray) -> FloatArray:
    """Return the chance of each run of `MIN_RUN_LENGTH` samples and more by those that are shorter; lengths descend."""
    number = min(int(np.count_nonzero(length >= MIN_RUN_LENGTH)), len(length) - 4 * TAIL_RUN_COUNT)
    if number <= 0:
        return np.zeros(0)
    total = np.concatenate(([0], np.cumsum(length[: number + TAIL_RUN_COUNT])))
    j = np.arange(number)
    least = length[j + TAIL_RUN_COUNT]
    excess = (total[j + 1 + TAIL_RUN_COUNT] - total[j + 1]) - TAIL_RUN_COUNT * least
    repeat = (excess + 1.0) / (excess + 1.0 + TAIL_RUN_COUNT)
    odds = np.exp(0.5 * (length[:number] - least) * np.log(repeat))
    few = j < TAIL_RUN_COUNT  # of more runs it is not known to a part of their number
    joint = gammainc(j + 1.0, (j + TAIL_RUN_COUNT) * odds)
    return np.asarray(np.where(few, joint, TAIL_RUN_COUNT * odds))


def _in_one_code(values: FloatArray, rest: Sequence[FloatArray]) -> FloatArray:
    """Return the largest chance that a sample repeats the one before, at each of the values; 1 where it is unknown."""
    others, count = np.unique(np.concatenate(rest), return_counts=True)
    chance = np.where(_at_a_rail(values, others, count), 1.0, 0.0)
    moved = np.concatenate([np.abs(np.diff(piece)) for piece in rest])
    step = quantizer_step(rest)
    if step == 0.0:
        return chance if len(others) > MIN_DISTINCT_SHARE * np.count_nonzero(moved) else np.ones(len(values))
    apart = moved > 1.5 * step
    share = apart[: len(apart) // BLOCK_PAIRS * BLOCK_PAIRS].reshape(-1, BLOCK_PAIRS).mean(axis=1)
    telling = float(np.quantile(share, QUIET_SHARE)) if len(share) else float(apart.mean())
    if telling < MIN_FAR_SHARE:
        return np.ones(len(values))
    u = math.exp(brentq(lambda x: _two_apart(math.exp(x)) - telling, math.log(1e-3), math.log(8.0)))
    inside = (values >= others[0]) & (values <= others[-1])
    others = np.concatenate(([-np.inf], others, [np.inf]))
    above = others[np.searchsorted(others, values, side="right")] - values
    below = values - others[np.searchsorted(others, values, side="left") - 1]
    near = np.minimum(above, below)
    above, below = (np.where(gap * u < UNREACHABLE_DISTANCE * step, gap, near) for gap in (above, below))
    within = inside & (near * u < UNREACHABLE_DISTANCE * step)
    width = np.where(within, np.maximum(above + below - step, step), step)
    return np.asarray(np.maximum(chance, erf(width * u / (step * math.sqrt(8.0)))))


def _at_a_rail(values: FloatArray, others: FloatArray, count: IntArray) -> NDArray[np.bool_]:
    """Return which of the values are the end of all, where others accumulate as well: there a sensor saturates.

    `others` are the other values, in order, and `count` says how often they come.
    """
    low = (values <= others[0]) & (count[0] >= max(MIN_RAIL_SAMPLES, count[1]))
    high = (values >= others[-1]) & (count[-1] >= max(MIN_RAIL_SAMPLES, count[-2]))
    at_end = (values == others[0]) | (values == others[-1])
    return np.asarray(at_end & (low | high), dtype=bool)


def _two_apart(u: float) -> float:
    """Return h for a quantizer step of u = D/σ: with the mean on a code or half-way between two, the larger one."""
    reach = math.ceil(8.0 / u) + 1
    edges = np.arange(-reach, reach + 1.0) - 0.5
    alike = []
    for phase in (0.0, 0.5):
        share = np.diff(ndtr(u * (edges - phase)))
        alike.append(float(share @ share + 2.0 * share[1:] @ share[:-1]))
    return 1.0 - min(alike)


def together(found: Sequence[tuple[str, Frozen]]) -> list[list[tuple[str, Frozen]]]:
    """Return axes with their frozen stretches, in groups that froze at the same times."""
    groups: list[list[tuple[str, Frozen]]] = []
    for axis, one in found:
        home = next((group for group in groups if group[0][1].alike(one)), None)
        if home is None:
            groups.append([(axis, one)])
        else:
            home.append((axis, one))
    return groups
