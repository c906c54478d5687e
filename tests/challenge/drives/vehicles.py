"""Routes of vehicles other than a car in a city, and places all over the Earth.

Speed, turns and slopes are sums of smooth steps, as in `route`; a vehicle adds how it leans, sways and bobs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from challenge.drives.route import GRAVITY, Step, rise, slope_of
from challenge.drives.scene import HOUR, MG, Scene
from challenge.generator.scene import log_uniform
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Range = tuple[float, float]

PLACES = (
    (62.0, 25.0, 120.0), (-41.0, 174.9, 20.0), (78.2, 15.6, 30.0), (-77.85, 166.7, 50.0), (1.3, 103.8, 10.0),
    (51.9, -179.999, 40.0), (-16.5, 179.9995, 5.0), (-54.8, -68.3, 10.0), (19.4, -99.1, 2240.0), (31.8, 35.4, -400.0),
)  # fmt: skip
"""Latitude, longitude, degrees, and height, m: near both poles, the date line and the equator, below the sea."""


@dataclass(frozen=True)
class Kind:
    """How a vehicle moves: ranges of uniform draws, SI; each pair of durations is of a change and of a pause after it.

    Attributes
    ----------
    levels, speeding, cruise : Range
        Speeds, time to change them and between changes.
    stop : float
        Share of changes that end at rest.
    turns, turning, between : Range
        Sizes of turns of either sign, rad, their durations, times between them.
    slopes : float
        Largest slope, rad.
    lean : float
        Roll per angle of the lateral acceleration; negative: into the turn.
    sway : tuple of (axis, amplitude, frequency)
        Sinusoids while moving, of roll, pitch, yaw (0 … 2) and of velocity down (3).
    height : float
        Above the place, m.
    imu_rate : float
        Hz.
    """

    levels: Range
    speeding: Range
    cruise: Range
    stop: float
    turns: Range
    turning: Range
    between: Range
    slopes: float = 0.0
    lean: float = 0.0
    sway: tuple[tuple[int, float, float], ...] = ()
    height: float = 0.0
    imu_rate: float = 50.0


KINDS = {
    "tram": Kind((6, 16), (8, 14), (10, 30), 0.4, (0.5, 1.5), (6, 12), (12, 40), 0.02),
    "suv": Kind((5, 22), (5, 10), (5, 25), 0.25, (0.4, 1.8), (4, 9), (5, 25), 0.05, 0.05),
    "copter": Kind((0, 12), (3, 6), (5, 20), 0.15, (0.5, 2.5), (3, 7), (5, 20), 0.2, -0.8, ((3, 0.3, 0.05),)),
    "ferry": Kind(
        (3, 9), (20, 40), (40, 90), 0.1, (0.4, 2.0), (20, 40), (20, 60), 0.0, -0.1,
        ((0, 0.06, 0.13), (1, 0.03, 0.17), (3, 0.4, 0.15)),
    ),
    "walker": Kind(
        (0.9, 1.7), (2, 4), (15, 40), 0.3, (0.8, 2.0), (2, 4), (8, 25), 0.0, 0.0,
        ((0, 0.04, 0.9), (1, 0.05, 1.8), (2, 0.06, 0.9), (3, 0.18, 1.8)), imu_rate=100.0,
    ),
    "train": Kind((15, 45), (40, 70), (40, 90), 0.1, (0.1, 0.6), (15, 35), (15, 50), 0.0, 0.5),
    "glider": Kind((25, 45), (10, 25), (20, 60), 0.0, (1.0, 6.0), (8, 25), (5, 25), 0.06, 1.0, height=2000.0),
    "airliner": Kind((140, 240), (30, 60), (60, 120), 0.0, (0.4, 1.5), (30, 70), (20, 60), 0.03, 1.0, height=2000.0),
}  # fmt: skip


@dataclass(frozen=True)
class Trip:
    """One route of a vehicle."""

    duration: float
    heading: float
    kind: Kind
    speed: tuple[Step, ...]
    turn: tuple[Step, ...]
    slope: tuple[Step, ...]
    crab: tuple[Step, ...]
    phases: FloatArray

    def motion(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocity north, east, down (n, 3) and roll, pitch, yaw (n, 3) at evenly spaced times."""
        kind, v = self.kind, rise(self.speed, t)
        rate, pitch = slope_of(self.turn, t), rise(self.slope, t)
        if self.turn_needs_motion:
            share = np.clip(v / 3.0, 0.0, 1.0)
            rate = rate * share**2 * (3.0 - 2.0 * share)
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)
        course = self.heading + np.concatenate([[0.0], np.cumsum(steps)])
        flat = v * np.cos(pitch)
        vel = np.column_stack([flat * np.cos(course), flat * np.sin(course), -v * np.sin(pitch)])
        rpy = np.column_stack([kind.lean * np.arctan(v * rate / GRAVITY), pitch, course + rise(self.crab, t)])
        if self.crab:  # a multicopter tilts to accelerate
            rpy[:, 1] = -0.8 * np.arctan(np.gradient(v, t) / GRAVITY)
        moving = np.clip(v / 0.5, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(v / 0.5, 0.0, 1.0))
        for (axis, size, frequency), phase in zip(kind.sway, self.phases, strict=False):
            wave = size * np.sin(2.0 * np.pi * frequency * t + phase) * moving
            if axis < 3:
                rpy[:, axis] += wave
            else:
                vel[:, 2] += wave
        return vel, rpy

    @property
    def turn_needs_motion(self) -> bool:
        """Whether the vehicle can turn only while it moves."""
        return not self.crab and self.kind.levels[0] > 1.0


def trip(rng: np.random.Generator, name: str, duration: float) -> Trip:
    """Draw a route; some 30 s at rest first."""
    kind, still = KINDS[name], float(rng.uniform(20.0, 40.0))
    heading = float(rng.uniform(-3.0, 3.0))
    now, tilt = 0.0, 0.0
    speed, slope = [], []
    for t, length in _times(rng, still, duration, kind.speeding, kind.cruise):
        new = 0.0 if rng.random() < kind.stop else float(rng.uniform(*kind.levels))
        speed.append((t, length, new - now))
        now = new

    def signed(bounds: Range) -> float:
        return float(rng.choice([-1.0, 1.0]) * rng.uniform(*bounds))

    after = still + kind.speeding[1]
    turn = [(t, n, signed(kind.turns)) for t, n in _times(rng, after, duration, kind.turning, kind.between)]
    for t, length in _times(rng, after, duration, (8.0, 15.0), (20.0, 60.0)) if kind.slopes else ():
        new = float(rng.uniform(-kind.slopes, kind.slopes))
        slope.append((t, length, new - tilt))
        tilt = new
    crab = []
    if name == "copter":
        crab = [(t, n, signed((0.0, 1.5))) for t, n in _times(rng, after, duration, (3.0, 8.0), (10.0, 30.0))]
    parts = (tuple(one) for one in (speed, turn, slope, crab))
    return Trip(duration, heading, kind, *parts, rng.uniform(0.0, 6.0, 6))


def _times(
    rng: np.random.Generator, begin: float, end: float, length: Range, pause: Range
) -> list[tuple[float, float]]:
    out, t = [], begin
    while t < end:
        out.append((t, float(rng.uniform(*length))))
        t += out[-1][1] + float(rng.uniform(*pause))
    return out


def scene_of(rng: np.random.Generator, name: str, duration: float = 480.0) -> Scene:
    """Draw a scene of a vehicle: place, grade of the unit and of the receiver."""
    kind, place = KINDS[name], PLACES[int(rng.integers(len(PLACES)))]
    grade, far, fast = (log_uniform(rng, *bounds) for bounds in ((0.4, 2.5), (0.3, 2.0), (0.5, 1.5)))
    gyro, accel = 12.0 * HOUR * grade, 0.4 * MG * grade
    return Scene(
        duration=duration,
        imu_rate=kind.imu_rate,
        gnss_rate=5.0 if name == "walker" else float(rng.choice([1.0, 2.0, 5.0])),
        arw=0.2 * grade * np.pi / 180.0 / 60.0,
        vrw=0.05 * grade / 60.0,
        gyro_bias=gyro,
        accel_bias=accel,
        gyro_flicker=0.1 * gyro,
        accel_flicker=0.1 * accel,
        position_sd=(far, far, 1.8 * far),
        velocity_sd=(0.06 * fast, 0.06 * fast, 0.1 * fast),
        arm=tuple(rng.uniform(-1.0, 1.0, 3).tolist()),
        route=trip(rng, name, duration),
        start=(np.radians(place[0]), np.radians(place[1]), place[2] + kind.height),
        reference=False,
    )
