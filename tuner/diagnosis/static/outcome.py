"""Result of a test of residuals: p-value, gain of likelihood, and the extension that it proposes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import LEAST_DIVISOR
from tuner.diagnosis.static.causes.base import Extension
from tuner.types import Alternative, Gain

UNKNOWN = "unknown"
"""Code of what is none of the causes, in a list of alternatives."""
WORTH_A_FIT = 1e-3
"""P-value above which nothing is fitted; chosen above any threshold, so that it only saves time."""
NO_GAIN = -9.0
"""Gain, nats, of what was not worth a fit: below any that a fit could give by chance, so that it is never chosen."""
ALTERNATIVE_NATS = 3.0
"""Nats within which a rival counts as an alternative: a likelihood ratio of 20, the usual 5 %."""
NEAR_TWIN_NATS = 10.0
"""Nats within which two slow shapes, or two shapes of the fast spectrum, are alternatives.

Errors of what they are functions of (a thermometer's lag and noise, a transient that is no exponential, a filter of
another order) cost a true one that much.
"""


@dataclass(frozen=True)
class TestResult:
    """Outcome of one family of tests on one fitted channel.

    Attributes
    ----------
    cause : str
        Name of the family; a cause code, or the name of a statistic that no cause owns.
    p_value : float
        Probability of such residuals where the model is right, the scan paid for.
    gain : float
        Log likelihood gained by the extension, less a price for its parameters and its scan, nats.
    statistic : float
        Value of the test statistic.
    name : str
        What the statistic is.
    propose : callable or None
        Makes the extensions (one; two for a pair); None where the family names no cause.
    misfit : float
        Of a test without a cause: nats that a description of its own would gain, 0 for that of the p-value.
    place : str
        Where it shows most, in words; empty for the whole record.
    confirm : callable or None
        Makes the result of closer judgement, which takes longer and gains no more; to be called before the proposal
        is used.
    """

    __test__ = False

    cause: str
    p_value: float
    gain: float
    statistic: float
    name: str
    propose: Callable[[], tuple[Extension, ...]] | None = None
    misfit: float = 0.0
    place: str = ""
    confirm: Callable[[], TestResult] | None = None

    @property
    def nats(self) -> float:
        """How much the data contradict the model, nats: of a fit, or what a p-value is worth."""
        return max(self.misfit, self.gain, -float(np.log(max(self.p_value, LEAST_DIVISOR))))

    @property
    def without_proposal(self) -> TestResult:
        """The result without `propose`, which would keep the whole fitted channel in memory."""
        return replace(self, propose=None, confirm=None)

    @property
    def without_fit(self) -> TestResult:
        """The result with whether it proposes something, but not what: that would keep the whole fit in memory."""
        return replace(self, propose=None if self.propose is None else tuple, confirm=None)


@dataclass(frozen=True)
class Accepted:
    """An extension, the test result that proposed it, and its gain on data held out."""

    extension: Extension
    result: TestResult
    alternatives: tuple[Alternative, ...] = ()
    gain: Gain | None = None
