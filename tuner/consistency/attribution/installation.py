"""Constants of the installation that differ from the truth: they shift the errors of all runs alike.

Noise differs from run to run; what a wrong lever arm or delay does to the errors is the same in each, and shows in
their mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.probability import fisher_beyond
from tuner.consistency.scores import FALSE_ALARM_RATE, scored_epochs
from tuner.simulation.monte_carlo import Runs
from tuner.simulation.scenario import Scenario
from tuner.types.verdict import Explanation, ExplanationKind

CLOCK = "delay of the fixes"
"""Name of the offset of the clocks among the explanations."""
ARM = "lever arm"
"""Name of the lever arm among the explanations."""


def of_installation(simulated: Runs, plan: Scenario) -> tuple[Explanation, ...]:
    """Return the constants in which filter and truth differ, where the runs have errors in common."""
    arm = float(np.linalg.norm(plan.lever_arm))
    if (arm == 0.0 and plan.delay == 0.0) or not _common_errors(simulated, plan):
        return ()
    rows = scored_epochs(simulated.t, plan.outages)
    speed = float(np.sqrt(np.mean(np.sum(plan.truth.vel_n[rows] ** 2, axis=1))))
    found = [(arm, arm, ARM), (plan.delay * speed, plan.delay, CLOCK)]
    return tuple(
        Explanation(ExplanationKind.INSTALLATION, name, size, (size, size), 0.0)
        for metres, size, name in sorted(found, key=lambda one: -abs(one[0]))
        if metres != 0.0
    )


def without_means(simulated: Runs) -> Runs:
    """Return runs without the errors that they have in common, as large as they were in the mean square."""
    m = len(simulated.error)
    larger = np.sqrt(m / (m - 1.0))
    return replace(
        simulated,
        error=larger * (simulated.error - simulated.error.mean(axis=0)),
        innovation=larger * (simulated.innovation - simulated.innovation.mean(axis=0)),
    )


def _common_errors(simulated: Runs, plan: Scenario) -> bool:
    """Tell whether the runs err alike: Hotelling's test of their mean at each scored epoch, with Bonferroni's bound."""
    rows = scored_epochs(simulated.t, plan.outages)
    m, d = len(simulated.error), 6
    if m < d + 2 or not np.isfinite(simulated.error).all():
        return True  # too few runs, or lost ones: what is known to differ is the likeliest
    error = simulated.error[:, rows, :d]
    mean, centred = error.mean(axis=0), error - error.mean(axis=0)
    scatter = np.einsum("mki,mkj->kij", centred, centred) / (m - 1)
    square = m * np.einsum("ki,ki->k", mean, np.linalg.solve(scatter, mean[..., None])[..., 0])
    tail = fisher_beyond(float(square.max()) * (m - d) / (d * (m - 1)), d, m - d)
    return bool(tail * len(rows) < FALSE_ALARM_RATE)
