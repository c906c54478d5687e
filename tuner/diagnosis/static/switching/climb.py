"""Free numbers at which block means are likeliest under switching levels, from the likeliest level at the start."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from models.arrays import FloatArray
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE
from tuner.diagnosis.static.switching.models import Chain, Slow, likelihood_from

Parts = Callable[[FloatArray], tuple[Chain, Slow] | None]
"""Gives the chain and the slow states of free numbers, (p,); None where these are not allowed."""

MAX_STEPS = 600
"""Largest number of steps of a climb, chosen above the 350 that six free numbers have taken."""
ENDING_TOLERANCE = 0.01
"""Nats, and free numbers (logs, and sizes in scales), at which a climb ends: below a tenth of what is reported of them.

Lead of three levels over two: 3 nats; sds of the free numbers: 0.03 and more.
"""
MAX_CLIMBS = 3
"""Largest number of climbs; each begins where the one before ended, from the level that is likeliest there."""


def climb(
    y: FloatArray,
    r: FloatArray | float,
    parts: Parts,
    x: FloatArray,
    simplex: FloatArray | None = None,
    tolerance: float = ENDING_TOLERANCE,
) -> tuple[FloatArray, tuple[Chain, Slow], Callable[[FloatArray], float]]:
    """Return the free numbers, shape (p,), at the maximum near `x`, what they make, and the cost about it, nats.

    The cost is minus the log likelihood together with one level at the start: the likeliest at `x`; where another is
    likelier at the end, it is followed from there. `simplex`: first steps from `x`, shape (p, p).
    `tolerance`: see `ENDING_TOLERANCE`.
    """
    model, level = parts(x), -1
    for _ in range(MAX_CLIMBS):
        assert model is not None, "the free numbers to start from are allowed"
        values = [likelihood_from(y, *model, r, start) for start in range(len(model[0].levels))]
        if int(np.argmax(values)) == level:
            break
        level = int(np.argmax(values))
        cost = partial(_cost, y, r, parts, level)
        options: dict[str, Any] = {"maxiter": MAX_STEPS, "fatol": tolerance, "xatol": tolerance}
        if simplex is not None:
            options["initial_simplex"] = np.vstack([x, x + simplex])
        x = minimize(cost, x, method="Nelder-Mead", options=options).x
        model = parts(x)
    assert model is not None
    return x, model, cost


def _cost(y: FloatArray, r: FloatArray | float, parts: Parts, level: int, free: FloatArray) -> float:
    model = parts(free)
    return COST_OUTSIDE if model is None else -likelihood_from(y, *model, r, level)
