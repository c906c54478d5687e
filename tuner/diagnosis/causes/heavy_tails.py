"""Heavy tails: residuals of Student's law in place of the normal one.

Statistic: excess kurtosis of the residuals cut at five deviations, normal with variance 24/n about that of normal
numbers rounded to a lattice of step Δ: −1.2 (Δ²/12σ²)² where Δ is small, else it depends on where the mean lies
between two codes, and the largest counts. Gain: likelihood of Student's law.
Extension: the residuals pass the distribution function of the fitted law and the normal quantile function. What is told
is the kurtosis of the white noise itself: rounding has one of its own, and quantization and the whitening filter mix
samples (`tuner.diagnosis.dilution`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import norm, t

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.dilution import dilution
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.histogram import Histogram, histogram
from tuner.diagnosis.residual import CLIP, Residual
from tuner.diagnosis.statistics import maximum

FloatArray = NDArray[np.float64]

CLIPPED_KURTOSIS = -0.00125
"""Excess kurtosis of normal numbers cut at five deviations."""
CELL, CELLS = 0.005, 1600
"""Width and number of the cells of a table of deviates, sd."""
FINE = 1.0
"""Step ÷ sd below which the mean between two codes does not matter."""


@dataclass(frozen=True)
class HeavyTails(Extension):
    """Student's law with `nu` degrees of freedom and unit variance."""

    cause: ClassVar[str] = "heavy_tails"
    meaning: ClassVar[str] = "large deviations are more frequent than normal noise allows, at all sizes"
    consequence: ClassVar[str] = (
        "the variance is right but its tails are not: a robust update or a wider gate"
    )
    nu: float

    def whiten(self, e: FloatArray) -> FloatArray:
        """Map Student's law to the normal one."""
        mapped = np.asarray(_looked_up(e, self._deviate(CELL * np.arange(CELLS + 1))))
        far = np.flatnonzero(np.abs(e) > CELL * CELLS)
        mapped[far] = np.copysign(self._deviate(np.abs(e[far])), e[far])
        return mapped

    def _deviate(self, size: NDArray[np.floating[Any]]) -> FloatArray:
        """Return the normal deviates of sizes of the law."""
        scale = np.sqrt((self.nu - 2.0) / self.nu)
        return np.asarray(-ndtri(np.maximum(t.sf(size / scale, self.nu), 1e-300)))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _looked_up(e: FloatArray, table: FloatArray) -> FloatArray:
    """Return deviates, shape (n,), between those of a table, shape (`CELLS` + 1,), with the signs of `e`."""
    out = np.empty(e.size)
    for i in range(e.size):
        place = min(abs(e[i]) / CELL, CELLS - 1e-6)
        cell = int(place)
        out[i] = np.copysign(table[cell] + (place - cell) * (table[cell + 1] - table[cell]), e[i])
    return out


def rounded_kurtosis(step: float) -> float:
    """Return the largest excess kurtosis of rounded normal numbers, the step in sd of what they are rounded to."""
    if step < FINE:
        return -1.2 * (step**2 / 12.0) ** 2
    sd = float(np.sqrt(max(1.0 - step**2 / 12.0, 0.01)))
    phase = np.linspace(0.0, 1.0, 33)[:, None]
    code = np.arange(-np.ceil(8.0 * sd / step) - 1.0, np.ceil(8.0 * sd / step) + 2.0)
    share = np.diff(ndtr(step * (np.append(code, code[-1] + 1.0) - 0.5 - phase) / sd), axis=1)
    value = code - np.sum(share * code, axis=1, keepdims=True)
    second, fourth = (np.sum(share * value**power, axis=1) for power in (2, 4))
    return float(np.max(fourth / second**2)) - 3.0


def test(found: Residual) -> Alarm:
    """Compare the kurtosis of the residuals with that of the normal law."""
    e = np.clip(found.good, -CLIP, CLIP)
    square = e * e
    n = len(e)
    kurtosis = float(np.mean(square * square) / np.mean(square) ** 2) - 3.0
    white = found.spread * float(
        np.sqrt(found.power[len(found.power) // 2 :].mean() / found.channel.interval)
    )
    lattice = rounded_kurtosis(found.channel.lattice / white)
    deviate = (kurtosis - CLIPPED_KURTOSIS - lattice) / np.sqrt(24.0 / n)
    p_value = float(norm.sf(deviate))
    gain, nu, spread = 0.0, np.inf, 0.0
    if p_value < 1e-3:
        gain, nu, spread = student(histogram(found.good))
        gain -= 0.5 * float(np.log(n))
    return Alarm(
        "heavy_tails",
        p_value,
        gain,
        kurtosis,
        "excess kurtosis of the residuals",
        lambda: (extension(found, nu, spread, -1.2 * (found.channel.lattice / white) ** 4 / 144.0),),
    )


def student(bins: Histogram) -> tuple[float, float, float]:
    """Return the gain of Student's law over the normal one, its ν, and the sd of ln(ν − 4)."""

    def cost(x: FloatArray) -> float:
        nu = 2.0 + np.exp(x[0])
        return -float(bins.count @ t.logpdf(bins.value, nu, 0.0, np.exp(x[1])))

    x, covariance, value = maximum(cost, [[3.0, 0.0]])
    nu = 2.0 + float(np.exp(x[0]))
    relative = float(np.sqrt(covariance[0, 0])) * (nu - 2.0) / max(nu - 4.0, 0.5)
    return bins.normal_cost() - value, nu, relative


def extension(found: Residual, nu: float, spread: float, rounding: float) -> HeavyTails:
    """Return the extension with the excess kurtosis of the white noise; that of the residuals is 6/(ν − 4)."""
    white = dilution(found)
    seen = Value.log(6.0 / max(nu - 4.0, 0.05), spread)
    low, value, high = (max(k - rounding, 1e-6) / white.fourth for k in (seen.lower, seen.value, seen.upper))
    return HeavyTails(
        nu, values={"excess_kurtosis": Value(value, low, high).owing(3.92 * white.error * value)}
    )
