"""Correlated errors of the position fixes: a Gauss–Markov process beside their white part.

Pre-test: correlations of the whitened position innovations summed over lags 1 … L; those of velocity are not used,
since a Q that is too small shows in both. Then a likelihood ratio of three more states, with sd of the horizontal and
of the vertical error and one time constant, the white part refitted under both hypotheses, so that a wrong R alone
gains nothing. Under the null the sds are at their bound 0 and the time constant is not identified: the ratio lies
below χ²₃ nearly everywhere (measured on replicas, see the tests). Which of Q, R and this cause is named depends on the
gain.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm

from models.arrays import FloatArray
from models.effects.drive.gnss import CorrelatedGnss as Effect
from tuner.diagnosis.drive.cause_test import CauseTest, not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.diagnosis.drive.linear_model.noise_fit import NoiseFit, maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import MARKOV_TIME, noise_parameters, present
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import (
    Likelihood,
    NoiseHypothesis,
    evaluate,
    with_constants_fixed,
)
from tuner.types import Coefficient

CORRELATED_GNSS = "correlated_gnss"
"""Code of the cause."""
SUMMED_LAGS = (1, 2, 4, 8, 16, 32)
"""Numbers of lags over which correlations are summed, in octaves: a sum is best near the correlation time."""
EFFECTIVE_TESTS = 4.0
"""Independent tests that these sums are equivalent to: fewer than their six, as they are nested."""
PRETEST_P_VALUE = 0.05
"""P-value of the pre-test below which states are fitted: it saves that time on 19 of 20 clean drives."""
TRIAL_SHARES = (0.6, 6.0, 0.3, 1.0, 2.5, 15.0)
"""Sds of the correlated part, relative to the white one, that a fit begins with: two at all times, all at the best one.

A receiver that smooths has errors of metres that stay, and a white part of centimetres.
"""
TIME_PRIOR_SD = 1.0
"""Prior sd of the log of the time constant about the best of those tried.

They are less than a factor 3 apart, and beyond the length of a run only sd²/T shows: a run does not make it longer.
"""
N_TRIAL_TIMES = 7
"""Time constants to begin the fit with, from twice the interval of the fixes to a quarter of the run.

Chosen so that one of them lies within the maximum of the likelihood.
"""


def correlated_gnss(noise: NoiseHypothesis, likelihood: Likelihood) -> CauseTest:
    """Test position fixes for a correlated error; the likelihood is that of the noise hypothesis."""
    title = "likelihood ratio of correlated position errors"
    if not noise.counted[:, :3].any():
        return not_significant(CORRELATED_GNSS, noise, 1.0, 0.0, title)
    chance = pretest(np.where(noise.counted, likelihood.white, 0.0)[:, :3])
    if chance > PRETEST_P_VALUE:
        return not_significant(CORRELATED_GNSS, noise, chance, 0.0, title)
    white = maximize_likelihood(
        noise, noise_parameters(present(noise, ("position_horizontal", "position_vertical")))
    )
    fit = fit_correlated(white.noise)
    ratio = max(0.0, 2.0 * (fit.log_likelihood - white.log_likelihood))
    if fit.noise.markov_time < _interval(noise):
        # An error that is gone at the next fix is white noise: of a size that the reported sds do not follow.
        return not_significant(CORRELATED_GNSS, noise, 1.0, ratio, title)
    price = 1.5 * float(np.log(np.count_nonzero(noise.counted[:, :3])))
    result = TestResult(
        CORRELATED_GNSS, float(chi2.sf(ratio, 3)), fit.log_likelihood - likelihood.value - price, ratio, title
    )
    return CauseTest(result, fit.noise, lambda: _coefficients(fit))


def pretest(white: FloatArray) -> float:
    """Return the p value of the summed lag correlations of whitened innovations (k, a), 0 where a row has none."""
    largest = 0.0
    total = 0.0
    for lag in range(1, min(SUMMED_LAGS[-1], len(white) - 1) + 1):
        total += float(np.sum(white[lag:] * white[:-lag]))
        if lag in SUMMED_LAGS:
            square = float(np.sum(white**2)) ** 2 / white.size
            largest = max(largest, abs(total) / np.sqrt(lag * square))
    return float(min(1.0, 2.0 * EFFECTIVE_TESTS * norm.sf(largest)))


def of_several_processes(cause: str, noise: NoiseHypothesis, threshold: float) -> bool:
    """Return whether errors of positions, or of velocities, are none of one Gauss–Markov process.

    Innovations of the filter that has its states then stay correlated: its size and time are those of no error.

    Parameters
    ----------
    cause : str
        That of the positions, or of the velocities.
    noise : NoiseHypothesis
        Of the filter that has its states.
    threshold : float
        P-value of the pre-test below which innovations are correlated.
    """
    rows = slice(0, 3) if cause == CORRELATED_GNSS else slice(3, 6)
    return pretest(np.where(noise.counted, evaluate(noise).white, 0.0)[:, rows]) < threshold


def fit_correlated(noise: NoiseHypothesis) -> NoiseFit:
    """Fit a Gauss–Markov error of the position fixes and their white part together.

    Parameters
    ----------
    noise : NoiseHypothesis
        Its sds of the fixes are the scale of the first guesses.
    """
    linearized = noise.linearized
    rows = noise.counted[:, :3]
    sd = np.array(
        [np.sqrt(np.mean(noise.sd[rows[:, a], a] ** 2)) if rows[:, a].any() else 1.0 for a in range(3)]
    )
    sd[:2] = np.sqrt(np.mean(sd[:2] ** 2))
    span = float(linearized.t[-1] - linearized.t[0])
    interval = _interval(noise)
    fixed = with_constants_fixed(noise)

    def trial(time: float, share: float) -> NoiseHypothesis:
        white = noise.sd[:, :3] * np.sqrt(1.0 / (1.0 + share**2))
        return replace(fixed, sd=np.hstack([white, noise.sd[:, 3:]]), markov_sd=share * sd, markov_time=time)

    def best(trials: Iterable[NoiseHypothesis]) -> NoiseHypothesis:
        return max(trials, key=lambda one: evaluate(one).value)

    times = np.geomspace(2.0 * interval, max(0.25 * span, 4.0 * interval), N_TRIAL_TIMES).tolist()
    time = best(trial(time, share) for time in times for share in TRIAL_SHARES[:2]).markov_time
    chosen = best(trial(time, share) for share in TRIAL_SHARES)
    start = replace(chosen, linearized=noise.linearized, columns=noise.columns)
    white = present(noise, ("position_horizontal", "position_vertical"))
    markov = tuple(name.replace("position", "markov") for name in white)
    parameters = noise_parameters((*markov, MARKOV_TIME, *white))
    return maximize_likelihood(start, parameters, prior_sd={MARKOV_TIME: TIME_PRIOR_SD})


def _interval(noise: NoiseHypothesis) -> float:
    """Return the time between fixes, s."""
    return float(np.median(np.diff(noise.linearized.t)))


def _coefficients(fit: NoiseFit) -> Mapping[str, Coefficient]:
    start, names = fit.start, fit.parameters.names
    out = {"time_constant": fit.coefficient(MARKOV_TIME, unit="s", scale=start.markov_time)}
    for name, label, axis in (("markov_horizontal", "sd", 0), ("markov_vertical", "sd_vertical", 2)):
        if name in names:
            out[label] = fit.coefficient(name, unit="m", scale=float(start.markov_sd[axis]))
    if "sd" not in out:
        out["sd"] = out.pop("sd_vertical")
    return out


class CorrelatedGnss(NoiseCause):
    """Position errors of the receiver that are correlated in time."""

    cause = CORRELATED_GNSS
    effect = Effect
    channels = ("gnss",)
    meaning = "errors of the positions stay from fix to fix, for some {time_constant}, with sd {sd}"
    consequence = "three Gauss–Markov states beside the white error"
    joins = "states"
    view = "slow means"

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:  # noqa: ARG003
        """Test for a Gauss–Markov error of the position fixes."""
        return (correlated_gnss(noise, evaluate(noise)),)

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis with the correlated states of the first one."""
        if final.config.gnss is None or base.config.gnss is None:
            return final
        configured = base.config.gnss
        gnss = replace(
            final.config.gnss,
            correlated=configured.correlated,
            correlated_down=configured.correlated_down,
        )
        return replace(final, config=replace(final.config, gnss=gnss))
