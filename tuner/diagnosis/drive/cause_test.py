"""Outcome of the test of a cause of noise, of single fixes or of a jump, and the limits that all such tests share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis
from tuner.types import Coefficient


@dataclass(frozen=True)
class CauseTest:
    """Outcome of the test of one cause.

    Attributes
    ----------
    result : TestResult
        p value and statistic; its `gain` is the log likelihood gained less ½ ln n a parameter, nats.
    noise : NoiseHypothesis
        The noise with the cause, to go on from; unchanged where the test is not significant.
    describe : callable
        () → parameters of the finding, with intervals; costs some fits.
    sd_model : mapping of str to float
        Model of the reported sds (`tuner.navigation.fix_sd_model`), factors on top of those compensated already; empty
        where one factor on each group of rows is enough.
    """

    result: TestResult
    noise: NoiseHypothesis
    describe: Callable[[], Mapping[str, Coefficient]]
    sd_model: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def is_significant(self, threshold: float) -> bool:
        """Whether the p value is below a threshold and the cause gains likelihood."""
        return self.result.p_value < threshold and self.result.gain > MIN_GAIN


MIN_GAIN = 1.0
"""Gain from which a cause is named, nats: a Bayes factor of e."""
NO_GAIN = -9.0
"""Gain of a test that is not significant, nats: below any gain that a fit could give by chance."""


def not_significant(
    cause: str, noise: NoiseHypothesis, p_value: float, statistic: float, name: str
) -> CauseTest:
    """Return the outcome of a test that is not significant."""
    return CauseTest(TestResult(cause, p_value, NO_GAIN, statistic, name), noise, dict)


MIN_FACTOR = 0.02
"""Least factor on a reported sd that is put into a filter; no setting takes it: an estimate at a bound decides nothing.

Beside correlated errors the white part of smoothed fixes may be nothing, and a filter configured for none rejects every
fix once its estimate is off. Chosen far below any factor of a real receiver.
"""


def scaled_factor(values: Mapping[str, float], key: str, more: float) -> float:
    """Return a factor of a compensation times another one, at least `MIN_FACTOR`."""
    return max(MIN_FACTOR, values.get(key, 1.0) * more)
