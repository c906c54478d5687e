"""The fit of the papers to an Allan curve: σ² = Σ A_n τⁿ, n = −2 … 2, every point of the same absolute weight.

The steep ends of the curve rule such a fit, and it has no intervals.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray

POWERS = np.arange(-2.0, 3.0)
"""Power of τ in the Allan variance of quantization, white noise, bias instability, random walk and ramp."""


def unweighted_fit(tau: FloatArray, variance: FloatArray) -> FloatArray:
    """Return A_n by the powers; a negative one means nothing."""
    design = tau[:, None] ** POWERS
    scale = np.linalg.norm(design, axis=0)
    return np.asarray(np.linalg.lstsq(design / scale, variance, rcond=None)[0] / scale)
