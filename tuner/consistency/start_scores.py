"""Is the uncertainty at the start right? Errors of tilt and heading at the first fix, before fixes correct them.

Aided errors are scored once a filter has settled: by then a wrong P0 has mostly decayed. It shows only where the errors
at the start are drawn from what an alignment with the true unit leaves, and not from the filter itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tuner.consistency.scores import TEST_COUNT, score, squares
from tuner.simulation.monte_carlo import Runs
from tuner.types.consistency import Score
from tuner.types.verdict import Explanation, ExplanationKind

STARTS = {"initial_tilt": slice(6, 8), "initial_heading": slice(8, 9)}
"""Scores of the start, and their states."""


def start_scores(simulated: Runs) -> tuple[Score, ...]:
    """Return the scores of tilt and heading of runs at their first fix."""
    error, covariance = simulated.error[:, :1], simulated.covariance[:, :1].astype(float)
    return tuple(
        score(
            name,
            list(squares(error[..., own], covariance[..., own, own])),
            own.stop - own.start,
            tests=TEST_COUNT + len(STARTS),
        )
        for name, own in STARTS.items()
    )


def wrong_starts(scores: Sequence[Score]) -> tuple[Explanation, ...]:
    """Return which initial sds are wrong by scores of the start, the farthest off first, with 95 % intervals."""
    wrong = [one for one in scores if one.name in STARTS and not one.consistent]
    return tuple(
        Explanation(
            ExplanationKind.SCALE,
            one.name.replace("_", " "),
            one.ratio,
            one.interval,
            0.0,
        )
        for one in sorted(wrong, key=lambda one: -abs(np.log(one.ratio)))
    )
