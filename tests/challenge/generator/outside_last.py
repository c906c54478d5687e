"""A last group of static records of what the catalogue does not have: written after all that the others changed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from challenge.generator.beyond import Made
from challenge.generator.outside import (
    CLOCK,
    COUNT,
    INTERVAL,
    SPAN,
    Rng,
    box,
    coloured,
    made,
    mean_sized,
    nats,
    noise,
    power_sized,
    slow,
    switching,
    thermometer,
    variance_sized,
)
from challenge.generator.scene import log_uniform
from scipy.signal import lfilter


def jumping_phase(rng: Rng) -> Made:
    """A tone of a source that is switched off and on: its phase jumps every 20 to 100 s."""
    jump = np.cumsum(
        np.where(rng.random(COUNT) < INTERVAL / log_uniform(rng, 20.0, 100.0), rng.uniform(1, 5), 0.0)
    )
    wave = np.sin(2.0 * np.pi * rng.uniform(3.0, 47.0) * CLOCK + jump)
    size = nats(rng)
    return made(noise(rng) + power_sized(wave, size), size, "line", "vibration")


def moving_resonance(rng: Rng) -> Made:
    """A resonance whose frequency moves by a tenth to a third through the record."""
    low = rng.uniform(5.0, 30.0)
    f = low * (1.0 + rng.uniform(0.1, 0.33) * CLOCK / SPAN)
    phase = 2.0 * np.pi * INTERVAL * np.cumsum(f)
    r = np.exp(-INTERVAL * low / rng.uniform(5.0, 30.0))
    envelope = lfilter([np.sqrt(1.0 - r * r)], [1.0, -r], rng.standard_normal((2, COUNT)))
    size = nats(rng)
    return made(
        noise(rng) + power_sized(envelope[0] * np.cos(phase) + envelope[1] * np.sin(phase), size),
        size,
        "vibration",
    )


def slow_gusts(rng: Rng) -> Made:
    """Wind on the mount now and then: noise of a second or less, for some ten seconds."""
    r = np.exp(-INTERVAL / log_uniform(rng, 0.03, 0.5))
    on = switching(rng, log_uniform(rng, 5.0, 30.0), 5) == 0
    size = log_uniform(rng, 300.0, 1500.0)
    gust = power_sized(on * lfilter([np.sqrt(1.0 - r * r)], [1.0, -r], rng.standard_normal(COUNT)), size)
    return made(noise(rng) + gust, size, "burst")


def dropouts(rng: Rng) -> Made:
    """A reading of zero in place of one sample in a hundred or less; the bias is three to eight sds."""
    y = noise(rng) + rng.uniform(3.0, 8.0)
    return made(
        np.where(rng.random(COUNT) < log_uniform(rng, 1e-3, 1e-2), 0.0, y),
        1e3,
        "error_code",
        "spikes",
        "skewed_noise",
        "heavy_tails",
    )


def compressed(rng: Rng) -> Made:
    """An amplifier that saturates softly: large samples are smaller than they should be."""
    w = np.tanh(rng.uniform(0.25, 0.6) * rng.standard_normal(COUNT))
    return made(w / w.std() + slow(rng), 1e3)


def two_registers(rng: Rng) -> Made:
    """Samples come in turn from two converters of other noise."""
    size = nats(rng)
    sd = variance_sized(np.arange(COUNT) % 2 - 0.5, size)
    return made(rng.standard_normal(COUNT) * sd + slow(rng), size, "periodic_variance")


def jumping_walk(rng: Rng) -> Made:
    """A bias that walks by rare jumps of either sign, ten to forty in the record."""
    begun = (rng.random(COUNT) < rng.uniform(10.0, 40.0) / COUNT) * rng.standard_normal(COUNT)
    size = log_uniform(rng, 1000.0, 5000.0)
    return made(noise(rng) + mean_sized(np.cumsum(begun), size), size, "step")


def waking_walk(rng: Rng) -> Made:
    """A random walk that begins in the middle of the record."""
    at = rng.uniform(0.4, 0.7)
    walk = np.cumsum(np.where(at * SPAN < CLOCK, rng.standard_normal(COUNT), 0.0))
    size = log_uniform(rng, 1000.0, 5000.0)
    return made(noise(rng) + mean_sized(walk, size), size)


def far_thermometer(rng: Rng) -> Made:
    """A bias that follows the temperature of another place: the thermometer is 20 to 100 s early."""
    felt = box(rng) + 0.3 * coloured(rng, -2.0)
    late = np.interp(CLOCK - log_uniform(rng, 20.0, 100.0), CLOCK, felt)
    size = nats(rng)
    right = ("temperature", "thermal", "thermal_lag", "temperature_rate")
    return made(noise(rng) + mean_sized(late, size), size, *right, temperature=thermometer(rng, felt))


def uneven_tone(rng: Rng) -> Made:
    """A tone with eight harmonics whose speed wanders by a hundredth."""
    speed = rng.uniform(1.0, 5.0) * (1.0 + 0.01 * coloured(rng, -2.0))
    turn = 2.0 * np.pi * INTERVAL * np.cumsum(speed)
    wave = sum(np.sin(k * turn + rng.uniform(0.0, 6.0)) / k for k in range(1, 9))
    size = nats(rng)
    return made(noise(rng) + power_sized(np.asarray(wave), size), size, "vibration")


KINDS: dict[str, Callable[[Rng], Made]] = {
    f.__name__: f
    for f in (
        jumping_phase, moving_resonance, slow_gusts, dropouts, compressed, two_registers, jumping_walk, waking_walk,
        far_thermometer, uneven_tone,
    )
}  # fmt: skip
