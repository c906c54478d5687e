"""How late the stamps of a receiver are against the inertial unit, as the streams of a drive show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

HALF_INTERVAL = 1.96
"""Half of a 95 % interval, in sds."""
CERTAIN_SDS = 4.0
"""Sds from which a delay is not chance."""


@dataclass(frozen=True)
class Delay:
    """Delay of stamps and its sd, s: positive where they are late; an infinite sd where the drive does not show it."""

    value: float = 0.0
    sd: float = math.inf

    @property
    def certain(self) -> bool:
        """Whether it is not chance."""
        return abs(self.value) > CERTAIN_SDS * self.sd

    @property
    def taken_out(self) -> float:
        """What a filter takes out of the stamps, s: nothing where it may be chance."""
        return self.value if self.certain else 0.0

    @property
    def left(self) -> float:
        """Sd of what a filter leaves in the stamps, s: where it may be chance, its value too, as it is not zero."""
        return math.hypot(self.value - self.taken_out, self.sd)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval, s."""
        return self.value - HALF_INTERVAL * self.sd, self.value + HALF_INTERVAL * self.sd

    def beside(self, known: float) -> Delay:
        """Return what remains beside a delay that was taken out, s."""
        return replace(self, value=self.value - known) if known else self


@dataclass(frozen=True)
class Clock:
    """Delay of all fixes against the inertial unit, and lag of velocities behind positions.

    Attributes
    ----------
    delay, lag : Delay
        The delay is that halfway between the first and the last fix.
    further : bool
        Whether the delay is what remains beside one that was taken out.
    drift : Delay
        By how much the delay grows in a second, and the sd of that.
    ends : (float, float)
        Stamps of the first and the last fix, s.
    """

    delay: Delay = field(default_factory=Delay)
    lag: Delay = field(default_factory=Delay)
    further: bool = False
    drift: Delay = field(default_factory=Delay)
    ends: tuple[float, float] = (0.0, 0.0)

    def beside(self, delay: float, lag: float, drift: float = 0.0) -> Clock:
        """Return what remains beside a delay, a lag, s, and a drift that were taken out."""
        return replace(
            self,
            delay=self.delay.beside(delay),
            lag=self.lag.beside(lag),
            further=self.further or delay != 0.0,
            drift=self.drift.beside(drift),
        )

    @property
    def delays(self) -> Mapping[str, Delay]:
        """The delay of the fixes by its time in words: one, or that of the first and of the last fix if it drifts."""
        if not self.drift.certain:
            return {"": self.delay}
        half = 0.5 * (self.ends[1] - self.ends[0])
        sd = math.hypot(self.delay.sd, half * self.drift.sd)
        first, last = (Delay(self.delay.taken_out + part * self.drift.value, sd) for part in (-half, half))
        return {f" at {self.ends[0]:.0f} s": first, f" at {self.ends[1]:.0f} s": last}
