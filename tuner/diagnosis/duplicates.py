"""Held readings: samples that repeat the one before.

On a lattice neighbours are equal by chance. Rounded to a step D, two values whose difference is normal of sd
s are equal with the probability ::

    g(s) = E max(0, 1 − |d|/D) = erf(D/(s√2)) − (2s/(D√(2π))) (1 − exp(−D²/(2s²)))

A held sample equals its neighbour but not the one before that, so equality at lag 1 is tested against
equality at lag 2. Coloured noise has other differences at lag 2 than at lag 1: the expectation is scaled by
R = g(s₁)/g(s₂), with a margin in proportion to that correction, and by no less than 1. Only differences that
are not zero tell s, so that holding does not change R. Counts and scales are taken in blocks: a change of the
noise along the record does no harm, and their scatter gives the test, a Student t over blocks, or the exact
binomial where equalities are few. Where the step exceeds about 4 s₁ equalities cannot tell holding from the
lattice.

On a fine lattice (s₁ of two steps and more) the counts n(k) of neighbours that differ by k steps tell chance without
the noise: their logarithm is a parabola in k near 0, and its value there, from k = ±1 … ±K, is what noise gives. What
the codes themselves do to n(0) they do at lag 2 as well::

    f n = n₁(0) − n̂₁(0) − (n̂₁(0)/n̂₂(0)) (n₂(0) − n̂₂(0) − f² n),    f n ≤ n₁(0) − n̂₁(0)

Elsewhere, with a share f of held samples, the shares of equal pairs are n₁ = f + (1 − f) P₁ and
n₂ = f n₁ + (1 − f) P₂, where P₁ = R P₂ is chance; hence f = (n₁ − R n₂)/(1 − R n₁), and never more than n₁.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, norm, t

FloatArray = NDArray[np.float64]

BLOCKS = 200
"""Blocks that a record is cut into."""
LEAST_BLOCK = 100
"""Least length of a block, samples."""
FEW = 400
"""Equalities below which the binomial test stands in for the scatter of the blocks."""
WIDEST = 8
"""Largest difference that tells how many are 0 by chance, steps."""
COARSE = 0.2
"""Mean square of neighbours' differences, step², below which a lattice hides what is held."""
SHAPE = 0.6
"""Share of the correction for colour that is left to the shape of the noise."""


@dataclass(frozen=True)
class Held:
    """How many samples repeat the one before.

    Attributes
    ----------
    statistic : float
        Excess of equal neighbours in its own sd.
    p_value : float
        Chance of such an excess.
    fraction : float
        Share of samples that are held.
    interval : (float, float)
        95 % interval of that.
    """

    statistic: float
    p_value: float
    fraction: float
    interval: tuple[float, float]


def chance_equality(s: float, step: float) -> float:
    """Return g(s) for differences of sd `s` on a lattice of that step."""
    u = step / s
    return math.erf(u / math.sqrt(2.0)) + 2.0 / (u * math.sqrt(2.0 * math.pi)) * math.expm1(-0.5 * u * u)


def held_readings(pieces: Sequence[FloatArray], steps: Sequence[float]) -> Held:
    """Test for samples that equal the one before in all the given channels at once.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n, k)
        Gap-free samples of k channels that are read together.
    steps : sequence of float
        Lattice step of each channel, unit; 0 for none.

    Returns
    -------
    Held
        The test and the share of held samples.
    """
    return _fine(pieces, steps) or _by_lags(pieces, steps)


def _by_lags(pieces: Sequence[FloatArray], steps: Sequence[float]) -> Held:
    """Return the test of equalities at lag 1 by those at lag 2."""
    block = max(LEAST_BLOCK, sum(map(len, pieces)) // BLOCKS)
    rows = [_counts(p[i : i + block + 2], steps) for p in pieces for i in range(0, len(p) - 2, block)]
    rows = [row for row in rows if row[3] >= LEAST_BLOCK // 2]
    if not rows or any(_hides(pieces, j, step) for j, step in enumerate(steps)):
        return Held(0.0, 1.0, 0.0, (0.0, 1.0))
    equal1, equal2, ratio, pairs = np.array(rows).T
    n1, n2, n = float(equal1.sum()), float(equal2.sum()), float(pairs.sum())
    colour = float(np.mean(ratio))
    margin = max(1.0 + SHAPE * abs(colour - 1.0), 1.0 / colour)
    excess = equal1 - equal2 * ratio * margin
    scatter = math.sqrt(len(rows)) * float(np.std(excess, ddof=1)) if len(rows) > 1 else n
    sd = max(scatter, math.sqrt(n1), 1.0)
    statistic = float(excess.sum()) / sd
    r = float(equal2 @ ratio) / n2 if n2 else colour
    if n1 + n2 < FEW:
        p_value = float(binom.sf(n1 - 1, n1 + n2, r * margin / (1.0 + r * margin)))
    else:
        p_value = float(t.sf(statistic, max(len(rows) - 1, 1)))
    free = max(1.0 - r * n1 / n, 1e-3)
    fraction = min(max((n1 - r * n2) / n / free, 0.0), n1 / n)
    half = float(norm.ppf(0.975)) * sd / n / free
    return Held(statistic, p_value, fraction, (max(fraction - half, 0.0), min(fraction + half, 1.0)))


def _fine(pieces: Sequence[FloatArray], steps: Sequence[float]) -> Held | None:
    """Return the test of one channel by the counts of small differences; None where the lattice is not fine."""
    if len(steps) > 1 or steps[0] <= 0.0:
        return None
    square = np.mean(np.concatenate([np.diff(p[:, 0]) ** 2 for p in pieces]))
    reach = int(min(0.5 * float(np.sqrt(square)) / steps[0], WIDEST))
    block = max(LEAST_BLOCK, sum(map(len, pieces)) // BLOCKS)
    if reach < 1:
        return None
    reach = max(reach, 2)
    rows = np.array(
        [
            [_differences(p[i : i + block + 2, 0], lag, steps[0], reach) for lag in (1, 2)]
            for p in pieces
            for i in range(0, len(p) - block - 1, block)
        ],
        dtype=float,
    )
    if len(rows) < 2 or rows.sum(axis=0).min() < FEW:
        return None
    k = np.arange(1.0, reach + 1.0)
    weight = np.linalg.pinv(np.stack((np.ones(reach), k * k), axis=1))[0]
    counts = rows.sum(axis=0)
    chance = np.exp(np.log(0.5 * counts[:, 1:]) @ weight)
    excess = rows[:, :, 0] - (rows[:, :, 1:] * (weight / counts[:, 1:])).sum(axis=2) * chance
    ratio, n = float(chance[0] / chance[1]), len(rows) * block
    held = excess[:, 0] - ratio * excess[:, 1]
    total, sd = float(held.sum()), math.sqrt(len(held)) * float(np.std(held, ddof=1))
    most, fraction = max(float(excess[:, 0].sum()) / n, 0.0), 0.0
    for _ in range(100):
        fraction = min(max(total / n + ratio * fraction**2, 0.0), most)
    half = float(norm.ppf(0.975)) * sd / n / max(1.0 - 2.0 * ratio * fraction, 0.2)
    interval = (max(fraction - half, 0.0), min(fraction + half, 1.0))
    return Held(total / sd, float(t.sf(total / sd, len(held) - 1)), fraction, interval)


def _differences(y: FloatArray, lag: int, step: float, reach: int) -> NDArray[np.int64]:
    """Return how many samples differ by 0, ±1 … ±reach steps from the one `lag` before."""
    size = np.abs(np.round((y[2:] - y[2 - lag : len(y) - lag]) / step)).astype(np.int64)
    return np.bincount(np.minimum(size, reach + 1), minlength=reach + 2)[: reach + 1]


def _hides(pieces: Sequence[FloatArray], column: int, step: float) -> bool:
    """Tell whether the lattice is so coarse that equal neighbours are the rule."""
    squares = np.concatenate([np.diff(piece[:, column]) ** 2 for piece in pieces])
    return bool(np.mean(squares) < COARSE * step**2)


def _counts(y: FloatArray, steps: Sequence[float]) -> tuple[float, float, float, float]:
    """Return equalities at lags 1 and 2, R, and the number of pairs of a block (0 where it cannot tell)."""
    lags = y[2:] - y[1:-1], y[2:] - y[:-2]
    ratio = 1.0
    for j, step in enumerate(steps):
        moving = [d[d[:, j] != 0.0, j] for d in lags]
        if not all(map(len, moving)):
            return 0.0, 0.0, 1.0, 0.0
        square1, square2 = (float(np.mean(d**2)) for d in moving)
        if step > 0:
            ratio *= _chance(square1, step) / _chance(square2, step)
        else:
            ratio *= math.sqrt(square2 / square1)
    equal1, equal2 = (float(np.count_nonzero(np.all(d == 0.0, axis=1))) for d in lags)
    return equal1, equal2, ratio, float(len(y) - 2)


def _chance(square: float, step: float) -> float:
    """Return g of the noise whose differences that are not zero have this mean square.

    The mean square of all differences is s² + D²/6 = (1 − g(s)) · square, solved by iteration.
    """
    g, last = 0.0, 1.0
    while abs(g - last) > 1e-9:
        last = g
        g = chance_equality(math.sqrt(max((1.0 - g) * square - step**2 / 6.0, 0.01 * step**2)), step)
    return g
