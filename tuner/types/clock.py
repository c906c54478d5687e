"""How late the stamps of a receiver are against the inertial unit, as the streams of a drive show."""

from __future__ import annotations

import math
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
    def interval(self) -> tuple[float, float]:
        """95 % interval, s."""
        return self.value - HALF_INTERVAL * self.sd, self.value + HALF_INTERVAL * self.sd

    def beside(self, known: float) -> Delay:
        """Return what remains beside a delay that was taken out, s."""
        return replace(self, value=self.value - known) if known else self


@dataclass(frozen=True)
class Clock:
    """Delay of all fixes against the inertial unit, and lag of velocities behind positions."""

    delay: Delay = field(default_factory=Delay)
    lag: Delay = field(default_factory=Delay)
    further: bool = False
    """Whether the delay is what remains beside one that was taken out."""

    def beside(self, delay: float, lag: float) -> Clock:
        """Return what remains beside a delay and a lag that were taken out, s."""
        return Clock(self.delay.beside(delay), self.lag.beside(lag), self.further or delay != 0.0)
