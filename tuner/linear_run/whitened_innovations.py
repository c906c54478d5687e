"""Whitened innovations of a linearised run, and their sensitivities to unknown constants.

The separate-bias form of Friedland [1]_: with the filter's own gains K, the error that constants θ cause is V θ,

    V⁻ = Φ V + B        s = H V⁻ + D        V = V⁻ − K s        z = s θ + white of variance f

row by row. W = z/√f is white under the model, and W = (s/√f) θ + white.

References
----------
.. [1] B. Friedland, Treatment of bias in recursive filtering, IEEE Trans. Automatic Control 14 (1969).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate


@dataclass(frozen=True)
class WhitenedInnovations:
    """The m rows of a run that count, divided by their predicted sds.

    Attributes
    ----------
    t : ndarray, shape (m,)
        s.
    residual : ndarray, shape (m,)
        W.
    slope : ndarray, shape (m, p)
        s/√f, of all candidate constants.
    logs : float
        Σ ln 2πf.
    """

    t: FloatArray
    residual: FloatArray
    slope: FloatArray
    logs: float = 0.0


def whiten(noise: NoiseHypothesis) -> WhitenedInnovations:
    """Return the whitened innovations of a run, and their sensitivities to all candidate constants."""
    linearized = noise.linearized
    every = evaluate(replace(noise, columns=tuple(range(linearized.B.shape[2]))))
    rows = noise.counted
    root = np.sqrt(every.variance[rows])
    slope = every.sensitivity[rows]
    t = np.broadcast_to(linearized.t[:, None], rows.shape)[rows]
    residual = (every.innovation[rows] + slope @ every.theta) / root
    return WhitenedInnovations(
        t, residual, slope / root[:, None], float(np.sum(np.log(2.0 * np.pi * root**2)))
    )
