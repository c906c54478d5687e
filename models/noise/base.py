"""What every noise term answers: spectrum, Allan and Hadamard variance, autocovariance, state space, samples.

A term is a frozen dataclass whose fields are its parameters in SI units. Terms add up to a flat
`models.noise.NoiseModel`. Functions take `interval`, s, to answer for samples (see `models`); with it,
cluster times are multiples m = τ/interval and frequencies satisfy |f| <= 1/(2 interval).

Both variances are contrasts of the sum x of the rate samples. With V(m) = var(x_{k+m} − x_k), generalised
where the rate is not stationary::

    AVAR(m) = [4 V(m) − V(2m)] / (2 m²)
    HVAR(m) = [15 V(m) − 6 V(2m) + V(3m)] / (6 m²)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.units import time_derivative

if TYPE_CHECKING:
    from models.noise import NoiseModel
    from models.statespace import StateSpace

FloatArray = NDArray[np.float64]


def as_array(values: ArrayLike) -> FloatArray:
    """Return the values as floats."""
    return np.asarray(values, dtype=np.float64)


def require_positive(name: str, value: float) -> None:
    """Raise ValueError unless the value is positive and finite."""
    if not 0.0 < value < np.inf:
        msg = f"'{name}' must be positive, got {value}"
        raise ValueError(msg)


@dataclass(frozen=True)
class Term(ABC):
    """A noise process with a name and positive parameters; the first parameter scales its amplitude."""

    name: ClassVar[str]
    PARAMETERS: ClassVar[tuple[str, ...]]
    UNITS: ClassVar[tuple[float | str, ...]]
    """Unit of each parameter: a unit, or the power p of 1/s by which it differs from the unit of the rate."""

    def __post_init__(self) -> None:
        for parameter in self.PARAMETERS:
            require_positive(parameter, getattr(self, parameter))

    @abstractmethod
    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the two-sided spectral density at frequencies f, Hz; shape of f, unit²/Hz."""

    @abstractmethod
    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the derivatives of `psd` by the logarithms of PARAMETERS, shape (p, *shape of f)."""

    @abstractmethod
    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Allan variance at cluster times τ, s; shape of τ, unit²."""

    @abstractmethod
    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Hadamard variance at cluster times τ, s; shape of τ, unit²."""

    @abstractmethod
    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the autocovariance at lags, s; shape of lag, unit²; ValueError where it does not exist."""

    @abstractmethod
    def state_space(self) -> StateSpace | None:
        """Return the states that make the process; None where it is white, or a difference of such."""

    @abstractmethod
    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return n consecutive samples, shape (n,)."""

    def scaled(self, factor: float) -> Self:
        """Return the term of a process multiplied by a factor."""
        amplitude = self.PARAMETERS[0]
        return replace(self, **{amplitude: abs(factor) * getattr(self, amplitude)})

    def units(self, rate_unit: str) -> tuple[str, ...]:
        """Return the SI unit of each parameter for a rate in ``rad/s`` or ``m/s^2``."""
        return tuple(u if isinstance(u, str) else time_derivative(rate_unit, u) for u in self.UNITS)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and lists, ready for JSON or YAML."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}

    def __add__(self, other: Term | NoiseModel) -> NoiseModel:
        from models.noise import NoiseModel

        return NoiseModel((self, other))

    def __radd__(self, other: int) -> NoiseModel:
        """Let `sum` begin with its 0."""
        from models.noise import NoiseModel

        return NoiseModel((self,)) if other == 0 else NotImplemented
