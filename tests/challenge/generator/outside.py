"""Static records of what the catalogue of causes does not have: sensors, converters and surroundings as they fail.

Every kind is a function of a random generator. Its size is the expected gain of log likelihood, nats, of the true model
over noise whose law and spectrum are known, 150 … 800 unless the kind says otherwise. `right` holds the causes whose
meaning is true of the record, however incomplete; every other name is wrong unless something else stands beside it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from challenge.generator.beyond import Made
from challenge.generator.scene import log_uniform
from numpy.typing import NDArray
from scipy.fft import dct, irfft, rfft, rfftfreq
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize
from scipy.signal import lfilter

FloatArray = NDArray[np.float64]
Rng = np.random.Generator

RATE, COUNT = 100.0, 100_000
INTERVAL, SPAN = 1.0 / RATE, COUNT / RATE
CLOCK = INTERVAL * np.arange(COUNT)
SCALE = 1e-3
"""Unit of the axes in white sd; rad/s."""
BAND = 64
"""Fourier frequencies over which the power of an effect is averaged to find its size."""


def nats(rng: Rng) -> float:
    return log_uniform(rng, 150.0, 800.0)


def coloured(rng: Rng, slope: float, n: int = COUNT) -> FloatArray:
    """Return noise of the spectrum f^slope and unit sd, shape (n,)."""
    f = rfftfreq(2 * n)
    f[0] = np.inf
    x = irfft(rfft(rng.standard_normal(2 * n)) * f ** (0.5 * slope))[:n]
    return np.asarray((x - x.mean()) / x.std())


def slow(rng: Rng, n: int = COUNT) -> FloatArray:
    """Return flicker and a random walk far below unit white noise, shape (n,)."""
    walk = np.cumsum(rng.standard_normal(n)) / n**0.5
    return log_uniform(rng, 0.003, 0.03) * coloured(rng, -1.0, n) + log_uniform(rng, 0.003, 0.03) * walk


def noise(rng: Rng, n: int = COUNT) -> FloatArray:
    return np.asarray(rng.standard_normal(n) + slow(rng, n))


def mean_sized(shape: FloatArray, size: float, *known: FloatArray) -> FloatArray:
    """Return a function of time that white noise and a walk leave so many nats of, besides an offset and a slope."""
    order = np.arange(1.0, COUNT)
    weight = 1.0 / np.sqrt(1.0 + (30.0 / order) ** 2)
    basis = np.stack([dct(x, norm="ortho")[1:] * weight for x in (CLOCK, *known)], axis=1)
    white = dct(shape, norm="ortho")[1:] * weight
    q, _ = np.linalg.qr(basis)
    white = white - q @ (q.T @ white)
    return np.asarray(shape * np.sqrt(2.0 * size / float(white @ white)))


def power_sized(effect: FloatArray, size: float) -> FloatArray:
    """Return a random effect whose mean spectrum gains so many nats over white noise."""
    power = uniform_filter1d(np.abs(rfft(effect)[1:]) ** 2 / COUNT, BAND, mode="nearest")
    low, high = 1e-8, 1e4
    for _ in range(60):
        factor = np.sqrt(low * high)
        gained = float(np.sum(factor * power - np.log1p(factor * power)))
        low, high = (factor, high) if gained < size else (low, factor)
    return np.asarray(effect * np.sqrt(low))


def beside_flicker(effect: FloatArray, size: float) -> FloatArray:
    """Return noise whose spectrum gains so many nats over the best sum of white, flicker and random walk noise."""
    power = uniform_filter1d(np.abs(rfft(effect)[1:]) ** 2 / COUNT, BAND, mode="nearest")
    edges = np.unique(np.geomspace(1, len(power) + 1, 60).astype(int))
    count = np.diff(edges)
    f = np.sqrt(edges[1:] * edges[:-1]) / len(power)
    rows = np.stack([np.ones_like(f), 1.0 / f, f**-2.0])

    def gained(factor: float) -> float:
        true = 1.0 + factor * np.add.reduceat(power, edges[:-1] - 1) / count

        def cost(x: FloatArray) -> float:
            model = np.exp(x) @ rows
            return float(count @ (true / model - 1.0 - np.log(true / model)))

        return float(minimize(cost, [0.0, -9.0, -16.0], method="Nelder-Mead", options={"maxiter": 2000}).fun)

    low, high = 1e-6, 1e3
    for _ in range(20):
        factor = np.sqrt(low * high)
        low, high = (factor, high) if gained(factor) < size else (low, factor)
    return np.asarray(effect * np.sqrt(low))


def variance_sized(path: FloatArray, size: float) -> FloatArray:
    """Return white sds whose log variance follows a path and gains so many nats over a constant one."""
    low, high = 1e-4, 10.0
    for _ in range(50):
        factor = 0.5 * (low + high)
        log_variance = factor * path
        gained = 0.5 * COUNT * float(np.log(np.mean(np.exp(log_variance))) - log_variance.mean())
        low, high = (factor, high) if gained < size else (low, factor)
    out = np.exp(0.5 * low * path)
    return np.asarray(out / np.sqrt(np.mean(out**2)))


def made(y: FloatArray, size: float, *right: str, temperature: FloatArray | None = None) -> Made:
    return Made({"gyro_x": SCALE * y}, frozenset(right), size, temperature)


def box(rng: Rng) -> FloatArray:
    """Return a temperature that goes up and down between one and three times, °C."""
    turn = 2.0 * np.pi * (CLOCK / SPAN * rng.uniform(1.0, 3.0) + rng.uniform())
    return 25.0 + rng.uniform(4.0, 15.0) * np.sin(turn) + rng.uniform(-5.0, 5.0) * CLOCK / SPAN


def thermometer(rng: Rng, felt: FloatArray) -> FloatArray:
    code = float(rng.choice([0.01, 0.03, 0.0625]))
    return np.asarray(code * np.round((felt + 0.01 * rng.standard_normal(COUNT)) / code))


def switching(rng: Rng, dwell: float, states: int = 2) -> NDArray[np.int64]:
    """Return a random state for each sample, with a mean dwell in s."""
    change = rng.random(COUNT) < INTERVAL / dwell
    step = np.where(change, rng.integers(1, states, COUNT), 0)
    return np.asarray(np.cumsum(step) % states)


# Vibration and interference -------------------------------------------------------------------------------------------


def wandering_tone(rng: Rng) -> Made:
    """A rotor above half the rate, folded, whose speed wanders."""
    speed = rng.uniform(60.0, 400.0) * (1.0 + log_uniform(rng, 1e-3, 1e-2) * coloured(rng, -2.0))
    wave = np.sin(2.0 * np.pi * INTERVAL * np.cumsum(speed))
    size = nats(rng)
    return made(noise(rng) + power_sized(wave, size), size, "vibration")


def keyed_interference(rng: Rng) -> Made:
    """A transmitter that is on now and then: a tone of constant frequency in packets."""
    on = switching(rng, log_uniform(rng, 0.5, 20.0), 4) == 0
    wave = on * np.sin(2.0 * np.pi * rng.uniform(3.0, 47.0) * CLOCK)
    size = nats(rng)
    wave = wave * np.sqrt(2.0 * size / float(wave @ wave))
    return made(noise(rng) + wave, size, "line", "vibration", "burst")


def ringing_shocks(rng: Rng) -> Made:
    """Knocks at random times, each with a decaying oscillation of a structure."""
    begun = np.where(
        rng.random(COUNT) < INTERVAL / log_uniform(rng, 5.0, 60.0), rng.standard_normal(COUNT), 0.0
    )
    f, decay = rng.uniform(2.0, 30.0), rng.uniform(0.1, 1.0)
    r = np.exp(-INTERVAL / decay)
    y = lfilter([1.0], [1.0, -2.0 * r * np.cos(2.0 * np.pi * f * INTERVAL), r * r], begun)
    size = nats(rng)
    return made(noise(rng) + power_sized(y, size), size, "vibration", "burst")


def relaxation(rng: Rng) -> Made:
    """A sawtooth of a controller whose period jitters by a few percent."""
    period = log_uniform(rng, 0.5, 30.0)
    every = period * (1.0 + rng.uniform(0.03, 0.1) * rng.standard_normal(int(2 * SPAN / period) + 10))
    edge = np.concatenate(([0.0], np.cumsum(np.maximum(every, 0.2 * period))))
    at = np.searchsorted(edge, CLOCK, side="right") - 1
    saw = (CLOCK - edge[at]) / (edge[at + 1] - edge[at]) - 0.5
    size = nats(rng)
    return made(noise(rng) + power_sized(saw, size), size, "vibration")


# Converter and interface ----------------------------------------------------------------------------------------------


def missing_codes(rng: Rng) -> Made:
    """A converter in which every 4th, 8th or 16th code never comes: its samples take the next one."""
    step, every = log_uniform(rng, 0.1, 0.6), int(rng.choice([4, 8, 16]))
    code = np.round((noise(rng) + 50.0 * rng.standard_normal()) / step)
    code += np.where(code % every == 0, 1.0, 0.0)
    return made(step * code, 1e3, "lattice")


def near_interpolation(rng: Rng) -> Made:
    """Straight lines between samples of a rate 1.15 to 1.95 times lower."""
    x = noise(rng)
    return made(
        np.interp(np.arange(COUNT) / rng.uniform(1.15, 1.95), np.arange(COUNT), x), 1e4, "interpolated"
    )


def band_limited(rng: Rng) -> Made:
    """Resampled from a rate 1.2 to 3 times lower by a windowed sinc of 6 to 16 samples on either side."""
    ratio, half = rng.uniform(1.2, 3.0), int(rng.integers(6, 17))
    x = noise(rng)
    place = np.arange(COUNT) / ratio + half
    first = place.astype(int)
    y = np.zeros(COUNT)
    for k in range(1 - half, half + 1):
        off = place - (first + k)
        y += x[np.minimum(first + k, COUNT - 1)] * np.sinc(off) * np.cos(0.5 * np.pi * off / half) ** 2
    return made(y, 1e4, "interpolated", "lowpass")


def mixed_holds(rng: Rng) -> Made:
    """Readings of a register that is filled at random times: held for one, two, three … samples."""
    fresh = rng.random(COUNT) < rng.uniform(0.6, 0.97)
    fresh[0] = True
    return made(noise(rng)[np.maximum.accumulate(np.where(fresh, np.arange(COUNT), 0))], 1e4, "duplicates")


def alternating_filters(rng: Rng) -> Made:
    """A driver that switches between two bandwidths, each with unit variance."""
    pole = rng.uniform(0.15, 0.6)
    white = rng.standard_normal(COUNT)
    filtered = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)
    state = switching(rng, log_uniform(rng, 2.0, 100.0))
    return made(np.where(state == 0, white, filtered) + slow(rng), 1e3)


# Noise ----------------------------------------------------------------------------------------------------------------


def half_slope(rng: Rng) -> Made:
    """Noise of the spectrum f^(−1/2) or f^(−3/2) beside the white noise."""
    steep = bool(rng.random() < 0.5)
    size = nats(rng)
    return made(
        rng.standard_normal(COUNT) + beside_flicker(coloured(rng, -1.5 if steep else -0.5), size), size
    )


def volatile(rng: Rng) -> Made:
    """White noise whose log variance is a Gauss–Markov process of 0.3 to 30 s."""
    r = np.exp(-INTERVAL / log_uniform(rng, 0.3, 30.0))
    path = lfilter([np.sqrt(1.0 - r * r)], [1.0, -r], rng.standard_normal(COUNT))
    size = nats(rng)
    return made(rng.standard_normal(COUNT) * variance_sized(path, size) + slow(rng), size)


def two_humps(rng: Rng) -> Made:
    """White noise of a law with light tails: a coin's ± beside normal noise; kurtosis −2 share²."""
    size = nats(rng)
    share = (48.0 * size / COUNT / 4.0) ** 0.25
    coin = rng.choice([-1.0, 1.0], COUNT)
    return made(np.sqrt(share) * coin + np.sqrt(1.0 - share) * rng.standard_normal(COUNT) + slow(rng), size)


def three_levels(rng: Rng) -> Made:
    """A bias that switches at random between three levels; 800 … 3000 nats where the times are known."""
    level = np.array([-1.0, rng.uniform(-0.3, 0.3), 1.0])[switching(rng, log_uniform(rng, 2.0, 40.0), 3)]
    size = log_uniform(rng, 800.0, 3000.0)
    return made(noise(rng) + mean_sized(level, size), size)


# Slow shapes ----------------------------------------------------------------------------------------------------------


def two_slopes(rng: Rng) -> Made:
    """A bias whose slope with temperature is another one while it falls than while it rises: the loops do not close."""
    felt = box(rng)
    rate = np.diff(felt, prepend=felt[0])
    size = nats(rng)
    y = mean_sized(np.cumsum(np.where(rate > 0.0, rate, 0.0)), size, felt)
    return made(noise(rng) + y, size, "temperature", "hysteresis", temperature=thermometer(rng, felt))


def kinked(rng: Rng) -> Made:
    """A bias with a kink in temperature, as of a glass transition."""
    felt = box(rng)
    kink = np.maximum(felt - np.quantile(felt, rng.uniform(0.4, 0.7)), 0.0)
    size = nats(rng)
    y = mean_sized(kink, size, felt)
    return made(
        noise(rng) + y, size, "temperature", "temperature_squared", temperature=thermometer(rng, felt)
    )


KINDS: dict[str, Callable[[Rng], Made]] = {
    f.__name__: f
    for f in (
        wandering_tone, keyed_interference, ringing_shocks, relaxation, missing_codes, near_interpolation,
        band_limited, mixed_holds, alternating_filters, half_slope, volatile, two_humps, three_levels, two_slopes,
        kinked,
    )
}  # fmt: skip
