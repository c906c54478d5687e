"""Records without any effect, of every grade, length, quantizer and filter; `beyond.py` runs them like its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from challenge.generator.beyond import INTERVAL, SCALE, Made
from challenge.generator.noise import Noise
from challenge.generator.scene import log_uniform
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

FloatArray = NDArray[np.float64]

COUNT = 100_000
NOTHING = Noise(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FINER = 8
"""Samples of the sensor for one of the log, before a filter decimates."""


def record(y: FloatArray, right: tuple[str, ...] = ()) -> Made:
    return Made({"gyro_x": SCALE * y}, frozenset(right), 0.0)


def made(
    noise: Noise, rng: np.random.Generator, n: int = COUNT, white: FloatArray | None = None
) -> FloatArray:
    """Return noise in white sds, shape (n,)."""
    w = rng.standard_normal(n) if white is None else white
    return np.asarray(w + noise.slow(n, INTERVAL, rng))


def of_grade(rng: np.random.Generator, n: int = COUNT) -> Noise:
    """Draw flicker, a Gauss–Markov process of 1 to 300 s or none, and a walk of any strength or none."""
    kind = rng.integers(3)
    floor = float(np.sqrt(INTERVAL / log_uniform(rng, 1.0, 200.0)))
    walk = floor * float(np.sqrt(3.0 / (log_uniform(rng, 0.03, 2.0) * n * INTERVAL)))
    return replace(
        NOTHING,
        flicker=floor / 0.664 if kind == 0 else 0.0,
        markov=floor / 0.617 if kind == 1 else 0.0,
        time_constant=log_uniform(rng, 1.0, 300.0) if kind == 1 else 0.0,
        walk=walk if rng.random() < 0.6 else 0.0,
        ramp=rng.normal() * walk / np.sqrt(n * INTERVAL) if rng.random() < 0.3 else 0.0,
        quantum=log_uniform(rng, 0.05, 1.0) if rng.random() < 0.3 else 0.0,
    )


def quiet(rng: np.random.Generator) -> Made:
    """White noise with slow noise of any grade."""
    return record(made(of_grade(rng), rng))


def quiet_markov(rng: np.random.Generator) -> Made:
    """White noise and one strong Gauss–Markov process of 0.05 to 100 s."""
    markov = replace(NOTHING, markov=log_uniform(rng, 0.05, 3.0), time_constant=log_uniform(rng, 0.05, 100.0))
    return record(made(markov, rng), ("gauss_markov", "lowpass", "colour"))


def quiet_walk(rng: np.random.Generator) -> Made:
    """White noise and a walk that ends 0.3 to 300 white sds away."""
    walk = log_uniform(rng, 0.3, 300.0) / np.sqrt(COUNT * INTERVAL)
    return record(made(replace(NOTHING, walk=walk), rng))


def quiet_short(rng: np.random.Generator) -> Made:
    """The first kind, 20 000 samples."""
    return record(made(of_grade(rng, 20_000), rng, 20_000))


def quiet_long(rng: np.random.Generator) -> Made:
    """The first kind, a million samples."""
    return record(made(of_grade(rng, 1_000_000), rng, 1_000_000))


def quiet_codes(rng: np.random.Generator) -> Made:
    """The first kind through a quantizer of 0.01 to 6 white sds."""
    step = log_uniform(rng, 0.01, 6.0)
    y = made(replace(of_grade(rng), quantum=0.0), rng) + 20.0 * rng.standard_normal()
    return record(step * np.round(y / step), ("lattice",))


def quiet_constant(rng: np.random.Generator) -> Made:
    """White noise of which a quantizer of 3 to 7 sds leaves a few samples off one code."""
    step = rng.uniform(3.0, 7.0)
    y = made(NOTHING, rng) + step * rng.uniform(-0.4, 0.4)
    return record(step * np.round(y / step), ("lattice",))


def filtered(rng: np.random.Generator, impulse: Callable[[FloatArray], FloatArray]) -> Made:
    """Return white noise at a higher rate behind a filter, decimated, with slow noise of any grade."""
    w = impulse(rng.standard_normal(FINER * COUNT))[::FINER]
    return record(made(replace(of_grade(rng), quantum=0.0), rng, white=w / w.std()), ("lowpass", "colour"))


def quiet_butterworth(rng: np.random.Generator) -> Made:
    """A Butterworth filter of order 1 to 4."""
    b, a = butter(int(rng.integers(1, 5)), 2.0 * log_uniform(rng, 0.05, 0.45) / FINER)
    return filtered(rng, lambda x: np.asarray(lfilter(b, a, x)))


def quiet_mean(rng: np.random.Generator) -> Made:
    """A moving mean over 1 to 8 samples of the log."""
    width = int(rng.integers(FINER, 8 * FINER))
    return filtered(rng, lambda x: np.asarray(lfilter(np.ones(width), [1.0], x)))


def quiet_cic(rng: np.random.Generator) -> Made:
    """A cascade of 2 to 4 moving means over as many samples as the log leaves out, or twice as many."""
    mean, b = np.ones(int(rng.choice([1, 2])) * FINER), np.ones(1)
    for _ in range(int(rng.integers(2, 5))):
        b = np.convolve(b, mean)
    return filtered(rng, lambda x: np.asarray(lfilter(b, [1.0], x)))


def quiet_skewed(rng: np.random.Generator) -> Made:
    """White noise of a law that is longer on one side, skewness 0.5 to 3.5, with slow noise of any grade or none."""
    skewness, kind = log_uniform(rng, 0.5, 3.5), rng.integers(4)
    if kind == 0:
        w = rng.standard_gamma(4.0 / skewness**2, COUNT)
    elif kind == 1:
        w = rng.lognormal(0.0, 0.3 * skewness**0.8, COUNT)
    elif kind == 2:
        w = rng.standard_normal(COUNT) + skewness * rng.exponential(size=COUNT)
    else:
        w = rng.beta(1.2, 6.0, COUNT)
    w = (w - w.mean()) / w.std() * rng.choice([-1.0, 1.0])
    noise = of_grade(rng) if rng.random() < 0.5 else NOTHING
    return record(made(replace(noise, quantum=0.0), rng, white=w), ("skewed_noise", "heavy_tails"))


def quiet_heavy(rng: np.random.Generator) -> Made:
    """White noise of Student's law with 3 to 30 degrees of freedom, or of Laplace's, likewise."""
    nu = log_uniform(rng, 3.0, 30.0)
    w = rng.laplace(size=COUNT) if rng.random() < 0.3 else rng.standard_t(nu, COUNT)
    noise = of_grade(rng) if rng.random() < 0.5 else NOTHING
    return record(made(replace(noise, quantum=0.0), rng, white=w / w.std()), ("heavy_tails",))


KINDS = {
    f.__name__: f
    for f in (
        quiet, quiet_markov, quiet_walk, quiet_short, quiet_long, quiet_codes, quiet_constant, quiet_butterworth,
        quiet_mean, quiet_cic, quiet_skewed, quiet_heavy,
    )
}  # fmt: skip
