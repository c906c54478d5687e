"""A channel with its noise model and extensions fitted, and its whitened residuals, which all tests use.

A channel, its extensions and a fit of its noise make residuals that are independent standard normal numbers where the
model is right::

    e = DCT⁻¹[ (a − C β) / √E ]

with the whole spectrum E of the model. Zero-phase whitening leaves a spike a spike and a line a line. Where a sharp
filter hides the white noise independent standard normal numbers stand in place of the coefficients, lines apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, TypeVar
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from models.arrays import SAMPLES_AT_ONCE, FloatArray, SingleArray
from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, Term, White
from models.probability import REACH_95
from tuner.diagnosis.static.causes.base import Extension, gain_of, hidden_by, power_of
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform, grid, inverse, lines, transform
from tuner.diagnosis.static.model.expected_power import ExpectedPower, spectrum_knots
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.series_statistics import (
    RESIDUAL_CLIP,
    robust_sd,
    unit_periodogram,
)
from tuner.diagnosis.static.model.slow_likelihood import BASES, Fit, Kinds, Track

T = TypeVar("T")

MIN_PROMISED_RATIO = 4.0
"""Likelihood ratio of a further Gauss–Markov process, foretold by scores, below which it is not fitted.

In simulations the score foretold 0.3 to 1.3 of ratios above 4; a finding needs 20 and more.
"""


@dataclass(frozen=True)
class FittedChannel:
    """A channel, its model as fitted, and its residuals under that.

    Attributes
    ----------
    channel : Channel
        As measured.
    cleaned : Channel
        After the cleaners of the extensions.
    extensions : tuple of Extension
        What has been accepted.
    track : Track
        Coefficients and templates of the slow track.
    fits : tuple of Fit
        Fits of the kinds of slow noise, the best first.
    coefficients : ndarray, shape (n,)
        Cosine coefficients of the cleaned samples.
    shapes : dict
        Power of each extension at coefficients 1 … n-1, shape (n − 1,), where it is known.
    known_of_samples, known : dict
        What functions that are computed `once` have made of its samples, and of it; copies begin without.
    """

    channel: Channel
    cleaned: Channel
    extensions: tuple[Extension, ...]
    track: Track
    fits: tuple[Fit, ...]
    coefficients: FloatArray
    shapes: dict[Extension, FloatArray] = field(repr=False, compare=False, default_factory=dict)
    known_of_samples: dict[Callable[..., Any], Any] = field(repr=False, compare=False, default_factory=dict)
    known: dict[Callable[..., Any], Any] = field(init=False, repr=False, compare=False, default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy for another process has: nothing that is computed `once`, whose keys are functions."""
        return {**self.__dict__, "known_of_samples": {}, "known": {}}

    def beside_others(self, channel: Channel) -> FittedChannel:
        """Return what is compared with other channels: the fit and the clipped residuals, but no other samples.

        `channel` is its own channel, with or without samples.
        """
        cleaned = channel if self.cleaned is self.channel else self.cleaned.without_samples
        same = replace(
            self, channel=channel, cleaned=cleaned, coefficients=np.empty(0), shapes={}, known_of_samples={}
        )
        same.__dict__["clipped"] = self.clipped
        return same

    @property
    def fit(self) -> Fit:
        """The best fit."""
        return self.fits[0]

    @property
    def starts(self) -> dict[Kinds, FloatArray]:
        """Logs of the parameters of every kind, to start a refit from."""
        return {fit.kinds: fit.theta for fit in self.fits}

    @property
    def cleaners(self) -> tuple[Extension, ...]:
        """Extensions that change samples."""
        return _cleaners(self.extensions)

    def count(self, *causes: str) -> int:
        """Return how many extensions have one of these causes."""
        return sum(extension.cause in causes for extension in self.extensions)

    def refit(self, columns: FloatArray) -> Fit:
        """Return the best fit with further templates, coefficients of shape (K,) or (K, q)."""
        track = self.track.with_columns(columns)
        return max((track.fit(f.kinds, f.theta) for f in self.fits), key=lambda f: f.log_likelihood)

    def reach(self, column: int) -> tuple[float, float]:
        """Return the 95 % interval of the size of a template.

        It is that of the likelihood, with the noise refitted for each size, or that of the size averaged over slow
        noise too weak to be seen: the wider one.
        """
        centre, sd = float(self.fit.beta[column]), float(np.sqrt(self.fit.beta_covariance[column, column]))

        def drop(size: float) -> float:
            fixed = self.track.without_column(column, size)
            best = max(fixed.fit(f.kinds, f.theta).log_likelihood for f in self.fits)
            return 2.0 * (self.fit.log_likelihood - best)

        flicker = next(f for f in self.fits if BiasInstability in f.kinds)
        half = REACH_95 * float(
            np.sqrt(self.track.averaged_variance(flicker, column, (RandomWalk, BiasInstability)))
        )
        return min(_crossing(drop, centre, -sd), centre - half), max(
            _crossing(drop, centre, sd), centre + half
        )

    @cached_property
    def model(self) -> NoiseModel:
        """Noise of the best fit, extensions apart, in units of the scale."""
        return NoiseModel(self.fit.terms())

    @property
    def power(self) -> FloatArray:
        """Expected power of each coefficient 1 … n-1, made anew: a column, of which most need a part."""
        return self.expected_power.between(0, len(self.cleaned) - 1)

    @cached_property
    def expected_power(self) -> ExpectedPower:
        """Expected power of each coefficient, made where it is needed."""
        n, low = len(self.cleaned), self.track.singles
        knots = spectrum_knots(low + 1, n)
        smooth = self.smooth_power(knots / (2.0 * n * self.channel.interval))
        return ExpectedPower(self.fit.expected[:low], knots, smooth, self.peaks)

    def smooth_power(self, f: FloatArray, further: Iterable[Term] = ()) -> FloatArray:
        """Return the spectrum without peaks at frequencies `f`, Hz: white noise behind the filters, and other terms."""
        dt, terms = self.channel.interval, self.fit.terms()
        white = sum(term.density**2 for term in terms if isinstance(term, White))
        others = NoiseModel([*(term for term in terms if not isinstance(term, White)), *further])
        return np.asarray(white * gain_of(self.extensions, f, dt) + others.psd(f, interval=dt))

    @property
    def has_peaks(self) -> bool:
        """Whether an extension adds power to single coefficients."""
        return any(type(extension).power is not Extension.power for extension in self.extensions)

    @cached_property
    def peaks(self) -> FloatArray:
        """Power that the extensions add to each coefficient 1 … n-1, zeros without memory where none does."""
        n, dt = len(self.cleaned), self.channel.interval
        if not self.has_peaks:
            return np.broadcast_to(0.0, n - 1)
        total, f = np.zeros(n - 1), np.arange(1.0, n) / (2.0 * n * dt)
        for extension in self.extensions:
            if type(extension).power is not Extension.power:
                if extension not in self.shapes:
                    self.shapes[extension] = np.asarray(extension.power(f, dt))
                total += self.shapes[extension]
        return total

    @cached_property
    def hidden(self) -> NDArray[np.bool_]:
        """Whether a filter hides the white noise, at coefficients 1 … n-1: the residuals have other noise there."""
        n, dt = len(self.cleaned), self.channel.interval
        filters = tuple(x for x in self.extensions if type(x).hides is not Extension.hides)
        if not filters:
            return np.broadcast_to(False, n - 1)
        return hidden_by(filters, np.arange(1.0, n) / (2.0 * n * dt), dt)

    @property
    def e(self) -> FloatArray:
        """Residuals, shape (n,), scaled to a robust unit variance."""
        return self.scaled[0]

    @cached_property
    def path(self) -> FloatArray:
        """Templates as fitted, on the block means, shape (M,): linear where nothing was measured."""
        return np.asarray(self.cleaned.bridged(_columns(self.channel, self.extensions)) @ self.fit.beta)

    @property
    def spread(self) -> float:
        """Robust standard deviation of the residuals before that scaling: 1 where the fit is right."""
        return self.scaled[1]

    @cached_property
    def scaled(self) -> tuple[FloatArray, float]:
        """Residuals of unit robust variance, and what they were divided by."""
        e = self.whitened()
        for extension in self.extensions:
            e = extension.whiten(e)
        spread = robust_sd(e if bool(self.valid.all()) else e[self.valid])
        e /= spread
        return e, spread

    def whitened(self) -> FloatArray:
        """Return the residuals as the whitening filter leaves them, shape (n,): of unit variance, of any law."""
        e = self.coefficients.copy()
        e[0] = 0.0
        e[1 : self.track.singles + 1] -= self.track.columns @ self.fit.beta
        for first in range(0, len(e) - 1, SAMPLES_AT_ONCE):
            last = min(first + SAMPLES_AT_ONCE, len(e) - 1)
            e[first + 1 : last + 1] /= np.sqrt(self.expected_power.between(first, last))
        if self.hidden.any():
            own = np.random.default_rng(crc32(self.channel.axis.encode()))
            noise = self.hidden & ~lines(e[1:] ** 2)
            e[1:][noise] = own.standard_normal(int(noise.sum()))
        return inverse(e, 1.0)

    @cached_property
    def clipped(self) -> SingleArray:
        """Residuals cut at `RESIDUAL_CLIP`, in single precision, which holds numbers of unit size to 1e-7."""
        e = np.empty(len(self.e), np.float32)
        return np.clip(self.e, -RESIDUAL_CLIP, RESIDUAL_CLIP, out=e, casting="same_kind")

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Samples that were measured and not cleaned."""
        return self.cleaned.valid

    @cached_property
    def good(self) -> FloatArray:
        """Residuals of valid samples."""
        return self.e if bool(self.valid.all()) else self.e[self.valid]

    @property
    def good_clipped(self) -> SingleArray:
        """Clipped residuals of valid samples."""
        return self.clipped if bool(self.valid.all()) else self.clipped[self.valid]

    @cached_property
    def may_have_markov(self) -> bool:
        """Whether the scores of a further Gauss–Markov process promise a likelihood ratio worth fits that have it."""
        return any(
            self.track.square_score_of_markov(fit) - 2.0 * (self.fit.log_likelihood - fit.log_likelihood)
            > MIN_PROMISED_RATIO
            for fit in self.fits
        )

    @cached_property
    def with_markov(self) -> tuple[Fit, ...]:
        """Fits of every kind of noise with a further Gauss–Markov process."""
        return tuple(self.track.fit((*fit.kinds, GaussMarkov)) for fit in self.fits)

    @cached_property
    def periodogram(self) -> SingleArray:
        """Periodogram of the clipped residuals at the Fourier frequencies 1 … n/2, mean 1."""
        n = len(self.e)
        if next_fast_len(2 * n, real=True) == 2 * n:
            return np.ascontiguousarray(self.spectrum[1][1::2])
        return unit_periodogram(self.clipped, n)

    def power_at(self, f: FloatArray | float) -> FloatArray:
        """Return the expected spectrum at frequencies `f`, Hz, by interpolation."""
        n = len(self.cleaned)
        place = np.clip(np.asarray(f) * (2.0 * n * self.channel.interval) - 1.0, 0.0, n - 2.0)
        return self.expected_power.at(place)

    @cached_property
    def spectrum(self) -> tuple[float, SingleArray]:
        """Periodogram of the clipped residuals at 1/T, 2/T, … Hz, at most half bins: T, s, and power, mean 1."""
        size = next_fast_len(2 * len(self.e), real=True)
        return size * self.channel.interval, unit_periodogram(self.clipped, size)


def once(make: Callable[[FittedChannel], T]) -> Callable[[FittedChannel], T]:
    """Return the function with a cache: its value for a fitted channel is stored with it, for all tests."""
    return _stored(make, lambda fitted: fitted.known)


def once_of_samples(make: Callable[[FittedChannel], T]) -> Callable[[FittedChannel], T]:
    """Return `once` for a function of the cleaned samples alone, which residuals of the same cleaners share."""
    return _stored(make, lambda fitted: fitted.known_of_samples)


def _stored(
    make: Callable[[FittedChannel], T], where: Callable[[FittedChannel], dict[Any, T]]
) -> Callable[[FittedChannel], T]:
    @wraps(make)
    def kept(fitted: FittedChannel) -> T:
        if make not in (made := where(fitted)):
            made[make] = make(fitted)
        return made[make]

    return kept


def _columns(channel: Channel, extensions: tuple[Extension, ...]) -> FloatArray:
    """Return a ramp and the templates of the extensions on the blocks, shape (M, p)."""
    ramp = channel.block_time / channel.span - 0.5
    return np.concatenate([ramp[:, None], *(x.columns(channel) for x in extensions)], axis=1)


def _cleaners(extensions: tuple[Extension, ...]) -> tuple[Extension, ...]:
    """Return the extensions that change samples."""
    return tuple(x for x in extensions if type(x).clean_samples is not Extension.clean_samples)


def _crossing(drop: Callable[[float], float], centre: float, step: float) -> float:
    """Return where twice the loss of log likelihood passes the 95 % point, going from the centre by steps."""
    goal = REACH_95**2 / SLOW_RATIO_FACTOR
    low, high = 0.0, REACH_95 * step
    for _ in range(12):
        if drop(centre + high) >= goal:
            break
        low, high = high, 2.0 * high
    for _ in range(6):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if drop(centre + middle) >= goal else (middle, high)
    return centre + high


def fit_channel(
    channel: Channel,
    extensions: tuple[Extension, ...] = (),
    *,
    starts: dict[Kinds, FloatArray] | None = None,
    near: FittedChannel | None = None,
) -> FittedChannel:
    """Fit a channel with these extensions.

    Parameters
    ----------
    channel : Channel
        What was measured.
    extensions : tuple of Extension
        The model beyond the base noise.
    starts : dict, optional
        Logs of the parameters of each kind of noise to start from.
    near : FittedChannel, optional
        One of the same channel, whose coefficients serve again where the cleaners are the same.
    """
    singles = channel.blocks // 2
    if near is not None and near.channel is channel and near.cleaners == _cleaners(extensions):
        cleaned, a, cells, made = near.cleaned, near.coefficients, near.track.grid, near.known_of_samples
    else:
        cleaned, made = channel, {}
        for extension in extensions:
            cleaned = extension.clean_samples(cleaned)
        a = transform(cleaned.y, channel.interval)
        cells = grid(a, channel.interval, singles)
    track = Track(
        cells,
        block_transform(_columns(channel, extensions), cleaned, singles),
        gain_of(extensions, cells.frequency, channel.interval),
        power_of(extensions, cells.frequency, channel.interval),
    )
    more: Kinds = (GaussMarkov,) * sum(x.cause == "gauss_markov" for x in extensions)
    kinds: list[Kinds] = [(*base, *more) for base in BASES]
    known = starts or {}
    fits = sorted((track.fit(kind, known.get(kind)) for kind in kinds), key=lambda fit: -fit.log_likelihood)
    shapes = near.shapes if near is not None and near.channel is channel else {}
    same = {extension: shapes[extension] for extension in extensions if extension in shapes}
    return FittedChannel(channel, cleaned, extensions, track, tuple(fits), a, same, made)


def with_extensions(fitted: FittedChannel, extensions: tuple[Extension, ...]) -> FittedChannel:
    """Return the channel fitted with these extensions, from its fit."""
    return fit_channel(fitted.channel, extensions, starts=fitted.starts, near=fitted)


def without(fitted: FittedChannel, index: int) -> FittedChannel:
    """Return the channel fitted with one extension less."""
    return with_extensions(fitted, tuple(x for i, x in enumerate(fitted.extensions) if i != index))


def extended(fitted: FittedChannel, *more: Extension) -> FittedChannel:
    """Return the channel fitted with further extensions."""
    return with_extensions(fitted, (*fitted.extensions, *more))


def refitted(fitted: FittedChannel, most: int) -> FittedChannel:
    """Return the channel with every extension fitted again beside the others, so often at most, until none changes."""
    for _ in range(most):
        refits = tuple(x.refit(fitted, i) for i, x in enumerate(fitted.extensions))
        if all(a is b for a, b in zip(refits, fitted.extensions, strict=True)):
            break
        fitted = with_extensions(fitted, refits)
    return fitted


def relabelled(fitted: FittedChannel, extensions: tuple[Extension, ...]) -> FittedChannel:
    """Return the same fit with other values in its extensions."""
    same = {extension: fitted.shapes[extension] for extension in extensions if extension in fitted.shapes}
    return replace(fitted, extensions=extensions, shapes=same)
