"""Second-order Gauss–Markov noise: a noise term of another package, in one file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from models.noise import Term
from models.statespace import StateSpace, stationary_system


@dataclass(frozen=True)
class SecondOrderGaussMarkov(Term):
    """Critically damped: autocovariance σ² (1 + |t|/T) exp(−|t|/T), smooth where that of first order has a corner."""

    sd: float  # σ: unit, stationary standard deviation
    time_constant: float  # T: s

    name: ClassVar[str] = "second_order_gauss_markov"
    title: ClassVar[str] = "second-order Gauss–Markov"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("sd", "time_constant")
    SYMBOLS: ClassVar[tuple[str, ...]] = ("σ GM2", "T GM2")
    UNITS: ClassVar[tuple[float | str, ...]] = (0.0, "s")

    def state_space(self) -> StateSpace:
        """Return the value and its rate × T; the rate is driven by white noise of density 4 σ²/T."""
        rate = 1.0 / self.time_constant
        dynamics = rate * np.array([[0.0, 1.0], [-1.0, -2.0]])
        return stationary_system(dynamics, [[0.0], [1.0]], [[1.0, 0.0]], [[4.0 * rate * self.sd**2]])
