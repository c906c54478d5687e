"""Further static records of what the catalogue does not have, drawn to judge what `outside` helped to improve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from challenge.generator.beyond import Made
from challenge.generator.outside import (
    CLOCK,
    COUNT,
    INTERVAL,
    SCALE,
    SPAN,
    FloatArray,
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
from scipy.ndimage import median_filter
from scipy.signal import lfilter


def product_of_axes(rng: Rng) -> Made:
    """One axis holds the product of the movements of the two others, each a Gauss–Markov process of 0.1 to 2 s.

    Most of its spectrum is that of one such process: 2000 … 8000 nats over white noise.
    """
    r = np.exp(-INTERVAL / log_uniform(rng, 0.1, 2.0))
    sway = lfilter([np.sqrt(1.0 - r * r)], [1.0, -r], rng.standard_normal((2, COUNT)))
    size = log_uniform(rng, 2000.0, 8000.0)
    axes = [noise(rng) + power_sized(sway[0] * sway[1], size)]
    axes += [noise(rng) + 0.02 * sway[k] for k in range(2)]
    names = ("gyro_x", "gyro_y", "gyro_z")
    right = frozenset({"gauss_markov"})
    return Made({name: SCALE * y for name, y in zip(names, axes, strict=True)}, right, size)


def stretched(rng: Rng) -> Made:
    """A warm-up that is no exponential: the logarithm of time, or two exponentials whose constants differ tenfold."""
    constant = log_uniform(rng, 10.0, 100.0)
    if rng.random() < 0.5:
        shape = np.log1p(CLOCK / constant)
    else:
        shape = np.exp(-CLOCK / constant) + rng.uniform(0.5, 2.0) * np.exp(-0.1 * CLOCK / constant)
    size = nats(rng)
    return made(noise(rng) + mean_sized(shape, size), size, "warmup")


def wrapped(rng: Rng) -> Made:
    """A register that overflows: samples beyond one limit come out at the other end of its range."""
    y = noise(rng)
    limit = float(np.quantile(y, 1.0 - log_uniform(rng, 1e-4, 3e-3)))
    return made(
        np.where(y > limit, y - 2.0 * rng.uniform(1.0, 2.0) * limit, y), 1e3, "overflow", "clipping", "spikes"
    )


def copied_stretch(rng: Rng) -> Made:
    """A buffer of 2 to 20 s that is written twice."""
    y = noise(rng)
    length = int(rng.uniform(2.0, 20.0) / INTERVAL)
    at = int(rng.integers(length, COUNT - length))
    y[at : at + length] = y[at - length : at]
    return made(y, 1e4, "repeated_packets")


def moving_filter(rng: Rng) -> Made:
    """A filter whose pole moves from one value to another through the record."""
    low, high = np.sort(rng.uniform(0.05, 0.7, 2))
    pole = np.linspace(low, max(high, low + 0.2), COUNT)[:: int(rng.choice([-1, 1]))]
    y, last = np.empty(COUNT), 0.0
    for i, (w, a) in enumerate(zip(rng.standard_normal(COUNT).tolist(), pole.tolist(), strict=True)):
        last = a * last + (1.0 - a * a) ** 0.5 * w
        y[i] = last
    return made(y + slow(rng), 1e3, "lowpass")


def ragged_means(rng: Rng) -> Made:
    """Each sample the mean of one, two or three readings, as many as came in time."""
    many = rng.integers(1, 4, COUNT)
    return made(rng.standard_normal(COUNT) / np.sqrt(many) + slow(rng), 1e3, "heavy_tails")


def slew_limited(rng: Rng) -> Made:
    """An amplifier that cannot follow: neighbouring samples differ by one to two sds at most."""
    most, y, last = rng.uniform(1.0, 2.0), np.empty(COUNT), 0.0
    for i, x in enumerate(rng.standard_normal(COUNT).tolist()):
        last += min(max(x - last, -most), most)
        y[i] = last
    return made(y + slow(rng), 1e4, "lowpass", "colour")


def median_filtered(rng: Rng) -> Made:
    """The median of three or five readings, of which the log has every second or every one."""
    every = int(rng.choice([1, 2]))
    w = median_filter(rng.standard_normal(every * COUNT), int(rng.choice([3, 5])))[::every]
    return made(w / w.std() + slow(rng), 1e4, "lowpass", "colour")


def shot_noise(rng: Rng) -> Made:
    """Short pulses of one sign that overlap."""
    size = nats(rng)
    pulses = lfilter([1.0], [1.0, -rng.uniform(0.2, 0.8)], rng.poisson(log_uniform(rng, 0.003, 0.05), COUNT))
    return made(
        noise(rng) + power_sized(pulses - pulses.mean(), size),
        size,
        "skewed_noise",
        "heavy_tails",
        "lowpass",
        "colour",
    )


def run_up_and_down(rng: Rng) -> Made:
    """A motor that runs up and down again: a tone that sweeps to a frequency and back."""
    low, high = np.sort(rng.uniform(3.0, 47.0, 2))
    at = rng.uniform(0.3, 0.7)
    f = np.interp(CLOCK / SPAN, [0.0, at, 1.0], [low, max(high, low + 5.0), low])
    size = nats(rng)
    wave = np.sqrt(2.0 * 4.0 * size / COUNT) * np.sin(2.0 * np.pi * INTERVAL * np.cumsum(f))
    return made(noise(rng) + wave, size)


def loud_half(rng: Rng) -> Made:
    """Noise that rises and falls by traffic: two levels of variance that alternate at random."""
    size = nats(rng)
    sd = variance_sized(switching(rng, log_uniform(rng, 5.0, 60.0)).astype(float), size)
    return made(rng.standard_normal(COUNT) * sd + slow(rng), size, "burst")


def ageing(rng: Rng) -> Made:
    """A slope of the bias that changes once, and stays."""
    size, at = nats(rng), SPAN * rng.uniform(0.25, 0.75)
    return made(noise(rng) + mean_sized(np.maximum(CLOCK - at, 0.0), size), size)


def warm_gain(rng: Rng) -> Made:
    """White noise whose sd follows the temperature."""
    felt, size = box(rng), nats(rng)
    sd = variance_sized((felt - felt.mean()) / felt.std(), size)
    y = rng.standard_normal(COUNT) * sd + slow(rng)
    return made(y, size, "variance_drift", "periodic_variance", temperature=thermometer(rng, felt))


def beating(rng: Rng) -> Made:
    """Two rotors of nearly the same wandering speed."""
    speed = rng.uniform(5.0, 40.0)
    both = [speed * (1.0 + 3e-3 * coloured(rng, -2.0) + rng.normal() * 5e-3) for _ in range(2)]
    wave = sum(np.sin(2.0 * np.pi * INTERVAL * np.cumsum(f)) for f in both)
    size = nats(rng)
    return made(noise(rng) + power_sized(np.asarray(wave), size), size, "vibration")


def uneven_converter(rng: Rng) -> Made:
    """A converter whose codes have widths that scatter by a third."""
    step = log_uniform(rng, 0.2, 0.8)
    edges = np.cumsum(step * np.maximum(1.0 + 0.33 * rng.standard_normal(4000), 0.05))
    y: FloatArray = noise(rng)
    code = np.searchsorted(edges, y + edges[2000]) - 2000
    return made(step * code, 1e3, "lattice")


KINDS: dict[str, Callable[[Rng], Made]] = {
    f.__name__: f
    for f in (
        product_of_axes, stretched, wrapped, copied_stretch, moving_filter, ragged_means, slew_limited,
        median_filtered, shot_noise, run_up_and_down, loud_half, ageing, warm_gain, beating, uneven_converter,
    )
}  # fmt: skip
