"""ARMA(p, q) noise of a sampled sequence.

::

    y_k = Σ ar_i y_{k−i} + e_k + Σ ma_j e_{k−j},   var e = variance,   samples `interval` apart

    S_d(f) = dt · variance · |1 + Σ ma_j z^−j|² / |1 − Σ ar_i z^−i|²,   z = exp(2πi f dt)

State form of Harvey, r = max(p, q + 1) states s::

    s_{k+1} = Phi s_k + g e_{k+1},   y_k = s_k[0],   Phi = [ar | shift],   g = (1, ma_1, …)

Allan and Hadamard variance come from the autocovariance g_i through the variance V(m) of a sum of m
samples [2]_, see `models.noise.base`. Lags are summed one by one while the process remembers, with g_0 − g_i
in place of g_i where that keeps the digits; beyond that V is a straight line.

References
----------
.. [1] P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, 2nd ed., ch. 3.
.. [2] N. F. Zhang, Allan variance of time series models for measurement data, Metrologia 45 (2008).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_discrete_lyapunov

from models.arrays import FloatArray, IntArray
from models.noise.base import Term, as_array, require_positive

_MIN_CORRELATION = 1e-18
"""Correlation below which the past is forgotten."""


@dataclass(frozen=True)
class Arma(Term):
    """A stationary and invertible ARMA sequence. It has no process in between: `interval` is its own.

    Raises
    ------
    ValueError
        Where a root says that the sequence is not stationary, or not invertible.
    """

    ar: tuple[float, ...]
    ma: tuple[float, ...]
    variance: float  # of the innovations e: unit²
    interval: float  # s

    name: ClassVar[str] = "arma"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("variance",)
    UNITS: ClassVar[tuple[float | str, ...]] = ()
    fitted: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("interval", self.interval)
        for field in ("ar", "ma"):
            object.__setattr__(self, field, tuple(float(a) for a in getattr(self, field)))
        for field, coefficients, fault in (
            ("ar", self.ar, "stationary"),
            ("ma", _negated(self.ma), "invertible"),
        ):
            root = _largest_root(coefficients)
            if not root < 1.0:
                values = getattr(self, field)
                raise ValueError(
                    f"'{field}' must be {fault}: largest root below 1, got {root:.6g} from {values}"
                )

    def scaled(self, factor: float) -> Arma:
        """Return the term of a sequence multiplied by a factor."""
        return replace(self, variance=factor**2 * self.variance)

    def units(self, rate_unit: str) -> tuple[str, ...]:
        """Return the unit of the variance."""
        return (f"({rate_unit})^2",)

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the spectrum of the sequence, |f| <= 1/(2 interval)."""
        self._check(interval)
        shift = np.exp(-2j * np.pi * as_array(f) * self.interval)
        numerator = np.polynomial.polynomial.polyval(shift, (1.0, *self.ma))
        denominator = np.polynomial.polynomial.polyval(shift, (1.0, *_negated(self.ar)))
        return as_array(self.interval * self.variance * np.abs(numerator / denominator) ** 2)

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return S, the derivative by ln variance, shape (1, *shape of f)."""
        return self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the exact Allan variance at whole multiples of the interval."""
        m = self._cluster_size(tau, interval)
        return self._contrast(m, (4.0, -1.0)) / (2.0 * m**2)

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the exact Hadamard variance at whole multiples of the interval."""
        m = self._cluster_size(tau, interval)
        return self._contrast(m, (15.0, -6.0, 1.0)) / (6.0 * m**2)

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the autocovariance at the nearest whole multiples of the interval."""
        self._check(interval)
        k = np.abs(np.rint(as_array(lag) / self.interval)).astype(np.int64)
        return _extended(self._first_autocovariances(), self.ar, int(k.max(initial=0)) + 1)[k]

    def state_space(self) -> NoReturn:
        """Raise ValueError: the sequence has discrete states only, see `transition`."""
        raise ValueError("an ARMA sequence has no continuous state space: use Arma.transition()")

    def transition(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return Phi, Qd and stationary P0 of the discrete states, shapes (r, r); y is the first state."""
        r = max(len(self.ar), len(self.ma) + 1)
        transition = np.eye(r, k=1)
        transition[: len(self.ar), 0] = self.ar
        gain = np.zeros(r)
        gain[: len(self.ma) + 1] = (1.0, *self.ma)
        noise = self.variance * np.outer(gain, gain)
        return transition, noise, solve_discrete_lyapunov(transition, noise)

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return a sequence that is stationary from its first sample."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        self._check(interval)
        transition, _, stationary = self.transition()
        values, vectors = np.linalg.eigh(stationary)
        past = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(values.size))
        memory = (transition @ past)[: max(len(self.ar), len(self.ma))]
        innovations = np.sqrt(self.variance) * rng.standard_normal(n)
        return np.asarray(lfilter((1.0, *self.ma), (1.0, *_negated(self.ar)), innovations, zi=memory)[0])

    def _check(self, interval: float | None) -> None:
        if interval is not None and not np.isclose(interval, self.interval, rtol=1e-6, atol=0.0):
            raise ValueError(
                f"'interval' must be that of the ARMA sequence, {self.interval} s, got {interval}"
            )

    def _cluster_size(self, tau: ArrayLike, interval: float | None) -> IntArray:
        self._check(interval)
        ratio = as_array(tau) / self.interval
        m = np.rint(ratio)
        if np.any(m < 1) or not np.allclose(ratio, m, rtol=1e-5, atol=0.0):
            raise ValueError(f"'tau' must be whole multiples of the interval {self.interval} s")
        return m.astype(np.int64)

    def _first_autocovariances(self) -> FloatArray:
        """Return g_0 … g_r; from g_r on they obey the autoregression alone."""
        transition, _, stationary = self.transition()
        column = stationary[:, 0]
        first = []
        for _ in range(column.size + 1):
            first.append(column[0])
            column = transition @ column
        return np.array(first)

    def _contrast(self, m: IntArray, weights: tuple[float, ...]) -> FloatArray:
        """Return w_1 V(m) + w_2 V(2m) + …, shape of m."""
        multiples = np.multiply.outer(np.arange(1, len(weights) + 1), m)
        root = _largest_root(self.ar)
        memory = (
            len(self.ar) + len(self.ma) + (int(np.log(_MIN_CORRELATION) / np.log(root)) if root > 0.0 else 0)
        )
        n = int(min(memory, multiples.max(initial=1))) + 1
        first = self._first_autocovariances()
        g = _extended(first, self.ar, n)
        variances = multiples * g[0] + 2.0 * _weighted_sum(g, multiples)
        drops = np.concatenate([[0.0], np.cumsum(_extended(first[:-1] - first[1:], self.ar, n - 1))])
        near = -2.0 * np.tensordot(weights, _weighted_sum(drops, multiples), axes=1)
        far = np.tensordot(weights, variances, axes=1)
        return np.where(multiples[-1] < n, near, far)


def _negated(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(-c for c in coefficients)


def _largest_root(coefficients: tuple[float, ...]) -> float:
    """Return the largest modulus of the roots of z^p − Σ c_i z^(p−i)."""
    return float(np.abs(np.roots((1.0, *_negated(coefficients)))).max(initial=0.0))


def _extended(first: FloatArray, ar: tuple[float, ...], n: int) -> FloatArray:
    """Return n values: the first ones as given, the others by the autoregression."""
    from scipy.signal import lfilter, lfiltic  # loaded when used: scipy.signal is slow to import

    if n <= first.size:
        return first[:n]
    denominator = (1.0, *_negated(ar))
    if not ar:
        return np.concatenate([first, np.zeros(n - first.size)])
    memory = lfiltic([1.0], denominator, first[::-1])
    rest, _ = lfilter([1.0], denominator, np.zeros(n - first.size), zi=memory)
    return np.concatenate([first, rest])


def _weighted_sum(g: FloatArray, m: IntArray) -> FloatArray:
    """Return Σ_{0<i<m} (m − i) g_i, with g = 0 beyond its end."""
    last = np.minimum(m - 1, g.size - 1)
    lag = np.arange(g.size)
    return as_array(m * (np.cumsum(g) - g[0])[last] - np.cumsum(lag * g)[last])
