"""Whether a filter takes its own errors for information: its covariance against that along the truth.

A filter forms its matrices at its estimate, whose errors make motion out of nothing: what a trajectory never shows,
most often the heading, seems to become known [1]_. Linear covariance along the true motion
(`tuner.consistency.error_budget`), of the
same beliefs, does not shrink so; on motion that shows all states the two agree to a hundredth.

References
----------
.. [1] G. P. Huang, A. I. Mourikis, S. I. Roumeliotis, Observability-based rules for designing consistent EKF SLAM
   estimators, International Journal of Robotics Research 29 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tuner.consistency.error_budget import Budget
from tuner.consistency.scores import MARGIN
from tuner.simulation.monte_carlo import Runs

_AXES = ("x", "y", "z")
_STATES = (
    *((f"position {axis}", 1.0, "m") for axis in ("north", "east", "down")),
    *((f"velocity {axis}", 1.0, "m/s") for axis in ("north", "east", "down")),
    *((name, float(np.degrees(1.0)), "deg") for name in ("tilt about north", "tilt about east", "heading")),
    *((f"gyro bias {axis}", float(np.degrees(1.0)), "deg/s") for axis in _AXES),
    *((f"accelerometer bias {axis}", 1.0, "m/s²") for axis in _AXES),
)
"""Name, factor from SI and unit of the errors of `Runs`."""


@dataclass(frozen=True)
class Spurious:
    """The error that a filter most believes to know and cannot: its sd, and that of linear covariance."""

    state: str
    believed: float
    linear: float
    unit: str

    @property
    def text(self) -> str:
        """In words."""
        return (
            f"the filter takes its own errors for information: it believes {self.state} to {self.believed:.2g} "
            f"{self.unit} (1 sd, while aided), where this motion tells it to {self.linear:.2g} {self.unit}; its noise "
            "cannot be judged here: fly turns and changes of speed, or begin with a smaller uncertainty"
        )


def spurious_information(flown: Runs, budget: Budget) -> Spurious | None:
    """Return the error whose sd a filter believes smaller by more than `MARGIN` than it can be; None without.

    Parameters
    ----------
    flown : Runs
        What was flown.
    budget : Budget
        Of the same filter along the same scenario.
    """
    rows = np.searchsorted(flown.t, budget.t[budget.aided])
    own = np.diagonal(flown.covariance[:, rows], axis1=-2, axis2=-1).mean(axis=(0, 1), dtype=float)
    linear = np.diagonal(budget.total[budget.aided], axis1=-2, axis2=-1).mean(axis=0)
    worst = int(np.argmin(own / linear))
    if own[worst] > linear[worst] / (1.0 + MARGIN) ** 2:
        return None
    name, factor, unit = _STATES[worst]
    return Spurious(name, factor * float(np.sqrt(own[worst])), factor * float(np.sqrt(linear[worst])), unit)
