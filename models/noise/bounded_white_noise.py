"""White noise where a record shows none: no filter takes zero, and none may take more than the Allan curve allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

BOUNDED_SHARE = 0.5
"""Share of an upper limit that stands for what the data only bound: in the middle of what they allow."""


def largest_white_density(tau: ArrayLike, variance: ArrayLike) -> float:
    """Return the smallest σ(τ) √τ of an Allan curve: N ≤ σ(τ) √τ at every cluster time.

    Parameters
    ----------
    tau, variance : array_like, shape (m,)
        Cluster times, s, and Allan variances.
    """
    return float(np.sqrt(np.min(np.asarray(variance, dtype=float) * np.asarray(tau, dtype=float))))
