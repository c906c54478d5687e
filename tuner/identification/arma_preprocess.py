"""Preparing a record for a time-series model, and the tests that say whether it was worth preparing.

The steps of MEMS papers in their order: outliers, mean, trend, then tests of stationarity. Every step says in
words and figures what it did.

- Outliers: |y − local median| beyond what normal noise reaches in one series of a hundred, in robust standard
  deviations (median absolute deviation × 1.4826: 5.0 of 20 000 samples, 5.7 of a million); the
  rule of 3 standard deviations, kept for comparison, takes 0.27 % of clean Gaussian data and 1.3 % of its
  deviation. Outliers are replaced by interpolation: deletion would break the time base.
- Trend: a straight line by least squares. On a random walk that is not harmless: it takes 7, 17, 41 % of
  the Allan variance at 5, 10, 20 % of the record. The prepared series serves time-series models only,
  never K.
- Reverse arrangements: of I group means u, A = #{i < j: u_i > u_j} has mean I(I − 1)/4 and variance
  I(2I² + 3I − 5)/72 where there is no monotone trend; |A − mean| is reduced by ½ for continuity. After a
  detrend it sees next to nothing, so the unit-root tests (ADF: null unit root; KPSS: null stationary) and a
  test of constant variance stand beside it.

References
----------
.. [1] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., section 4.5 (reverse arrangements).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import LEAST_DIVISOR, FloatArray
from models.probability import normal_beyond, normal_reach, same_mean
from models.robust import normal_sd
from tuner.identification.unit_root import LEVEL_CHANCES, dickey_fuller, steady_level
from tuner.types import SeriesTest

OUTLIER_CHANCE = 0.01
"""Chance that any sample of normal noise is replaced: one in its place adds a step that differenced noise never has."""
PAPER_SIGMAS = 3.0
TREND_TEST_GROUPS = 10
"""Groups of the reverse-arrangements and variance tests."""
_BLOCKS_A_GROUP = 20
"""Blocks of a group, whose variances the test of constant variance compares."""

_MEDIAN_BLOCK = 101
"""Samples a block of the local median."""

TEST_SIZE, STRICT_SIZE = 0.05, 0.01
"""Sizes of the tests: the usual one, and that of the variance, which noise of any law must pass."""
TABULATED = LEVEL_CHANCES[-1], LEVEL_CHANCES[0]
"""Chances between which those of a steady level are tabulated."""
_UNIT_ROOT_POINTS = 2000
"""Block means that the unit-root tests look at: they are about slow behaviour, and their cost grows."""


@dataclass(frozen=True)
class Prepared:
    """Stretches of a series ready for a time-series model.

    Attributes
    ----------
    pieces : tuple of ndarray, shape (n_i,)
        Samples without outliers, each without its mean, and all without one line.
    steps : tuple of str
        What was done and found, in words.
    """

    pieces: tuple[FloatArray, ...]
    steps: tuple[str, ...]


def prepare(pieces: Sequence[FloatArray], unit: str = "") -> Prepared:
    """Remove outliers, the mean of each stretch, and one line of all.

    A line of each stretch would take what a model of the whole has at low frequencies.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Samples without gaps, n_i ≥ 20.
    unit : str
        Of the samples, for the words.
    """
    n = sum(map(len, pieces))
    reach = normal_reach(1.0 - OUTLIER_CHANCE / n)
    marked = [robust_outliers(y, reach) for y in pieces]
    clean = [replace_outliers(y, which) for y, which in zip(pieces, marked, strict=True)]
    centred = [y - y.mean() for y in clean]
    times = [np.arange(len(y)) - 0.5 * (len(y) - 1) for y in clean]
    slope = sum(float(t @ y) for t, y in zip(times, centred, strict=True)) / sum(float(t @ t) for t in times)
    left = [y - slope * t for t, y in zip(times, centred, strict=True)]
    sds = [
        float(np.sqrt(sum(np.sum((y - y.mean()) ** 2) for y in each) / n)) for each in (pieces, clean, left)
    ]
    steps = (
        f"outliers: {sum(int(which.sum()) for which in marked)} of {n} samples beyond {reach:.3g} robust standard "
        f"deviations replaced by interpolation (normal noise has one in {OUTLIER_CHANCE:.0%} of such series; 3 sds "
        f"would take {sum(int(sigma_outliers(y).sum()) for y in pieces)}); standard deviation "
        f"{sds[0]:.4g} → {sds[1]:.4g} {unit}",
        f"mean: {sum(float(y.sum()) for y in clean) / n:.4g} {unit} removed"
        + " of each stretch" * (len(pieces) > 1),
        f"trend: {slope * n:+.3g} {unit} over the record removed; standard deviation {sds[1]:.4g} → {sds[2]:.4g} "
        f"{unit}; a random walk loses 17 % of its Allan variance at a tenth of the record by it: K is read from the "
        "series before",
    )
    return Prepared(tuple(left), steps)


def sigma_outliers(y: FloatArray) -> NDArray[np.bool_]:
    """Mark samples further than three standard deviations from the mean, once (the rule of the papers)."""
    return np.asarray(np.abs(y - np.mean(y)) > PAPER_SIGMAS * np.std(y))


def robust_outliers(y: FloatArray, reach: float) -> NDArray[np.bool_]:
    """Mark samples further than so many robust standard deviations from the local median."""
    residual = y - _local_median(y)
    scale = float(normal_sd(residual))
    if scale == 0.0:  # more than half of the samples on one quantization level: a level is not an outlier
        away = np.abs(residual[residual != 0.0])
        scale = max(float(np.std(residual)), float(np.min(away, initial=np.inf)))
    return np.asarray(np.abs(residual) > reach * scale)


def replace_outliers(y: FloatArray, marked: NDArray[np.bool_]) -> FloatArray:
    """Return y with marked samples interpolated between their unmarked neighbours."""
    if not marked.any() or marked.all():
        return y.copy()
    clean = y.copy()
    index = np.arange(len(y))
    clean[marked] = np.interp(index[marked], index[~marked], y[~marked])
    return clean


def remove_trend(y: FloatArray) -> tuple[float, FloatArray]:
    """Return the least-squares slope, unit a sample, and y without that line."""
    time = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(time @ y / (time @ time))
    return slope, y - slope * time


def reverse_arrangements(y: FloatArray) -> SeriesTest:
    """Test for a monotone trend by the order of group means.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Samples; the last n mod I of I groups are left out.

    Returns
    -------
    SeriesTest
        Z with the continuity correction, and its two-sided probability.
    """
    groups = TREND_TEST_GROUPS
    means = _groups(y, groups).mean(axis=1)
    count = int(np.sum(np.triu(means[:, None] > means[None, :], 1)))
    excess = count - groups * (groups - 1) / 4.0
    variance = groups * (2.0 * groups**2 + 3.0 * groups - 5.0) / 72.0
    z = float(np.sign(excess) * max(abs(excess) - 0.5, 0.0) / np.sqrt(variance))
    p_value = 2.0 * normal_beyond(abs(z))
    found = "a trend is left" if p_value < TEST_SIZE else "none seen; a line taken out before leaves none"
    return SeriesTest(f"reverse arrangements of {groups} groups, Z", z, p_value, "no monotone trend", found)


def variance_change(y: FloatArray) -> SeriesTest:
    """Test whether the variance of first differences is the same in all groups.

    The logarithms of the block variances inside a group are the sample whose means are compared (F
    test): this stands outliers and correlation better than Bartlett's test of the samples.
    """
    differences = np.diff(y)
    cut = _groups(differences, TREND_TEST_GROUPS * _BLOCKS_A_GROUP)
    logs = np.log(np.mean(cut**2, axis=1) + LEAST_DIVISOR).reshape(TREND_TEST_GROUPS, -1)
    statistic, p_value = same_mean(logs) if np.ptp(logs) > 0.0 else (0.0, 1.0)
    found = "it changes" if p_value < STRICT_SIZE else "no change seen"
    return SeriesTest(
        f"variance of differences in {TREND_TEST_GROUPS} groups, F",
        statistic,
        p_value,
        "it is constant",
        found,
    )


def unit_root(y: FloatArray) -> tuple[SeriesTest, SeriesTest]:
    """Return the ADF test (null: unit root) and the KPSS test (null: stationary) of up to 2000 block means."""
    size = max(len(y) // _UNIT_ROOT_POINTS, 1)
    points = _groups(y, len(y) // size).mean(axis=1)
    lags = int(12.0 * (len(points) / 100.0) ** 0.25)
    (t, wanders), (eta, steady) = dickey_fuller(points, lags), steady_level(points, lags)
    found = "no unit root" if wanders < TEST_SIZE else "a unit root is not excluded"
    kpss = "its level is steady" if steady > TEST_SIZE else "its level wanders"
    return (
        SeriesTest(f"ADF of {len(points)} means, {lags} lags, t", t, wanders, "a unit root", found),
        SeriesTest(
            f"KPSS of {len(points)} means, {lags} lags, η", eta, steady, "a steady level", kpss, TABULATED
        ),
    )


def stationarity_tests(y: FloatArray) -> tuple[SeriesTest, ...]:
    """Return the tests of stationarity of a series, shape (n,): those that it is long enough for."""
    varying = unit_root(y) if np.std(y) > 0.0 else ()
    return (reverse_arrangements(y), *varying, *([variance_change(y)] if len(y) > 2000 else []))


def _groups(y: FloatArray, number: int) -> FloatArray:
    """Return y cut into equal groups, shape (number, n // number)."""
    size = len(y) // number
    if size < 1:
        raise ValueError(f"{number} groups need as many samples, got {len(y)}")
    return np.asarray(y[: number * size].reshape(number, size))


def _local_median(y: FloatArray) -> FloatArray:
    """Return medians of blocks, joined by straight lines."""
    number = len(y) // _MEDIAN_BLOCK
    if number < 2:
        return np.full(len(y), np.median(y))
    medians = np.median(_groups(y, number), axis=1)
    size = len(y) // number
    return np.asarray(np.interp(np.arange(len(y)), size * (np.arange(number) + 0.5) - 0.5, medians))
