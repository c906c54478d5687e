"""The route of a vehicle: speed, heading, slope and roll as sums of smooth steps.

A step rises along x⁴ (35 − 84 x + 70 x² − 20 x³), three times differentiable at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Step = tuple[float, float, float]
"""Begin and length, s, and rise."""

GRAVITY = 9.81
LEAN = 0.03
"""Roll per lateral acceleration in g, outwards, rad."""


class Motion(Protocol):
    """What a route says."""

    @property
    def duration(self) -> float: ...

    def motion(self, t: FloatArray) -> tuple[FloatArray, FloatArray]: ...


@dataclass(frozen=True)
class Route:
    """Steps of each profile, from rest and level.

    Attributes
    ----------
    duration : float
        s.
    heading : float
        At the start, rad.
    speed, turn, slope : tuple of Step
        m/s, rad, rad.
    """

    duration: float
    heading: float
    speed: tuple[Step, ...]
    turn: tuple[Step, ...]
    slope: tuple[Step, ...]

    def motion(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocity north, east, down (n, 3) and roll, pitch, yaw (n, 3)."""
        speed, rate = rise(self.speed, t), slope_of(self.turn, t)
        roll = -LEAN * speed * rate / GRAVITY
        pitch, yaw = rise(self.slope, t), self.heading + rise(self.turn, t)
        flat = speed * np.cos(pitch)
        vel = np.column_stack([flat * np.cos(yaw), flat * np.sin(yaw), -speed * np.sin(pitch)])
        return vel, np.column_stack([roll, pitch, yaw])


def rise(steps: tuple[Step, ...], t: FloatArray) -> FloatArray:
    """Return the sum of steps at rising times t."""
    total = np.zeros_like(t)
    for begin, length, size in steps:
        first, last = np.searchsorted(t, (begin, begin + length))
        x = (t[first:last] - begin) / length
        total[first:last] += size * x**4 * (35.0 - x * (84.0 - x * (70.0 - 20.0 * x)))
        total[last:] += size
    return total


def slope_of(steps: tuple[Step, ...], t: FloatArray) -> FloatArray:
    """Return the derivative of that sum."""
    total = np.zeros_like(t)
    for begin, length, size in steps:
        first, last = np.searchsorted(t, (begin, begin + length))
        x = (t[first:last] - begin) / length
        total[first:last] += size / length * 140.0 * (x * (1.0 - x)) ** 3
    return total


def city(rng: np.random.Generator, duration: float, still: float) -> Route:
    """Draw a city drive: legs, stops, right-angled and gentle turns, slopes; `still` s at rest first."""
    speed, turn, slope = [], [], []
    t, now, tilt = still, 0.0, 0.0
    while t < duration:
        fast = float(rng.uniform(8.0, 17.0))
        t = _change(speed, t, now, fast, rng)
        cruise = float(rng.uniform(5.0, 25.0))
        if rng.random() < 0.6:
            turn.append((t, cruise, float(rng.uniform(-0.5, 0.5))))
        if rng.random() < 0.7:
            steeper = float(rng.uniform(-0.04, 0.04))
            slope.append((t, max(cruise, 6.0), steeper - tilt))
            tilt = steeper
        t += cruise
        halt = rng.random() < 0.35
        now = 0.0 if halt else float(rng.uniform(4.0, 7.0))
        t = _change(speed, t, fast, now, rng)
        if halt:
            t += float(rng.uniform(5.0, 25.0))
        else:
            corner = float(rng.uniform(4.0, 7.0))
            turn.append((t, corner, float(rng.choice([-1.0, 1.0]) * rng.uniform(1.2, 1.8))))
            t += corner
    return Route(duration, float(rng.uniform(-np.pi, np.pi)), tuple(speed), tuple(turn), tuple(slope))


def straight(rng: np.random.Generator, duration: float, still: float) -> Route:
    """Draw a straight road: speed between 12 and 25 m/s, hardly a bend."""
    speed, turn, t, now = [], [], still, 0.0
    while t < duration:
        after = float(rng.uniform(12.0, 25.0))
        t = _change(speed, t, now, after, rng) + float(rng.uniform(20.0, 60.0))
        turn.append((t, 15.0, float(rng.uniform(-0.02, 0.02))))
        now = after
    return Route(duration, float(rng.uniform(-np.pi, np.pi)), tuple(speed), tuple(turn), ())


def _change(steps: list[Step], t: float, before: float, after: float, rng: np.random.Generator) -> float:
    """Append a change of speed at some 1 … 2 m/s² and return when it ends."""
    length = max(2.0, abs(after - before) * 2.2 / float(rng.uniform(1.0, 2.2)))
    steps.append((t, length, after - before))
    return t + length
