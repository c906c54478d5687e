"""Time constants of slow templates: their best value, and their interval by the profile of the likelihood.

A template C(τ) of an extension is replaced in the track by that of another τ. The best τ is sought with the noise as
fitted; its 95 % interval ends where twice the loss of log likelihood, sizes and noise fitted again, passes the point
of χ²₁. The uncertainty of the size that comes from τ is its change over that interval, a fifth of a normal law's 3.92
deviations a deviation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from models.probability import REACH_95
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.slow_likelihood import Track

Template = Callable[[float], FloatArray]
"""Columns on the blocks, shape (M, p), for a time constant, s."""

MIN_LOG_CHANGE = 0.01
"""Change of the log of a time constant below which it has converged; intervals are tens of percent wide."""
MAX_LOG_FACTOR = 4.0
"""Log of the factor (55) to which the ends of an interval are searched.

Beyond, time constant and size are degenerate.
"""
MAX_NATS_BELOW = 10.0
"""Nats below the best fit from which a kind of noise is left out of the profile: it has lost by a factor of 2e4."""


@dataclass(frozen=True)
class Profile:
    """An interval of a time constant.

    Attributes
    ----------
    constant : Value
        s.
    drift : float
        Half the change of the size over the interval, in scales: the part of its uncertainty due to the time constant.
    """

    constant: Value
    drift: float


def first_column(fitted: FittedChannel, index: int) -> int:
    """Return the place of the first template of extension `index` among the columns of the track."""
    return 1 + sum(int(x.columns(fitted.channel).shape[1]) for x in fitted.extensions[:index])


def track_without(fitted: FittedChannel, index: int) -> Track:
    """Return the track without the templates of extension `index`."""
    at = first_column(fitted, index)
    width = fitted.extensions[index].columns(fitted.channel).shape[1]
    kept = np.delete(fitted.track.columns, np.arange(at, at + width), axis=1)
    return replace(fitted.track, columns=kept)


def best_constant(fitted: FittedChannel, index: int, template: Template, near: float) -> float:
    """Return the time constant next to `near`, s, of greatest likelihood at the fitted noise."""
    explained = _explained(fitted, index, template)
    bounds = (np.log(near / 2.0), np.log(near * 2.0))
    best = minimize_scalar(lambda x: -explained(x), bounds=bounds, method="bounded", options={"xatol": 1e-3})
    return float(np.exp(best.x))


def _explained(fitted: FittedChannel, index: int, template: Template) -> Callable[[float], float]:
    """Return the squares that the templates explain at the fitted noise, for the logarithm of a time constant."""
    track = track_without(fitted, index)
    singles = track.singles
    root = 1.0 / np.sqrt(fitted.fit.expected[:singles])
    known = track.columns * root[:, None]
    target = track.grid.amplitude[:singles] * root

    def explained(log_constant: float) -> float:
        columns = block_transform(template(float(np.exp(log_constant))), fitted.cleaned, singles)
        basis, _ = np.linalg.qr(np.concatenate((known, columns * root[:, None]), axis=1))
        return float(np.sum((basis.T @ target) ** 2))

    return explained


def profile(fitted: FittedChannel, index: int, template: Template, centre: float, size: Value) -> Profile:
    """Return the 95 % interval of the time constant of an extension, s.

    `size` is that of its template at this time constant. As far as its interval is wider than the fitted noise
    has it, so is the interval of the time constant.
    """
    track = track_without(fitted, index)
    column = track.columns.shape[1]
    sd = float(np.sqrt(fitted.fit.beta_covariance[first_column(fitted, index), first_column(fitted, index)]))
    wider = max(1.0, (size.upper - size.lower) / (2.0 * REACH_95 * sd))
    explained, middle = _explained(fitted, index, template), float(np.log(centre))
    most = explained(middle)
    followed = [f for f in fitted.fits if f.log_likelihood > fitted.fit.log_likelihood - MAX_NATS_BELOW]

    def at_fitted_noise(log_factor: float) -> float:
        return most - explained(middle + log_factor)

    def refitted(log_factor: float) -> float:
        constant = centre * float(np.exp(log_factor))
        trial = track.with_columns(block_transform(template(constant), fitted.cleaned, track.singles))
        best = max(trial.fit(f.kinds, f.theta).log_likelihood for f in followed)
        return SLOW_RATIO_FACTOR * 2.0 * (fitted.fit.log_likelihood - best)

    ends = []
    for sign in (-1.0, 1.0):
        ends.append(sign * max(_reach(refitted, sign), wider * _reach(at_fitted_noise, sign)))
    sizes = []
    for end in ends:
        columns = block_transform(template(centre * float(np.exp(end))), fitted.cleaned, track.singles)
        weighted = track.with_columns(columns)
        root = 1.0 / np.sqrt(fitted.fit.expected[: track.singles])
        target = track.grid.amplitude[: track.singles] * root
        sizes.append(float(np.linalg.lstsq(weighted.columns * root[:, None], target)[0][column]))
    low, high = (centre * float(np.exp(end)) for end in ends)
    return Profile(Value(centre, low, high, "s"), 0.5 * abs(sizes[1] - sizes[0]))


def _reach(loss: Callable[[float], float], sign: float) -> float:
    """Return how far from zero, on one side, twice a loss of log likelihood passes the 95 % point."""
    low, high = 0.0, 0.1
    while high < MAX_LOG_FACTOR and loss(sign * high) < REACH_95**2:
        low, high = high, 2.0 * high
    for _ in range(5):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if loss(sign * middle) >= REACH_95**2 else (middle, high)
    return high
