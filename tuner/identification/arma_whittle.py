"""ARMA models of every order by the Whittle likelihood of the cosine periodogram.

The spectrum of x_k = Σ a_i x_{k-i} + e_k + Σ b_j e_{k-j}, var e = s², unit interval, is::

    S(f) = s² |B(z)|² / |A(z)|²,    A = 1 - Σ a_i z^i,    B = 1 + Σ b_j z^j,    z = e^{-2πif}
    -2 ln L = Σ_cells c [ln S + P/S]
    ∂ ln S/∂a_i = 2 Re z^i/A,    ∂ ln S/∂b_j = 2 Re z^j/B

c coefficients of mean square P in a cell. The free numbers are ln s² and u, of which tanh u are the partial
autocorrelations of A, and of B as if it were one [3]_: every model is causal and invertible, and a root that nears the
unit circle, as of a slow bias, moves its u by as much for each decade.

An order starts from its smaller neighbours, with a zero coefficient or with a pole and a zero that nearly cancel, so
that the weak slow process of an inertial sensor (φ = 0.999 under white noise) is found, and from its larger ones with
coefficients left out. Sweeps over all orders, up and down, end when none gains: then no model is less likely than a
smaller one, or than a larger one without a coefficient.

P is that of the series behind a pilot autoregression, over the power of its filter: so nothing leaks from the ends of
the record to where there is little power. The estimates are those of maximum likelihood to O(1/n), at a cost that does
not grow with n after the transform.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
.. [2] P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, 2nd ed., ch. 4.4 and 10.8.
.. [3] J. F. Monahan, A note on enforcing stationarity in autoregressive-moving average models, Biometrika 71 (1984).
.. [4] D. B. Percival, A. T. Walden, Spectral Analysis for Physical Applications, 1993, ch. 6.5: prewhitening.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numba
import numpy as np
from scipy.fft import prev_fast_len
from scipy.linalg import block_diag, solve_toeplitz

from models.arrays import ComplexArray, FloatArray
from tuner.identification.fisher_scoring import minimise
from tuner.identification.periodogram import CosinePeriodogram, cosine_periodogram

Order = tuple[int, int]

MAX_CELLS = 512
"""Cells of even width: none is wider than this part of the band, so that a sharp peak is not smeared."""
MAX_FREE_NUMBER = 14.0
"""Largest |u|, a partial correlation of 1 − 1e-12: that of two slow roots is the product of their distances from 1."""
MAX_SWEEPS = 12
"""Sweeps over all orders, up and down in turn; chosen above what series need."""
LEAST_GAIN = 1e-2
"""Gain of −2 ln L for which a model is replaced: the price of a coefficient is some thousand times as much."""
FAST_POLES = (0.5, -0.5, -0.9)
"""Poles at which the search begins, beside one a decade of memory from ten samples up to the record."""
MOST_REFINED = 2
"""Starts from smaller orders that are refined: the likelihood may have several maxima."""
PILOT_LAGS, SAMPLES_A_LAG = 20, 50
"""Order of the autoregression by which a series is whitened before its periodogram, and least samples for each lag."""
LONG_TRANSFORM = 100_000
"""Samples from which a length with a large prime factor takes a second to transform."""
LAST_STEP_GAIN, LEAST_STEP_GAIN, FIRST_STEP_GAIN = 1e-8, 1e-3, 1.0
"""Gain of a step of −2 ln L below which a model is finished, a search ends, and starts are compared."""


@dataclass(frozen=True)
class WhittleArma:
    """An ARMA model: x_k = Σ ar_i x_{k-i} + e_k + Σ ma_j e_{k-j}, var e = variance, with its -2 ln L.

    `covariance` is that of (ar, ma), shape (p + q, p + q), by the information of the periodogram.
    """

    ar: tuple[float, ...]
    ma: tuple[float, ...]
    variance: float
    deviance: float
    covariance: FloatArray

    def score(self, penalty: float) -> float:
        """Return deviance plus `penalty` a parameter: 2 makes AIC, ln n makes BIC."""
        return self.deviance + penalty * (len(self.ar) + len(self.ma) + 1)


Part = tuple[FloatArray, FloatArray]
"""Free numbers u of poles (p,) and of zeros (q,)."""


@dataclass(frozen=True)
class _Point:
    """Free numbers of a model: ln s², and u of its poles, shape (p,), and zeros, shape (q,); with its -2 ln L."""

    p: int
    theta: FloatArray
    deviance: float

    @property
    def u(self) -> Part:
        """Free numbers of poles and of zeros."""
        return self.theta[1 : self.p + 1], self.theta[self.p + 1 :]

    @property
    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """AR and MA coefficients."""
        poles, zeros = self.u
        return autoregression(poles)[0], -autoregression(zeros)[0]


def fit_orders(pieces: Sequence[FloatArray], highest: Order = (3, 3)) -> dict[Order, WhittleArma]:
    """Fit every ARMA(p, q) up to the highest orders.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Evenly spaced samples of one series, each without a gap; the mean of each is taken out.
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
    likelihood = _Likelihood.of(prewhitened(pieces), max(highest))
    orders = [(p, q) for p in range(highest[0] + 1) for q in range(highest[1] + 1)]
    decades = np.arange(1.0, np.log10(likelihood.data.count.sum()))
    poles = (*(1.0 - 10.0**-decades).tolist(), *FAST_POLES)
    found = {(0, 0): likelihood.best([(np.zeros(0), np.zeros(0))], 1)}
    last = set(orders)
    for sweep in range(MAX_SWEEPS):
        up, changed = sweep % 2 == 0, set[Order]()
        for p, q in orders if up else orders[::-1]:
            beside = [(p - 1, q), (p, q - 1), (p - 1, q - 1)] if up else [(p + 1, q), (p, q + 1)]
            near = [found[one] for one in beside if one in found and one in last | changed]
            starts = [
                start
                for model in near
                for start in (_larger(model, (p, q), poles) if up else _smaller(model, (p, q)))
            ]
            if not starts:
                continue
            best = likelihood.best(starts, MOST_REFINED if up else len(starts))
            if (p, q) not in found or best.deviance < found[p, q].deviance - LEAST_GAIN:
                found[p, q] = best
                changed.add((p, q))
        if sweep and not changed:
            break
        last = changed
    return {order: likelihood.model(found[order]) for order in orders}


def prewhitened(pieces: Sequence[FloatArray]) -> CosinePeriodogram:
    """Return the periodogram of what an autoregression leaves of a series, over the power of its filter.

    Of a series whose spectrum is all but zero somewhere the periodogram holds mostly what leaks from its ends [4]_.
    """
    longest = max(pieces, key=len)
    n, rest = len(longest), longest - longest.mean()
    lags = min(PILOT_LAGS, n // SAMPLES_A_LAG)
    g = np.array([rest[: n - k] @ rest[k:] for k in range(lags + 1)]) / n
    filtered = np.append(1.0, -solve_toeplitz(g[:-1], g[1:])) if g[0] > 0.0 else np.ones(1)
    left = [np.convolve(one, filtered, mode="valid") for one in pieces if len(one) >= len(filtered)]
    left = [one[: prev_fast_len(len(one))] if len(one) > LONG_TRANSFORM else one for one in left]
    data = cosine_periodogram(left, 1.0, widest=0.5 / MAX_CELLS)
    passed = np.polynomial.polynomial.polyval(np.exp(-2j * np.pi * data.frequency), filtered)
    kept = data.order > 1.0  # a line that was taken out is nearly all of coefficient 1, as the mean is of 0
    cells = {
        name: getattr(data, name)[kept] for name in ("frequency", "count", "order", "parity", "span", "line")
    }
    return replace(data, amplitude=(data.amplitude / np.abs(passed))[kept], **cells)


@dataclass(frozen=True)
class _Likelihood:
    """-2 ln L as a function of (ln s², u of poles, u of zeros); `powers` are z^i, shape (most, m)."""

    data: CosinePeriodogram
    powers: ComplexArray

    @staticmethod
    def of(data: CosinePeriodogram, most: int) -> _Likelihood:
        """Return that of a periodogram, of orders up to `most`."""
        return _Likelihood(data, np.exp(-2j * np.pi * np.outer(np.arange(1, most + 1), data.frequency)))

    def best(self, starts: Sequence[Part], most: int) -> _Point:
        """Return the likeliest point next to starts; those that lead farthest, `most` of them, are followed to the end.

        A pole and a zero that nearly cancel change nothing yet: where they lead shows after some steps.
        """
        begun = sorted((self._begun(*start) for start in starts), key=lambda one: one.deviance)[:most]
        ends = (self._next(one.p, one.theta, LEAST_STEP_GAIN) for one in begun)
        return min(ends, key=lambda one: one.deviance)

    def model(self, point: _Point) -> WhittleArma:
        """Return the model of the minimum next to a point."""
        point = self._next(point.p, point.theta, LAST_STEP_GAIN)
        ar, ma = point.coefficients
        by = block_diag(*(sign * autoregression(u)[1] for sign, u in zip((1.0, -1.0), point.u, strict=True)))
        information = self._at(point.theta, point.p)[2]  # of -2 ln L
        covariance = by @ np.linalg.pinv(0.5 * information, hermitian=True)[1:, 1:] @ by.T
        return WhittleArma(
            tuple(ar.tolist()), tuple(ma.tolist()), float(np.exp(point.theta[0])), point.deviance, covariance
        )

    def _begun(self, poles: FloatArray, zeros: FloatArray) -> _Point:
        """Return where a start at its best variance leads in a few steps."""
        theta, count = np.concatenate(([0.0], poles, zeros)), float(self.data.count.sum())
        theta[0] = np.log(1.0 - float(self._at(theta, len(poles))[1][0]) / count)  # Σ c P/S ÷ Σ c
        return self._next(len(poles), theta, FIRST_STEP_GAIN)

    def _next(self, p: int, theta: FloatArray, gain: float) -> _Point:
        """Return the minimum next to a point, to where a step gains less."""
        wide = np.concatenate(([np.inf], np.full(len(theta) - 1, MAX_FREE_NUMBER)))
        return _Point(
            p, *minimise(lambda at: self._at(at, p), theta, lower=-wide, upper=wide, tolerance=gain)
        )

    def _at(self, theta: FloatArray, p: int) -> tuple[float, FloatArray, FloatArray]:
        """Return -2 ln L at a point, its gradient and its information."""
        value, gradient, information = _sums(theta, p, self.powers, self.data.power, self.data.count)
        return value, gradient, information


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def autoregression(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of a stationary autoregression with partial correlations tanh u, and their derivatives.

    Parameters
    ----------
    u : ndarray, shape (p,)
        Free numbers.

    Returns
    -------
    coefficients : ndarray, shape (p,)
    derivatives : ndarray, shape (p, p)
        Of each coefficient by each u.
    """
    a, by = np.zeros(u.size), np.zeros((u.size, u.size))
    for k in range(u.size):
        partial = np.tanh(u[k])
        before, by_before = a[:k].copy(), by[:k].copy()
        for i in range(k):
            a[i] -= partial * before[k - 1 - i]
            by[i] -= partial * by_before[k - 1 - i]
            by[i, k] -= (1.0 - partial**2) * before[k - 1 - i]
        a[k], by[k, k] = partial, 1.0 - partial**2
    return a, by


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _sums(
    theta: FloatArray, p: int, powers: ComplexArray, power: FloatArray, count: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return -2 ln L of (ln s², u of p poles, u of zeros), its gradient, shape (r,), and information, shape (r, r)."""
    (a, by_poles), (b, by_zeros) = autoregression(theta[1 : p + 1]), autoregression(theta[p + 1 :])
    by = np.eye(theta.size)
    by[1 : p + 1, 1 : p + 1], by[p + 1 :, p + 1 :] = by_poles, by_zeros
    value, gradient, information = 0.0, np.zeros(theta.size), np.zeros((theta.size, theta.size))
    slope = np.ones(theta.size)
    for k in range(power.size):
        below, above = 1.0 + 0.0j, 1.0 + 0.0j
        for i in range(a.size):
            below -= a[i] * powers[i, k]
        for j in range(b.size):
            above -= b[j] * powers[j, k]
        spectrum = theta[0] + np.log((above.real**2 + above.imag**2) / (below.real**2 + below.imag**2))
        ratio = power[k] * np.exp(-spectrum)
        value += count[k] * (spectrum + ratio)
        for i in range(a.size):
            slope[1 + i] = 2.0 * (powers[i, k] / below).real
        for j in range(b.size):
            slope[1 + p + j] = -2.0 * (powers[j, k] / above).real
        for i in range(theta.size):
            gradient[i] += count[k] * (1.0 - ratio) * slope[i]
            for j in range(i + 1):
                information[i, j] += count[k] * slope[i] * slope[j]
    for i in range(theta.size):
        for j in range(i):
            information[j, i] = information[i, j]
    return value, gradient @ by, by.T @ information @ by


def free_numbers(a: FloatArray) -> FloatArray | None:
    """Return u of `autoregression`, shape (p,); None where the coefficients are not stationary."""
    u = np.zeros(len(a))
    for k in range(len(a) - 1, -1, -1):
        partial = a[-1]
        if not abs(partial) < 1.0:
            return None
        u[k] = np.arctanh(partial)
        a = (a[:-1] + partial * a[-2::-1]) / (1.0 - partial**2)
    return np.clip(u, -MAX_FREE_NUMBER, MAX_FREE_NUMBER)


def _parts(ar: FloatArray, ma: FloatArray) -> Iterator[Part]:
    """Yield the free numbers of coefficients, where these are causal and invertible."""
    poles, zeros = free_numbers(ar), free_numbers(-ma)
    if poles is not None and zeros is not None:
        yield poles, zeros


def _larger(known: _Point, order: Order, tried: Sequence[float]) -> Iterator[Part]:
    """Yield starts of a larger order: a coefficient of zero, or a pole and a zero that nearly cancel."""
    poles, zeros = known.u
    more = order[0] - len(poles), order[1] - len(zeros)
    if more != (1, 1):
        yield np.pad(poles, (0, more[0])), np.pad(zeros, (0, more[1]))
        return
    ar, ma = known.coefficients
    for pole in tried:
        zero = pole - 0.3 * np.sign(pole) * (1.0 - abs(pole))
        for ends in ((pole, zero), (zero, pole)):
            below, above = (
                np.convolve(np.append(1.0, one), [1.0, -end])
                for one, end in zip((-ar, ma), ends, strict=True)
            )
            yield from _parts(-below[1:], above[1:])


def _smaller(known: _Point, order: Order) -> Iterator[Part]:
    """Yield the starts of a smaller order: without the last coefficient, and without the last partial correlation."""
    (p, q), (ar, ma), (poles, zeros) = order, known.coefficients, known.u
    yield from _parts(ar[:p], ma[:q])
    yield poles[:p], zeros[:q]
