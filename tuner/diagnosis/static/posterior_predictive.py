"""Posterior predictive coverage: share of the measured curves inside the range of simulations of the model.

Replicas of the model are simulated and fitted again, so that the band knows what fitting hides. The quantity is the log
of an empirical curve over that of the model fitted to the same samples; the band at each point is the range of
the replicas, and the coverage the share of the points of the measured curve inside it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import LEAST_DIVISOR, FloatArray
from tuner.curves.allan import overlapping_allan
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel
from tuner.diagnosis.static.search import SearchResult

BAND_COUNT = 96
"""Bands of the spectrum, evenly spaced in the logarithm of the frequency; chosen as about twenty a decade."""


def covered(outcome: SearchResult, replicas: int, seed: int) -> SearchResult:
    """Return an outcome whose gains carry the coverage before and after."""
    if not outcome.accepted:
        return outcome
    before, after = (coverage(found, replicas, seed) for found in (outcome.base, outcome.final))
    shares = {name: (before[name], after[name]) for name in before}
    accepted = tuple(
        replace(a, gain=None if a.gain is None else replace(a.gain, coverage=shares))
        for a in outcome.accepted
    )
    return replace(outcome, accepted=accepted)


def coverage(fitted: FittedChannel, replicas: int, seed: int) -> dict[str, float]:
    """Return the share of the Allan curve (``allan``) and of the spectrum (``psd``) within the range of replicas.

    Parameters
    ----------
    fitted : FittedChannel
        Channel and model.
    replicas : int
        Number of simulated records, at least two.
    seed : int
        Seed of their noise.
    """
    n = len(fitted.channel)
    clusters = np.unique(np.geomspace(1, n // 5, 40).astype(int))
    edges = np.unique(np.geomspace(1, n, BAND_COUNT).astype(int))
    measured = _curves(fitted, clusters, edges)
    ratios: dict[str, list[FloatArray]] = {name: [] for name in measured}
    kept = tuple(x for x in fitted.extensions if type(x).clean_samples is Extension.clean_samples)
    rng = np.random.default_rng((seed, 39))
    for _ in range(max(2, replicas)):
        again = fit_channel(_replica(fitted, rng), kept, starts=fitted.starts)
        for name, (curve, model) in _curves(again, clusters, edges).items():
            ratios[name].append(np.log(curve / model))
    out = {}
    for name, (curve, model) in measured.items():
        spread = np.stack(ratios[name])
        lower, upper = model * np.exp(spread.min(axis=0)), model * np.exp(spread.max(axis=0))
        out[name] = float(np.mean((curve >= lower) & (curve <= upper)))
    return out


def _curves(
    fitted: FittedChannel, clusters: NDArray[np.int64], edges: NDArray[np.int64]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the measured curve and that of the model, Allan variance and spectrum, in scales²."""
    square = fitted.coefficients[1:] ** 2
    count = np.diff(edges).astype(float)
    power = np.add.reduceat(square[: edges[-1] - 1], edges[:-1] - 1) / count
    expected = np.add.reduceat(fitted.power[: edges[-1] - 1], edges[:-1] - 1) / count
    variance = overlapping_allan(fitted.cleaned.y, clusters)
    smooth = overlapping_allan(_template_path(fitted), clusters) + _model_allan(fitted, clusters)
    return {"allan": (variance, np.maximum(smooth, LEAST_DIVISOR)), "psd": (power, expected)}


def _template_path(fitted: FittedChannel) -> FloatArray:
    """Return what the templates make of the samples, shape (n,)."""
    centre = (np.arange(fitted.channel.blocks) + 0.5) * fitted.channel.block
    return np.interp(np.arange(len(fitted.channel)), centre, fitted.path)


def _model_allan(fitted: FittedChannel, clusters: NDArray[np.int64]) -> FloatArray:
    """Return the Allan variance of the noise from its spectrum, 4 Σ E sin⁴(xm)/(m² sin² x) Δf."""
    n, dt = len(fitted.channel), fitted.channel.interval
    edges = np.unique(np.geomspace(1, n, 2000).astype(int))
    count = np.diff(edges).astype(float)
    power = np.add.reduceat(fitted.power[: edges[-1] - 1], edges[:-1] - 1) / count
    x = 0.5 * np.pi * 0.5 * (edges[:-1] + edges[1:] - 1) / n
    weight = power * count / (2.0 * n * dt)
    out = np.empty(len(clusters))
    for i, m in enumerate(clusters):
        half = 0.5 * m * np.pi * count / (2.0 * n)
        mean = 3.0 / 8.0 - 0.5 * np.cos(2.0 * m * x) * np.sinc(2.0 * half / np.pi)
        mean = mean + 0.125 * np.cos(4.0 * m * x) * np.sinc(4.0 * half / np.pi)
        out[i] = 4.0 * float(np.sum(weight * mean / (m * np.sin(x)) ** 2))
    return out


def _replica(fitted: FittedChannel, rng: np.random.Generator) -> Channel:
    """Return a simulated channel: noise of the model, its templates and its law."""
    n = len(fitted.channel)
    law = next((x for x in fitted.extensions if isinstance(x, HeavyTails)), None)
    e = rng.standard_normal(n) if law is None else law.sample(n, rng)
    a = np.concatenate(([0.0], transform(e, 1.0)[1:] * np.sqrt(fitted.power) * fitted.spread))
    return replace(fitted.channel, y=inverse(a, fitted.channel.interval) + _template_path(fitted))
