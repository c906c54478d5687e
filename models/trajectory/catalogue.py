"""Built-in motions: closed forms that excite a filter in different ways.

`TRAJECTORIES` maps each name to a function of the duration, s. Speeds and turns are those of a road vehicle,
except in `climb`, a light aeroplane.

==============  =====================================================================================
static          stands still, slightly tilted
straight        heading constant, varying speed: no turns, so heading is observed by speed alone
circle          constant speed v and turn rate w on the radius v/w
figure_eight    heading ψ = J sin ωt with J the first zero of J₀: a closed path, no net displacement
s_turns         slalom around a straight line, speed and roll changing as well
climb           banked turns while climbing and descending, faster than a car
city            stops, speed changes, right-angled turns both ways, slopes
==============  =====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave, steps

BESSEL_ZERO = 2.404825557695773
"""First zero of J₀: cos(J sin ωt) has no mean, so the path closes."""


def static(duration: float) -> Trajectory:
    """Stand still, slightly tilted."""
    return Trajectory("static", duration, Profile(), Profile(0.6), pitch=Profile(0.02), roll=Profile(-0.03))


def straight(duration: float, *, speed: float = 20.0, period: float = 60.0) -> Trajectory:
    """Drive north-east at a speed that varies by half of itself with the period, s."""
    return Trajectory(
        "straight", duration, Profile(speed, waves=(Wave(0.5 * speed, 1.0 / period),)), Profile(math.pi / 4.0)
    )


def circle(duration: float, *, speed: float = 15.0, radius: float = 100.0) -> Trajectory:
    """Drive a circle: the turn rate is speed ÷ radius."""
    return Trajectory("circle", duration, Profile(speed), Profile(rate=speed / radius), roll=Profile(0.02))


def figure_eight(duration: float, *, speed: float = 12.0, period: float = 80.0) -> Trajectory:
    """Drive figures of eight, one a period, s, rolled out of the turns."""
    return Trajectory(
        "figure_eight",
        duration,
        Profile(speed),
        Profile(waves=(Wave(BESSEL_ZERO, 1.0 / period),)),
        roll=Profile(waves=(Wave(-0.03, 1.0 / period, math.pi / 2.0),)),
    )


def s_turns(duration: float, *, speed: float = 15.0, period: float = 20.0) -> Trajectory:
    """Drive a slalom about the east, one swing a period, s."""
    return Trajectory(
        "s_turns",
        duration,
        Profile(speed, waves=(Wave(0.2 * speed, 0.31 / period),)),
        Profile(math.pi / 2.0, waves=(Wave(0.6, 1.0 / period),)),
        roll=Profile(waves=(Wave(-0.04, 1.0 / period, math.pi / 2.0),)),
        pitch=Profile(waves=(Wave(0.01, 0.17 / period),)),
    )


def climb(duration: float, *, speed: float = 50.0, turn_period: float = 150.0) -> Trajectory:
    """Make banked turns both ways while climbing and descending."""
    return Trajectory(
        "climb",
        duration,
        Profile(speed, waves=(Wave(0.1 * speed, 1.0 / 90.0),)),
        Profile(0.3, waves=(Wave(2.0, 1.0 / turn_period),)),
        pitch=Profile(0.03, waves=(Wave(0.06, 1.0 / 110.0),)),
        roll=Profile(waves=(Wave(0.4, 1.0 / turn_period, math.pi / 2.0),)),
    )


CITY_PERIOD = 120.0
"""Length of a round through the town, s."""
CITY_SPEED = (  # begin, duration, change: start, slow for two turns, fast leg, stop for 15 s
    (4.0, 10.0, 13.0),
    (22.0, 5.0, -8.0),
    (36.0, 6.0, 9.0),
    (52.0, 6.0, -8.0),
    (68.0, 8.0, 10.0),
    (92.0, 10.0, -16.0),
)
"""Changes of speed in a round: begin and duration, s, and change, m/s."""
CITY_TURNS = ((28.0, 7.0), (59.0, 7.0), (80.0, 8.0))
"""Right-angled turns in a round: begin and duration, s."""
CITY_SIGNS = ((1, -1, 1), (-1, -1, 1), (1, 1, -1), (-1, 1, -1))
"""Directions of the three turns, right positive, in four successive rounds; their sum is zero."""
CITY_SLOPE = ((12.0, 12.0, 0.03), (44.0, 14.0, -0.05), (76.0, 12.0, 0.02))
"""Changes of the pitch in a round: begin and duration, s, and change, rad."""


def city(duration: float) -> Trajectory:
    """Drive through a town: rounds of two minutes with a stop, three right-angled turns and slopes."""
    rounds = range(math.ceil(duration / CITY_PERIOD))
    starts = [CITY_PERIOD * i for i in rounds]
    turns = [
        (start + begin, length, sign * math.pi / 2.0)
        for i, start in enumerate(starts)
        for (begin, length), sign in zip(CITY_TURNS, CITY_SIGNS[i % 4], strict=True)
    ]
    rolls = [
        row
        for begin, length, angle in turns
        for row in (
            (begin, 0.5 * length, -0.02 * math.copysign(1.0, angle)),
            (begin + 0.5 * length, 0.5 * length, 0.02 * math.copysign(1.0, angle)),
        )
    ]
    return Trajectory(
        "city",
        duration,
        Profile(steps=steps(*((start + b, d, c) for start in starts for b, d, c in CITY_SPEED))),
        Profile(0.2, steps=steps(*turns)),
        pitch=Profile(steps=steps(*((start + b, d, c) for start in starts for b, d, c in CITY_SLOPE))),
        roll=Profile(steps=steps(*rolls)),
    )


TRAJECTORIES: Mapping[str, Callable[[float], Trajectory]] = MappingProxyType(
    {f.__name__: f for f in (static, straight, circle, figure_eight, s_turns, climb, city)}
)
"""Built-in trajectories by name; each takes the duration, s."""
