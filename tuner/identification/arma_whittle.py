"""ARMA models of every order by the Whittle likelihood of the cosine periodogram.

The spectrum of x_k = Σ a_i x_{k-i} + e_k + Σ b_j e_{k-j}, var e = s², unit interval, is::

    S(f) = s² |B(z)|² / |A(z)|²,    A = 1 - Σ a_i z^i,    B = 1 + Σ b_j z^j,    z = e^{-2πif}
    -2 ln L = Σ_cells c [ln S + P/S]
    ∂ ln S/∂a_i = 2 Re z^i/A,    ∂ ln S/∂b_j = 2 Re z^j/B

c coefficients of mean square P in a cell. Orders are fitted from the smallest up; each starts from its
smaller neighbours, with a zero coefficient or with a pole and a zero that nearly cancel, so that the weak
slow process of an inertial sensor (φ = 0.999 under white noise) is found. The spectrum does not see whether a
root lies inside or outside the unit circle: roots are reflected to make the model causal and invertible.

The estimates are those of maximum likelihood to O(1/n), at a cost that does not grow with n after the
transform.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
.. [2] P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, 2nd ed., ch. 4.4 and 10.8.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from models.arrays import ComplexArray, FloatArray
from tuner.identification.fisher_scoring import minimise
from tuner.identification.periodogram import CosinePeriodogram, cosine_periodogram

Order = tuple[int, int]

MAX_CELLS = 512
"""Cells of even width: none is wider than this part of the band, so that a sharp peak is not smeared."""

_TRIAL_POLES = (0.999, 0.99, 0.9, 0.5, -0.5, -0.9)
"""Poles at which the search begins: slow and fast, of both signs."""
_REFINED_STARTS = 2
"""Best starts that are refined: the likelihood may have several maxima."""


@dataclass(frozen=True)
class WhittleArma:
    """An ARMA model: x_k = Σ ar_i x_{k-i} + e_k + Σ ma_j e_{k-j}, var e = variance, with its -2 ln L."""

    ar: tuple[float, ...]
    ma: tuple[float, ...]
    variance: float
    deviance: float

    def score(self, penalty: float) -> float:
        """Return deviance plus `penalty` a parameter: 2 makes AIC, ln n makes BIC."""
        return self.deviance + penalty * (len(self.ar) + len(self.ma) + 1)


def fit_orders(y: FloatArray, highest: Order = (3, 3)) -> dict[Order, WhittleArma]:
    """Fit every ARMA(p, q) up to the highest orders.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly spaced samples; the mean is taken out.
    highest : (int, int)
        Highest p and q, up to 5 each.

    Returns
    -------
    dict
        Models by order (p, q), all deviances on the same scale.

    Raises
    ------
    ValueError
        If the series is too short or constant.
    """
    data = cosine_periodogram([y], 1.0, widest=0.5 / MAX_CELLS)
    powers = np.exp(-2j * np.pi * np.outer(np.arange(1, max(*highest, 1) + 1), data.frequency))
    fits: dict[Order, WhittleArma] = {}
    for p in range(highest[0] + 1):
        for q in range(highest[1] + 1):
            likelihood = _Likelihood(data, powers[:p], powers[:q])
            starts = np.stack(list(_starts(data, fits, (p, q))))
            first = np.argsort(likelihood.values(starts), kind="stable")[:_REFINED_STARTS]
            best = min((likelihood.minimise(starts[i]) for i in first), key=lambda found: found[1])
            fits[p, q] = _causal(*best, p)
    return fits


@dataclass(frozen=True)
class _Likelihood:
    """-2 ln L of one order as a function of (ln s², a, b); `poles` and `zeros` are z^i, (p, m) and (q, m)."""

    data: CosinePeriodogram
    poles: ComplexArray
    zeros: ComplexArray

    def __call__(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        p = len(self.poles)
        ar = 1.0 - theta[1 : p + 1] @ self.poles
        ma = 1.0 + theta[p + 1 :] @ self.zeros
        spectrum = np.exp(theta[0]) * _square(ma) / _square(ar)
        ratio = self.data.power / spectrum
        relative = np.empty((len(theta), len(ratio)))
        relative[0] = 1.0
        np.multiply(2.0, (self.poles / ar).real, out=relative[1 : p + 1])
        np.multiply(2.0, (self.zeros / ma).real, out=relative[p + 1 :])
        weighted = relative * self.data.count
        return (
            float(self.data.count @ (np.log(spectrum) + ratio)),
            weighted @ (1.0 - ratio),
            weighted @ relative.T,
        )

    def values(self, thetas: FloatArray) -> FloatArray:
        """Return -2 ln L of several parameters, shape (s, 1 + p + q)."""
        p = len(self.poles)
        ar, ma = 1.0 - thetas[:, 1 : p + 1] @ self.poles, 1.0 + thetas[:, p + 1 :] @ self.zeros
        spectrum = np.exp(thetas[:, :1]) * _square(ma) / _square(ar)
        return np.asarray((np.log(spectrum) + self.data.power / spectrum) @ self.data.count)

    def minimise(self, start: FloatArray) -> tuple[FloatArray, float]:
        """Return the minimum next to `start` and its value."""
        wide = np.full(len(start), np.inf)
        return minimise(self, start, lower=-wide, upper=wide, tolerance=1e-4)


def _square(values: ComplexArray) -> FloatArray:
    """Return |values|²."""
    return np.asarray(values.real**2 + values.imag**2)


def _starts(data: CosinePeriodogram, fits: dict[Order, WhittleArma], order: Order) -> Iterator[FloatArray]:
    """Yield parameters to start from: smaller models with a zero coefficient or a pair of roots added."""
    p, q = order
    if order == (0, 0):
        yield np.array([np.log(data.count @ data.power / data.count.sum())])
    for smaller in ((p - 1, q), (p, q - 1)):
        if smaller in fits:
            model = fits[smaller]
            ar, ma = np.zeros(p), np.zeros(q)
            ar[: smaller[0]], ma[: smaller[1]] = model.ar, model.ma
            yield np.concatenate(([np.log(model.variance)], ar, ma))
    if (p - 1, q - 1) in fits:
        model = fits[p - 1, q - 1]
        for pole in _TRIAL_POLES:
            zero = pole - 0.3 * np.sign(pole) * (1.0 - abs(pole))
            for ends in ((pole, zero), (zero, pole)):
                ar = -np.convolve(np.concatenate(([1.0], np.negative(model.ar))), [1.0, -ends[0]])[1:]
                ma = np.convolve(np.concatenate(([1.0], model.ma)), [1.0, -ends[1]])[1:]
                yield np.concatenate(([np.log(model.variance)], ar, ma))


def _causal(theta: FloatArray, deviance: float, p: int) -> WhittleArma:
    """Return the model of the same spectrum with all roots inside the unit circle."""
    poles, pole_gain = _reflect(np.concatenate(([1.0], -theta[1 : p + 1])))
    zeros, zero_gain = _reflect(np.concatenate(([1.0], theta[p + 1 :])))
    variance = float(np.exp(theta[0])) * zero_gain / pole_gain
    return WhittleArma(tuple((-poles[1:]).tolist()), tuple(zeros[1:].tolist()), variance, deviance)


def _reflect(polynomial: FloatArray) -> tuple[FloatArray, float]:
    """Return 1 + c_1 z + … with its reciprocal roots in the unit circle, and the factor taken out of |.|²."""
    roots = np.roots(polynomial)
    outside = np.abs(roots) > 1.0
    if not outside.any():
        return polynomial, 1.0
    gain = float(np.prod(np.abs(roots[outside]) ** 2))
    roots[outside] = 1.0 / np.conj(roots[outside])
    return np.atleast_1d(np.poly(roots).real), gain
