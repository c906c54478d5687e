"""Sizes of given shapes of power, by Fisher scoring.

The mean of c squared coefficients of expectation E has the law of a gamma variable::

    -ln L = Σ c/2 (P/E − 1 − ln P/E),    E = Σ_k size_k shape_k + known,    size_k ≥ 0

Each step is a weighted least-squares fit whose weights c/(2 E²) are those of the last one; sizes that come out
negative are set to zero, the most negative first.

References
----------
.. [1] P. McCullagh, J. A. Nelder, Generalized Linear Models, 2nd ed., ch. 8 (gamma law, identity link).
"""

from __future__ import annotations

import numba
import numpy as np

from models.arrays import LEAST_DIVISOR, FloatArray

MAX_STEPS = 40
"""Largest number of steps of Fisher scoring, which converges in a few; it bounds the time where it does not."""
MIN_STEP_GAIN = 1e-4
"""Nats below which a step ends the search; far below what any decision needs."""
RATIOS_MULTIPLIED = 8
"""Ratios of power whose product is far from the largest and the least number."""
SUMS_IN_ANY_ORDER = {"reassoc", "contract", "nsz"}
"""What lets a processor add several numbers at a time; sums differ in their last digits."""
DIAGONAL_RIDGE = 1e-10
"""Share added to the diagonal of the normal equations, whose diagonal is 1: against singular ones, above rounding."""


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=SUMS_IN_ANY_ORDER)  # type: ignore[misc, unused-ignore]
def sizes(
    power: FloatArray, count: float, shapes: FloatArray, known: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the best sizes (k,) of shapes (k, b), the power they expect (b,) and minus its log likelihood.

    `power` and `known` have shape (b,): mean squares of `count` coefficients each, power that is not sized. Logarithms
    are taken of products of `RATIOS_MULTIPLIED` ratios.
    """
    number, width = shapes.shape
    level, weight = power.copy(), np.empty(width)
    ratio = np.ones(-(-width // RATIOS_MULTIPLIED) * RATIOS_MULTIPLIED)
    best, best_level, best_cost = np.zeros(number), level.copy(), np.inf
    matrix, target = np.empty((number, number)), np.empty(number)
    for _ in range(MAX_STEPS):
        for at in range(width):
            divisor = max(level[at], LEAST_DIVISOR)
            weight[at] = 0.5 * count / (divisor * divisor)
        for i in range(number):
            total = 0.0
            for at in range(width):
                total += weight[at] * shapes[i, at] * (power[at] - known[at])
            target[i] = total
            for j in range(i + 1):
                total = 0.0
                for at in range(width):
                    total += weight[at] * shapes[i, at] * shapes[j, at]
                matrix[i, j] = matrix[j, i] = total
        size = not_negative(matrix, target)
        largest, cost = 0.0, 0.0
        for at in range(width):
            level[at] = known[at]
            for i in range(number):
                level[at] += size[i] * shapes[i, at]
            largest = max(largest, level[at])
        for at in range(width):
            level[at] = max(level[at], 1e-9 * largest + LEAST_DIVISOR)
            ratio[at] = power[at] / level[at]
            cost += ratio[at] - 1.0
        for first in range(0, ratio.size, RATIOS_MULTIPLIED):
            product = 1.0
            for at in range(first, first + RATIOS_MULTIPLIED):
                product *= ratio[at]
            cost -= np.log(product)
        cost *= 0.5 * count
        settled = cost > best_cost - MIN_STEP_GAIN
        if cost < best_cost:
            best, best_level, best_cost = size, level.copy(), cost
        if settled:
            break
    return best, best_level, best_cost


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def not_negative(matrix: FloatArray, target: FloatArray) -> FloatArray:
    """Return the solution of normal equations (k, k), the most negative sizes set to zero one by one."""
    number = target.size
    scale = np.empty(number)
    for i in range(number):
        scale[i] = 1.0 / np.sqrt(max(matrix[i, i], LEAST_DIVISOR))
    kept = np.ones(number, dtype=np.bool_)
    part = np.empty((number, number))
    size = np.empty(number)
    for left in range(number, 0, -1):
        for i in range(number):
            size[i] = target[i] * scale[i] if kept[i] else 0.0
            for j in range(number):
                coupled = kept[i] and kept[j]
                part[i, j] = matrix[i, j] * scale[i] * scale[j] if coupled else 0.0
            part[i, i] += DIAGONAL_RIDGE if kept[i] else 1.0
        for i in range(number):
            for j in range(i + 1, number):
                factor = part[j, i] / part[i, i]
                size[j] -= factor * size[i]
                for k in range(i, number):
                    part[j, k] -= factor * part[i, k]
        for i in range(number - 1, -1, -1):
            for j in range(i + 1, number):
                size[i] -= part[i, j] * size[j]
            size[i] /= part[i, i]
        worst = int(np.argmin(size))
        if left == 1 or size[worst] >= 0.0:
            break
        kept[worst] = False
    return np.maximum(size, 0.0) * scale
