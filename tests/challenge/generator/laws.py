"""Effects on the distribution of the white noise: heavy tails, spikes, burst, drifting variance, common noise."""

from __future__ import annotations

import numpy as np
from challenge.generator.effect import Effect, Place, Truth, UnreachableError, sized
from challenge.generator.scene import Scene, log_uniform
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import norm
from scipy.stats import t as student

FloatArray = NDArray[np.float64]


class HeavyTails(Effect):
    """Student's t of the same variance."""

    cause = "heavy_tails"

    @classmethod
    def hide(cls, place: Place, target: float) -> HeavyTails:
        self = cls()
        n = place.scene.samples
        share = (place.scene.axes[place.axis].white / place.white) ** 4
        self.nu, self.nats = sized(lambda nu: n * share * above_normal(nu), target, 4.5, 3000.0)
        return self

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        chi2 = 2.0 * rng.standard_gamma(0.5 * self.nu, len(w))
        return np.asarray(w * np.sqrt((self.nu - 2.0) / chi2))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"excess_kurtosis": 6.0 / (self.nu - 4.0)}


def above_normal(nu: float) -> float:
    """Return the divergence of Student's law from the normal one of its variance, nats a sample."""
    if nu > 60.0:
        return float(6.0 / (nu - 4.0)) ** 2 / 48.0
    spread = np.sqrt(nu / (nu - 2.0))
    law = student(nu, scale=1.0 / spread)
    value, _ = quad(lambda x: law.pdf(x) * (law.logpdf(x) - norm.logpdf(x)), -np.inf, np.inf, limit=400)
    return float(value)


class Spikes(Effect):
    """A few samples off by ± size; their number is exact, not a draw."""

    cause = "spikes"

    @classmethod
    def hide(cls, place: Place, target: float) -> Spikes:
        self, n = cls(), place.scene.samples
        self.number = round(log_uniform(place.rng, 2.0, max(2.5, min(60.0, target / 6.0))))
        self.rate = self.number / place.scene.span
        self.size, self.nats = sized(lambda s: n * contaminated(self.number / n, s), target, 3.0, 60.0)
        self.size *= place.white / place.scene.axes[place.axis].white
        return self

    def signal(self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        y = np.zeros(scene.samples)
        at = rng.choice(scene.samples, self.number, replace=False)
        y[at] = self.size * scene.axes[axis].white * rng.choice([-1.0, 1.0], self.number)
        return y

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"rate": self.rate, "size": self.size * scene.axes[axis].white}


def contaminated(share: float, size: float) -> float:
    """Return the divergence of a normal law with spikes ± size from the refitted one, nats a sample."""
    x = np.linspace(-size - 8.0, size + 8.0, 20001)
    quiet = norm.pdf(x)
    law = (1.0 - share) * quiet + 0.5 * share * (norm.pdf(x - size) + norm.pdf(x + size))
    sd = np.sqrt(1.0 + share * size**2)
    return float(np.trapezoid(law * (np.log(np.maximum(law, 1e-300)) - norm.logpdf(x, scale=sd)), x))


class Burst(Effect):
    """A stretch of louder noise."""

    cause = "burst"

    @classmethod
    def hide(cls, place: Place, target: float) -> Burst:
        self, scene, rng = cls(), place.scene, place.rng
        share = log_uniform(rng, 0.01, 0.3)
        self.duration = share * scene.span
        self.start = scene.start + (scene.span - self.duration) * rng.uniform(0.02, 0.98)
        quiet = 1.0 - (scene.axes[place.axis].white / place.white) ** 2

        def nats(extra: float) -> float:
            ratio = 1.0 + extra * (1.0 - quiet)
            return 0.5 * scene.samples * float(np.log1p(share * (ratio - 1.0)) - share * np.log(ratio))

        extra, self.nats = sized(nats, target, 1e-3, 200.0)
        self.ratio = 1.0 + extra
        return self

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        t = scene.clock()
        inside = (t >= self.start) & (t < self.start + self.duration)
        return np.asarray(np.where(inside, np.sqrt(self.ratio), 1.0) * w)

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"start": self.start, "duration": self.duration, "variance_ratio": self.ratio}


class VarianceDrift(Effect):
    """The log of the variance runs evenly in time."""

    cause = "variance_drift"

    @classmethod
    def hide(cls, place: Place, target: float) -> VarianceDrift:
        self, scene = cls(), place.scene
        share = (scene.axes[place.axis].white / place.white) ** 2

        def nats(change: float) -> float:
            variance = 1.0 - share + share * np.exp(change * np.linspace(-0.5, 0.5, 2001))
            return 0.5 * scene.samples * float(np.log(variance.mean()) - np.log(variance).mean())

        change, self.nats = sized(nats, target, 1e-3, 6.0)
        self.slope = change / scene.span * float(place.rng.choice([-1.0, 1.0]))
        return self

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        middle = scene.start + 0.5 * scene.span
        return np.asarray(w * np.exp(0.5 * self.slope * (scene.clock() - middle)))

    def truth(self, axis: str, scene: Scene) -> Truth:
        return {"slope": self.slope}


class Swelling(VarianceDrift):
    """Foreign: a variance that swells and ebbs with a period much shorter than the record."""

    cause = "unknown:swelling"

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        phase = 40.0 * np.pi * (scene.clock() - scene.start) / scene.span
        depth = 0.4 * abs(self.slope) * scene.span
        return np.asarray(w * np.exp(0.5 * depth * np.sin(phase)))


class CrossAxis(Effect):
    """White noise that the axes of a sensor share."""

    cause, needs, shared = "cross_axis", "triad", True

    @classmethod
    def hide(cls, place: Place, target: float) -> CrossAxis:
        self, scene = cls(), place.scene
        sensor = place.axis.split("_")[0]
        noises = [noise for name, noise in scene.axes.items() if name.startswith(sensor)]
        if len(noises) < 2:
            msg = "one axis shares nothing"
            raise UnreachableError(msg)
        width = len(noises)

        def nats(rho: float) -> float:
            share = rho * (scene.axes[place.axis].white / place.white) ** 2
            return (
                -0.5 * scene.samples * float(np.log1p((width - 1) * share) + (width - 1) * np.log1p(-share))
            )

        self.correlation, self.nats = sized(nats, target, 1e-4, 0.9)
        return self

    def begin(self, n: int, rng: np.random.Generator) -> None:
        self.common = rng.standard_normal(n)

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        return np.asarray(np.sqrt(1.0 - self.correlation) * w + np.sqrt(self.correlation) * sd * self.common)

    def truth(self, axis: str, scene: Scene) -> Truth:
        noise = scene.axes[axis]
        seen = noise.white**2 / (noise.white**2 + noise.step**2 / 12.0 + 2.0 * noise.quantum**2)
        return {"correlation": self.correlation * seen}
