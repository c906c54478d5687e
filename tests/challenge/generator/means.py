"""Effects on the mean: sinusoid, temperature, thermal lag, warm-up, step, mount tilt, motion; three foreign ones."""

from __future__ import annotations

import numpy as np
from challenge.generator.effect import Effect, Place, Truth, UnreachableError, sized
from challenge.generator.scene import Scene, log_uniform, smooth
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

FloatArray = NDArray[np.float64]

GRAVITY = 9.81


class MeanEffect(Effect):
    """size · template; the size is found from the energy of the template."""

    size: float

    def draw(self, place: Place) -> None:
        """Draw the shape."""

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        """Return the shape of unit size, shape (n,)."""
        raise NotImplementedError

    @classmethod
    def hide(cls, place: Place, target: float) -> MeanEffect:
        """Draw one of a wanted detectability."""
        self = cls()
        self.draw(place)
        energy = (
            place.oracle.energy(self.template(place.felt, place.scene))
            * place.scene.axes[place.axis].white ** 2
        )
        size, self.nats = sized(lambda a: place.oracle.mean(energy, a), target, 1e-6, 1e4)
        self.size = size * float(place.rng.choice([-1.0, 1.0]))
        return self

    def amplitude(self, axis: str, scene: Scene) -> float:
        return self.size * scene.axes[axis].white

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return self.amplitude(axis, scene) * self.template(felt, scene)


class Line(MeanEffect):
    cause = "line"

    def draw(self, place: Place) -> None:
        rng, scene = place.rng, place.scene
        self.frequency = log_uniform(
            rng, min(max(0.05, 60.0 / scene.span), 0.1 * scene.rate), 0.49 * scene.rate
        )
        self.phase = float(rng.uniform(0.0, 2.0 * np.pi))

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return np.cos(2.0 * np.pi * self.frequency * scene.clock() + self.phase)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"frequency": self.frequency, "amplitude": abs(self.amplitude(axis, scene))}


class Temperature(MeanEffect):
    cause, needs = "temperature", "temperature"

    @classmethod
    def hide(cls, place: Place, target: float) -> MeanEffect:
        """Draw one whose bias the thermometer tells well: its error makes less noise than the sensor does."""
        self = super().hide(place, target)
        scene, p = place.scene, place.scene.temperature
        error = (p["noise"] ** 2 + p["code"] ** 2 / 12.0) * max(p["update"], scene.interval)
        if self.size**2 * error > 0.1 * scene.interval:
            msg = "the thermometer is too coarse for this slope"
            raise UnreachableError(msg)
        return self

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return felt - 25.0

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"slope": self.amplitude(axis, scene)}


class ThermalLag(Temperature):
    cause = "thermal_lag"

    def draw(self, place: Place) -> None:
        self.memory = log_uniform(place.rng, 50.0, 800.0)

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return smooth(felt, self.memory * scene.rate) - felt[0]

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"slope": self.amplitude(axis, scene), "time_constant": self.memory}


class Warmup(MeanEffect):
    cause = "warmup"

    def draw(self, place: Place) -> None:
        self.memory = log_uniform(
            place.rng, min(20.0, 0.1 * place.scene.span), min(900.0, 0.25 * place.scene.span)
        )

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return np.exp(-(scene.clock() - scene.start) / self.memory)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"amplitude": self.amplitude(axis, scene), "time_constant": self.memory}


class Step(MeanEffect):
    cause = "step"

    def draw(self, place: Place) -> None:
        self.time = place.scene.start + place.scene.span * float(place.rng.uniform(0.1, 0.9))

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return (scene.clock() >= self.time).astype(float)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"time": self.time, "size": self.amplitude(axis, scene)}


class Attitude(MeanEffect):
    """The mount rolls by `tilt` between two times; gravity moves from accel z into accel y."""

    cause, needs = "attitude", "accel"

    def draw(self, place: Place) -> None:
        self.first, self.last = np.sort(place.rng.uniform(0.1, 0.9, 2))

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return np.asarray(
            np.interp(np.linspace(0.0, 1.0, scene.samples), [self.first, self.last], [0.0, 1.0])
        )

    def tilt(self, scene: Scene) -> float:
        return self.size * scene.axes["accel_y"].white / GRAVITY

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        angle = self.tilt(scene) * self.template(felt, scene)
        if axis == "accel_y":
            return GRAVITY * np.sin(angle)
        return GRAVITY * (np.cos(angle) - 1.0) if axis == "accel_z" else np.zeros(scene.samples)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"tilt": self.tilt(scene)}


class Motion(Effect):
    """Somebody handles the sensor for a while: band-limited sway far above the noise."""

    cause, shared = "motion", True

    @classmethod
    def hide(cls, place: Place, target: float) -> Motion:
        self = cls()
        rng, scene = place.rng, place.scene
        self.duration = scene.span * log_uniform(rng, 0.01, 0.1)
        self.start = scene.start + rng.uniform(0.05, 0.85) * scene.span
        self.sd = log_uniform(rng, 5.0, 100.0)
        self.nats = 1000.0
        return self

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        t = scene.clock()
        inside = (t >= self.start) & (t < self.start + self.duration)
        sway = sosfilt(
            butter(2, [0.1, 3.0], "band", fs=scene.rate, output="sos"), rng.standard_normal(inside.sum())
        )
        y = np.zeros(scene.samples)
        y[inside] = self.sd * scene.axes[axis].white * sway / sway.std() * np.hanning(len(sway))
        return y

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"start": self.start, "duration": self.duration}


class Chirp(MeanEffect):
    """Foreign: a tone that sweeps."""

    cause = "unknown:chirp"

    def draw(self, place: Place) -> None:
        rate = place.scene.rate
        self.ends = np.sort(np.exp(place.rng.uniform(np.log(0.02 * rate), np.log(0.45 * rate), 2)))

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        t = scene.clock() - scene.start
        low, high = self.ends
        return np.cos(2.0 * np.pi * (low * t + 0.5 * (high - low) * t**2 / scene.span))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"low": float(self.ends[0]), "high": float(self.ends[1])}


class Bilinear(MeanEffect):
    """Foreign: a temperature coefficient that ages, T · t."""

    cause, needs = "unknown:bilinear", "temperature"

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return (felt - felt.mean()) * np.linspace(-1.0, 1.0, scene.samples)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"size": self.amplitude(axis, scene)}


class ThreeLevels(MeanEffect):
    """Foreign: a bias that hops between three levels."""

    cause = "unknown:three levels"

    def draw(self, place: Place) -> None:
        rng, scene = place.rng, place.scene
        hops = np.sort(rng.uniform(0.0, scene.span, max(6, rng.poisson(scene.span / 120.0))))
        levels = np.cumsum(rng.integers(1, 3, len(hops) + 1)) % 3 - 1.0
        self.hops, self.levels = hops, levels

    def template(self, felt: FloatArray, scene: Scene) -> FloatArray:
        return np.asarray(self.levels[np.searchsorted(self.hops, scene.clock() - scene.start)])

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"size": self.amplitude(axis, scene)}
