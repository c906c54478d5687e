"""The likeliest size of a hypothesis with one free number, and its interval, from its deviance −2 ln L."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.interval_ends import reach

INTERVAL_DEVIANCE = 4.0
"""Deviance by which a size may be worse than the best: two standard errors, 95 %."""
DISTANCE_TO_END = 0.1
"""Distance to a bound of the search below which a size counts as beyond it: then the pattern is another fault's."""
FIRST_REACH = 0.05
"""Distance from the best size at which its interval is first looked for: that of some hundred independent values."""


@dataclass(frozen=True)
class BestSize:
    """The likeliest size of a hypothesis.

    Attributes
    ----------
    of : callable
        The deviance of a size.
    bounds : (float, float)
        Of the search.
    size, deviance : float
        The best one.
    """

    of: Callable[[float], float]
    bounds: tuple[float, float]
    size: float
    deviance: float

    @property
    def beyond(self) -> bool:
        """Whether the size lies beyond the bounds of the search."""
        return min(self.size - self.bounds[0], self.bounds[1] - self.size) < DISTANCE_TO_END

    def interval(self, rise: float = INTERVAL_DEVIANCE) -> tuple[float, float]:
        """Return where the deviance has risen by so much to either side, or the bounds."""

        def end(side: float, bound: float) -> float:
            limit, most = self.deviance + rise, side * (bound - self.size)
            near, far = reach(lambda x: self.of(self.size + side * x) > limit, FIRST_REACH, most)
            return self.size + 0.5 * side * (near + far)

        return end(-1.0, self.bounds[0]), end(1.0, self.bounds[1])


def best_size(deviance: Callable[[float], float], grid: Sequence[float]) -> BestSize:
    """Return the size of least deviance: the best of a rising grid, refined between its neighbours."""
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    best = int(np.argmin([deviance(x) for x in grid]))
    near = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    found = minimize_scalar(deviance, bounds=near, method="bounded", options={"xatol": 1e-4})
    return BestSize(deviance, (grid[0], grid[-1]), float(found.x), float(found.fun))
