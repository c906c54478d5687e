"""The quantizer of a sensor: its step, its dead band, its missing codes.

A converter of step D returns y = D round(x/D). Adjacent values of the data differ by whole steps; the step is
their greatest common divisor. As long as D ≤ 2σ, with σ the white sd of a sample, quantization adds D²/12 to
the variance and nothing else [1]_: that is a note, not a finding. What is a finding:

- a coarser step: the error is no longer independent of the signal;
- a code without samples between two that have many, unless they are close against σ: a histogram without a
  hole there has at least half the lesser of the two, so that the chance of none is exp(−min/2) by Poisson;
- a dead band |x| < b that reads 0: code 0 stands out, and has such holes beside it, or, for b ≤ D, more
  samples than the parabola through the logarithms of the counts of codes ±1 and ±2 allows (exact for a
  Gaussian);
- codes of uneven width (differential nonlinearity): the logarithms of five neighbouring counts do not lie on one smooth
  curve. What a smooth law itself leaves of the fourth difference falls by 16 from pairs of codes to single ones, while
  that of uneven widths does not.

References
----------
.. [1] B. Widrow, I. Kollár, Quantization Noise, 2008 (the conditions of Sheppard's correction).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import brentq

from models.arrays import FloatArray
from models.probability import chi2_beyond, normal_beyond, normal_reach, rounding_variance

MAX_VALUES = 200_000
"""Samples from which the step is found; chosen to bound the time: they meet every frequent code."""
MIN_CODE_SHARE = 0.97
"""Share of the samples whose values must be whole steps; the rest may be interpolated over gaps."""
MAX_CODE_DISTANCE = 0.1
"""Distance from a code, steps, from which a sample counts as interpolated; decimal rounding moves it by 2 % at most."""
MEAN_WINDOW = 257
"""Width of the moving mean that separates slow from fast noise, samples.

Chosen wide: it takes 1/257 of the variance of white noise, and an odd width keeps the phase.
"""
MIN_NOISE_VARIANCE = 0.01
"""Least variance of the noise beside quantization, step².

A white sd of a tenth of a step, below which it is not seen.
"""
MIN_CODE_COUNT = 30
"""Samples in a code from which a missing code beside it is tested: exp(−30/2) = 3e-7 by Poisson."""
MAX_CODES = 1e6
"""Codes in the range above which they are digits of arithmetic, not of a converter (20 bits)."""
MAX_HOLE_LENGTH = 16
"""Longest run of missing codes that counts as a hole, codes; longer ones separate spikes from the noise."""
HARMLESS_DISTANCE = 0.1
"""Distance of two codes, σ, below which a hole between them does no harm: its D²/12 is 0.1 % of the variance."""
MIN_PEAK_RATIO = 1.5
"""Samples of code 0 ÷ those of any other near it from which a dead band is tested: one of b = D doubles them."""
MIN_LOG_EXCESS = np.log(1.5)
"""Log excess of zeros that noise of other than normal shape may have; `MIN_PEAK_RATIO` in the logarithm."""
SMOOTH_SHARE = 1.0 / 8.0
"""Fourth difference of single codes ÷ that of pairs, up to which it is that of a law: half of 1/16 more than that."""
MIN_UNEVENNESS = 0.1
"""Relative sd of the widths of codes that is a finding: it adds 1 % to the variance of rounding."""
MAX_EVEN_CHANCE = 0.05
"""Chance of such counts of even codes below which the widths may differ: one even converter in twenty."""
MIN_UNEVEN_STEP, MAX_UNEVEN_STEP = 0.1, 0.8
"""Step ÷ sd of the fast noise: below, widths do no harm, as missing codes do none; above, no five codes are filled."""
MAX_FILLED = 20.0
"""Range of the codes with samples ÷ sd of the fast noise above which the level moves: its rests look like widths."""
MIN_COUNT_RATIO = 0.5
"""Least counts of codes ±2 ÷ those of codes ±1 for which five codes lie on a parabola (step 0.7 σ)."""
DIFFERENCE_WEIGHTS = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""Weights of the fourth difference, of which the middle one is 1: they leave no cubic."""


@dataclass(frozen=True)
class Codes:
    """Quantizer of a channel as its samples show it.

    Attributes
    ----------
    white_sd : float
        White sd of a sample without the rounding, unit; at least a tenth of the step.
    coarse : bool
        Whether the step exceeds two white sd.
    deadband : float
        Half-width b of the dead band, unit; 0 for none.
    missing : int
        Codes that never come between codes that often do.
    p_value : float
        P-value of the least likely hole or excess, times the codes tested; else of the scatter of widths.
    unevenness : float
        Relative sd of the widths of the codes; 0 where they are alike.
    """

    white_sd: float
    coarse: bool
    deadband: float
    missing: int
    p_value: float
    unevenness: float = 0.0


def quantizer_step(pieces: Sequence[FloatArray], samples_a_mean: int = 1) -> float:
    """Return the quantizer step of which all values are multiples, unit; 0 where there is none.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        Samples; steps may carry the rounding of a decimal print-out (2 % of a step). The rarest 3 % of the
        samples may lie between codes, as interpolated ones do, where codes are so few that they repeat.
    samples_a_mean : int
        Samples of which each value is the mean: those of samples in single precision carry its rounding.
    """
    some = np.concatenate([piece[:MAX_VALUES] for piece in pieces])[:MAX_VALUES]
    values, count = np.unique(some, return_counts=True)
    descending = np.sort(count)[::-1]
    frequent = count >= descending[np.searchsorted(descending.cumsum(), MIN_CODE_SHARE * count.sum())]
    values = values[frequent] if np.count_nonzero(frequent) > 1 else values
    if len(values) < 2:
        return 0.0
    largest = np.abs(values).max()
    kinds = (np.float64, np.float32) if samples_a_mean > 1 else (np.float64,)
    found = (_step_of(values, 8.0 * float(np.spacing(kind(largest)))) for kind in kinds)
    return next((step for step in found if step), 0.0)


def _step_of(values: FloatArray, grain: float) -> float:
    """Return the step of sorted values that arithmetic has moved by no more than a grain; 0 where there is none.

    Values of one code lie within it: sums of numbers in single precision do in its grain, not in that of doubles.
    """
    gaps = np.diff(values)
    apart = gaps > grain
    if not apart.any():
        return 0.0
    if not apart.all():
        ends = np.append(np.flatnonzero(apart), len(gaps))
        if np.any(values[ends] - values[np.append(0, ends[:-1] + 1)] > grain):
            return 0.0
        gaps = gaps[apart]
    least = float(gaps.min())
    for divisor in range(1, 7):
        step = least / divisor
        for _ in range(3):
            whole = np.maximum(np.round(gaps / step), 1.0)
            near = whole <= 1000
            step = float(gaps[near].sum() / whole[near].sum())
        if step > max(4.0 * grain, np.ptp(values) / MAX_CODES) and np.all(
            np.abs(gaps - whole * step)[near] < 0.02 * step + grain
        ):
            return step
    return 0.0


def fast_part(piece: FloatArray) -> FloatArray:
    """Return a gap-free piece (n,) less its moving mean, scaled to keep the variance of white noise."""
    width = min(MEAN_WINDOW, len(piece))
    mean: FloatArray = uniform_filter1d(piece, width, mode="reflect")
    noise: FloatArray = (piece - mean) / np.sqrt(1.0 - 1.0 / max(width, 2))
    return noise


def read_codes(pieces: Sequence[FloatArray], step: float, samples_a_mean: int = 1) -> Codes:
    """Estimate noise, dead band and missing codes of the quantizer of one channel.

    Means of several samples show the noise of these and how coarse their codes are, but no dead band and no missing
    code: what a sample may not be, a mean is.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        Gap-free samples of the channel.
    step : float
        Distance of the codes of a sample, unit.
    samples_a_mean : int
        Samples in each of the `pieces`' values.

    Returns
    -------
    Codes
        Coarseness, dead band and holes.
    """
    y = np.concatenate(pieces)
    variance = samples_a_mean * float(np.mean(np.concatenate([fast_part(p) for p in pieces]) ** 2))
    white_sd = float(np.sqrt(max(variance - rounding_variance(step), MIN_NOISE_VARIANCE * step**2)))
    coarse = step > 2.0 * white_sd
    if np.ptp(y) / step > MAX_CODES or samples_a_mean > 1:
        return Codes(white_sd, coarse, 0.0, 0, 1.0)
    origin = float(np.partition(y, len(y) // 2)[len(y) // 2])
    place = (y - origin) / step
    code = np.round(place)
    code = code[np.abs(place - code) < MAX_CODE_DISTANCE].astype(np.int64)
    low = int(code.min())
    count = np.bincount(code - low)
    if coarse:
        zero = round(-origin / step) - low
        inside = 0 <= zero < len(count) and np.count_nonzero(y == 0.0) >= MIN_CODE_COUNT
        return Codes(white_sd, coarse, step * _gap(count, zero) if inside else 0.0, 0, 1.0)
    holes, p_hole = _holes(count, HARMLESS_DISTANCE * white_sd / step)
    zero = round(-origin / step) - low
    deadband, p_zero = 0.0, 1.0
    if 0 <= zero < len(count) and np.count_nonzero(y == 0.0) >= MIN_CODE_COUNT and _stands_out(count, zero):
        beside, p_zero = _holes(count[max(zero - MAX_HOLE_LENGTH, 0) : zero + MAX_HOLE_LENGTH + 1], 0.0)
        is_dead = bool({-1, 1} & set((beside - min(zero, MAX_HOLE_LENGTH)).tolist()))
        if not is_dead:
            p_zero = _zero_excess(count, zero)
        if is_dead or p_zero < 1e-3:
            deadband = step * _deadband(count, zero)
    p_value = min(1.0, len(count) * min(p_hole, p_zero))
    uneven = 0.0
    quiet = float(np.median([np.median(np.abs(fast_part(p))) for p in pieces])) / normal_reach(0.5)
    filled = np.count_nonzero(count >= MIN_CODE_COUNT) * step
    if (
        p_value == 1.0
        and MIN_UNEVEN_STEP * quiet < step < MAX_UNEVEN_STEP * quiet
        and filled < MAX_FILLED * quiet
    ):
        uneven, p_uneven = _unevenness(count)
        p_value, uneven = (p_uneven, uneven) if uneven > MIN_UNEVENNESS else (p_value, 0.0)
    return Codes(white_sd, coarse, deadband, len(holes), p_value, uneven)


def may_be_uneven(y: FloatArray, step: float) -> bool:
    """Return whether the codes of samples (n,) may differ in width by `MIN_UNEVENNESS`, which makes another law.

    They seem to, or those with samples are too few to show it. Widths far below the noise, and those over which a level
    moves, do no harm.
    """
    quiet = float(np.median(np.abs(fast_part(y)))) / normal_reach(0.5)
    place = (y - np.median(y)) / step
    code = np.round(place)
    code = code[np.abs(place - code) < MAX_CODE_DISTANCE].astype(np.int64)
    if step <= MIN_UNEVEN_STEP * quiet or not len(code) or np.ptp(code) > MAX_CODES:
        return False
    count = np.bincount(code - code.min())
    if np.count_nonzero(count >= MIN_CODE_COUNT) * step >= MAX_FILLED * quiet:
        return False
    uneven, chance = _unevenness(count)
    return chance == 1.0 or (uneven > MIN_UNEVENNESS and chance < MAX_EVEN_CHANCE)


def _unevenness(count: NDArray[np.int64]) -> tuple[float, float]:
    """Return the relative sd of the widths of codes with these counts, and the chance of such counts of even ones.

    The third of the codes that is farthest off is left out: laws have edges, widths differ everywhere. Five differences
    beside each other count as one: a fifth of the sum of squares is at most χ² of a fifth of their number.
    """
    size = len(count) // 2
    pairs = count[: 2 * size].reshape(size, 2).sum(axis=1)
    smooth, noise = _fourth_differences(pairs)
    if not len(smooth):
        return 0.0, 1.0
    law = SMOOTH_SHARE**2 * float(np.mean(smooth**2))
    excess, noise = _fourth_differences(count)
    square = excess**2 / (noise + law)
    most = np.sort(square)[: -(len(square) // 3) or None]
    apart = chi2_beyond(float(most.sum()) / len(DIFFERENCE_WEIGHTS), len(most) / len(DIFFERENCE_WEIGHTS))
    own = float(DIFFERENCE_WEIGHTS @ DIFFERENCE_WEIGHTS)
    variance = float(np.median(excess**2)) / normal_reach(0.5) ** 2 - float(np.median(noise)) - law
    return float(np.sqrt(max(variance / own, 0.0))), apart


def _fourth_differences(count: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Return how far the log of each count is from the cubic through four filled ones beside it, and variances."""
    if len(count) < len(DIFFERENCE_WEIGHTS):
        return np.empty(0), np.empty(0)
    five = sliding_window_view(count, 5)
    five = five[five.min(axis=1) >= MIN_CODE_COUNT]
    return np.log(five) @ DIFFERENCE_WEIGHTS, (1.0 / five) @ DIFFERENCE_WEIGHTS**2


def _holes(count: NDArray[np.int64], width: float) -> tuple[NDArray[np.intp], float]:
    """Return the empty codes between well-filled ones, and the p-value of the least likely of them.

    Holes between codes closer than `width` codes do not count.
    """
    filled = np.flatnonzero(count)
    empty = np.flatnonzero(count == 0)
    empty = empty[(empty > filled[0]) & (empty < filled[-1])]
    after = np.searchsorted(filled, empty)
    left, right = filled[after - 1], filled[after]
    least = np.minimum(count[left], count[right])
    hole = (least >= MIN_CODE_COUNT) & (right - left <= MAX_HOLE_LENGTH) & (right - left >= width)
    return empty[hole], float(np.exp(-0.5 * least[hole].max())) if hole.any() else 1.0


def _stands_out(count: NDArray[np.int64], zero: int) -> bool:
    """Return whether code 0 has half as many samples again as any other near it."""
    around = count[max(zero - MAX_HOLE_LENGTH, 0) : zero + MAX_HOLE_LENGTH + 1].copy()
    around[min(zero, MAX_HOLE_LENGTH)] = 0
    return bool(count[zero] > MIN_PEAK_RATIO * around.max())


def _zero_excess(count: NDArray[np.int64], zero: int) -> float:
    """Return the chance of so many zeros, given the counts of codes ±1 and ±2."""
    if not 2 <= zero < len(count) - 2:
        return 1.0
    near, far = count[[zero - 1, zero + 1]], count[[zero - 2, zero + 2]]
    if min(near.min(), far.min()) < MIN_CODE_COUNT or far.sum() < MIN_COUNT_RATIO * near.sum():
        return 1.0
    excess = np.log(count[zero]) - (4.0 * np.log(near).mean() - np.log(far).mean()) / 3.0
    variance = 1.0 / count[zero] + 4.0 / 9.0 * np.sum(1.0 / near) + np.sum(1.0 / far) / 36.0
    return normal_beyond(float((excess - MIN_LOG_EXCESS) / np.sqrt(variance)))


def _gap(count: NDArray[np.int64], zero: int) -> float:
    """Return the half-width in steps of a dead band that leaves codes beside 0 empty; 0 where there is none."""
    beside = [np.flatnonzero(side[:MAX_HOLE_LENGTH]) for side in (count[zero + 1 :], count[:zero][::-1])]
    first = [int(side[0]) for side in beside if len(side)]
    return float(min(first)) + 0.5 if first and min(first) > 0 else 0.0


def _deadband(count: NDArray[np.int64], zero: int) -> float:
    """Return the half-width of the dead band, steps: between it and the next code that is whole lies the rest of one.

    Mean and sd are those of the normal law with as many samples beyond that code on either side as there are, and the
    half-width b that with which it has as many zeros. Without samples there it is the band that leaves codes empty.
    """
    sides = (count[zero + 1 :], count[:zero][::-1])
    first = [int(np.flatnonzero(side)[0]) for side in sides if side.any()]
    if not first:
        return 0.0
    whole = max(first) + 1
    beyond = [int(side[whole:].sum()) for side in sides]
    if min(beyond) < MIN_CODE_COUNT:
        return float(np.mean(first)) + 0.5
    high, low = (normal_reach(1.0 - 2.0 * part / int(count.sum())) for part in beyond)
    edge = whole + 0.5
    sd = 2.0 * edge / (high + low)
    mean = edge - sd * high
    share = count[zero] / count.sum()
    return float(
        brentq(
            lambda b: 1.0 - normal_beyond((b - mean) / sd) - normal_beyond((b + mean) / sd) - share, 0.0, edge
        )
    )
