"""Repeated samples: readings that equal the one before, as from a register polled faster than it is filled.

Quantized neighbours are equal by chance, too. Rounded to a step D, two values whose difference is normal of sd
s are equal with the probability ::

    g(s) = E max(0, 1 − |d|/D) = erf(D/(s√2)) − (2s/(D√(2π))) (1 − exp(−D²/(2s²)))

A repeated sample equals its neighbour but not the ones before that, so equality at lag 1 is tested against
equality at lags 2 … 9, which estimate chance together; where the noise is coloured such that their differences are not
of the size of those at lag 2, against equality there only. Coloured noise has other differences at lag 1 too: the
expectation is scaled by R = g(s₁)/g(s_k), with a margin in proportion to that correction, and by no less than 1. Only
differences that are not zero estimate s, so that repetition does not change R. Counts and scales are taken in blocks: a
change of the noise along the record does no harm, and their scatter gives the test, a Student t over blocks, or the
exact binomial where equalities are few. Where the step exceeds about 4 s₁ repetition
and quantization cannot be separated.

Where a channel has no quantizer and no two samples are equal but some neighbours, all n²/2 pairs estimate chance: each
pair of neighbours is one of n/2 as likely, nearer to each other than any two by √2 s/s₁, s the sd of the samples.

With a fine quantizer (s₁ of two steps and more) the counts n(j) of neighbours that differ by j steps give chance
without the noise: their logarithm is a parabola in j near 0, and its value there, from j = ±1 … ±s₁/D (half as far
where the noise is coloured), is what noise gives. What the codes themselves do to n(0) they do at the other lags as
well: the excess e₁ = n₁(0) − n̂₁(0) stands against the excesses e_k, scaled by R = n̂₁(0)/n̂_k(0).

With a share f of repeated samples, equality at lag k is that at lag k − 1 for these, and chance for the others. Hence,
with the shares e of equal pairs, or of their excesses, e₀ = 1, and the mean over the lags k::

    f = (e₁ − mean R_k e_k) / (1 − mean R_k e_(k−1)),    f ≤ e₁
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from models.arrays import FloatArray, IntArray
from models.probability import binomial_at_least, normal_reach, student_beyond

BLOCK_COUNT = 200
"""Blocks that a record is cut into: enough degrees of freedom for a t law close to the normal one."""
MIN_BLOCK_SAMPLES = 100
"""Least length of a block, samples; chosen so that a block has several lags' worth of pairs (`MAX_LAG` is 9)."""
MIN_EQUALITIES = 400
"""Equalities below which the exact binomial test replaces the scatter over blocks: two a block of `BLOCK_COUNT`."""
MIN_FINE_SD = 2.0
"""Least sd of the differences for a fine quantizer, steps.

Codes ±1 and ±2 lie within one sd, where log n is a parabola.
"""
MAX_DIFFERENCE_STEPS = 8
"""Largest difference from which the count of zeros by chance is extrapolated, steps.

Enough points for a parabola in the logarithm.
"""
MAX_COLOURED_DIFFERENCE = 0.5
"""Largest difference used for coloured noise, sd of the differences.

Further out its distribution at lag 1 may differ from that at other lags; half as far as for white noise.
"""
MAX_LAG = 9
"""Largest lag at which equalities estimate chance; eight lags make its variance an eighth of that at lag 1."""
LAG_TOLERANCE = 0.02
"""Relative difference of R between two lags up to which both estimate chance.

Chosen far below the margin of the test.
"""
MIN_SQUARE_DIFFERENCE = 0.2
"""Mean square of neighbours' differences, step², below which quantization hides repetition: four of five are equal."""
MAX_ITERATIONS = 200
"""Largest number of iterations for s; they converge linearly, slowest for coarse steps."""
SHAPE_SHARE = 0.6
"""Share of the correction for colour that is allowed as its error.

The correction is exact for normal noise; chosen so that noise of other distributions is not rejected.
"""


@dataclass(frozen=True)
class RepeatedSamples:
    """Test for samples that repeat the one before, and their share.

    Attributes
    ----------
    statistic : float
        Excess of equal neighbours in its own sd.
    p_value : float
        Chance of such an excess.
    fraction : float
        Share of samples that are repetitions.
    interval : (float, float)
        95 % interval of that.
    """

    statistic: float
    p_value: float
    fraction: float
    interval: tuple[float, float]


def chance_equality(s: FloatArray | float, step: float) -> FloatArray:
    """Return g(s) for differences of sd `s` through a quantizer of that step."""
    u = step / np.asarray(s, dtype=float)
    return np.asarray(erf(u / math.sqrt(2.0)) + 2.0 / (u * math.sqrt(2.0 * math.pi)) * np.expm1(-0.5 * u * u))


def find_repeated_samples(pieces: Sequence[FloatArray], steps: Sequence[float]) -> RepeatedSamples:
    """Test for samples that equal the one before in all the given channels at once.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n, k)
        Gap-free samples of k channels that are read together.
    steps : sequence of float
        Quantizer step of each channel, unit; 0 for none.

    Returns
    -------
    RepeatedSamples
        The test and the share of repeated samples.
    """
    return _fine(pieces, steps) or _by_lags(pieces, steps)


def _by_lags(pieces: Sequence[FloatArray], steps: Sequence[float]) -> RepeatedSamples:
    """Return the test of equalities at lag 1 by those at the other lags."""
    block = max(MIN_BLOCK_SAMPLES, sum(map(len, pieces)) // BLOCK_COUNT)
    rows = [_counts(piece, steps, block) for piece in pieces if len(piece) > MAX_LAG + MIN_BLOCK_SAMPLES // 2]
    if not rows or any(_hides(pieces, j, step) for j, step in enumerate(steps)):
        return RepeatedSamples(0.0, 1.0, 0.0, (0.0, 1.0))
    equal, ratio, pairs = (np.concatenate(part) for part in zip(*rows, strict=True))
    telling = np.all(np.isfinite(ratio), axis=1)
    if not telling.any():
        return RepeatedSamples(0.0, 1.0, 0.0, (0.0, 1.0))
    equal, ratio, pairs = equal[telling], ratio[telling], pairs[telling]
    colour = ratio.mean(axis=0)
    lags = _alike(colour)
    colour = colour[lags - 1]
    scaled = equal[:, lags] * ratio[:, lags - 1]
    margin = np.maximum(1.0 + SHAPE_SHARE * np.abs(colour - 1.0), 1.0 / colour)
    excess = equal[:, 0] - np.mean(scaled * margin, axis=1)
    first, later, n = float(equal[:, 0].sum()), float(equal[:, lags].sum()), float(pairs.sum())
    scatter = math.sqrt(len(excess)) * float(np.std(excess, ddof=1)) if len(excess) > 1 else n
    sd = max(scatter, math.sqrt(first), 1.0)
    statistic = float(excess.sum()) / sd
    if first > 1.0 and later == 0.0 and not any(steps) and _only_neighbours(pieces, first):
        p_value = min(_chance_of_neighbours(pieces), 1.0) ** first
    elif first + later < MIN_EQUALITIES:
        odds = float(np.sum(scaled * margin)) / later if later else float(np.mean(colour * margin))
        p_value = binomial_at_least(first, first + later, odds / (odds + len(lags)))
    else:
        p_value = student_beyond(statistic, max(len(excess) - 1, 1))
    shares = np.concatenate(([1.0], equal.sum(axis=0) / n))
    scale = np.array([scaled[:, i].sum() / max(equal[:, k].sum(), 1.0) for i, k in enumerate(lags)])
    return _with_share(statistic, p_value, shares, np.where(scale > 0.0, scale, colour), lags, sd / n)


def _only_neighbours(pieces: Sequence[FloatArray], equal: float) -> bool:
    """Return whether no other samples of the first channel are equal than so many neighbours."""
    values = np.concatenate([piece[:, 0] for piece in pieces])
    return len(values) - len(np.unique(values)) == equal


def _chance_of_neighbours(pieces: Sequence[FloatArray]) -> float:
    """Return how likely neighbours are the two of all samples that are equal: by their number and distance."""
    values = np.concatenate(list(pieces))
    closer = np.std(values, axis=0) / np.std(np.concatenate([np.diff(p, axis=0) for p in pieces]), axis=0)
    return float(np.prod(math.sqrt(2.0) * closer)) / (0.5 * len(values))


def _fine(pieces: Sequence[FloatArray], steps: Sequence[float]) -> RepeatedSamples | None:
    """Return the test of one channel by the counts of small differences; None where the quantizer is not fine."""
    if len(steps) > 1 or steps[0] <= 0.0:
        return None
    near, far = (
        float(np.sqrt(np.mean(np.concatenate([(p[lag:, 0] - p[:-lag, 0]) ** 2 for p in pieces]))))
        for lag in (1, 2)
    )
    spread = near / steps[0]
    block = max(MIN_BLOCK_SAMPLES, sum(map(len, pieces)) // BLOCK_COUNT)
    if spread < MIN_FINE_SD:
        return None
    white = abs(far / near - 1.0) < LAG_TOLERANCE
    reach = max(round(min(spread if white else MAX_COLOURED_DIFFERENCE * spread, MAX_DIFFERENCE_STEPS)), 2)
    long = [piece[:, 0] for piece in pieces if len(piece) >= block + MAX_LAG]
    if not long:
        return None
    rows = np.concatenate([_differences(y, steps[0], reach, block) for y in long]).astype(float)
    counts = rows.sum(axis=0)
    if len(rows) < 2 or counts.min() < MIN_EQUALITIES:
        return None
    j = np.arange(1.0, reach + 1.0)
    weight = np.linalg.pinv(np.stack((np.ones(reach), j * j), axis=1))[0]
    chance = np.exp(np.log(0.5 * counts[:, 1:]) @ weight)
    excess = rows[:, :, 0] - (rows[:, :, 1:] * (weight / counts[:, 1:])).sum(axis=2) * chance
    lags = _alike(chance[0] / chance[1:])
    ratio, n = chance[0] / chance[lags], len(rows) * block
    repeated = excess[:, 0] - np.mean(ratio * excess[:, lags], axis=1)
    total, sd = float(repeated.sum()), math.sqrt(len(repeated)) * float(np.std(repeated, ddof=1))
    shares = np.concatenate(([1.0], excess.sum(axis=0) / n))
    return _with_share(total / sd, student_beyond(total / sd, len(repeated) - 1), shares, ratio, lags, sd / n)


def _with_share(
    statistic: float, p_value: float, shares: FloatArray, ratio: FloatArray, lags: IntArray, sd: float
) -> RepeatedSamples:
    """Return the test with the share of repeated samples, from the shares of equal pairs at lags 0, 1 and on."""
    free = max(1.0 - float(np.mean(ratio * shares[lags])), 1e-3)
    most = max(float(shares[1]), 0.0)
    fraction = min(max((shares[1] - float(np.mean(ratio * shares[lags + 1]))) / free, 0.0), most)
    half = normal_reach(0.95) * sd / free
    return RepeatedSamples(
        statistic, p_value, fraction, (max(fraction - half, 0.0), min(fraction + half, 1.0))
    )


def _alike(ratio: FloatArray) -> IntArray:
    """Return the lags, less 1, that estimate chance as lag 2 does, by R of the lags from 2 on."""
    return 1 + np.flatnonzero(np.abs(ratio / ratio[0] - 1.0) < LAG_TOLERANCE)


def _edges(n: int, block: int) -> IntArray:
    """Return where the blocks of n pairs begin: about `block` in each."""
    return np.linspace(0, n, max(1, n // block) + 1)[:-1].astype(int)


def _differences(y: FloatArray, step: float, reach: int, block: int) -> IntArray:
    """Return how many samples of each block differ by 0, ±1 … ±reach steps from those 1 … `MAX_LAG` before."""
    number = (len(y) - MAX_LAG) // block
    last = MAX_LAG + number * block
    start = (reach + 2) * np.repeat(np.arange(number), block)
    rows = np.empty((number, MAX_LAG, reach + 1), dtype=np.int64)
    for lag in range(1, MAX_LAG + 1):
        size = np.minimum(
            np.abs(np.round((y[MAX_LAG:last] - y[MAX_LAG - lag : last - lag]) / step)), reach + 1
        )
        counts = np.bincount(start + size.astype(np.int64), minlength=number * (reach + 2))
        rows[:, lag - 1] = counts.reshape(number, reach + 2)[:, : reach + 1]
    return rows


def _hides(pieces: Sequence[FloatArray], column: int, step: float) -> bool:
    """Return whether the quantizer is so coarse that equal neighbours are the rule."""
    if step == 0.0:
        return False
    squares = np.concatenate([np.diff(piece[:, column]) ** 2 for piece in pieces])
    return bool(np.mean(squares) < MIN_SQUARE_DIFFERENCE * step**2)


def _counts(y: FloatArray, steps: Sequence[float], block: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return equalities at lags 1 … `MAX_LAG`, (blocks, lags), R of lags 2 …, (blocks, lags − 1), and numbers of pairs.

    R is not finite where a block has no information on it.
    """
    edges = _edges(len(y) - MAX_LAG, block)
    pairs = np.diff(edges, append=len(y) - MAX_LAG).astype(float)
    equal, chance = np.empty((len(edges), MAX_LAG)), np.ones((len(edges), MAX_LAG))
    moving, square = np.empty((2, len(edges), MAX_LAG, len(steps)))
    for at, (first, number) in enumerate(zip(edges.tolist(), pairs.astype(int).tolist(), strict=True)):
        here = y[
            first : first + number + MAX_LAG
        ]  # a block at a time: what is computed from it stays in the cache
        for lag in range(1, MAX_LAG + 1):
            moved = here[MAX_LAG:] - here[MAX_LAG - lag : number + MAX_LAG - lag]
            changed = moved != 0.0
            equal[at, lag - 1] = number - np.count_nonzero(changed.any(axis=1))
            moving[at, lag - 1] = np.count_nonzero(changed, axis=0)
            square[at, lag - 1] = np.einsum("nk,nk->k", moved, moved)
    square /= np.where(moving > 0.0, moving, np.nan)
    for j, step in enumerate(steps):
        for lag in range(MAX_LAG):
            own = square[:, lag, j]
            chance[:, lag] *= _chance(own, step) if step > 0 else 1.0 / np.sqrt(own)
    return equal, chance[:, :1] / chance[:, 1:], pairs


def _chance(square: FloatArray, step: float) -> FloatArray:
    """Return g of the noise whose differences that are not zero have these mean squares.

    The mean square of all differences is s² + D²/6 = (1 − g(s)) · square, solved by iteration.
    """
    g = np.zeros_like(square)
    for _ in range(MAX_ITERATIONS):
        last = g
        variance = np.maximum((1.0 - g) * square - step**2 / 6.0, 0.01 * step**2)
        g = chance_equality(np.sqrt(variance), step)
        if not np.any(np.abs(g - last) > 1e-9):
            break
    return g
