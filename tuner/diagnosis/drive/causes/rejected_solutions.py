"""Stated solutions that a filter rejects: their sds are reported before any single fix is called wrong.

A receiver may state a class of solution for every fix and report for one of them sds that are a hundredth of its
errors. The gate then rejects most of that class and little of the others, so that no likelihood of the fixes that are
left shows it. The shares are compared by Fisher's exact test; the first factor on the sds of the class is the root
mean square of its innovations ÷ sds, and is fitted with all others later.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import hypergeom

from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.linear_model.noise_parameters import BLOCKS, ROW_GROUPS, names_of_block
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE

MIN_FIXES = 10
"""Fixes of a class from which its rejection is no chance: a gate of 4 sds rejects one in ten thousand."""
MAX_REJECTED_SHARE = 0.5
"""Share of rejected fixes up to which the fixes that are left say what the sds of a class are."""


def rejected_solutions(run: FilterRun, threshold: float) -> tuple[Mapping[str, float], float]:
    """Return the sds of fixes by stated solution where a run rejects one, and the p value; nothing and 1 else.

    Parameters
    ----------
    run : FilterRun
        The run, without a model of the reported sds.
    threshold : float
        p value below which a share is not chance.

    Returns
    -------
    values : mapping of str to float
        Values of ``gnss_noise_scale`` (`tuner.navigation.fix_sd_model`).
    p_value : float
        The least, times the number of tests.
    """
    linearized, least = run.linearized, 1.0
    found: dict[str, float] = {}
    number, count = np.unique(
        linearized.solution[linearized.scored & np.isfinite(linearized.solution)], return_counts=True
    )
    stated = number[count >= MIN_FIXES].tolist()
    if len(number) < 2 or run.hypothesis.compensation.of(GNSS_NOISE_SCALE):
        return {}, 1.0
    for block, columns in BLOCKS.items():
        rows = list(columns)
        there = linearized.available[:, rows].all(axis=1) & linearized.scored
        lost = there & ~linearized.used[:, rows].all(axis=1)
        factors: dict[str, float] = {}
        for c, solution in enumerate(stated):
            own = there & (linearized.solution == solution)
            others = there & ~own
            if not own.any() or not others.any():
                continue
            share, usual = lost[own].mean(), lost[others].mean()
            chance = hypergeom.sf(lost[own].sum() - 1, there.sum(), lost.sum(), own.sum())
            p_value = min(1.0, float(chance) * len(BLOCKS) * len(stated))
            if share <= MAX_REJECTED_SHARE or usual >= MAX_REJECTED_SHARE or p_value >= threshold:
                continue
            least = min(least, p_value)
            for name in names_of_block(ROW_GROUPS, block):
                at = np.ix_(own, ROW_GROUPS[name])
                ratio = np.mean((linearized.innovation[at] / linearized.sd[at]) ** 2)
                factors[f"{name}_class_{c}"] = max(1.0, float(np.sqrt(ratio)))
        if factors:
            found |= {f"{block}_solution_{c}": solution for c, solution in enumerate(stated)} | factors
    return found, least
