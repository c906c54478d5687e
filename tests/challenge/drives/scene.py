"""A drive without effects: route, inertial unit, receiver; one reference profile, and random variations."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from challenge.drives.route import Motion, city, straight
from challenge.drives.truth import Truth
from challenge.generator.scene import log_uniform

HOUR = np.pi / 180.0 / 3600.0
"""A degree an hour, rad/s."""
MG = 9.80665e-3
"""A thousandth of standard gravity, m/s²."""
HARD = ("straight road", "gaps", "begun in motion", "turn-on", "long stop", "flicker", "short stop")
"""Clean drives that tempt: what each exaggerates."""


@dataclass(frozen=True)
class Scene:
    """Everything but the effects (SI).

    Attributes
    ----------
    duration, imu_rate, gnss_rate : float
        s, Hz, Hz.
    arw, vrw : float
        White densities, rad/s/√Hz and m/s²/√Hz.
    gyro_bias, accel_bias : float
        Sds of the turn-on constants.
    gyro_flicker, accel_flicker : float
        Levels B of the flicker noise.
    position_sd, velocity_sd : tuple of 3 floats
        Errors of the receiver, north, east, down: true and reported.
    arm : tuple of 3 floats
        Lever arm as said, m.
    route : Motion
    start : tuple of 3 floats
        Latitude, longitude, rad, height, m.
    gaps : tuple of (begin, end)
        Times without fixes, s.
    turn_on : float
        Size of the turn-on constants in sds, or 0 for normal ones.
    hard : str
        One of `HARD`, or nothing.
    """

    duration: float
    imu_rate: float
    gnss_rate: float
    arw: float
    vrw: float
    gyro_bias: float
    accel_bias: float
    gyro_flicker: float
    accel_flicker: float
    position_sd: tuple[float, float, float]
    velocity_sd: tuple[float, float, float]
    arm: tuple[float, float, float]
    route: Motion
    start: tuple[float, float, float]
    gaps: tuple[tuple[float, float], ...] = ()
    turn_on: float = 0.0
    hard: str = ""
    reference: bool = True

    @cached_property
    def truth(self) -> Truth:
        return Truth(self.route, self.start)

    def told(self) -> dict[str, object]:
        """Return it as plain values, with what the tables group by."""
        plain = asdict(self)
        plain.pop("route")
        return {**plain, "samples": round(self.duration * self.gnss_rate), "axes": {"drive": {}}}


def scene(
    rng: np.random.Generator, *, hard: str = "", road: str = "city", reference: bool | None = None
) -> Scene:
    """Draw a scene: the reference profile in 60 of 100 cases, where `reference` does not say."""
    usual = bool(rng.random() < 0.6) if reference is None else reference
    duration = 900.0 if usual else float(rng.choice([600.0, 900.0, 1200.0]))
    grade = 1.0 if usual else log_uniform(rng, 0.3, 3.0)
    still = float(rng.uniform(20.0, 60.0))
    if hard == "begun in motion":
        still = float(rng.uniform(0.0, 3.0))
    if hard == "short stop":
        still = float(rng.uniform(0.5, 2.5))
    if hard == "long stop":
        still = 0.4 * duration
    straightly = road == "straight" or hard == "straight road"
    route = (straight if straightly else city)(rng, duration, still)
    far = 1.0 if usual else log_uniform(rng, 0.3, 2.5)
    fast = 1.0 if usual else log_uniform(rng, 0.5, 2.0)
    flick = 6.0 if hard == "flicker" else 1.0
    gyro, accel = 12.0 * HOUR * grade, 0.4 * MG * grade
    # A start by gravity and motion alone, turned by degrees a second, is tens of degrees off.
    more = log_uniform(rng, 100.0, 1000.0) if hard == "short stop" else 1.0
    gaps = ()
    if hard == "gaps":
        begins = np.sort(rng.uniform(0.2, 0.9, 3)) * duration
        gaps = tuple((float(b), float(b + rng.uniform(20.0, 60.0))) for b in begins)
    return Scene(
        duration=duration,
        imu_rate=50.0 if usual else float(rng.choice([50.0, 100.0])),
        gnss_rate=1.0 if usual else float(rng.choice([1.0, 2.0, 5.0])),
        arw=0.2 * grade * np.pi / 180.0 / 60.0,
        vrw=0.05 * grade / 60.0,
        gyro_bias=more * gyro,
        accel_bias=0.1 * more * accel if hard == "short stop" else accel,
        gyro_flicker=0.1 * flick * gyro,
        accel_flicker=0.1 * flick * accel,
        position_sd=(1.0 * far, 1.0 * far, 1.8 * far),
        velocity_sd=(0.06 * fast, 0.06 * fast, 0.1 * fast),
        arm=(0.0, 0.0, 0.0) if usual else tuple(rng.uniform(-1.0, 1.0, 3).tolist()),
        route=route,
        start=(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(-3.0, 3.0)), float(rng.uniform(0.0, 800.0))),
        gaps=gaps,
        turn_on=2.0 if hard == "turn-on" else 0.0,
        hard=hard,
        reference=usual,
    )
