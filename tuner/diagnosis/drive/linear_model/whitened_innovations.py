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
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, evaluate


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
    """

    t: FloatArray
    residual: FloatArray
    slope: FloatArray


def whiten(noise: NoiseHypothesis) -> WhitenedInnovations:
    """Return the whitened innovations of a run, and their sensitivities to all candidate constants."""
    linearized = noise.linearized
    every = evaluate(replace(noise, columns=tuple(range(len(linearized.parameters)))))
    rows = noise.counted
    root = np.sqrt(every.variance[rows])
    slope = every.sensitivity[rows]
    t = np.broadcast_to(linearized.t[:, None], rows.shape)[rows]
    return WhitenedInnovations(
        t, (every.innovation[rows] + slope @ every.theta) / root, slope / root[:, None]
    )
