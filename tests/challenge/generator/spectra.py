"""Effects on the spectrum: low-pass filter, first-order colour, resonance, a second Gauss–Markov process.

The filter runs at eight times the rate and is decimated, as a sensor does it; the resonance is a carrier with
a randomly walking envelope, not a recursion of second order.
"""

from __future__ import annotations

import numpy as np
from challenge.generator.effect import Effect, Place, Truth, sized
from challenge.generator.noise import markov, markov_power
from challenge.generator.scene import Scene, log_uniform
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt, sosfreqz

FloatArray = NDArray[np.float64]

OVERSAMPLING = 8


class LowPass(Effect):
    """Analogue Butterworth filter of order 1 or 2 before the sampler; the variance of the samples is kept."""

    cause = "lowpass"

    @classmethod
    def hide(cls, place: Place, target: float) -> LowPass:
        self, noise, rate = cls(), place.scene.axes[place.axis], place.scene.rate
        self.order = int(place.rng.integers(1, 3))
        base = place.oracle.power - noise.white**2

        def nats(cutoff: float) -> float:
            return place.oracle.spectrum(
                base + noise.white**2 * self.response(cutoff, place.oracle.frequency, rate)
            )

        self.cutoff, self.nats = sized(nats, target, 0.05 * rate, 2.0 * rate)
        return self

    def sections(self, cutoff: float, rate: float) -> FloatArray:
        return np.asarray(butter(self.order, cutoff, fs=OVERSAMPLING * rate, output="sos"))

    def response(self, cutoff: float, f: FloatArray, rate: float) -> FloatArray:
        """Return the folded squared response, of mean 1 over the band."""
        images = np.arange(OVERSAMPLING) * rate

        def folded(at: FloatArray) -> FloatArray:
            _, h = sosfreqz(
                self.sections(cutoff, rate), (at[:, None] + images).ravel(), fs=OVERSAMPLING * rate
            )
            return np.asarray((np.abs(h) ** 2).reshape(len(at), -1).sum(axis=1))

        even = folded((np.arange(512) + 0.5) / 1024.0 * rate)
        return folded(f) / even.mean()

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        fine = rng.standard_normal(OVERSAMPLING * (len(w) + 64))
        y = sosfilt(self.sections(self.cutoff, scene.rate), fine)[64 * OVERSAMPLING :: OVERSAMPLING]
        return np.asarray(sd * y / y.std())

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"cutoff": self.cutoff, "order": float(self.order)}


class Colour(Effect):
    """Negative correlation of neighbours, x_k = φ x_{k−1} + w_k with φ < 0."""

    cause = "colour"

    @classmethod
    def hide(cls, place: Place, target: float) -> Colour:
        self, noise, scene = cls(), place.scene.axes[place.axis], place.scene
        base = place.oracle.power - noise.white**2
        turn = np.cos(2.0 * np.pi * place.oracle.frequency * scene.interval)

        def nats(size: float) -> float:
            return place.oracle.spectrum(base + noise.white**2 / (1.0 + size**2 + 2.0 * size * turn))

        size, self.nats = sized(nats, target, 1e-4, 0.8)
        self.phi = -size
        return self

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return np.asarray(lfilter([1.0], [1.0, -self.phi], w))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"ar": [self.phi]}


class Vibration(Effect):
    """A carrier whose complex envelope is a Gauss–Markov process of bandwidth frequency ÷ quality."""

    cause = "vibration"
    sharpness = (5.0, 100.0)

    @classmethod
    def hide(cls, place: Place, target: float) -> Vibration:
        self, scene, rng = cls(), place.scene, place.rng
        self.frequency = log_uniform(rng, max(2.0, 0.02 * scene.rate), 0.45 * scene.rate)
        self.quality = log_uniform(rng, *cls.sharpness)
        self.memory = self.quality / (np.pi * self.frequency)
        shape = place.white**2 * self.response(place.oracle.frequency, scene.interval)
        self.size, self.nats = sized(
            lambda s: place.oracle.spectrum(place.oracle.power + s**2 * shape), target, 1e-3, 3.0
        )
        return self

    def response(self, f: FloatArray, interval: float) -> FloatArray:
        sides = [markov_power(f + s * self.frequency, interval, 1.0, self.memory) for s in (-1.0, 1.0)]
        return np.asarray(0.5 * (sides[0] + sides[1]))

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        sd = self.size * np.hypot(scene.axes[axis].white, scene.axes[axis].step / np.sqrt(12.0))
        turn = 2.0 * np.pi * self.frequency * scene.clock()
        parts = [markov(scene.samples, scene.interval, sd, self.memory, rng) for _ in range(2)]
        return np.asarray(parts[0] * np.cos(turn) + parts[1] * np.sin(turn))

    def truth(self, axis: str, scene: Scene) -> Truth:
        sd = self.size * np.hypot(scene.axes[axis].white, scene.axes[axis].step / np.sqrt(12.0))
        return {"frequency": self.frequency, "quality": self.quality, "sd": float(sd)}


class SecondMarkov(Effect):
    """A Gauss–Markov process beside the slow noise; most of them the base absorbs."""

    cause = "gauss_markov"

    @classmethod
    def hide(cls, place: Place, target: float) -> SecondMarkov:
        self, scene, noise = cls(), place.scene, place.scene.axes[place.axis]
        self.memory = log_uniform(place.rng, min(1.0, scene.span / 100.0), scene.span / 50.0)
        shape = noise.white**2 * markov_power(place.oracle.frequency, scene.interval, 1.0, self.memory)
        self.size, self.nats = sized(
            lambda s: place.oracle.spectrum(place.oracle.power + s**2 * shape), target, 1e-3, 3.0
        )
        return self

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return markov(scene.samples, scene.interval, self.size * scene.axes[axis].white, self.memory, rng)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"sd": self.size * scene.axes[axis].white, "time_constant": self.memory}
