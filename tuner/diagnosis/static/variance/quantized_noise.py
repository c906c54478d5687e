"""Noise through a coarse quantizer: the variance of a sample depends on where its mean lies between two codes.

A sample x ~ N(μ, σ²) is written as the code of the cell it falls into, cells of one step each and a dead band about
zero; with P_c(μ, σ) the chance of code c::

    g(μ) = Σ c P_c,    v(μ) = Σ (c − g)² P_c,    κ(μ) = Σ (c − g)⁴ P_c / v² − 1

For steps up to σ the variance is σ² + step²/12 wherever μ lies, within 1e-7; at 2σ it swings by 2 %, at 3σ by a half.
g(μ) is taken from the slow track of the samples, σ is what makes v as large on average as their noise is.

References
----------
.. [1] B. Widrow, I. Kollár, Quantization Noise, 2008 (moments of a quantized Gaussian).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtr

from models.arrays import FloatArray
from models.noise import NoiseModel, Quantization, White
from models.probability import rounding_variance
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import inverse
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, once_of_samples

MAX_FINE_STEP = 1.0
"""Step ÷ sd up to which the place in a cell does not matter: the variance is constant within 1e-7."""
MIN_COARSE_STEP = 2.0
"""Step ÷ sd from which a quantizer is a finding: the variance begins to depend on the mean (2 %)."""
MAX_TELLING_STEP = 3.0
"""Step ÷ sd beyond which the law, the spectrum and the path of the samples are those of the rounding.

Rounding then bends the mean by 0.1 sd and more (0.32 exp(−2π² sd²/step²) steps), and its error is not white.
"""
MIN_BLOCK_SAMPLES = 4
"""Least samples in a block whose scatter is used; in fewer the mean takes most of it."""
MIN_NOISE_SD, MAX_NOISE_SD = 0.2, 2.0
"""Bounds of the sd of the noise, steps; below, samples hardly leave their code and say nothing of their noise."""
SPARSE_STRIDE = 64
"""Stride of the samples from which the sd of the noise is found.

Chosen for speed: the slow track hardly moves within 64 samples.
"""
CELL_PLACES = 64
"""Places in a cell at which the moments are computed; between them they are interpolated."""
MIN_VARIANCE_RATIO = 0.02
"""Variance of the codes ÷ that of the noise below which samples carry no information about their noise."""


@dataclass(frozen=True)
class Moments:
    """Moments of codes at even places; all in steps.

    Attributes
    ----------
    reach : float
        Whole number of steps beyond which everything repeats with each step.
    place, mean, variance, scatter : ndarray, shape (p,)
        μ, g, v and κ.
    """

    reach: float
    place: FloatArray
    mean: FloatArray
    variance: FloatArray
    scatter: FloatArray

    def at(self, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return v and κ where the codes have these means, shapes of `mean`."""
        beyond = np.abs(mean) > self.reach
        folded = np.where(beyond, np.copysign(self.reach + np.abs(mean) % 1.0, mean), mean)
        variance, scatter = _between(folded, self.mean, self.variance, self.scatter)
        return variance, scatter


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _between(
    x: FloatArray, knots: FloatArray, first: FloatArray, second: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values given at rising knots (p,) on straight lines between them, `x` (n,) moving little by little."""
    one, other = np.empty(x.size), np.empty(x.size)
    at = 0
    for i in range(x.size):
        while at < knots.size - 2 and x[i] > knots[at + 1]:
            at += 1
        while at > 0 and x[i] < knots[at]:
            at -= 1
        share = min(max((x[i] - knots[at]) / (knots[at + 1] - knots[at]), 0.0), 1.0)
        one[i] = first[at] + share * (first[at + 1] - first[at])
        other[i] = second[at] + share * (second[at + 1] - second[at])
    return one, other


def moments(sd: float, deadband: float = 0.0, unsure: float = 0.0) -> Moments:
    """Return the moments of the codes of normal numbers, averaged over the uncertainty of their mean.

    Parameters
    ----------
    sd, deadband, unsure : float
        Of the numbers, half-width of the dead band, and sd of the mean, steps.
    """
    reach = float(np.ceil(deadband + 8.0 * sd)) if deadband > 0.0 else 0.0
    place = np.arange(-(reach + 1.0) * CELL_PLACES, (reach + 1.0) * CELL_PLACES + 1.0) / CELL_PLACES
    side = int(np.ceil(8.0 * sd + deadband)) + 1
    code = np.round(place)[:, None] + np.arange(-side, side + 1.0)
    low, high = code - 0.5, code + 0.5
    if deadband > 0.5:
        low = np.where(code > 0.0, np.maximum(low, deadband), np.where(code == 0.0, -deadband, low))
        high = np.where(code < 0.0, np.minimum(high, -deadband), np.where(code == 0.0, deadband, high))
    share = np.maximum(ndtr((high - place[:, None]) / sd) - ndtr((low - place[:, None]) / sd), 0.0)
    mean = np.sum(share * code, axis=1)
    away = (code - mean[:, None]) ** 2
    variance = np.sum(share * away, axis=1)
    fourth = np.sum(share * away**2, axis=1)
    shift, variance, fourth = (
        gaussian_filter1d(x, max(unsure * CELL_PLACES, 1e-3), mode="wrap")
        for x in (mean - place, variance, fourth)
    )
    scatter = fourth / np.maximum(variance, 1e-12) ** 2 - 1.0
    return Moments(reach, place, (1.0 + 1e-12) * place + shift, variance, scatter)


def cell_moments(fitted: FittedChannel) -> tuple[FloatArray, FloatArray] | None:
    """Return the variance of every sample ÷ that of the usual one, and κ; shapes (n,). None where rounding is fine.

    Samples that say nothing of their noise have κ = ∞.
    """
    channel, step = fitted.channel, fitted.channel.quantizer_step
    if step <= 0.5 * MAX_FINE_STEP:
        return None
    seen = fitted.spread**2 * float(_noise_power(fitted).mean()) / channel.interval / step**2
    if channel.deadband == 0.0 and seen - 1.0 / 12.0 >= MAX_FINE_STEP**-2:
        return None
    slow, _, unsure = slow_track(fitted)
    code, zero = _codes(channel)
    place = (slow - code) / step + zero
    dead, vague = channel.deadband / step, float(np.sqrt(unsure)) / step
    sd = _sd_of(seen, np.sort(place[::SPARSE_STRIDE]), dead, vague)
    variance, scatter = moments(sd, dead, vague).at(place)
    silent = (variance < MIN_VARIANCE_RATIO * sd**2) | (sd < 1.01 * MIN_NOISE_SD)
    usual = float(np.mean(variance[~silent])) if not bool(silent.all()) else 1.0
    return np.where(silent, 1.0, variance / usual), np.where(silent, np.inf, scatter)


def _codes(channel: Channel) -> tuple[float, float]:
    """Return a sample, scales, and the code that it has, whole steps, counted from 0 where there is a dead band."""
    step, code = channel.quantizer_step, float(channel.y[int(np.argmax(channel.valid))])
    return code, float(
        np.round((code + channel.level / channel.scale) / step)
    ) if channel.deadband > 0.0 else 0.0


def _sd_of(seen: float, place: FloatArray, deadband: float, unsure: float) -> float:
    """Return the sd of noise whose codes have this variance where its mean lies at rising places, shape (p,); steps."""
    low, high = MIN_NOISE_SD, MAX_NOISE_SD
    for _ in range(20):
        sd = float(np.sqrt(low * high))
        less = float(np.mean(moments(sd, deadband, unsure).at(place)[0])) > seen
        low, high = (low, sd) if less else (sd, high)
    return sd


@once_of_samples
def hides_noise(fitted: FittedChannel) -> bool:
    """Return whether samples do not show their noise: interpolated, or codes of more than `MAX_TELLING_STEP` sd.

    The sd is that of the samples in a block about its mean, with coloured noise: all of it moves them between codes.
    """
    channel, step = fitted.cleaned, fitted.channel.quantizer_step
    if channel.interpolated or step <= 0.5 * MAX_FINE_STEP or channel.block < MIN_BLOCK_SAMPLES:
        return channel.interpolated
    code, zero = _codes(fitted.channel)
    x = ((channel.y - code) / step + zero).reshape(channel.blocks, channel.block)
    seen = float(np.mean(x.var(axis=1, ddof=1)))
    if seen > MAX_TELLING_STEP**-2 + 0.25:
        return False
    dead = channel.deadband / step
    return _sd_of(seen, np.sort(x.mean(axis=1)), dead, 0.0) * MAX_TELLING_STEP < 1.0


def is_coarse(fitted: FittedChannel) -> bool:
    """Return whether a step exceeds `MIN_COARSE_STEP` sd of the white noise: the place in a cell matters."""
    white = sum(t.density**2 for t in fitted.fit.terms() if isinstance(t, White)) / fitted.channel.interval
    step = fitted.channel.quantizer_step
    return (
        step**2 > MIN_COARSE_STEP**2 * max(fitted.spread**2 * white - rounding_variance(step), 0.0)
        and step > 0.0
    )


def _noise_power(fitted: FittedChannel) -> FloatArray:
    """Return the power of white noise and quantization at coefficients 1 … n − 1, not above that of the model."""
    dt, n = fitted.channel.interval, len(fitted.coefficients)
    f = np.linspace(0.0, 0.5 / dt, CELL_PLACES**2)
    noise = NoiseModel(t for t in fitted.fit.terms() if isinstance(t, White | Quantization)).psd(
        f, interval=dt
    )
    return np.minimum(np.interp(np.arange(1.0, n) / (2.0 * n * dt), f, noise), fitted.power)


def slow_track(fitted: FittedChannel) -> tuple[FloatArray, float, float]:
    """Return the samples without their white noise and quantization, as the model sees them, shape (n,), in scales.

    In the cosine domain s = Cβ + (1 − W/E)(a − Cβ), with W the power of the noise. Its variance comes with it, mean W,
    and that of the track, mean W (1 − W/E).
    """
    dt, n = fitted.channel.interval, len(fitted.coefficients)
    power = _noise_power(fitted)
    a = fitted.coefficients.copy()
    means = np.zeros(n - 1)
    means[: fitted.track.singles] = fitted.track.columns @ fitted.fit.beta
    kept = 1.0 - power / fitted.power
    a[1:] = means + kept * (a[1:] - means)
    unsure = float(np.mean(power * kept)) / dt
    return inverse(a, dt), fitted.spread**2 * float(power.mean()) / dt, unsure
