"""Static records that wrong names are given to: curves of temperature, holds, short processes, registers, modulation.

Every kind is a function of a random generator and of a size, nats of log likelihood that the true model gains.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from challenge.generator.beyond import Made
from challenge.generator.outside import (
    CLOCK,
    COUNT,
    SPAN,
    FloatArray,
    Rng,
    box,
    made,
    mean_sized,
    noise,
    power_sized,
    slow,
    thermometer,
)
from challenge.generator.scene import log_uniform
from scipy.signal import lfilter
from scipy.stats import norm

THERMAL = ("temperature", "temperature_squared", "thermal_lag", "thermal")


def warming(rng: Rng) -> FloatArray:
    """Return the temperature of a unit that warms after power-on, °C."""
    return 25.0 - rng.uniform(5.0, 20.0) * np.expm1(-CLOCK / (log_uniform(rng, 0.05, 0.4) * SPAN))


def temperature_square(rng: Rng, size: float) -> Made:
    """A bias in proportion to the square of the temperature about its value at power-on, in a unit that warms."""
    felt = warming(rng)
    return made(
        noise(rng) + mean_sized((felt - felt[0]) ** 2, size),
        size,
        *THERMAL,
        temperature=thermometer(rng, felt),
    )


def temperature_vertex(rng: Rng, size: float) -> Made:
    """A bias in proportion to the square of the temperature about a value within its range, up and down."""
    felt = box(rng)
    vertex = float(np.quantile(felt, rng.uniform(0.2, 0.8)))
    return made(
        noise(rng) + mean_sized((felt - vertex) ** 2, size),
        size,
        *THERMAL,
        temperature=thermometer(rng, felt),
    )


def _coloured(response: FloatArray, size: float) -> float:
    """Return the weight with which a shape of log power over frequency gains so many nats over white noise."""
    low, high = 1e-5, 0.499
    for _ in range(50):
        weight = 0.5 * (low + high)
        power = 1.0 + weight * response
        gained = 0.5 * COUNT * float(np.log(power.mean()) - np.log(power).mean())
        low, high = (weight, high) if gained < size else (low, weight)
    return weight


def echo(rng: Rng, size: float) -> Made:
    """A moving average of the sample and the one two samples before: x(t) + b x(t − 2)."""
    turn = 2.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 4096))
    b = _coloured(turn, size)  # 1 + b² + 2 b cos 2ω is 1 + w 2 cos 2ω up to a factor, b ≈ w
    w = rng.standard_normal(COUNT + 2)
    return made(w[2:] + float(rng.choice([-1.0, 1.0])) * b * w[:-2] + slow(rng), size, "colour")


def moving_average(rng: Rng, size: float) -> Made:
    """A moving average of the sample and the one before: x(t) + b x(t − 1)."""
    b = _coloured(2.0 * np.cos(np.linspace(0.0, np.pi, 4096)), size)
    w = rng.standard_normal(COUNT + 1)
    return made(w[1:] + b * w[:-1] + slow(rng), size, "colour", "lowpass")


def holds(rng: Rng, size: float) -> Made:
    """Samples that repeat the one before, on a quantizer of 0.1 to 1 sd; the gain is that of the equal neighbours."""
    step = log_uniform(rng, 0.1, 1.0)
    chance = step / (2.0 * np.sqrt(np.pi))
    low, high = 1e-6, 0.5
    for _ in range(60):
        share = np.sqrt(low * high)
        q = chance + share * (1.0 - chance)
        gained = COUNT * (q * np.log(q / chance) + (1.0 - q) * np.log((1.0 - q) / (1.0 - chance)))
        low, high = (share, high) if gained < size else (low, share)
    y = noise(rng) + 20.0 * rng.standard_normal()
    source = np.where(rng.random(COUNT) < share, 0, np.arange(COUNT))
    source[0] = 0
    return made(step * np.round(y[np.maximum.accumulate(source)] / step), size, "duplicates")


def pulses(rng: Rng, size: float) -> Made:
    """A pulse of one to three samples each 0.2 to 30 s."""
    every, width = log_uniform(rng, 0.2, 30.0), int(rng.integers(1, 4))
    first = (np.arange(rng.uniform(0.0, every), SPAN - 0.1, every) * 100.0).astype(int)
    y = np.zeros(COUNT)
    for k in range(width):
        y[first + k] = 1.0
    return made(noise(rng) + y * np.sqrt(2.0 * size / y.sum()), size, "comb")


def short_process(rng: Rng, size: float) -> Made:
    """A Gauss–Markov process of 4 to 16 samples."""
    r = float(np.exp(-1.0 / log_uniform(rng, 4.0, 16.0)))
    process = lfilter([1.0], [1.0, -r], rng.standard_normal(COUNT))
    return made(noise(rng) + power_sized(process, size), size, "gauss_markov", "colour")


def overflow(rng: Rng, size: float) -> Made:
    """A register that wraps around its range of 8 to 40 sds at one end; the size is the number of samples that do."""
    y, width = noise(rng), float(rng.uniform(8.0, 40.0))
    limit = float(norm.isf(size / COUNT)) * float(rng.choice([-1.0, 1.0]))
    if limit > 0.0:
        return made(np.where(y > limit, y - width, y), size, "overflow")
    return made(np.where(y < limit, y + width, y), size, "overflow")


def overflow_coded(rng: Rng, size: float) -> Made:
    """The same with codes of 0.05 to 0.5 sd, of which the range has a power of two."""
    step = log_uniform(rng, 0.05, 0.5)
    code, width = np.round(noise(rng) / step), 2 ** int(np.ceil(np.log2(10.0 / step)))
    limit = np.floor(float(norm.isf(size / COUNT)) / step)
    return made(step * np.where(code > limit, code - width, code), size, "overflow")


def sidebands(rng: Rng, size: float) -> Made:
    """A line whose amplitude swells by 30 to 90 % with a period of 2 to 100 s."""
    envelope = 1.0 + rng.uniform(0.3, 0.9) * np.sin(2.0 * np.pi * CLOCK / log_uniform(rng, 2.0, 100.0))
    wave = envelope * np.cos(2.0 * np.pi * log_uniform(rng, 2.0, 45.0) * CLOCK + rng.uniform(0.0, 6.0))
    return made(noise(rng) + mean_sized(wave, size), size, "line")


def sawtooth(rng: Rng, size: float) -> Made:
    """A sawtooth of a controller whose period jitters by 3 to 10 %."""
    period = log_uniform(rng, 0.5, 30.0)
    every = period * (1.0 + rng.uniform(0.03, 0.1) * rng.standard_normal(int(2 * SPAN / period) + 10))
    edge = np.concatenate(([0.0], np.cumsum(np.maximum(every, 0.2 * period))))
    at = np.searchsorted(edge, CLOCK, side="right") - 1
    saw = (CLOCK - edge[at]) / (edge[at + 1] - edge[at]) - 0.5
    return made(noise(rng) + power_sized(saw, size), size, "vibration")


def _drawn(sized: Callable[[Rng, float], Made]) -> Callable[[Rng], Made]:
    """Return a kind of a random size of 20 to 1000 nats."""
    return lambda rng: sized(rng, log_uniform(rng, 20.0, 1000.0))


SIZED: dict[str, Callable[[Rng, float], Made]] = {
    f.__name__: f
    for f in (
        temperature_square, temperature_vertex, echo, moving_average, holds, pulses, short_process, overflow,
        overflow_coded, sidebands, sawtooth,
    )
}  # fmt: skip
KINDS: dict[str, Callable[[Rng], Made]] = {name: _drawn(sized) for name, sized in SIZED.items()}
