"""Damped Fisher scoring: the one optimiser of all likelihoods on a periodogram.

The step solves (I + λ diag I) d = -g with the gradient g and the expected second derivatives I of the
function; λ falls tenfold with every success and grows tenfold with every failure. Parameters stay inside
their bounds, and one that presses against its bound rests there.

References
----------
.. [1] K. Levenberg, A method for the solution of certain non-linear problems in least squares,
   Quart. Appl. Math. 2 (1944).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.arrays import FloatArray

Function = Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]

MOST_STEPS = 100
LONGEST_STEP = 2.0


def minimise(
    function: Function,
    start: FloatArray,
    *,
    lower: FloatArray,
    upper: FloatArray,
    fixed: int | None = None,
    tolerance: float = 1e-6,
) -> tuple[FloatArray, float]:
    """Return the minimum next to a start, and the value there.

    Parameters
    ----------
    function : callable
        Returns value, gradient (p,) and expected second derivatives (p, p).
    start, lower, upper : ndarray, shape (p,)
        First point and bounds.
    fixed : int, optional
        Number of a parameter that keeps its value.
    tolerance : float
        Gain of one step below which the search ends.
    """
    free = np.arange(len(start)) != fixed
    theta, damping = start.copy(), 1e-3
    value, gradient, information = function(theta)
    for _ in range(MOST_STEPS):
        at_edge = ((theta <= lower) & (gradient > 0)) | ((theta >= upper) & (gradient < 0))
        move = np.flatnonzero(free & ~at_edge)
        if not len(move):
            break
        matrix = information[move[:, None], move]
        diagonal = matrix.reshape(-1)[:: len(move) + 1]
        diagonal += damping * (diagonal + 1e-3)
        step = np.linalg.solve(matrix, -gradient[move])
        step = np.minimum(np.maximum(step, -LONGEST_STEP), LONGEST_STEP)
        trial = theta.copy()
        trial[move] = np.minimum(np.maximum(theta[move] + step, lower[move]), upper[move])
        attempt = function(trial)
        if attempt[0] <= value:
            gain, theta = value - attempt[0], trial
            value, gradient, information = attempt
            damping = max(0.1 * damping, 1e-9)
            if gain < tolerance:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return theta, value
