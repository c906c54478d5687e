"""Power-law noise as the rival of correlated noise: a process f^α that no term of the catalogue has.

A Gauss–Markov process, a low-pass or a colour each bend the spectrum, and so does noise of the spectrum f^α with an α
that is none of 0, −1 and −2 (white, flicker, random walk). Where such noise in their place explains the spectrum as
well, with no more parameters, it is the something else of a shortlist::

    E(f) = S_base(f) + s f^α,    s ≥ 0, α on a grid

with the base of quantization, white, flicker and random walk noise fitted again for each s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from models.noise import BiasInstability, RandomWalk
from tuner.diagnosis.static.model.residual import Residual, residual
from tuner.diagnosis.static.model.slow_likelihood import FLICKER

CORRELATED = ("gauss_markov", "lowpass", "colour")
"""Causes that bend the spectrum over decades."""
TRIED_EXPONENTS = (-0.25, -0.5, -0.75, -1.25, -1.5, -1.75)
"""α that are tried, a quarter apart: one between two loses a nat in fifty, and −1 and −2 are in the base."""
LOG_SIZES = (-12.0, 6.0)
"""Range of the log of the power ÷ that of the white noise, in the middle of the cells of the fit."""


def lead(fitted: Residual) -> float:
    """Return the log likelihood that power-law noise gains in place of all correlated causes of a model, nats."""
    kept = tuple(x for x in fitted.extensions if x.cause not in CORRELATED)
    bare = residual(fitted.channel, kept, near=fitted)
    fit = next(one for one in bare.fits if one.kinds == FLICKER)
    problem, f = bare.track.objective(FLICKER), bare.track.grid.frequency
    weak = fit.theta.copy()
    for kind in (RandomWalk, BiasInstability):
        at = sum(len(k.PARAMETERS) for k in FLICKER[: FLICKER.index(kind)])
        weak[at] = problem.lower[at] + 1.0
    best = -np.inf
    for exponent in TRIED_EXPONENTS:
        shape = fit.expected[-1] * (f / f[len(f) // 2]) ** exponent
        for start in (fit.theta, weak):

            def cost(log_size: float, shape=shape, start=start) -> float:  # type: ignore[no-untyped-def]
                track = replace(bare.track, fixed=bare.track.fixed + np.exp(log_size) * shape)
                return -track.fit(FLICKER, start).log_likelihood

            found = minimize_scalar(cost, bounds=LOG_SIZES, method="bounded", options={"xatol": 0.1})
            best = max(best, -float(found.fun))
    return best - fitted.fit.log_likelihood
