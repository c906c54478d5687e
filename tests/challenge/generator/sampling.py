"""Effects on how samples are stored: repeated samples, saturation, quantizer, time stamps; and telegraph noise."""

from __future__ import annotations

import numpy as np
from challenge.generator.effect import Effect, IntArray, Place, Truth, UnreachableError, sized
from challenge.generator.noise import Noise
from challenge.generator.oracle import fitted
from challenge.generator.scene import Scene, log_uniform
from numpy.typing import NDArray
from scipy.fft import dct

FloatArray = NDArray[np.float64]

TIE = 1e-9
"""Chance that two samples without a lattice are equal to the last digit."""
EXACT = 1000.0
"""Nats of what needs no statistics."""


class Duplicates(Effect):
    """Readings of one sensor that repeat the last ones, all axes at once."""

    cause, shared = "duplicates", True

    @classmethod
    def hide(cls, place: Place, target: float) -> Duplicates:
        self, scene = cls(), place.scene
        sensor = place.axis.split("_")[0]
        alike = 1.0
        for name, noise in scene.axes.items():
            if name.startswith(sensor):
                alike *= max(
                    TIE,
                    min(
                        0.5, noise.step / (2.0 * np.sqrt(np.pi) * np.hypot(noise.white, 1.4 * noise.quantum))
                    ),
                )
        alike = max(alike, TIE)

        def nats(share: float) -> float:
            p = alike + share * (1.0 - alike)
            return scene.samples * float(
                p * np.log(p / alike) + (1.0 - p) * np.log((1.0 - p) / (1.0 - alike))
            )

        share, self.nats = sized(nats, target, 1e-7, 0.9)
        self.number = max(2, round(share * scene.samples))
        self.nats = nats(self.number / scene.samples)
        return self

    def rows(self, n: int, rng: np.random.Generator) -> IntArray:
        source = np.arange(n)
        source[1 + rng.choice(n - 1, self.number, replace=False)] = 0
        return np.maximum.accumulate(source)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"fraction": self.number / scene.samples}


class Clipping(Effect):
    """A rail above the signal, so placed that its trace in the codes is worth the wanted nats."""

    cause, alone = "clipping", True

    @classmethod
    def hide(cls, place: Place, target: float) -> Clipping:
        self = cls()
        self.target, self.nats, self.level = target, target, np.inf
        return self

    def codes(self, y: FloatArray, axis: str, scene: Scene) -> FloatArray:
        code, count = np.unique(y, return_counts=True)
        beyond = np.cumsum(count[::-1])[::-1]
        worth = beyond * np.log(
            beyond / np.maximum(count if scene.axes[axis].step else TIE * len(y), TIE * len(y))
        )
        reached = np.flatnonzero((worth >= self.target) & (beyond >= 3))
        if len(reached):
            self.level = float(code[reached[-1]])
            self.nats = float(worth[reached[-1]])
        return np.minimum(y, self.level)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"high": self.level}


class Lattice(Effect):
    """Codes wider than two standard deviations of the noise."""

    cause = "lattice"

    @classmethod
    def hide(cls, place: Place, target: float) -> Lattice:
        self = cls()
        self.step, self.nats = float(place.rng.uniform(2.2, 4.0)), EXACT
        return self

    def codes(self, y: FloatArray, axis: str, scene: Scene) -> FloatArray:
        step = self.step * scene.axes[axis].white
        return np.asarray(step * np.round(y / step))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"step": self.step * scene.axes[axis].white}


class Timing(Effect):
    """Lost samples, or stamps with jitter."""

    cause, shared = "timing", True

    @classmethod
    def hide(cls, place: Place, target: float) -> Timing:
        self, rng = cls(), place.rng
        self.lost = int(rng.integers(3, 100)) if rng.random() < 0.5 else 0
        self.jitter = 0.0 if self.lost else log_uniform(rng, 0.003, 0.2) * place.scene.interval
        self.nats = EXACT
        return self

    def rows(self, n: int, rng: np.random.Generator) -> IntArray:
        kept = np.ones(n, dtype=bool)
        starts = 10 + 20 * rng.choice(n // 20 - 2, self.lost, replace=False)
        for start in starts:
            kept[start : start + rng.integers(1, 9)] = False
        return np.flatnonzero(kept)

    def stamps(self, t: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return np.asarray(np.sort(t + self.jitter * rng.standard_normal(len(t))))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"gap_count": float(self.lost)} if self.lost else {"jitter_sd": self.jitter}


class Telegraph(Effect):
    """A bias that switches between two levels at random times.

    Its spectrum is that of a Gauss–Markov process; d is the likelihood of the switching model (forward
    recursion) less that of the best base, on block means of one drawn path in white noise; the slow noise
    counts as white.
    """

    cause = "telegraph"

    @classmethod
    def hide(cls, place: Place, target: float) -> Telegraph:
        self, scene, rng = cls(), place.scene, place.rng
        noise = scene.axes[place.axis]
        top = scene.span / 12.0
        self.dwell = tuple(log_uniform(rng, min(5.0, 0.2 * top), min(300.0, top)) for _ in range(2))
        self.switches: FloatArray = np.cumsum(
            np.array(self.dwell)[np.arange(20000) % 2] * rng.standard_exponential(20000)
        )
        size = max(1, round(min(self.dwell) / 10.0 * scene.rate))
        blocks = scene.samples // size
        step = size * scene.interval
        path = self.path(scene)[: blocks * size].reshape(blocks, size).mean(axis=1)
        if np.count_nonzero(np.diff(self.path(scene))) < 8:
            msg = "too few switches"
            raise UnreachableError(msg)
        f = np.array([0.5 / min(self.dwell)])
        slow = float(noise.power(f, scene.interval)[0] + noise.step**2 / 12.0) / size
        draw = rng.standard_normal(blocks)

        def nats(a: float) -> float:
            x = (a * noise.white * path + np.sqrt(slow) * draw) / np.sqrt(slow)
            high = a * noise.white / np.sqrt(slow)
            return forward(x, high, step, self.dwell) - base_likelihood(x, step)

        self.size, self.nats = sized(nats, target, 1e-3, 3.0)
        return self

    def path(self, scene: Scene) -> FloatArray:
        at = np.searchsorted(self.switches, np.arange(scene.samples) * scene.interval)
        return np.asarray((at % 2).astype(float))

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return self.size * scene.axes[axis].white * self.path(scene)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {
            "size": self.size * scene.axes[axis].white,
            "dwell_low": self.dwell[0],
            "dwell_high": self.dwell[1],
        }


def forward(x: FloatArray, high: float, step: float, dwell: tuple[float, ...]) -> float:
    """Return the log likelihood of unit white noise about a level that switches between 0 and `high`."""
    up, down = -np.expm1(-step / dwell[0]), -np.expm1(-step / dwell[1])
    weight = dwell[1] / (dwell[0] + dwell[1])
    low_density, high_density = np.exp(-0.5 * x * x), np.exp(-0.5 * (x - high) ** 2)
    total = -0.5 * len(x) * float(np.log(2.0 * np.pi))
    for a, b in zip(low_density.tolist(), high_density.tolist(), strict=True):
        q = (1.0 - weight) * a
        p = weight * b
        total += float(np.log(p + q + 1e-300))
        weight = p / (p + q + 1e-300)
        weight = weight * (1.0 - down) + (1.0 - weight) * up
    return total


def base_likelihood(x: FloatArray, step: float) -> float:
    """Return the log likelihood of the best base for block means of unit white noise."""
    a = dct(x, norm="ortho")[1:] ** 2
    f = np.arange(1, len(x)) / (2.0 * len(x) * step)
    near = Noise(1.0, 0.0, 0.3, 0.3, 20.0 * step, 0.0, 0.0, 0.0, 0.0)
    cost = fitted(a, np.ones(len(a)), f, step, near)
    return -cost - 0.5 * len(x) * float(np.log(2.0 * np.pi))
