"""Score scans on the slow track: which template would lower the likelihood most, the noise as fitted.

With weights 1/E and the templates N of the model projected out, a template c has::

    z = c'W r / √(c'W c − c'W N (N'W N)⁻¹ N'W c),    r = a − N β

A step at every block boundary costs one sine transform. The best template is then judged by a likelihood ratio
with the noise refitted under both hypotheses: a step resembles a random walk, so that a noise fit that has
absorbed it must be free to change.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from tuner.diagnosis.static.model.dct import block_transform, step_scale, step_sums
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR, davies

MIN_SQUARE_SCORE = 6.0
"""Square of a score below which a template is not refitted.

By chance χ²₁ exceeds 6 in 1.4 %, far more often than any threshold allows.
"""


@dataclass(frozen=True)
class Scan:
    """Scores of p templates.

    Attributes
    ----------
    score : ndarray, shape (p,)
        Normal deviates z.
    correlation : ndarray, shape (p − 1,)
        Correlation of neighbours, for the price of the scan.
    """

    score: FloatArray
    correlation: FloatArray

    @property
    def best(self) -> int:
        """Number of the template of largest score."""
        return int(np.argmax(np.abs(self.score)))

    @property
    def promising(self) -> bool:
        """Whether a refit is worth its time."""
        return bool(self.score[self.best] ** 2 > MIN_SQUARE_SCORE)


@dataclass(frozen=True)
class Judgement:
    """Test of a template by refits: likelihood ratio (shrunk), chance of it with the scan paid for, gain in nats."""

    ratio: float
    p_value: float
    gain: float


def weights(fitted: FittedChannel) -> FloatArray:
    """Return 1/E of the single coefficients, shape (K,)."""
    return 1.0 / fitted.fit.expected[: fitted.track.singles]


def rest(fitted: FittedChannel) -> FloatArray:
    """Return the residual coefficients, a − N β, shape (K,)."""
    return fitted.track.grid.amplitude[: fitted.track.singles] - fitted.track.columns @ fitted.fit.beta


def project(fitted: FittedChannel, templates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return whitened templates (K, p) free of those of the model, and their norms (p,)."""
    root = np.sqrt(weights(fitted))[:, None]
    basis, _ = np.linalg.qr(fitted.track.columns * root)
    white = templates * root
    norm_before = np.sqrt(np.sum(white * white, axis=0))
    white = white - basis @ (basis.T @ white)
    norm = np.sqrt(np.sum(white * white, axis=0))
    norm = np.where(norm > 1e-4 * norm_before, norm, np.inf)
    return white / norm, norm


def scan(fitted: FittedChannel, columns: FloatArray) -> tuple[Scan, FloatArray]:
    """Score templates given on the blocks, shape (M, p); return their coefficients (K, p) too."""
    templates = block_transform(columns, fitted.cleaned, fitted.track.singles)
    white, _ = project(fitted, templates)
    score = white.T @ (rest(fitted) * np.sqrt(weights(fitted)))
    return Scan(score, np.sum(white[:, :-1] * white[:, 1:], axis=0)), templates


def likeliest(fitted: FittedChannel, column: Callable[[float], FloatArray], near: float) -> float:
    """Return the time constant within a factor of two of `near`, s, whose template, shape (M,), scores most."""
    singles = fitted.track.singles
    target = rest(fitted) * np.sqrt(weights(fitted))

    def loss(log_constant: float) -> float:
        template = block_transform(column(float(np.exp(log_constant)))[:, None], fitted.cleaned, singles)
        return -float((project(fitted, template)[0][:, 0] @ target) ** 2)

    best = minimize_scalar(loss, bounds=(np.log(near / 2.0), np.log(near * 2.0)), method="bounded")
    return float(np.exp(best.x))


def scan_steps(fitted: FittedChannel) -> Scan:
    """Score a step at each block boundary 1 … M − 1."""
    channel, w = fitted.channel, weights(fitted)
    m, k = channel.blocks, np.arange(1, fitted.track.singles + 1)
    score = step_sums(w * rest(fitted), channel)
    g = np.zeros(m, dtype=complex)
    g[1 : len(k) + 1] = step_scale(channel, len(k)) ** 2 * w
    total = float(g.real.sum())
    place = np.arange(1, m)
    twice = _cosine_sums(g.real, m)[place]
    shifted = np.real(np.fft.fft(g * np.exp(-1j * np.pi * np.arange(m) / m)))[place]
    beside = float(g.real[1 : len(k) + 1] @ np.cos(np.pi * k / m))
    cross = np.stack([step_sums(w * column, channel) for column in fitted.track.columns.T], axis=1)
    inverse = np.linalg.pinv(fitted.track.columns.T @ (fitted.track.columns * w[:, None]), hermitian=True)
    variance = 0.5 * (total - twice) - np.sum((cross @ inverse) * cross, axis=1)
    covariance = 0.5 * (beside - shifted[:-1]) - np.sum((cross[:-1] @ inverse) * cross[1:], axis=1)
    usable = variance > 1e-6 * variance.max()
    sd = np.sqrt(np.where(usable, variance, np.inf))
    edge = np.minimum(place, m - place) < max(4, m // 500)
    score = np.where(edge, 0.0, score / sd)
    return Scan(score, np.nan_to_num(covariance / (sd[:-1] * sd[1:]), nan=1.0))


def _cosine_sums(g: FloatArray, m: int) -> FloatArray:
    """Return Σ_k g_k cos(2πkj/M) for j = 0 … M − 1."""
    half = np.real(rfft(g))
    return np.concatenate((half, half[1 : m - len(half) + 1][::-1]))


def judge(fitted: FittedChannel, template: FloatArray, correlation: FloatArray, *, price: float) -> Judgement:
    """Test a template (K,) by refits; `price` is what the gain pays for the choice, nats."""
    ratio = max(0.0, 2.0 * (fitted.refit(template).log_likelihood - fitted.fit.log_likelihood))
    gain = 0.5 * ratio - price - 0.25 * float(np.log(fitted.channel.blocks))
    return Judgement(ratio, davies(SLOW_RATIO_FACTOR * ratio, correlation), gain)
