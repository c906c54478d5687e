"""Detectability of an effect: likelihood gain of the true model over the best-fitting base model, nats, noise known.

With m_k the orthonormal cosine coefficients of a hidden mean and S_k the true power of the noise::

    d = min_θ ½ Σ_k [ (S_k + |m_k|²) / S'_k(θ) − 1 + ln(S'_k(θ)/S_k) ]

is the expectation of ln L(truth) − ln L(base), θ the parameters of the base (white, quantization, random
walk, and flicker or one Gauss–Markov process). The ramp, which the base has, is taken out of the mean first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from challenge.generator.noise import Noise, markov_power
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.optimize import minimize

FloatArray = NDArray[np.float64]

SINGLES = 1024
"""Coefficients that are cells of their own."""
PER_DECADE = 60
"""Cells in a decade beyond."""


@dataclass(frozen=True)
class Oracle:
    """A record of n samples of a known noise."""

    noise: Noise
    samples: int
    interval: float

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """First coefficient of each cell, and the end."""
        wide = np.geomspace(SINGLES, self.samples, int(PER_DECADE * np.log10(self.samples / SINGLES)) + 2)
        return np.unique(np.concatenate([np.arange(1, SINGLES), wide.astype(np.int64)]))

    @cached_property
    def count(self) -> FloatArray:
        """Coefficients in each cell."""
        return np.diff(self.edges).astype(float)

    @cached_property
    def frequency(self) -> FloatArray:
        """Middle of each cell, Hz."""
        middle = np.where(self.count > 1, np.sqrt(self.edges[:-1] * (self.edges[1:] - 1.0)), self.edges[:-1])
        return np.asarray(middle / (2.0 * self.samples * self.interval))

    @cached_property
    def power(self) -> FloatArray:
        """True power of each cell, the lattice as white noise."""
        return self.noise.power(self.frequency, self.interval) + self.noise.step**2 / 12.0

    def energy(self, template: FloatArray) -> FloatArray:
        """Return the mean square of the coefficients of a template (n,) in each cell, without its ramp."""
        ramp = np.linspace(-1.0, 1.0, self.samples)
        a, r = dct(template, norm="ortho")[1:], dct(ramp, norm="ortho")[1:]
        weight = np.repeat(1.0 / self.power, np.diff(self.edges))
        a -= r * np.sum(weight * a * r) / np.sum(weight * r * r)
        return np.asarray(np.add.reduceat(a * a, self.edges[:-1] - 1) / self.count)

    def mean(self, energy: FloatArray, size: float) -> float:
        """Return d of a mean of the given energy times size²."""
        return self.gain(self.power + size**2 * energy, self.power)

    def spectrum(self, power: FloatArray) -> float:
        """Return d of a noise of this power in place of the base's own."""
        return self.gain(power, power)

    def gain(self, seen: FloatArray, true: FloatArray) -> float:
        """Return the expected gain where the cells show `seen` on average and their noise is `true`."""
        best = fitted(seen, self.count, self.frequency, self.interval, self.noise)
        cost = 0.5 * float(np.sum(self.count * (1.0 + np.log(true))))
        return best - cost


def fitted(
    seen: FloatArray, count: FloatArray, f: FloatArray, interval: float, near: Noise, starts: int = 2
) -> float:
    """Return the least cost ½ Σ c [ln S' + seen/S'] of the base, both kinds of slow noise tried."""
    white = near.white**2
    slow = float(max(near.flicker, near.markov)) or 1e-3 * near.white
    walk = max(near.walk, 1e-3 * slow / np.sqrt(1.0 / f[0]))
    start = [white, max(near.quantum, 0.03 * near.white) ** 2, walk**2, slow**2]
    memory = near.time_constant or 100.0
    flicker = (
        1.0,
        4.0 * np.sin(np.pi * f * interval) ** 2,
        interval / (4.0 * np.sin(np.pi * f * interval) ** 2),
    )

    def cost(x: FloatArray, kind: str) -> tuple[float, FloatArray]:
        parts = [np.exp(x[i]) * np.broadcast_to(flicker[i], f.shape) for i in range(3)]
        if kind == "flicker":
            parts.append(np.exp(x[3]) / (2.0 * np.pi * f * interval))
            slopes = list(parts)
        else:
            parts.append(markov_power(f, interval, np.exp(0.5 * x[3]), np.exp(x[4])))
            longer = markov_power(f, interval, np.exp(0.5 * x[3]), np.exp(x[4] + 1e-4))
            slopes = [*parts, (longer - parts[3]) / 1e-4]
        total = np.sum(parts, axis=0)
        value = 0.5 * float(np.sum(count * (np.log(total) + seen / total)))
        outer = 0.5 * count * (1.0 - seen / total) / total
        return value, np.array([float(np.sum(outer * slope)) for slope in slopes])

    best = np.inf
    for kind in ("flicker", "markov"):
        for factor in (1.0, 30.0)[:starts]:
            first = np.log(np.array(start))
            first[2:] += np.log(factor)
            if kind == "markov":
                first = np.append(first, np.log(memory if factor == 1.0 else 0.03 / f[0]))
            limits = [(v - 25.0, v + 16.0) for v in first[:4]]
            if kind == "markov":
                limits.append((np.log(20.0 * interval), np.log(10.0 / f[0])))
            out = minimize(cost, first, args=(kind,), jac=True, method="L-BFGS-B", bounds=limits,
                           options={"maxiter": 300, "ftol": 1e-14, "gtol": 1e-6})  # fmt: skip
            best = min(best, float(out.fun))
    return best
