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

import numpy as np

from tuner.consistency.observability import NAMES
from tuner.consistency.scores import EQUIVALENCE_MARGIN
from tuner.simulation.monte_carlo import Runs
from tuner.types.consistency import ErrorBudget
from tuner.types.verdict import Severity, Verdict, VerdictCode


def spurious_information(simulated: Runs, budget: ErrorBudget) -> Verdict | None:
    """Return the verdict that the linearisation gives information that the true motion does not; None without.

    It names the error whose sd the filter underestimates most, more than `EQUIVALENCE_MARGIN` below linear covariance,
    and both sds (SI).

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
    numbers = {"filter_sd": float(np.sqrt(own[worst])), "linear_sd": float(np.sqrt(linear[worst]))}
    return Verdict(VerdictCode.SPURIOUS_INFORMATION, Severity.EXPLANATION, NAMES[worst], numbers)
