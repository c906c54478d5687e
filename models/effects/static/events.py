"""Effects in time: a step, a recovery, telegraph noise, spikes, a stretch that moved.

::

    step         size · (t ≥ time)
    recovery     size · exp(−(t − time)/time_constant) · (t ≥ time)
    telegraph    0 or size; exponential dwells of means dwell_low and dwell_high. Autocovariance
                 size² p (1 − p) exp(−|lag| (1/dwell_low + 1/dwell_high)),
                 where p = dwell_high/(dwell_low + dwell_high)
    spikes       ± size in single samples, a Poisson process of `rate`
    motion       sd · smooth random sway · window, for start ≤ t < start + duration

References
----------
.. [1] S. Machlup, Noise in semiconductors: spectrum of a two-parameter random signal,
   J. Appl. Phys. 25, 1954.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.base import (
    GLITCH,
    Effect,
    Samples,
    Scale,
    log_uniform,
    require_finite,
    require_not_negative,
    require_positive,
    sign,
)

SWAY_FREQUENCY = 1.0
"""Corner frequency of the sway of `Motion`, Hz."""


@dataclass(frozen=True)
class Step(Effect):
    """A bias that jumps once.

    Attributes
    ----------
    time : float
        Time of the jump on the clock of the record, s.
    size : float
        unit (either sign).
    """

    name: ClassVar[str] = "step"
    deterministic: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("time",)
    time: float
    size: float

    def __post_init__(self) -> None:
        require_finite(time=self.time, size=self.size)

    def signal(self, t: FloatArray) -> FloatArray:
        """Return the step at times `t`, shape (n,)."""
        return np.where(t >= self.time, self.size, 0.0)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the step to every channel."""
        return block.add(self.signal(block.t))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of size ± 0.5 … 10 Allan floors, between a tenth and nine tenths of the record."""
        return cls(
            scale.start + scale.span * float(rng.uniform(0.1, 0.9)),
            sign(rng) * scale.floor * log_uniform(rng, 0.5, 10.0),
        )


@dataclass(frozen=True)
class Recovery(Effect):
    """A bias that jumps and decays back, as after an overload, a knock or a glitch.

    Attributes
    ----------
    time : float
        Time of the jump on the clock of the record, s.
    size : float
        unit (either sign).
    time_constant : float
        s.
    """

    name: ClassVar[str] = "recovery"
    deterministic: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("time",)
    positive: ClassVar[tuple[str, ...]] = ("time_constant",)
    time: float
    size: float
    time_constant: float

    def __post_init__(self) -> None:
        require_finite(time=self.time, size=self.size)
        require_positive(time_constant=self.time_constant)

    def signal(self, t: FloatArray) -> FloatArray:
        """Return the transient at times `t`, shape (n,)."""
        after = t - self.time
        return np.where(after >= 0.0, self.size * np.exp(-np.maximum(after, 0.0) / self.time_constant), 0.0)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the transient to every channel."""
        return block.add(self.signal(block.t))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of ± 1 … 20 Allan floors, time constant 0.3 … 5 % of the record, in its middle 80 %."""
        return cls(
            scale.start + scale.span * float(rng.uniform(0.1, 0.9)),
            sign(rng) * scale.floor * log_uniform(rng, 1.0, 20.0),
            scale.span * log_uniform(rng, 0.003, 0.05),
        )


@dataclass(frozen=True)
class Telegraph(Effect):
    """Telegraph ("popcorn") noise: a bias that switches between 0 and `size`, in each channel by itself.

    Attributes
    ----------
    size : float
        Distance of the two levels, unit (either sign).
    dwell_low, dwell_high : float
        Mean time at 0 and at `size`, s.
    """

    name: ClassVar[str] = "telegraph"
    identified_as: ClassVar[str | None] = "gauss_markov"
    is_noise: ClassVar[bool] = True
    positive: ClassVar[tuple[str, ...]] = ("dwell_low", "dwell_high")
    size: float
    dwell_low: float
    dwell_high: float

    def __post_init__(self) -> None:
        require_finite(size=self.size)
        require_positive(dwell_low=self.dwell_low, dwell_high=self.dwell_high)

    def signal(self, t: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a path at increasing times `t`, stationary from the first on; shape (n,)."""
        high = bool(rng.random() < self.dwell_high / (self.dwell_low + self.dwell_high))
        means = (self.dwell_high, self.dwell_low) if high else (self.dwell_low, self.dwell_high)
        pairs = 16 + int(1.5 * (t[-1] - t[0]) / sum(means))
        switches = np.empty(0)
        last = float(t[0])
        while last <= t[-1]:
            more = last + np.cumsum(rng.exponential(means, (pairs, 2)).ravel())
            switches, last = np.concatenate((switches, more)), float(more[-1])
        switched = np.searchsorted(switches, t, side="right") % 2 == 1
        return np.where(switched != high, self.size, 0.0)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add an own path to every channel."""
        return block.add(np.column_stack([self.signal(block.t, rng) for _ in range(block.y.shape[1])]))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of size 0.02 … 0.5 white sd, dwells 1 … 1000 s but at most an eighth of the record."""
        top = max(min(1000.0, scale.span / 8.0), 4.0 * scale.interval)
        low = min(1.0, 0.25 * top)
        return cls(
            scale.white_sd * log_uniform(rng, 0.02, 0.5),
            log_uniform(rng, low, top),
            log_uniform(rng, low, top),
        )


@dataclass(frozen=True)
class Spikes(Effect):
    """Single samples that are off by ± `size`, in each channel by itself.

    Attributes
    ----------
    rate : float
        Spikes a second, at most one a sample.
    size : float
        unit.
    """

    name: ClassVar[str] = "spikes"
    stage: ClassVar[int] = GLITCH
    positive: ClassVar[tuple[str, ...]] = ("rate", "size")
    rate: float
    size: float

    def __post_init__(self) -> None:
        require_not_negative(rate=self.rate, size=self.size)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the spikes to every channel."""
        chance = self.rate * block.interval
        if chance > 1.0:
            raise ValueError(
                f"'rate' must not exceed the sampling rate, {1.0 / block.interval} Hz, got {self.rate}"
            )
        hit = rng.random(block.y.shape) < chance
        return block.add(np.where(hit, self.size * rng.choice((-1.0, 1.0), block.y.shape), 0.0))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of 1e-6 … 1e-3 a sample (at least three expected), 5 … 50 white sd."""
        least = max(1e-6, 3.0 * scale.interval / scale.span)
        chance = log_uniform(rng, least, max(1e-3, 2.0 * least))
        return cls(min(chance, 0.5) / scale.interval, scale.white_sd * log_uniform(rng, 5.0, 50.0))


@dataclass(frozen=True)
class Motion(Effect):
    """A stretch in which the sensor was not still: smooth sway, another one in each channel.

    Attributes
    ----------
    start, duration : float
        On the clock of the record, s.
    sd : float
        Standard deviation of the sway in the middle of the stretch, unit.
    """

    name: ClassVar[str] = "motion"
    locates: ClassVar[tuple[str, ...]] = ("start",)
    positive: ClassVar[tuple[str, ...]] = ("duration",)
    start: float
    duration: float
    sd: float

    def __post_init__(self) -> None:
        require_finite(start=self.start)
        require_positive(duration=self.duration)
        require_not_negative(sd=self.sd)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add an own sway to every channel."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import
        from scipy.signal.windows import tukey  # loaded when used: scipy.signal is slow to import

        inside = np.flatnonzero((block.t >= self.start) & (block.t < self.start + self.duration))
        sway = np.zeros_like(block.y)
        if len(inside):
            pole = np.exp(-2.0 * np.pi * SWAY_FREQUENCY * block.interval)
            run_in = int(10.0 / (SWAY_FREQUENCY * block.interval)) + 1
            w = rng.standard_normal((run_in + len(inside), block.y.shape[1]))
            gain = np.sqrt((1.0 - pole**2) ** 3 / (1.0 + pole**2))
            smooth = lfilter([gain], [1.0, -2.0 * pole, pole**2], w, axis=0)[run_in:]
            sway[inside] = self.sd * tukey(len(inside), 0.5)[:, np.newaxis] * smooth
        return block.add(sway)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of 1 … 10 % of the record, 3 … 100 white sd."""
        duration = scale.span * log_uniform(rng, 0.01, 0.1)
        start = scale.start + float(rng.uniform(0.0, scale.span - duration))
        return cls(start, duration, scale.white_sd * log_uniform(rng, 3.0, 100.0))
