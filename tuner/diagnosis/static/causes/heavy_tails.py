"""Heavy tails: residuals of Student's law in place of the normal one.

Statistic: excess kurtosis of the residuals cut at five deviations, normal with variance 24/n about that of normal
numbers rounded to a step Δ: −1.2 (Δ²/12σ²)² where Δ is small, else it depends on where the mean lies
between two codes, and the largest counts. Gain: likelihood of Student's law.
Where normal noise is added or mixed in, tails are heavier than those of the Student's law of the middle: a share of
normal and a share of Student's law stand for both then, if they are likelier than Student's law beside spikes, which
has as many parameters. One law for all sizes is one cause.
Extension: the residuals pass the distribution function of the fitted law and the normal quantile function. What is
reported is the kurtosis of the white noise itself: rounding has one of its own, and quantization and the whitening
filter mix samples (`tuner.diagnosis.static.variance.white_share`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaln, ndtr, ndtri

from models.arrays import LEAST_DIVISOR, FloatArray
from models.effects.static.distribution import HeavyTails as Effect
from models.probability import REACH_95, normal_beyond, rounding_variance, student_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, maximum, minimum
from tuner.diagnosis.static.model.series_statistics import moment
from tuner.diagnosis.static.outcome import WORTH_A_FIT, TestResult
from tuner.diagnosis.static.variance.histogram import Histogram, histogram
from tuner.diagnosis.static.variance.white_share import dilution

CLIPPED_KURTOSIS = -0.00125
"""Excess kurtosis of normal numbers cut at five sds, by integration."""
CELL_WIDTH, CELL_COUNT = 0.005, 1600
"""Width and number of the cells of a table of deviates, sds: up to eight, interpolated between."""
SEARCH_CENTRE, SEARCH_HALF_WIDTH = np.array([0.0, 0.0, 1.0, 1.0]), np.array([10.0, 5.0, 4.0, 2.5])
"""Where two shares are sought: logit of Student's, log of the normal sd, of ν − 2, of the ratio of the two scales."""
MIN_FREEDOM = 2.05
"""ν below which the law lies at the bound of its parameter, 2, without a variance: it is no law of these samples."""
MAX_FINE_STEP = 1.0
"""Step ÷ sd below which the mean between two codes does not matter."""


@dataclass(frozen=True)
class HeavyTails(Extension):
    """Student's law with `nu` degrees of freedom, for a `share` of the samples, beside normal ones; unit variance.

    `ratio` is the scale of Student's law ÷ the sd of the normal one.
    """

    cause = "heavy_tails"
    effect = Effect
    group = "distribution"
    needs_fine_quantizer = True
    view = "histogram"
    meaning = "large deviations are more frequent than normal noise allows, at all sizes"
    consequence = "the variance is right but its tails are not: a robust update or a wider gate"
    nu: float
    share: float = 1.0
    ratio: float = 1.0

    @property
    def scales(self) -> tuple[float, float]:
        """Sd of the normal part, and scale of Student's."""
        wide = self.ratio**2 * self.nu / (self.nu - 2.0)
        core = (1.0 - self.share + self.share * wide) ** -0.5
        return core, core * self.ratio

    def log_density(self, e: FloatArray) -> FloatArray:
        """Return the log density of the law."""
        core, wide = self.scales
        heavy = _log_student(e, self.nu, wide)
        if self.share == 1.0:
            return heavy
        normal = float(np.log1p(-self.share)) + _log_normal(e, core)
        return _log_sum(normal, float(np.log(self.share)) + heavy)

    def sample(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Return numbers of the law, shape (n,)."""
        core, wide = self.scales
        heavy = wide * rng.standard_t(self.nu, n)
        if self.share == 1.0:
            return np.asarray(heavy)
        return np.where(rng.random(n) < self.share, heavy, core * rng.standard_normal(n))

    def whiten(self, e: FloatArray) -> FloatArray:
        """Map Student's law to the normal one."""
        mapped = np.asarray(_looked_up(e, self._deviate(CELL_WIDTH * np.arange(CELL_COUNT + 1))))
        far = np.flatnonzero(np.abs(e) > CELL_WIDTH * CELL_COUNT)
        mapped[far] = np.copysign(self._deviate(np.abs(e[far])), e[far])
        return mapped

    def _deviate(self, size: NDArray[np.floating[Any]]) -> FloatArray:
        """Return the normal deviates of sizes of the law."""
        core, wide = self.scales
        exact = np.asarray(size, dtype=float)
        beyond = (1.0 - self.share) * normal_beyond(exact / core)
        beyond += self.share * student_beyond(exact / wide, self.nu)
        return np.asarray(-ndtri(np.maximum(beyond, LEAST_DIVISOR)))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Compare the kurtosis of the residuals with that of the normal law; None where missing codes make another."""
        if fitted.channel.missing_codes:
            return None
        e = fitted.good_clipped
        n = len(e)
        kurtosis = moment(e, 4) / moment(e, 2) ** 2 - 3.0
        last = len(fitted.cleaned) - 1
        fast = float(fitted.expected_power.between(last // 2, last).mean())
        white = fitted.spread * float(np.sqrt(fast / fitted.channel.interval))
        rounding = rounded_kurtosis(fitted.channel.quantizer_step / white)
        deviate = (kurtosis - CLIPPED_KURTOSIS - rounding) / np.sqrt(24.0 / n)
        p_value = normal_beyond(deviate)
        gain, law = 0.0, Law(0.0, np.inf, 0.0)
        if p_value < WORTH_A_FIT:
            law = whole(histogram(fitted.good))
            gain = law.gain - (0.5 if law.share == 1.0 else 1.5) * float(np.log(n))
        name = "excess kurtosis of the residuals"
        if law.nu < MIN_FREEDOM:
            return TestResult("heavy_tails", p_value, gain, kurtosis, name)
        return TestResult(
            "heavy_tails", p_value, gain, kurtosis, name, lambda: (extension(fitted, law, white),)
        )


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _looked_up(e: FloatArray, table: FloatArray) -> FloatArray:
    """Return deviates, shape (n,), between those of a table, shape (`CELL_COUNT` + 1,), with the signs of `e`."""
    out = np.empty(e.size)
    for i in range(e.size):
        place = min(abs(e[i]) / CELL_WIDTH, CELL_COUNT - 1e-6)
        cell = int(place)
        out[i] = np.copysign(table[cell] + (place - cell) * (table[cell + 1] - table[cell]), e[i])
    return out


def rounded_kurtosis(step: float) -> float:
    """Return the largest excess kurtosis of rounded normal numbers, the step in sd of what they are rounded to."""
    if step < MAX_FINE_STEP:
        return -1.2 * rounding_variance(step) ** 2
    sd = float(np.sqrt(max(1.0 - rounding_variance(step), 0.01)))
    phase = np.linspace(0.0, 1.0, 33)[:, None]
    code = np.arange(-np.ceil(8.0 * sd / step) - 1.0, np.ceil(8.0 * sd / step) + 2.0)
    share = np.diff(ndtr(step * (np.append(code, code[-1] + 1.0) - 0.5 - phase) / sd), axis=1)
    value = code - np.sum(share * code, axis=1, keepdims=True)
    second, fourth = (np.sum(share * value**power, axis=1) for power in (2, 4))
    known = second**2 > 0.0  # beyond, all samples are one code, and any other is far off
    return float(np.max(np.divide(fourth, second**2, out=np.full_like(second, np.inf), where=known))) - 3.0


@dataclass(frozen=True)
class Law:
    """A law of heavy tails: what it gains on the normal one, nats, its ν, the relative sd of its excess kurtosis.

    Of `share` and `ratio` see `HeavyTails`.
    """

    gain: float
    nu: float
    spread: float
    share: float = 1.0
    ratio: float = 1.0


def whole(bins: Histogram) -> Law:
    """Return Student's law, or a share of it beside a normal one where that is likelier, and than spikes beside it."""
    law = student(bins)

    def cost(x: FloatArray) -> float:
        if np.any(np.abs(x - SEARCH_CENTRE) > SEARCH_HALF_WIDTH):
            return COST_OUTSIDE
        share, core, nu, ratio = expit(x[0]), np.exp(x[1]), 2.0 + np.exp(x[2]), np.exp(x[3])
        heavy = np.log(share) + _log_student(bins.value, nu, core * ratio)
        return -float(bins.count @ np.logaddexp(np.log1p(-share) + _log_normal(bins.value, core), heavy))

    x, value = minimum(cost, [[0.0, 0.0, 1.0, 0.0], [-3.0, 0.0, 1.0, 0.5]], scale=0.5, tolerance=1e-2)
    gain = bins.normal_cost() - value
    if gain < law.gain + float(np.log(bins.count.sum())) or gain < beside_spikes(bins):
        return law
    nu, ratio = 2.0 + float(np.exp(x[2])), float(np.exp(x[3]))
    return Law(gain, nu, law.spread, float(expit(x[0])), ratio)


def beside_spikes(bins: Histogram) -> float:
    """Return the gain over the normal law of Student's law with a share of far larger, normal deviations."""

    def cost(x: FloatArray) -> float:
        if np.any(np.abs(x) > 15.0) or x[3] > 5.0:
            return COST_OUTSIDE
        nu, scale, share, size = 2.0 + np.exp(x[0]), np.exp(x[1]), expit(x[2]), 4.0 + np.exp(x[3])
        near = np.log1p(-share) + _log_student(bins.value, nu, scale)
        return -float(bins.count @ np.logaddexp(near, np.log(share) + _log_normal(bins.value, size)))

    return bins.normal_cost() - minimum(cost, [[3.0, 0.0, -9.0, 1.0]], scale=0.5, tolerance=1e-2)[1]


def _log_student(e: FloatArray, nu: float, scale: float) -> FloatArray:
    """Return the log density of Student's law, without the checks that cost as much as the density."""
    level = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(np.pi * nu) - np.log(scale)
    return np.asarray(level - 0.5 * (nu + 1.0) * np.log1p((e / scale) ** 2 / nu))


def _log_sum(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return ln(exp one + exp other) to 1e-16, in a third of the time that `logaddexp` takes for 1e-16 of itself."""
    return np.asarray(np.maximum(one, other) + np.log(1.0 + np.exp(-np.abs(one - other))))


def _log_normal(e: FloatArray, sd: float) -> FloatArray:
    """Return the log density of the normal law, likewise."""
    return np.asarray(-0.5 * (e / sd) ** 2 - np.log(sd * np.sqrt(2.0 * np.pi)))


def student(bins: Histogram) -> Law:
    """Return Student's law of the best fit."""

    def cost(x: FloatArray) -> float:
        nu = 2.0 + np.exp(x[0])
        return -float(bins.count @ _log_student(bins.value, nu, float(np.exp(x[1]))))

    x, covariance, value = maximum(cost, [[3.0, 0.0]])
    nu = 2.0 + float(np.exp(x[0]))
    relative = float(np.sqrt(covariance[0, 0])) * (nu - 2.0) / max(nu - 4.0, 0.5)
    return Law(bins.normal_cost() - value, nu, relative)


def extension(fitted: FittedChannel, law: Law, sd: float) -> HeavyTails:
    """Return the extension with the excess kurtosis of the white noise; that of Student's law is 6/(ν − 4).

    `sd` is that of the white noise, in scales.
    """
    white = dilution(fitted)
    rounding = -1.2 * (fitted.channel.quantizer_step / sd) ** 4 / 144.0
    shape = HeavyTails(law.nu, law.share, law.ratio)
    core, wide = shape.scales
    heavy = 3.0 * law.nu**2 / ((law.nu - 2.0) * max(law.nu - 4.0, 0.05)) * wide**4
    kurtosis = 6.0 / max(law.nu - 4.0, 0.05)
    if law.share < 1.0:
        kurtosis = 3.0 * (1.0 - law.share) * core**4 + law.share * heavy - 3.0
    seen = Value.log(kurtosis, law.spread)
    low, value, high = (max(k - rounding, 1e-6) / white.fourth for k in (seen.lower, seen.value, seen.upper))
    return replace(
        shape,
        values={"excess_kurtosis": Value(value, low, high).widened_by(2.0 * REACH_95 * white.error * value)},
    )
