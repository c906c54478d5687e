"""Wrong R and wrong Q: factors on the noise of the receiver and of the sensors, tested one by one and together.

Prior knowledge of a factor, true ÷ assumed, such as the intervals of a static identification, enters as sd of its log.
The tests `gnss_noise_scale` and `imu_noise_scale` test each factor alone, the rest as configured: first by score and
curvature of ln L by the log x of the factor (of R: 2 Σ (r d)², d the precision of a row given all others), then by a
fit where the score is large. The null hypothesis for a factor whose log has a prior sd σ is a factor about 1 with that
σ::

    LR = max_x 2 ln L(x) − max_x [2 ln L(x) − x²/σ²] ~ χ²₁,    exactly known (σ = 0): 2 ln L(x̂) − 2 ln L(0)

whether x ~ N(0, σ²) or x = 0. A factor on R or Q is inside its range there, so that no mixture of χ² is needed. The p
value allows for the number of factors; of R, those on a whole position or velocity have a larger share of the error
rate than those on a part. Where R and Q are both wrong, each leaks into the other's test: `joint_noise` fits both (a
car whose unit is 5 to 8 times as noisy as at rest and whose receiver has twice its reported error: 4300 nats
together, 740 and 2600 one by one).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from models.arrays import FloatArray
from models.effects.drive import gnss as effects
from models.effects.drive.imu import ImuNoiseScale as ImuEffect
from tuner.diagnosis.drive.cause_test import CauseTest, not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.causes.reported_sd import has_sd_model, reported_sd_test
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.linear_model.noise_fit import NO_PRIOR, NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import BLOCKS, ROW_GROUPS, noise_parameters, present
from tuner.diagnosis.drive.linear_model.noise_prior import static_prior
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import (
    NoiseHypothesis,
    evaluate,
    evaluate_with_gradient,
    with_constants_fixed,
)
from tuner.linear_run.linearized_run import NOISE_GROUPS
from tuner.types import Coefficient

MIN_SCORE_STATISTIC = 6.0
"""Score statistic from which a fit is worth its time: χ²₁ exceeds 6 by chance in 1.4 %."""
ERROR_RATE_SHARE = {**dict.fromkeys(BLOCKS, 0.3), **dict.fromkeys(ROW_GROUPS, 0.1)}
"""Share of the test's error rate that each factor of R has.

Bonferroni over two factors of blocks and four of groups of rows: 2 · 0.3 + 4 · 0.1 = 1.
"""
MIN_CONVEX_CURVATURE = 10.0
"""Curvature by a log above which the slope also shows large factors: the log is known to 0.3 there."""
MIN_CURVATURE = 0.25
"""Curvature by a log below which the drive has no information on a factor: the log has an sd above 2 then."""
TRIAL_LOGS = (1.0, 2.5)
"""Logs of large factors on Q (2.7, 12) that are tried where ln L is flat at 1 and its slope shows little of them."""
FINDING_NAMES = {"gyro_white": "gyro", "accel_white": "accel"}
"""Names of factors in a finding where they differ."""
JOINT_P_VALUE = 1e-9
"""P-value of wrong R, and of wrong Q, below which both are fitted together.

A wrong R also shows in the test of Q and the other way round; chosen so small that both are clear.
"""
_LOG_STEP = 0.02
"""Step of the log for numerical second derivatives: small against the sd of a log, large against rounding."""


@dataclass(frozen=True)
class NoiseScores:
    """Score and curvature of ln L by the log of each factor, and twice the largest gain among `TRIAL_LOGS`."""

    names: tuple[str, ...]
    value: float
    slope: FloatArray
    curvature: FloatArray
    tried: FloatArray

    def size(self, name: str) -> float:
        """Return the curvature, at least the slope: where a factor is far off, ln L is not convex at 1."""
        j = self.names.index(name)
        return float(max(self.curvature[j], abs(self.slope[j])))

    def is_informative(self, name: str) -> bool:
        """Whether the drive has information on a factor."""
        return (
            self.size(name) > MIN_CURVATURE or float(self.tried[self.names.index(name)]) > MIN_SCORE_STATISTIC
        )

    def ratio(self, name: str, prior_sd: float) -> float:
        """Return the likelihood ratio of a factor by its score, or by a trial."""
        j, size = self.names.index(name), max(self.size(name), MIN_CURVATURE)
        exact = max(float(self.slope[j]) ** 2 / size, float(self.tried[j]))
        return exact / (1.0 + size * prior_sd**2)


def noise_scores(noise: NoiseHypothesis) -> NoiseScores:
    """Return the scores of all factors that the run has rows or noise of."""
    names = present(noise, (*ROW_GROUPS, *BLOCKS, *NOISE_GROUPS))
    parameters, zero = noise_parameters(names), np.zeros(len(names))
    noise = with_constants_fixed(noise)
    likelihood, gradient = evaluate_with_gradient(noise)
    slope = parameters.slopes(noise, zero, gradient)
    own = 2.0 * np.where(noise.counted, gradient.precision * noise.sd**2, 0.0) ** 2
    curvature, tried = np.empty(len(names)), np.zeros(len(names))
    for j, unit in enumerate(np.eye(len(names))):
        if names[j] not in NOISE_GROUPS:
            curvature[j] = own[:, (ROW_GROUPS | BLOCKS)[names[j]]].sum()
            continue
        other = parameters.slopes(
            noise, zero, evaluate_with_gradient(parameters.change(noise, _LOG_STEP * unit))[1]
        )
        curvature[j] = (slope[j] - other[j]) / _LOG_STEP
        if curvature[j] < max(MIN_CONVEX_CURVATURE, abs(slope[j])):
            trials = [evaluate(parameters.change(noise, log * unit)).value for log in TRIAL_LOGS]
            tried[j] = max(0.0, 2.0 * (max(trials) - likelihood.value))
    return NoiseScores(names, likelihood.value, slope, curvature, tried)


def gnss_noise(noise: NoiseHypothesis, scores: NoiseScores) -> CauseTest:
    """Test the factors on the sds of the fixes."""
    return _test(noise, scores, "gnss_noise_scale", ERROR_RATE_SHARE, NO_PRIOR)


def imu_noise(
    noise: NoiseHypothesis, scores: NoiseScores, *, prior_sd: Mapping[str, float] = NO_PRIOR
) -> CauseTest:
    """Test the factors on the process noise of the sensors; `prior_sd` is that of the log of a factor, 0 by default."""
    names = [name for name in NOISE_GROUPS if name in scores.names and scores.is_informative(name)]
    return _test(noise, scores, "imu_noise_scale", dict.fromkeys(names, 1.0 / max(len(names), 1)), prior_sd)


def joint_noise(
    noise: NoiseHypothesis, scores: NoiseScores, *, prior_sd: Mapping[str, float] = NO_PRIOR
) -> tuple[CauseTest, CauseTest] | None:
    """Test factors on R and Q together where both are wrong; None where one of them is not.

    Each leaks into the test of the other: a sensor far noisier than configured makes fixes look bad. Both tests have
    one noise hypothesis (the same object) and the same gain, that of both.

    Parameters
    ----------
    noise : NoiseHypothesis
        Before the test.
    scores : NoiseScores
        Its scores.
    prior_sd : mapping of str to float
        As of `imu_noise`.
    """
    names = tuple(
        name
        for name in scores.names
        if name in ROW_GROUPS or (name in NOISE_GROUPS and scores.is_informative(name))
    )
    sides = [tuple(n for n in names if n in side) for side in (ROW_GROUPS, NOISE_GROUPS)]
    score = [[scores.ratio(name, prior_sd.get(name, 0.0)) for name in side] for side in sides]
    if any(not side or chi2.sf(max(side), 1) > JOINT_P_VALUE for side in score):
        return None
    fit = _fit_identifiable(noise, names)
    names = fit.parameters.names
    sides = [tuple(name for name in names if name in side) for side in sides]
    ratio = [
        max((_wald_statistic(fit, n, prior_sd.get(n, 0.0)) for n in side), default=0.0) for side in sides
    ]
    chance = [min(1.0, len(side) * float(chi2.sf(r, 1))) for r, side in zip(ratio, sides, strict=True)]
    if max(chance) > JOINT_P_VALUE:
        return None
    gain = fit.log_likelihood - scores.value - 0.5 * float(np.log(noise.count)) * len(names)
    title = "squares of factors on R and Q fitted together, by their variances"
    fitted = fit.noise

    def test(cause: str, i: int) -> CauseTest:
        def described() -> Mapping[str, Coefficient]:
            return {FINDING_NAMES.get(name, name): fit.coefficient(name) for name in sides[i]}

        return CauseTest(TestResult(cause, chance[i], gain, ratio[i], title), fitted, described)

    return test("gnss_noise_scale", 0), test("imu_noise_scale", 1)


def _fit_identifiable(
    noise: NoiseHypothesis, names: tuple[str, ...], alone: NoiseFit | None = None
) -> NoiseFit:
    """Fit factors; those on Q that the drive does not identify, or that are 1 within error, stay as configured.

    A factor that was fitted `alone` is not fitted again.

    Where ln L is flat in a factor the search ends anywhere: white noise of accelerometers hardly shows in fixes at
    1 Hz.
    """
    fit = maximize_likelihood(noise, noise_parameters(names))
    kept = tuple(
        n
        for n in names
        if n in ROW_GROUPS or (fit.identifiable(n) and _wald_statistic(fit, n, 0.0) > MIN_SCORE_STATISTIC)
    )
    if kept in (names, ()):
        return fit
    known = alone is not None and kept == alone.parameters.names
    return alone if alone is not None and known else maximize_likelihood(noise, noise_parameters(kept))


def _wald_statistic(fit: NoiseFit, name: str, prior_sd: float) -> float:
    """Return the square of the log of a factor by its variance, that of its prior included."""
    j = fit.number(name)
    return float(fit.estimate[j] ** 2 / (fit.covariance[j, j] + prior_sd**2))


def _test(
    noise: NoiseHypothesis,
    scores: NoiseScores,
    cause: str,
    share: Mapping[str, float],
    prior_sd: Mapping[str, float],
) -> CauseTest:
    title = "likelihood ratio of a factor on the noise"
    ratio = {name: scores.ratio(name, prior_sd.get(name, 0.0)) for name in share if name in scores.names}
    chance = {name: min(1.0, float(chi2.sf(value, 1)) / share[name]) for name, value in ratio.items()}
    best = min(chance, key=lambda name: chance[name], default="")
    if not best or ratio[best] < MIN_SCORE_STATISTIC:
        return not_significant(cause, noise, chance.get(best, 1.0), ratio.get(best, 0.0), title)
    alone = maximize_likelihood(noise, noise_parameters((best,)))
    exact = _likelihood_ratio(alone, scores.value, prior_sd.get(best, 0.0))
    p_value = min(1.0, float(chi2.sf(exact, 1)) / share[best])
    price = 0.5 * float(np.log(noise.count))
    parts = tuple(
        name for name in scores.names if name in (ROW_GROUPS if best in ERROR_RATE_SHARE else NOISE_GROUPS)
    )
    wrong = tuple(name for name in parts if ratio.get(name, 0.0) > MIN_SCORE_STATISTIC)
    fits = [alone] if wrong in ((), (best,)) else [alone, _fit_identifiable(noise, wrong, alone)]
    fit = max(fits, key=lambda one: one.log_likelihood - price * len(one.estimate))
    gain = fit.log_likelihood - scores.value - price * len(fit.estimate)
    result = TestResult(cause, p_value, gain, exact, title)
    others = {name: sd for name, sd in prior_sd.items() if name not in fit.parameters.names}
    return CauseTest(result, fit.noise, lambda: _coefficients(noise, parts, others))


def _likelihood_ratio(alone: NoiseFit, value: float, prior_sd: float) -> float:
    """Return the likelihood ratio of the factor that was fitted alone."""
    if prior_sd == 0.0:
        return max(0.0, 2.0 * (alone.log_likelihood - value))
    (name,), half = alone.parameters.names, 0.5 * alone.estimate
    tied = maximize_likelihood(alone.start, noise_parameters((name,)), prior_sd={name: prior_sd}, start=half)
    return max(0.0, 2.0 * (alone.log_likelihood - tied.objective))


def _coefficients(
    noise: NoiseHypothesis, names: tuple[str, ...], prior_sd: Mapping[str, float]
) -> Mapping[str, Coefficient]:
    fit = maximize_likelihood(noise, noise_parameters(names), prior_sd=prior_sd)
    return {FINDING_NAMES.get(name, name): fit.coefficient(name) for name in names}


class GnssNoiseScale(NoiseCause):
    """Errors of the fixes that are not as large as assumed: as reported, or configured where nothing is reported."""

    cause = "gnss_noise_scale"
    effect = effects.GnssNoiseScale
    channels = ("gnss",)
    meaning = "fixes do not err as assumed, positions {position} × as much, velocities {velocity} × as much"
    consequence = "scale the standard deviations of the fixes"
    joins = "measurement noise"
    is_noise_scale = True

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:  # noqa: ARG003
        """Test factors on R and on Q, together where both are wrong, and models of the reported sds."""
        scores, prior = noise_scores(noise), static_prior(run.hypothesis.config.channels)
        factors = joint_noise(noise, scores, prior_sd=prior)
        if factors is None:
            factors = gnss_noise(noise, scores), imu_noise(noise, scores, prior_sd=prior)
        values = run.hypothesis.compensation.of(cls.cause)
        models = (reported_sd_test(noise, block) for block in BLOCKS if not has_sd_model(values, block))
        return (*factors, *(test for test in models if test is not None))


class ImuNoiseScale(NoiseCause):
    """Sensors that are noisier, or less noisy, than configured."""

    cause = "imu_noise_scale"
    effect = ImuEffect
    channels = ("imu",)
    meaning = "sensors are noisier or quieter than configured, gyros {gyro} × as much, accelerometers {accel} × as much"
    consequence = "scale the densities"
    joins = "noise model"
    is_noise_scale = True
    tested_with = "gnss_noise_scale"
