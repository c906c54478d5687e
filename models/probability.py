"""Tails and quantiles of customary laws, and tests of a sample by its moments.

`scipy.stats` has them too; loading it takes half a second, a quarter of what a short command may take.

References
----------
.. [1] C. M. Jarque, A. K. Bera, Efficient tests for normality, homoscedasticity and serial independence of regression
   residuals, Econ. Lett. 6 (1980).
.. [2] R. B. D'Agostino, A. Belanger, R. B. D'Agostino Jr., A suggestion for using powerful and informative tests of
   normality, Amer. Statist. 44 (1990): the root of b₁, after D'Agostino (1970), b₂ after Anscombe and Glynn (1983).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from scipy.special import betainc, fdtrc, gammainc, gammaincc, gammaincinv, ndtr, ndtri, stdtr, stdtrit

from models.arrays import FloatArray

Numbers = TypeVar("Numbers", float, FloatArray)
MEDIAN_OVER_MEAN_SD = math.sqrt(0.5 * math.pi)
"""Sd of the median ÷ that of the mean of normal values."""


def normal_below(z: float) -> float:
    """Return the chance that a standard normal number is below `z`."""
    return float(ndtr(z))


def normal_beyond(z: Numbers) -> Numbers:
    """Return the chance that a standard normal number is above `z`, for each of several."""
    found: Numbers = _as_given(ndtr(-z))
    return found


def normal_reach(level: float) -> float:
    """Return how many sds on either side of its mean hold a normal number with the chance `level`."""
    return float(-ndtri(0.5 * (1.0 - level)))


REACH_95 = normal_reach(0.95)
"""Half of a 95 % interval of a normal number, sds."""


def rounding_variance(step: Numbers) -> Numbers:
    """Return the variance of what rounding to codes `step` apart adds, for each of several: that of an even law."""
    found: Numbers = _as_given(np.square(step) / 12.0)
    return found


def normal_density(z: Numbers, sd: float = 1.0) -> Numbers:
    """Return the density of a normal number without mean at `z`, in its inverse unit, for each of several."""
    found: Numbers = _as_given(np.exp(-0.5 * np.square(z / sd)) / (np.sqrt(2.0 * np.pi) * sd))
    return found


def log_normal_density(z: Numbers, sd: float) -> Numbers:
    """Return the logarithm of the density of a normal number without mean at `z`, for each of several."""
    found: Numbers = _as_given(-0.5 * np.square(z / sd) - np.log(np.sqrt(2.0 * np.pi) * sd))
    return found


def chi2_below(x: FloatArray, freedom: float) -> FloatArray:
    """Return the chance that χ² with so many degrees of freedom is below each of `x`, shape (n,), of 0 or more."""
    return np.asarray(gammainc(0.5 * freedom, 0.5 * x))


def chi2_beyond(x: float, freedom: float) -> float:
    """Return the chance that χ² with so many degrees of freedom is above `x`; one where none is left."""
    return float(gammaincc(0.5 * freedom, 0.5 * x)) if x > 0.0 and freedom > 0.0 else 1.0


def chi2_quantile(p: float, freedom: Numbers) -> Numbers:
    """Return what χ² is below with the chance `p`, for each number of degrees of freedom."""
    found: Numbers = 2.0 * gammaincinv(0.5 * freedom, p)
    return found


def poisson_interval(count: int) -> tuple[float, float]:
    """Return the 95 % interval of the mean of a Poisson law from one count (Garwood 1936)."""
    low, high = (0.5 * chi2_quantile(p, 2.0 * n) for p, n in ((0.025, count), (0.975, count + 1)))
    return float(low), float(high)


def student_quantile(p: float, freedom: Numbers) -> Numbers:
    """Return what Student's t is below with the chance `p`, for each number of degrees of freedom."""
    found: Numbers = _as_given(stdtrit(freedom, p))
    return found


def student_beyond(x: Numbers, freedom: float) -> Numbers:
    """Return the chance that Student's t is above `x`, for each of several."""
    found: Numbers = _as_given(stdtr(freedom, -x))
    return found


def poisson_at_least(count: int, mean: float) -> float:
    """Return the chance of so many events or more, where so many are expected."""
    return float(gammainc(count, mean)) if count > 0 else 1.0


def binomial_at_least(count: float, tried: float, chance: float) -> float:
    """Return the chance that so many or more of those tried succeed, each with the chance given."""
    return float(betainc(count, tried - count + 1, chance)) if count > 0 else 1.0


def negative_binomial_at_least(count: int, mean: float, variance: float) -> float:
    """Return the chance of so many events or more, where a gamma law of a relative variance scatters their mean."""
    return float(betainc(count, 1.0 / variance, 1.0 - 1.0 / (1.0 + mean * variance))) if count > 0 else 1.0


def fisher_beyond(x: float, above: float, below: float) -> float:
    """Return the chance that F with degrees of freedom of its numerator and its denominator is above `x`."""
    return float(fdtrc(above, below, x)) if x > 0.0 else 1.0


def _as_given(found: FloatArray) -> Any:
    """Return an array as it is, and one number as such."""
    return float(found) if np.ndim(found) == 0 else found


def same_mean(groups: FloatArray) -> tuple[float, float]:
    """Return the F statistic of equal means of k groups of b independent numbers, shape (k, b), and its p-value."""
    k, b = groups.shape
    means = groups.mean(axis=1)
    between = b * float(np.sum((means - means.mean()) ** 2)) / (k - 1)
    within = float(np.sum((groups - means[:, None]) ** 2)) / (k * (b - 1))
    ratio = between / within
    return ratio, fisher_beyond(ratio, k - 1, k * (b - 1))


@dataclass(frozen=True)
class Normality:
    """P-values of normality by Jarque and Bera [1]_ and D'Agostino [2]_, skewness, excess kurtosis, both statistics."""

    jarque_bera: float
    dagostino: float
    skewness: float
    excess_kurtosis: float
    jarque_bera_statistic: float
    dagostino_statistic: float


def normality(x: FloatArray) -> Normality:
    """Test whether independent numbers, shape (n,), n of 20 at least, are normal."""
    n = float(len(x))
    rest = x - x.mean()
    square = rest * rest
    variance = float(square.mean())
    skewness = float((square * rest).mean()) / variance**1.5
    kurtosis = float(np.vdot(square, square)) / n / variance**2
    jarque_bera = n / 6.0 * (skewness**2 + 0.25 * (kurtosis - 3.0) ** 2)
    dagostino = _skewness_deviate(skewness, n) ** 2 + _kurtosis_deviate(kurtosis, n) ** 2
    return Normality(
        chi2_beyond(jarque_bera, 2),
        chi2_beyond(dagostino, 2),
        skewness,
        kurtosis - 3.0,
        jarque_bera,
        dagostino,
    )


def _skewness_deviate(skewness: float, n: float) -> float:
    """Return a number that is standard normal where a skewness is that of n normal numbers."""
    y = skewness * np.sqrt((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0)))
    beta = 3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0)
    beta /= (n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0)
    w2 = np.sqrt(2.0 * (beta - 1.0)) - 1.0
    return float(np.arcsinh(y / np.sqrt(2.0 / (w2 - 1.0))) / np.sqrt(0.5 * np.log(w2)))


def _kurtosis_deviate(kurtosis: float, n: float) -> float:
    """Return a number that is standard normal where a kurtosis is that of n normal numbers."""
    mean = 3.0 * (n - 1.0) / (n + 1.0)
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (kurtosis - mean) / np.sqrt(variance)
    third = 6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
    third *= np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)))
    a = 6.0 + 8.0 / third * (2.0 / third + np.sqrt(1.0 + 4.0 / third**2))
    ratio = (1.0 - 2.0 / a) / (1.0 + x * np.sqrt(2.0 / (a - 4.0)))
    return float((1.0 - 2.0 / (9.0 * a) - np.cbrt(ratio)) / np.sqrt(2.0 / (9.0 * a)))
