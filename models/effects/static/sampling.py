"""Effects between the sensor and the file: rails, coarse codes, small registers, repeated readings, time stamps.

::

    clipping      min(max(y, low), high)
    lattice       step · round(y/step);  0 where |y| < deadband
    overflow      low + (y − low) mod (high − low)
    duplicates    y_k = y_{k−1} with the chance `fraction`, in all channels at once, or always in one stretch
    timing        gap_count stretches of samples lost; stamps t_0 + clock_ratio (t − t_0) + jitter_sd · e,
                  rounded to whole multiples of `rounding`
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from models.effects.static.base import (
    HOLD,
    QUANTIZER,
    RAIL,
    REGISTER,
    STAMP,
    Effect,
    Samples,
    Scale,
    log_uniform,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
    sign,
)


@dataclass(frozen=True)
class Clipping(Effect):
    """Saturation at one or two rails.

    Attributes
    ----------
    low, high : float, optional
        Rails, unit; at least one of them.
    """

    name: ClassVar[str] = "clipping"
    stage: ClassVar[int] = RAIL
    absolute: ClassVar[bool] = True
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if self.low is None and self.high is None:
            raise ValueError("'low' or 'high' must be given, got neither")
        require_finite(low=self.low or 0.0, high=self.high or 0.0)
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"'low' must be below 'high', {self.high}, got {self.low}")

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Clip every channel."""
        return replace(block, y=np.clip(block.y, self.low, self.high))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of rails 3 … 6 white sd from the level; one rail alone in a third of the cases."""
        rail = scale.white_sd * rng.uniform(3.0, 6.0, 2)
        low, high = float(scale.level - rail[0]), float(scale.level + rail[1])
        kind = int(rng.integers(6))
        return cls(None if kind == 0 else low, None if kind == 1 else high)


@dataclass(frozen=True)
class Quantizer(Effect):
    """Digital codes: multiples of a step, with an optional dead band around zero.

    Attributes
    ----------
    step : float
        Distance of the codes, unit.
    deadband : float
        Inputs smaller than this read zero, unit; 0 for none.
    """

    name: ClassVar[str] = "lattice"
    stage: ClassVar[int] = QUANTIZER
    step: float
    deadband: float = 0.0

    def __post_init__(self) -> None:
        require_positive(step=self.step)
        require_not_negative(deadband=self.deadband)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Round every channel."""
        y = self.step * np.round(block.y / self.step)
        return replace(block, y=np.where(np.abs(block.y) < self.deadband, 0.0, y))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of step 0.01 … 2 white sd; in a quarter of the cases a dead band of 1 … 3 steps."""
        step = scale.white_sd * log_uniform(rng, 0.01, 2.0)
        return cls(step, step * float(rng.integers(1, 4)) if rng.random() < 0.25 else 0.0)


@dataclass(frozen=True)
class Overflow(Effect):
    """A register too small for a sample: what is beyond one end of its range comes out at the other end.

    Attributes
    ----------
    low, high : float
        Ends of the range, unit.
    """

    name: ClassVar[str] = "overflow"
    stage: ClassVar[int] = REGISTER
    absolute: ClassVar[bool] = True
    low: float
    high: float

    def __post_init__(self) -> None:
        require_finite(low=self.low, high=self.high)
        if not self.low < self.high:
            raise ValueError(f"'low' must be below 'high', {self.high}, got {self.low}")

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Wrap every channel around; samples within the range stay as they are to the last digit."""
        width = self.high - self.low
        return replace(block, y=block.y - width * np.floor((block.y - self.low) / width))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of one end 1.5 … 3 white sd from the level and a range of 10 … 40 white sd."""
        end, width = scale.white_sd * rng.uniform(1.5, 3.0), scale.white_sd * rng.uniform(10.0, 40.0)
        if rng.random() < 0.5:
            return cls(scale.level + end - width, scale.level + end)
        return cls(scale.level - end, scale.level - end + width)


@dataclass(frozen=True)
class Duplicates(Effect):
    """Readings that repeat the last one: the register is polled faster than it is filled, or stuck for a while.

    Attributes
    ----------
    fraction : float
        Chance that a sample is a repetition, 0 ≤ fraction < 1.
    start, duration : float, optional
        The one stretch in which every sample is a repetition, on the clock of the record, s; `fraction`, the share
        of the record that this is, decides nothing then.
    """

    name: ClassVar[str] = "duplicates"
    stage: ClassVar[int] = HOLD
    one_for_all: ClassVar[bool] = True
    fraction: float
    start: float | None = None
    duration: float | None = None

    def __post_init__(self) -> None:
        require_between(0.0, 1.0, fraction=self.fraction)
        if (self.start is None) is not (self.duration is None):
            raise ValueError("'start' and 'duration' must be given together")
        if self.start is not None and self.duration is not None:
            require_finite(start=self.start)
            require_positive(duration=self.duration)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Hold the last reading in all channels at the same samples."""
        if self.start is None or self.duration is None:
            fresh = rng.random(len(block.t)) >= self.fraction
        else:
            fresh = (block.t < self.start) | (block.t >= self.start + self.duration)
        source = np.maximum.accumulate(np.where(fresh, np.arange(len(fresh)), 0))
        return replace(block, y=block.y[source], white=None if block.white is None else block.white[source])

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of fraction 1e-4 … 0.9."""
        return cls(log_uniform(rng, 1e-4, 0.9))


@dataclass(frozen=True)
class Timing(Effect):
    """Lost samples and stamps that are not those of an even clock.

    Attributes
    ----------
    gap_count : int
        Number of gaps.
    jitter_sd : float
        Standard deviation of a stamp about its true place, s; the stamps stay in order.
    clock_ratio : float
        Interval that the stamps show ÷ nominal interval.
    gap_samples : int
        Samples lost in each gap.
    rounding : float
        Unit that stamps are rounded to, s; 0 for none.
    """

    name: ClassVar[str] = "timing"
    stage: ClassVar[int] = STAMP
    home: ClassVar[str | None] = "imu"
    one_for_all: ClassVar[bool] = True
    gap_count: int = 0
    jitter_sd: float = 0.0
    clock_ratio: float = 1.0
    gap_samples: int = 5
    rounding: float = 0.0

    def __post_init__(self) -> None:
        require_not_negative(gap_count=self.gap_count, jitter_sd=self.jitter_sd, rounding=self.rounding)
        require_positive(clock_ratio=self.clock_ratio, gap_samples=self.gap_samples)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Drop samples of all channels and rewrite the stamps."""
        kept = self._kept(len(block.t), rng)
        t = block.t[0] + self.clock_ratio * (block.t - block.t[0])
        t = np.sort(t[kept] + self.jitter_sd * rng.standard_normal(len(kept)))
        if self.rounding > 0.0:
            t = self.rounding * np.round(t / self.rounding)
        piece = np.isin(np.arange(len(block.t)), block.breaks).cumsum()[kept]
        after = np.flatnonzero((np.diff(kept) > 1) | (np.diff(piece) > 0)) + 1
        return Samples(
            t,
            block.y[kept],
            block.interval,
            None if block.temperature is None else block.temperature[kept],
            None if block.white is None else block.white[kept],
            tuple(after.tolist()),
        )

    def _kept(self, n: int, rng: np.random.Generator) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Return the samples that survive: every gap has a sample on both sides."""
        period = self.gap_samples + 1
        slots = (n - 1) // period
        if self.gap_count > slots:
            raise ValueError(
                f"'gap_count' must leave room in {n} samples, at most {slots}, got {self.gap_count}"
            )
        starts = 1 + period * rng.choice(slots, self.gap_count, replace=False)
        keep = np.ones(n, dtype=bool)
        keep[(starts[:, np.newaxis] + np.arange(self.gap_samples)).ravel()] = False
        return np.flatnonzero(keep)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of 0.001 … 1 % lost samples, jitter 0.1 … 20 % of the interval, clock off by 1e-5 … 1e-3."""
        n = scale.span / scale.interval
        length = int(rng.integers(1, 21))
        gaps = max(1, round(n * log_uniform(rng, 1e-5, 1e-2) / length))
        return cls(
            min(gaps, math.floor((n - 1) / (length + 1))),
            scale.interval * log_uniform(rng, 1e-3, 0.2),
            1.0 + sign(rng) * log_uniform(rng, 1e-5, 1e-3),
            length,
        )
