"""Does a filter gain information that its trajectory does not give? Its covariance against linear covariance.

A filter forms its matrices at its estimate, whose errors act like motion: what a trajectory never shows, most often
the heading, seems to become known [1]_. Linear covariance along the true motion
(`tuner.consistency.error_budget`) of the same configuration does not shrink so; on motion that shows all states the
two agree to a hundredth.

References
----------
.. [1] G. P. Huang, A. I. Mourikis, S. I. Roumeliotis, Observability-based rules for designing consistent EKF SLAM
   estimators, International Journal of Robotics Research 29 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tuner.consistency.observability import NAMES
from tuner.consistency.scores import EQUIVALENCE_MARGIN
from tuner.simulation.monte_carlo import Runs
from tuner.types.consistency import ErrorBudget
from tuner.types.verdict import Severity, Verdict, VerdictCode


@dataclass(frozen=True)
class SpuriousInformation:
    """The error whose sd a filter underestimates most: name, sd of the filter and of linear covariance (SI)."""

    state: str
    filter_sd: float
    linear_sd: float

    @property
    def verdict(self) -> Verdict:
        """Verdict that the linearisation gives information that the true motion does not."""
        numbers = {"filter_sd": self.filter_sd, "linear_sd": self.linear_sd}
        return Verdict(VerdictCode.SPURIOUS_INFORMATION, Severity.EXPLANATION, self.state, numbers)


def spurious_information(simulated: Runs, budget: ErrorBudget) -> SpuriousInformation | None:
    """Return the error whose sd a filter states more than `EQUIVALENCE_MARGIN` below linear covariance; None without.

    Parameters
    ----------
    simulated : Runs
        Simulated runs of a filter.
    budget : ErrorBudget
        Of the same filter along the same scenario.
    """
    rows = np.searchsorted(simulated.t, budget.t[budget.aided])
    own = np.diagonal(simulated.covariance[:, rows], axis1=-2, axis2=-1).mean(axis=(0, 1), dtype=float)
    linear = np.diagonal(budget.total[budget.aided], axis1=-2, axis2=-1).mean(axis=0)
    worst = int(np.argmin(own / linear))
    if own[worst] > linear[worst] / (1.0 + EQUIVALENCE_MARGIN) ** 2:
        return None
    return SpuriousInformation(NAMES[worst], float(np.sqrt(own[worst])), float(np.sqrt(linear[worst])))
