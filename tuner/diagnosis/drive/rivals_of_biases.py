"""What else a bias beyond its prior may be: constants that explain the innovations from the first fix on as well.

The innovations of the first minute, in which a filter settles, count in no test. But biases are estimated there: a bias
state takes up what a constant cause does, at the price of a prior that only those innovations show. So where a bias is
far beyond its prior, constants are tested once more on all innovations, beside a constant error of the same axes::

    ln B of a cause    against    ln B of the bias, and ½ z² of its estimate in prior sds

A cause that comes near is its alternative. A bias which the innovations hardly show is that of something else: as of
one wrong fix before the filter had settled. Biases that were measured at rest, before the filter started, need none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.filter_states.declaration import NAVIGATION_STATES
from tuner.diagnosis.drive.motion_errors import without_bias
from tuner.diagnosis.drive.score_tests import score_tests
from tuner.diagnosis.drive.search import RIVAL_NATS, SearchResult
from tuner.linear_run.likelihood import as_configured
from tuner.linear_run.whitened_innovations import whiten
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import Alternative, Finding

MIN_SHOWN_SHARE = 0.5
"""Part of ½ z² of a bias that the innovations must show: they show all of it where the filter is linear."""
MIN_MOVED_SHARE = 0.5
"""Part of a bias that the fixes must have corrected; less, and it was measured at rest."""
MAX_COST = 5.0
"""Evidence that a constant error of three axes pays for its amplitudes, nats: ½ k (1 + ln z²/k) at z² of 30."""


@dataclass(frozen=True)
class Rivals:
    """Alternatives of a bias beyond its prior, and whether the innovations show the bias."""

    alternatives: tuple[Alternative, ...]
    shown: bool


def rivals_of_bias(outcome: SearchResult, one: Finding) -> Rivals:
    """Return what else a bias may be, and whether the innovations show it.

    Parameters
    ----------
    outcome : SearchResult
        The search.
    one : Finding
        The bias; its value is the largest of its axes, in prior sds.
    """
    linearized = outcome.final.linearized
    moved = {
        axis: abs(float(linearized.correction[:, NAVIGATION_STATES + i].sum()))
        for i, axis in enumerate(GYROS + ACCELS)
        if axis in one.parameters
    }
    if all(moved[axis] < MIN_MOVED_SHARE * abs(c.value or 0.0) for axis, c in one.parameters.items()):
        return Rivals((), shown=True)
    own = without_bias(as_configured(linearized), list(one.parameters), {})
    w, evidence = whiten(own.noise), own.rival.evidence(own.rival.colour)
    listed = {a.cause for a in one.alternatives}
    near = tuple(
        Alternative(test.cause, float(np.exp(min(test.gain - evidence, 0.0))))
        for test in score_tests(w, linearized.parameters, outcome.shifts)
        if test.credible and test.cause not in listed and test.gain > max(evidence - RIVAL_NATS, 1.0)
    )
    return Rivals(near, evidence > MIN_SHOWN_SHARE * 0.5 * one.value**2 - MAX_COST)
