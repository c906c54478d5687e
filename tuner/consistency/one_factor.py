"""One factor on all stated sds: does it explain the scores of a filter, whatever the filter is? Its size.

Sds that are no filter's, such as constants, give no gains, and so no likelihood of a fault. One factor k on all of
them still has a consequence that scores show: each mean of squares is k² times what it should be. With the means m_i
of d_i components and ν_i degrees of freedom::

    k² = Σ ν_i m_i/d_i ÷ Σ ν_i        each m_i/k² in its band        sd of ln k = 1/√(2 ν)

ν being that of the score of all states together: their errors depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from models.probability import REACH_95
from tuner.types.consistency import Score
from tuner.types.output_score import OutputCause

MIN_STATES = 3
"""States that must agree: any factor explains a single score."""


def one_factor(scores: Sequence[Score], states: Sequence[Score]) -> OutputCause | None:
    """Return the factor on all stated sds that explains all scores, None where none does.

    Parameters
    ----------
    scores : sequence of Score
        Of all states together, of blocks and of innovations.
    states : sequence of Score
        Of each state alone.
    """
    if len(states) < MIN_STATES:
        return None
    squares = sum(one.effective * one.mean / one.dof for one in states)
    square = squares / sum(one.effective for one in states)
    if not square > 0.0:
        return None
    if not all(one.band[0] <= one.mean / square <= one.band[1] for one in (*scores, *states)):
        return None
    size = math.sqrt(square)
    independent = max(one.effective for one in (*scores, *states))
    wide = math.exp(REACH_95 / math.sqrt(2.0 * independent))
    interval = (size / wide, size * wide)
    gain = independent * (0.5 * square - 0.5 - math.log(size))
    return OutputCause("noise_scale", size, interval, "1", gain, {"ratio": (size, *interval)})
