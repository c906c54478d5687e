"""Noise of a triad beside linear causes, from three series whose noise has known shapes and unknown sizes.

The spectrum of an axis is S(f) = Σ θ_c B_c(f) + F(f), with the same θ ≥ 0 for three axes. Series and causes are
tapered (Percival and Walden 1993, section 6.4): position noise that is differenced twice is 40 dB above white noise at
high frequencies, and would leak. Causes are fitted by least squares weighted with 1/S, the sizes θ by Whittle's
likelihood of what is left, in turn. Neighbouring frequencies of a tapered series are correlated: information is divided
by n Σh⁴.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.probability import normal_reach
from tuner.identification.fisher_scoring import minimise
from tuner.types import LEVEL, Coefficient

FIT_TURNS = 4
"""Turns of causes and noise: the sizes then change by less than a tenth of their sd."""
LIMIT_STEPS = 5
"""Steps to a limit: it then changes by less than 1 %."""
PRIOR_SDS = {"scale": 0.05, "turn": 0.1}
"""Sds of errors of scale and right angles, and of turned axes, rad, before a run: of uncalibrated units."""
SHORTEST_STRETCH = 32
"""Rows of a stretch: a tapered shorter one has no frequencies to speak of."""
NEIGHBOUR_ROWS, WILD_RATIO = 10, 10.0
"""Rows on either side, and remainder ÷ their median from which a pose is wrong: normal errors never are so large."""
WIDEST_LOG = 30.0
"""Range of the logarithm of a size about its first guess, of either sign: as good as absent, as good as alone."""


@dataclass(frozen=True)
class Misfit:
    """What a triad measures beyond poses, one value a time between them, and how causes and noise would show in it.

    Attributes
    ----------
    y : ndarray, shape (n, 3)
        Rate, rad/s, or specific force, m/s², along the axes of the triad.
    causes : mapping of str to ndarray, shape (p, n, 3)
        What one unit of each part of a cause adds.
    interval : float
        Time between poses, s.
    white, reference : ndarray, shapes (l,), (3, l)
        Autocovariances of unit white noise of the sensor, and of unit errors of the poses on each axis.
    known : ndarray, shape (3, l)
        Autocovariances of what is known of the poses otherwise.
    mixing : mapping of str to ndarray, shape (p, 3, 3)
        Of causes that are made of the measured values: how, by axis of the misfit and axis that is measured.
    kept : ndarray of bool, shape (n,)
        Rows between which there are all poses and samples, and no wild one.
    """

    y: FloatArray
    causes: Mapping[str, FloatArray]
    interval: float
    white: FloatArray
    reference: FloatArray
    known: FloatArray
    mixing: Mapping[str, FloatArray]
    kept: NDArray[np.bool_]

    @property
    def stretches(self) -> tuple[slice, ...]:
        """Rows in a line, `SHORTEST_STRETCH` and more."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self.kept, [False]]).astype(int)))
        return tuple(slice(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= SHORTEST_STRETCH)


@dataclass(frozen=True)
class Fitted:
    """Noise and causes of a triad.

    Attributes
    ----------
    causes : mapping of str to (ndarray, ndarray)
        Values (p,) and covariance (p, p).
    white, walk, reference : Coefficient
        N, K and the sd of the poses.
    """

    causes: Mapping[str, tuple[FloatArray, FloatArray]]
    white: Coefficient
    walk: Coefficient
    reference: Coefficient


def fitted(misfit: Misfit, names: Sequence[str], units: tuple[str, str, str], least_white: float) -> Fitted:
    """Fit the noise of a triad beside some causes.

    Causes that are made of measured values hold their noise: what it adds to the normal equations is taken out.

    Parameters
    ----------
    misfit : Misfit
        Of the triad.
    names : sequence of str
        Causes beside the noise.
    units : tuple of 3 str
        Of N, K and the sd of the poses.
    least_white : float
        N that the measured values have at least.
    """
    columns = np.concatenate([misfit.causes[name] for name in names])
    none = np.zeros((1, 3, 3))
    mixing = np.concatenate(
        [misfit.mixing.get(name, none.repeat(len(misfit.causes[name]), axis=0)) for name in names]
    )
    prior = np.concatenate([np.full(len(misfit.causes[name]), PRIOR_SDS.get(name, np.inf)) for name in names])
    parts = [_part(misfit, columns, stretch) for stretch in misfit.stretches]
    y, x, basis, known, white = (np.concatenate(one, axis=1) for one in zip(*parts, strict=True))
    correlated = float(SHORTEST_STRETCH * np.sum(hann(SHORTEST_STRETCH) ** 4))
    gram, cross = np.einsum("aij,bij->iab", mixing, mixing), np.einsum("aii->ia", mixing)
    size, spectrum = np.zeros(3), np.ones(y.shape[:2])
    beta, spread = np.zeros(len(columns)), np.eye(len(columns))
    for _ in range(FIT_TURNS):
        noise = 2.0 * max(float(size[0]), least_white**2) * np.sum(white / spectrum, axis=1)
        weighted = x / spectrum[..., None, None]
        matrix = np.einsum("ifra,ifrb->ab", weighted, x) - np.tensordot(noise, gram, 1)
        vector = np.einsum("ifra,ifr->a", weighted, y) - noise @ cross
        matrix = matrix / correlated + np.diag(prior**-2.0)
        scale = np.sqrt(np.abs(np.diag(matrix)))
        spread = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-10, hermitian=True) / np.outer(
            scale, scale
        )
        beta = spread @ vector / correlated
        power = np.mean((y - x @ beta) ** 2, axis=-1)
        size = sizes(power, basis, known)
        spectrum = basis @ size + known
    found, first = {}, 0
    for name in names:
        own = slice(first, first + len(misfit.causes[name]))
        found[name] = beta[own], spread[own, own]
        first = own.stop
    white_density, drift, reference = (
        _root(size, basis, known, correlated, part, unit) for part, unit in enumerate(units)
    )
    return Fitted(found, white_density, drift, reference)


def without_wild(misfit: Misfit, fit: Fitted) -> Misfit:
    """Return a misfit without rows whose remainder is `WILD_RATIO` times that of the rows about them."""
    rest = misfit.y - fitted_causes(misfit, fit)
    length = np.where(misfit.kept, np.linalg.norm(rest, axis=1), np.nan)
    usual = np.nanmedian(
        sliding_window_view(np.pad(length, NEIGHBOUR_ROWS, constant_values=np.nan), 2 * NEIGHBOUR_ROWS + 1),
        axis=1,
    )
    return replace(misfit, kept=misfit.kept & ~(length > WILD_RATIO * usual))


def fitted_causes(misfit: Misfit, fit: Fitted) -> FloatArray:
    """Sum of the causes at their fitted values, shape (n, 3)."""
    return np.asarray(
        sum(np.tensordot(values, misfit.causes[name], 1) for name, (values, _) in fit.causes.items())
    )


def hann(n: int) -> FloatArray:
    """Hann window of n samples without zeros at its ends, of unit sum of squares."""
    h = np.hanning(n + 2)[1:-1]
    return np.asarray(h / np.sqrt(h @ h))


def _part(misfit: Misfit, columns: FloatArray, stretch: slice) -> tuple[FloatArray, ...]:
    """Return Fourier coefficients of a stretch and of columns; spectra of noise, of what is known, of white noise."""
    n = stretch.stop - stretch.start
    frequency = 2.0 * np.pi * np.arange(1, (n - 1) // 2 + 1) / n
    h = hann(n)
    x = np.stack([_transformed(one[stretch], h) for one in columns], axis=-1)
    white = np.broadcast_to(_spectrum(misfit.white, frequency), (3, len(frequency)))
    walk = np.broadcast_to(misfit.interval / (2.0 - 2.0 * np.cos(frequency)), white.shape)
    reference, known = (
        np.stack([_spectrum(one, frequency) for one in own]) for own in (misfit.reference, misfit.known)
    )
    return _transformed(misfit.y[stretch], h), x, np.stack([white, walk, reference], axis=-1), known, white


def _transformed(x: FloatArray, h: FloatArray) -> FloatArray:
    """Return tapered Fourier coefficients of columns (n, 3): (3, frequencies, 2), real and imaginary parts × √2.

    Each column is without its tapered mean: biases of every stretch, which a filter knows.
    """
    found = np.fft.rfft(h[:, None] * (x - h @ x / h.sum()), axis=0)[1 : (len(x) - 1) // 2 + 1].T
    return np.asarray(np.sqrt(2.0) * np.stack([found.real, found.imag], axis=-1))


def _spectrum(covariance: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return the spectrum of a moving average by its autocovariances, at frequencies in rad a step."""
    lags = np.arange(1, len(covariance))
    return np.asarray(covariance[0] + 2.0 * np.cos(np.outer(frequency, lags)) @ covariance[1:])


def sizes(power: FloatArray, basis: FloatArray, known: FloatArray) -> FloatArray:
    """Return how much of each part powers show by the likelihood Σ ln s + p/s, s = basis · size + known.

    Parameters
    ----------
    power, known : ndarray, shape (...)
        Powers, and what is known of their means.
    basis : ndarray, shape (..., p)
        Power of one unit of each part.
    """
    parts = basis.reshape(-1, basis.shape[-1])
    p, fixed = power.ravel(), known.ravel()

    def cost(log: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        part = parts * np.exp(log)
        s = part.sum(axis=1) + fixed
        share = part / s[:, None]
        return float(np.sum(np.log(s) + p / s)), share.T @ (1.0 - p / s), share.T @ share

    first = np.log([max(float(np.median(p / one)), 1e-300) for one in parts.T])
    lower, upper = first - WIDEST_LOG, first + WIDEST_LOG
    starts = (first - 6.0 * (np.arange(len(first)) != alone) for alone in range(len(first)))
    fits = [minimise(cost, start, lower=lower, upper=upper) for start in starts]
    return np.asarray(np.exp(min(fits, key=lambda one: one[1])[0]))


def _root(
    size: FloatArray, basis: FloatArray, known: FloatArray, correlated: float, part: int, unit: str
) -> Coefficient:
    """Return the root of a size with its interval, or a limit where the size is not shown to be above zero."""
    value, sd = float(size[part]), _sd(size, basis, known, correlated, part)
    root, reach = math.sqrt(value), normal_reach(LEVEL)
    if value > reach * sd:
        factor = math.exp(0.5 * reach * sd / value)
        return Coefficient.known(root, root / factor, root * factor, unit)
    limit = value
    for _ in range(LIMIT_STEPS):  # a size at its limit scatters by more than one of zero
        at_limit = np.where(np.arange(len(size)) == part, limit, size)
        limit = value + normal_reach(2.0 * LEVEL - 1.0) * _sd(at_limit, basis, known, correlated, part)
    return Coefficient.bounded(math.sqrt(limit), unit, "hidden by the poses")


def _sd(size: FloatArray, basis: FloatArray, known: FloatArray, correlated: float, part: int) -> float:
    """Return the sd of a size by the expected information."""
    share = (basis / (basis @ size + known)[..., None]).reshape(-1, len(size))
    scale = np.linalg.norm(share, axis=0)
    share = share / scale
    return float(np.sqrt(correlated * np.linalg.pinv(share.T @ share)[part, part]) / scale[part])
