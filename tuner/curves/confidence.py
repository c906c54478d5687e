"""Equivalent degrees of freedom of the Allan family.

A variance estimate V of mean σ² is treated as σ² χ²(ν)/ν with ν = 2 (E V)² / var V. For the mean of M squares of a
stationary difference z with autocovariance s(l) that is exact and cheap::

    ν = M² s(0)² / Σ_{|l|<M} (M - |l|) s(l)²

and s is the second (Allan) or third (Hadamard) difference, taken twice, of the generalised covariance c of the phase:
s(l) = 6 c(l) - 4 c(l ± m) + c(l ± 2m) for Allan, with c(t) = Q² δ(t), -N² |t|/2, B² t² ln|t|/(2π), K² |t|³/12 and
-σ² T² (|t|/T - 1 + e^{-|t|/T}) for quantization, white noise, flicker, random walk and Gauss–Markov noise. A sum of terms
sums c. Beyond 32 samples a cluster s is a smooth function of l/m and the sum is taken on 32 points a cluster.

Total variance and Thêo1 are no such means; their degrees of freedom for pure noises were computed from the trace
ν = tr(QS)²/tr(QSQS) of the quadratic form and are tabulated against τ/T, without the sampling interval. A sum of terms
counts there as the term that dominates at τ.

References
----------
.. [1] C. A. Greenhall, W. J. Riley, Uncertainty of stability variances based on finite differences, PTTI 2003.
.. [2] D. A. Howe, T. K. Peppler, Estimation of very long-term stability using a special-purpose statistic, 2003.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    White,
)

FloatArray = NDArray[np.float64]

PURE: dict[str, Term] = {
    "quantization": Quantization(1.0),
    "white": White(1.0),
    "bias_instability": BiasInstability(1.0),
    "random_walk": RandomWalk(1.0),
}
"""Noise types that can be named in place of a model."""

_GRID = 32
"""Points a cluster on which a smooth autocovariance is summed."""

_REACH = 32
"""Longest lag of the sum, clusters: beyond it the differences of every term are uncorrelated."""

_WEIGHTS = {2: (6.0, -4.0, 1.0), 3: (20.0, -15.0, 6.0, -1.0)}
"""Weights of c at 0, ±1, ±2 (±3) clusters in the autocovariance of the second (third) difference."""


def dof(
    estimator: str,
    n: int,
    m: ArrayLike,
    noise: str | Sequence[str] | NoiseModel,
    *,
    interval: float = 1.0,
    offset: ArrayLike | None = None,
) -> FloatArray:
    """Return the equivalent degrees of freedom of variances of a record without gaps.

    Parameters
    ----------
    estimator : str
        ``adev oadev twogroup mdev hdev ohdev totdev theo1 theobr nsec``.
    n : int
        Samples of the record.
    m : array_like of int, shape (q,)
        Cluster sizes (m of Thêo1, not its τ).
    noise : str, sequence of str or NoiseModel
        Noise type by name, one for all or one a cluster size, or the whole model.
    interval : float
        Sampling interval, s; matters only for a model.
    offset : array_like of int, optional
        Start of the second grouping of ``twogroup``; m // 2 by default.

    Returns
    -------
    ndarray, shape (q,)
        At least 1.
    """
    clusters = np.atleast_1d(np.asarray(m, dtype=np.int64))
    if isinstance(noise, NoiseModel):
        models = [noise] * clusters.size
    else:
        names = [noise] * clusters.size if isinstance(noise, str) else list(noise)
        models = [NoiseModel((_named(name),)) for name in names]
    starts = np.broadcast_to(clusters // 2 if offset is None else np.asarray(offset), clusters.shape)
    found = np.empty(clusters.size)
    for i, (k, model, start) in enumerate(zip(clusters.tolist(), models, starts.tolist(), strict=True)):
        tau = k * interval
        if estimator in ("oadev", "ohdev"):
            order = 2 if estimator == "oadev" else 3
            found[i] = _overlapping(_Difference(model, order, tau), k, n + 1 - order * k)
        elif estimator == "mdev":
            found[i] = _averaged(_Difference(model, 2, tau), k, n + 2 - 3 * k)
        elif estimator in ("adev", "hdev"):
            order = 2 if estimator == "adev" else 3
            found[i] = 1.0 / _adjoining(
                _Difference(model, order, tau), n // k + 1 - order, n // k + 1 - order, 0.0
            )
        elif estimator == "twogroup":
            found[i] = _two_groups(_Difference(model, 2, tau), k, n, start)
        elif estimator == "totdev":
            found[i] = _total(dominant(model, tau), n, k)
        elif estimator == "theo1":
            found[i] = _theo1(dominant(model, 0.75 * tau), n, k)
        elif estimator == "theobr":
            found[i] = _theo_br(dominant(model, 0.75 * tau), n, k)
        elif estimator == "nsec":
            found[i] = n // k - 1
        else:
            msg = f"no degrees of freedom are known for estimator {estimator!r}"
            raise ValueError(msg)
    return np.maximum(found, 1.0)


def _named(name: str) -> Term:
    if name not in PURE:
        msg = f"'noise' must be one of {', '.join(PURE)}, got {name!r}"
        raise ValueError(msg)
    return PURE[name]


def dominant(model: NoiseModel, tau: float) -> str:
    """Return the noise type, of those in `PURE`, that carries most of the Allan variance of a model at τ."""
    share = dict.fromkeys(PURE, 0.0)
    for term in model.terms:
        slope = {GaussMarkov: "bias_instability"}.get(type(term), term.name if term.name in PURE else "white")
        if not isinstance(term, (Ramp, Sinusoid)):
            share[slope] += float(term.allan_variance(tau))
    return max(share, key=lambda name: share[name])


class _Difference:
    """Autocovariance of the second or third difference of the phase, against the lag in clusters."""

    def __init__(self, model: NoiseModel, order: int, tau: float) -> None:
        self.order = order
        self.tau = tau
        self.terms = [t for t in model.terms if not isinstance(t, (Ramp, Sinusoid, Quantization))]
        self.jitter = sum(t.increment_sd**2 for t in model.terms if isinstance(t, Quantization))
        if not self.terms and not self.jitter:
            self.terms = [PURE["white"]]

    def smooth(self, lag: FloatArray) -> FloatArray:
        """Return the part of the terms with memory at lags in clusters."""
        total = _WEIGHTS[self.order][0] * self._phase(lag)
        for j, weight in enumerate(_WEIGHTS[self.order][1:], start=1):
            total += weight * (self._phase(lag + j) + self._phase(lag - j))
        return total

    def spikes(self) -> FloatArray:
        """Return the part of quantization, which lives at whole lags 0, 1, … only."""
        return self.jitter * np.array(_WEIGHTS[self.order])

    def _phase(self, lag: FloatArray) -> FloatArray:
        t = np.abs(lag) * self.tau
        total = np.zeros_like(t)
        for term in self.terms:
            match term:
                case BiasInstability():
                    log = np.log(np.maximum(np.abs(lag), np.finfo(float).tiny))
                    total += term.level**2 / (2.0 * np.pi) * t**2 * log
                case RandomWalk():
                    total += term.density**2 * t**3 / 12.0
                case GaussMarkov():
                    scaled = t / term.time_constant
                    total -= (term.sd * term.time_constant) ** 2 * (scaled + np.expm1(-scaled))
                case _:  # white, or what looks white from afar
                    total -= 0.5 * float(term.allan_variance(self.tau)) * self.tau * t
        return total


def _overlapping(z: _Difference, m: int, terms: int) -> float:
    grid = min(m, _GRID)
    step = m / grid
    lags = np.arange(min(int(np.ceil(terms / step)), _REACH * grid))
    pairs = np.where(lags == 0, 1.0, 2.0) * (terms - step * lags)
    s = z.smooth(lags / grid)
    total = step * np.sum(pairs * s**2) + _spike_sum(z, terms, m)
    return float((terms * (s[0] + z.spikes()[0])) ** 2 / total)


def _spike_sum(z: _Difference, terms: int, m: int) -> float:
    """Return what quantization adds to Σ (M - |l|) s(l)²: whole samples, whatever the grid."""
    spikes = z.spikes()
    whole = np.arange(spikes.size)
    smooth = z.smooth(whole.astype(float))
    pairs = np.where(whole == 0, 1.0, 2.0) * np.maximum(terms - m * whole, 0)
    return float(np.sum(pairs * ((smooth + spikes) ** 2 - smooth**2)))


def _averaged(z: _Difference, m: int, terms: int) -> float:
    grid = min(m, _GRID)
    step = m / grid
    lags = np.arange(min(int(np.ceil(terms / step)), _REACH * grid))
    reach = np.arange(-grid + 1, lags.size + grid - 1)
    s = z.smooth(reach / grid)
    for j, spike in enumerate(z.spikes()):
        s[np.abs(reach) == j * grid] += spike / step
    s = np.convolve(s, grid - np.abs(np.arange(-grid + 1, grid)), mode="valid")
    pairs = np.where(lags == 0, 1.0, 2.0) * (terms - step * lags)
    return float((terms * s[0]) ** 2 / (step * np.sum(pairs * s**2)))


def _adjoining(z: _Difference, first: int, second: int, offset: float) -> float:
    """Return half the covariance of two means of squares at every m-th position, relative to the squared mean.

    The second mean starts `offset` clusters later; with the mean itself that is 1/ν.
    """
    lags = np.arange(max(1 - second, -_REACH), min(first, _REACH + 1))
    pairs = np.minimum(first, second + lags) - np.maximum(lags, 0)
    shifted = lags - offset
    s = z.smooth(shifted)
    spikes = z.spikes()
    for j, spike in enumerate(spikes):
        s[np.abs(shifted) == j] += spike
    variance = z.smooth(np.zeros(1))[0] + spikes[0]
    return float(np.sum(pairs * s**2) / (first * second * variance**2))


def _two_groups(z: _Difference, m: int, n: int, offset: int) -> float:
    first, second = n // m - 1, (n - offset) // m - 1
    own = _adjoining(z, first, first, 0.0) + _adjoining(z, second, second, 0.0)
    return 4.0 / (own + 2.0 * _adjoining(z, first, second, offset / m))


_TOTAL = {"white": (1.50, 0.0), "bias_instability": (1.168, 0.222), "random_walk": (0.927, 0.358)}
"""b and c of ν = b T/τ - c, τ ≤ T/2 [Greenhall, Howe, Percival 1999; traces agree to 0.02]."""

_TOTAL_SAMPLING = {"white": (1.25, 2.0), "bias_instability": (0.328, 3.4), "random_walk": (0.0442, 4.8)}
"""a and p of the factor 1/(1 + a/m^p) for clusters of few samples, fitted to traces at N = 401."""

_TOTAL_END = {
    "quantization": (12.0, 5.44, 3.03),
    "white": (3.0, 1.59, 1.49),
    "bias_instability": (2.11, 1.18, 1.13),
    "random_walk": (1.51, 1.06, 1.03),
}
"""Traces at τ/T = 1/2, 3/4 and 1."""


def _total(noise: str, n: int, m: int) -> float:
    if 2 * m > n:
        return float(np.interp(m / n, [0.5, 0.75, 1.0], _TOTAL_END[noise]))
    if noise == "quantization":  # squares of the 2m terms at the ends share the end points
        return (6.0 * n + 8.0 * m) ** 2 / (70.0 * n + 126.0 * m + 32.0 * m * m)
    b, c = _TOTAL[noise]
    a, power = _TOTAL_SAMPLING[noise]
    return (b * n / m - c) / (1.0 + a / m**power)


_THEO1_SHARE = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75)
_THEO1 = {
    "white": (4.365, 4.168, 3.977, 3.616, 3.316, 3.171, 2.792, 2.133, 1.682, 1.502),
    "bias_instability": (1.897, 1.806, 1.716, 1.543, 1.385, 1.248, 1.054, 0.899, 0.873, 0.908),
    "random_walk": (1.285, 1.217, 1.149, 1.015, 0.888, 0.773, 0.697, 0.687, 0.739, 0.785),
}
"""ν τ/T of Thêo1 against τ/T for many samples: traces at m = 320."""

_THEO_BR_SHARE = (0.012, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.75)
_THEO_BR = {
    "white": (0.0049, 0.0070, 0.0168, 0.0306, 0.0367, 0.0367, 0.0341, 0.0279, 0.0223, 0.0160),
    "bias_instability": (0.0027, 0.0041, 0.0152, 0.0321, 0.0433, 0.0471, 0.0484, 0.0481, 0.0503, 0.0436),
    "random_walk": (0.0040, 0.0081, 0.0174, 0.0295, 0.0405, 0.0485, 0.0624, 0.0857, 0.1061, 0.1080),
}
"""1/ν of ThêoBR less 1/ν of Thêo1 against τ/T: what the ratio from the same record costs (12 000 runs, n = 1000)."""


def _theo1(noise: str, n: int, m: int) -> float:
    tau = 0.75 * m
    if noise == "quantization":
        return 0.86 * (n + 2) * (n + 1 - m) / (n + 1 - tau) * tau / (tau + 1.14)
    sampling = 1.0 - 2.44 / m if noise == "white" else 1.0
    return float(np.interp(tau / n, _THEO1_SHARE, _THEO1[noise]) * n / tau * sampling)


def _theo_br(noise: str, n: int, m: int) -> float:
    plain = _theo1(noise, n, m)
    if noise == "quantization":
        return plain
    return 1.0 / (1.0 / plain + float(np.interp(0.75 * m / n, _THEO_BR_SHARE, _THEO_BR[noise])))
