"""The tests of all causes on one filter run, in the order in which their results may be trusted.

Causes that are constants shift the innovations and are tested by `score_tests`; causes of the noise, of single fixes
and jumps of biases test another noise hypothesis of the linearised run (`CauseTest`).
"""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.drive.cause_test import MIN_GAIN, CauseTest
from tuner.diagnosis.drive.causes.base import constant_causes, noise_causes
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.score_tests import ScoreTest, score_tests
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured
from tuner.linear_run.whitened_innovations import WhitenedInnovations
from tuner.types import Coefficient, Parameter

STRONG_P_VALUE = 1e-9
"""p value below which a constant cause is significant whatever the noise: wrong noise does not halve a χ² of 40."""
SCORE_TEST_TITLE = "score of the sensitivity of the innovations"


@dataclass(frozen=True)
class Candidate:
    """A cause that may explain a run, with its test.

    Attributes
    ----------
    result : TestResult
        p value, gain and statistic.
    score_test : ScoreTest or None
        Test of a constant cause.
    test : CauseTest or None
        Test of any other.
    """

    result: TestResult
    score_test: ScoreTest | None = None
    test: CauseTest | None = None

    @property
    def cause(self) -> str:
        """Code of the cause."""
        return self.result.cause

    @property
    def credible(self) -> bool:
        """Whether a cause of the size that it would have to be is met in practice."""
        if self.score_test is not None:
            return self.score_test.credible
        return self.test is None or noise_causes()[self.cause].is_credible(self.test)

    def is_significant(self, threshold: float) -> bool:
        """Whether the p value is below a threshold and the cause gains likelihood."""
        return self.result.p_value < threshold and self.result.gain > MIN_GAIN


def noise_hypothesis_of(run: FilterRun, accepted: tuple[str, ...]) -> NoiseHypothesis:
    """Return the noise for which the filter of a run was configured, with accepted constants free."""
    names = run.linearized.parameters
    columns = tuple(i for i, parameter in enumerate(names) if parameter.cause in accepted)
    return replace(as_configured(run.linearized), columns=columns)


def candidates(
    run: FilterRun, w: WhitenedInnovations, accepted: tuple[str, ...], threshold: float
) -> tuple[Candidate, ...]:
    """Test all causes on a run, those with rivals only where one of these, or nothing, is significant."""
    found = _candidates(run, w, accepted, threshold)
    significant = {one.cause for one in found if one.is_significant(threshold) and one.credible}
    alike = [
        cause
        for cause in noise_causes().values()
        if cause.rivals and (not significant or significant & set(cause.rivals))
    ]
    noise = noise_hypothesis_of(run, accepted)
    return (*found, *(_candidate(test) for cause in alike for test in cause.test(run, noise, threshold)))


def _candidates(
    run: FilterRun, w: WhitenedInnovations, accepted: tuple[str, ...], threshold: float
) -> tuple[Candidate, ...]:
    """Test all causes on a run; accepted constants are fitted beside every test.

    Constants that shift innovations leak into every noise parameter, and wrong noise makes weak constants look
    significant. Where a constant is strong, noise and jumps are tested with all constants free, so that none leaks:
    what is still strong then comes before any constant, and strong constants follow. Where none is strong, noise and
    jumps come first, both beside single fixes, and weak constants last. A test that comes later is not made, or counts
    as not significant, while an earlier one is significant.
    """
    linearized = run.linearized
    noise = noise_hypothesis_of(run, accepted)
    constants = [score_candidate(one) for one in score_tests(w, linearized.parameters, accepted)]
    if any(one.is_significant(STRONG_P_VALUE) for one in constants):
        free = replace(noise, columns=tuple(range(len(linearized.parameters))))
        fixes, others = _test_fixes_and_noise(run, free, threshold)
        if any(one.is_significant(STRONG_P_VALUE) for one in others):
            return (*fixes, *others)
        return (*constants, *_test_fixes(run, noise, threshold))
    fixes, others = _test_fixes_and_noise(run, noise, threshold)
    if any(one.is_significant(threshold) for one in (*fixes, *others)):
        return (*fixes, *others)
    return (*constants, *fixes, *others)


def _test_fixes(run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[Candidate, ...]:
    """Test the causes of single fixes."""
    own = [cause for cause in noise_causes().values() if cause.of_single_fixes and cause.tested_with is None]
    return tuple(_candidate(test) for cause in own for test in cause.test(run, noise, threshold))


def _test_fixes_and_noise(
    run: FilterRun, noise: NoiseHypothesis, threshold: float
) -> tuple[tuple[Candidate, ...], ...]:
    """Test the causes of single fixes, and those of the noise and of jumps; two causes at a time.

    The kernels of the likelihood release the interpreter's lock. Warnings of scipy's line search are not for the user,
    and scipy suppresses them in one thread only.
    """
    with warnings.catch_warnings(), ThreadPoolExecutor(max_workers=2) as pool:
        warnings.filterwarnings("ignore", "The line search|Rounding errors", RuntimeWarning)
        own = [
            cause
            for cause in noise_causes().values()
            if not (cause.of_single_fixes or cause.rivals) and cause.tested_with is None
        ]
        others = [pool.submit(cause.test, run, noise, threshold) for cause in own]
        fixes = pool.submit(_test_fixes, run, noise, threshold)
        return fixes.result(), tuple(_candidate(test) for one in others for test in one.result())


def _candidate(test: CauseTest) -> Candidate:
    return Candidate(test.result, test=test)


def score_candidate(test: ScoreTest) -> Candidate:
    """Return the candidate of a constant cause."""
    result = TestResult(test.cause, test.p_value, test.gain, test.statistic, SCORE_TEST_TITLE)
    return Candidate(result, score_test=test)


def coefficients(
    parameters: tuple[Parameter, ...], value: FloatArray, covariance: FloatArray
) -> dict[str, Coefficient]:
    """Return estimates (p,) with covariance (p, p) as coefficients with normal intervals, by parameter name."""
    sd, causes = np.sqrt(np.diag(covariance)), constant_causes()
    return {
        p.name: Coefficient.known(
            float(v), float(v - 1.96 * s), float(v + 1.96 * s), causes[p.cause].units[p.name]
        )
        for p, v, s in zip(parameters, value, sd, strict=True)
    }
