"""Errors at the start of a run, which no score counts, where they are far beyond what the filter says of them.

A start errs once a run: however many rows it has, the mean of eᵀ P⁻¹ e over them has at most the law of χ² with the
degrees of freedom of the block, one draw a run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from models.probability import chi2_quantile
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.output_scores import known_epochs, settling_time
from tuner.consistency.scores import BLOCKS
from tuner.consistency.velocity_of_positions import FALSE_ALARM
from tuner.limits import TOLERATED_RATIO
from tuner.types.consistency import Score


def unscored_start(runs: Sequence[OutputErrors], scores: Sequence[Score] = ()) -> list[str]:
    """Return notes on blocks whose errors in the time that is not scored exceed what is predicted, with their ratio.

    Blocks whose scores, after that time, are about as far off say nothing of the start.
    """
    notes, later = [], {one.name: one.ratio for one in scores}
    for name, own in BLOCKS.items():
        means = []
        for run in runs:
            rows = np.flatnonzero((run.t < run.t[0] + settling_time(run.t)) & known_epochs(run, own))
            if len(rows):
                error = run.error[rows, own]
                inverse = np.linalg.pinv(run.covariance[rows, own, own], hermitian=True)
                means.append(float(np.mean(np.einsum("ki,kij,kj->k", error, inverse, error))))
        freedom = 3.0 * len(means)
        if means and sum(means) > chi2_quantile(1.0 - FALSE_ALARM, freedom):
            ratio = math.sqrt(sum(means) / freedom)
            if ratio < TOLERATED_RATIO * later.get(name, 0.0):
                continue
            seconds = max(settling_time(run.t) for run in runs)
            notes.append(
                f"in the first {seconds:.0f} s, which the table leaves out, {name} errs by {ratio:.2g} × what is "
                "predicted: the start is less certain than the filter says"
            )
    return notes
