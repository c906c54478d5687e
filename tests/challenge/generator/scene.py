"""The sensor in which an effect is hidden: its grade, clock, temperature and the noise of its axes.

Ranges are those of common sensors: consumer, industrial and tactical MEMS; an hour or so of 50 … 400 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from challenge.generator.noise import Noise
from numpy.typing import NDArray
from scipy.signal import lfilter

FloatArray = NDArray[np.float64]

DEG = np.pi / 180.0
GRADES = {"consumer": (0.3, 1.5), "industrial": (0.05, 0.3), "tactical": (0.005, 0.05)}
"""Angle random walk of the grades, deg/√h; the accelerometers go with it."""
HARD = ("walk and warm-up", "lattice of one sd", "ramp", "foreign temperature", "markov", "flicker")
"""Null sets that tempt: what each exaggerates."""


@dataclass(frozen=True)
class Scene:
    """Everything but the effects.

    Attributes
    ----------
    grade : str
        One of `GRADES`.
    rate : float
        Hz.
    samples : int
        Samples of a record.
    start : float
        First stamp, s.
    axes : dict of str to Noise
        Noise of ``gyro_x`` … ``accel_z``.
    profile : str
        ``none constant warming diurnal chamber wander``.
    temperature : dict of str to float
        Figures of the profile and of its thermometer.
    hard : str
        What is exaggerated, or nothing.
    """

    grade: str
    rate: float
    samples: int
    start: float
    axes: dict[str, Noise]
    profile: str
    temperature: dict[str, float]
    hard: str = ""

    @property
    def interval(self) -> float:
        return 1.0 / self.rate

    @property
    def span(self) -> float:
        return self.samples / self.rate

    def clock(self) -> FloatArray:
        """Return the true times of the samples, s."""
        return self.start + self.interval * np.arange(self.samples)

    def felt(self, rng: np.random.Generator) -> FloatArray:
        """Return the temperature of the sensor, °C; another run has another one of the same kind."""
        t, p = np.arange(self.samples) / self.rate, self.temperature
        if self.profile == "warming":
            return p["level"] - p["range"] * np.expm1(-t / p["time_constant"]) * rng.uniform(0.8, 1.25)
        if self.profile == "diurnal":
            turn = 2.0 * np.pi * (t / p["period"] + rng.uniform())
            return p["level"] + p["range"] * np.sin(turn)
        if self.profile == "chamber":
            corner = np.sort(rng.uniform(0.1, 0.9, 4)) * t[-1]
            return np.interp(t, corner, p["level"] + p["range"] * np.array([0.0, 1.0, 1.0, 0.0]))
        if self.profile == "wander":
            steps = rng.standard_normal(self.samples) * p["range"] / np.sqrt(self.samples)
            return p["level"] + smooth(np.cumsum(steps), 60.0 * self.rate)
        return np.full(self.samples, p["level"])

    def read(self, felt: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return what the thermometer writes: noise, codes, a value held between updates."""
        p = self.temperature
        noisy = felt + p["noise"] * rng.standard_normal(len(felt))
        codes = p["code"] * np.round(noisy / p["code"])
        held = max(1, round(p["update"] * self.rate))
        return np.asarray(codes[np.arange(len(codes)) // held * held])


def smooth(x: FloatArray, memory: float) -> FloatArray:
    """Return x behind a first-order lag of `memory` samples, started at rest."""
    phi = float(np.exp(-1.0 / memory))
    return np.asarray(x[0] + lfilter([1.0 - phi], [1.0, -phi], x - x[0]))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is even between two limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def scene(
    rng: np.random.Generator, *, hard: str = "", samples: int | None = None, width: int | None = None
) -> Scene:
    """Draw a scene.

    Parameters
    ----------
    rng : numpy.random.Generator
    hard : str
        One of `HARD`, or nothing.
    samples, width : int, optional
        Samples and axes (1, 3 or 6), else drawn.
    """
    grade = str(rng.choice(list(GRADES)))
    rate = float(rng.choice([50.0, 100.0, 100.0, 125.0, 200.0, 400.0]))
    n = samples or int(rng.choice([360_000, 1_000_000], p=[0.85, 0.15]))
    wide = width or int(rng.choice([1, 3, 6], p=[0.55, 0.35, 0.1]))
    names = [f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"][:wide]
    span = n / rate
    arw = log_uniform(rng, *GRADES[grade]) * DEG / 60.0
    family = draw_noise(rng, 1.0 / rate, span, hard)
    axes = {}
    for name in names:
        white = arw * np.sqrt(rate) * (1.0 if name.startswith("gyro") else 10.0)
        own = replace(family, ramp=family.ramp * rng.uniform(-1.0, 1.0))
        bias = white * rng.uniform(-30.0, 30.0) + (9.81 if name == "accel_z" else 0.0)
        axes[name] = replace(scaled(own, white * rng.uniform(0.8, 1.25)), bias=float(bias))
    profile = str(
        rng.choice(["none", "constant", "warming", "diurnal", "chamber"], p=[0.15, 0.15, 0.3, 0.2, 0.2])
    )
    if hard == "walk and warm-up":
        profile = "warming"
    if hard == "foreign temperature":
        profile = "wander"
    temperature = {
        "level": float(rng.uniform(15.0, 35.0)),
        "range": log_uniform(rng, 1.0, 20.0),
        "time_constant": log_uniform(rng, 0.03, 0.3) * span,
        "period": span * rng.uniform(0.7, 3.0),
        "noise": log_uniform(rng, 0.002, 0.1),
        "code": float(rng.choice([0.01, 0.03125, 0.0625, 0.125])),
        "update": float(rng.choice([0.0, 0.1, 1.28])),
    }
    return Scene(grade, rate, n, float(rng.integers(0, 5000)), axes, profile, temperature, hard)


def draw_noise(rng: np.random.Generator, interval: float, span: float, hard: str) -> Noise:
    """Draw the noise of an axis of unit white sd from the times where its Allan curve turns."""
    crossing = log_uniform(rng, 10.0, 300.0)
    markovian = hard == "markov" or (hard != "flicker" and rng.random() < 0.35)
    if hard == "flicker":
        crossing = log_uniform(rng, 0.5, 5.0)
    rise = log_uniform(rng, 0.05, 2.0) * span
    absent = rng.random() < 0.3 and hard != "walk and warm-up"
    if hard == "walk and warm-up":
        rise = log_uniform(rng, 0.005, 0.05) * span
    ramp = 0.0 if rng.random() < 0.5 else rng.uniform(0.0, 5.0)
    if hard == "ramp":
        ramp = rng.uniform(20.0, 100.0)
    codes = 0.0 if rng.random() < 0.3 else log_uniform(rng, 0.03, 1.0)
    if hard == "lattice of one sd":
        codes = 1.0
    floor = float(np.sqrt(interval / crossing))
    return Noise(
        white=1.0,
        quantum=0.0 if rng.random() < 0.6 else log_uniform(rng, 0.05, 0.7),
        flicker=0.0 if markovian else floor / 0.664,
        markov=floor / 0.617 if markovian else 0.0,
        time_constant=log_uniform(rng, 20.0, 500.0) if markovian else 0.0,
        walk=0.0 if absent else floor * np.sqrt(3.0 / rise),
        ramp=ramp * floor / span,
        step=codes,
        bias=0.0,
    )


def scaled(noise: Noise, white: float) -> Noise:
    """Return a noise of another white sd, slow parts in proportion."""
    return replace(
        noise,
        white=white,
        quantum=noise.quantum * white,
        flicker=noise.flicker * white,
        markov=noise.markov * white,
        walk=noise.walk * white,
        ramp=noise.ramp * white,
        step=noise.step * white,
    )
