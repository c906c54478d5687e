"""What a state of a filter is: one declaration, from which its dynamics, measurements, tables and files follow.

A state x of a filter adds to what is measured, in proportion to x::

    error of a sensor      += factor x                    times nothing: a bias
                           += factor x ω_y,  factor x f_z  times a true rate or force: a scale factor, a misalignment
    acceleration down      += factor x                    what gravity is larger than its formula
    error of a fix         += factor x                    north, east, down, of position or velocity

and changes by itself as x' = −x/T + noise, or is the slope of another state. The first column of F, G and H, the
calibration that takes the estimate out again, the error budget, the simulated truth: all of it is computed from these
terms, by the reference filter and by the compiled one.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum

from models.units import known_units

SENSORS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
"""Sensors whose error a state may add to."""
RATES = ("rate_x", "rate_y", "rate_z", "force_x", "force_y", "force_z")
"""True angular rates and specific forces in b that the error of a sensor may be in proportion to."""
FIX_ROWS = tuple(f"{what}_{axis}" for what in ("position", "velocity") for axis in ("north", "east", "down"))
"""Components of a fix that a state may add to, m and m/s."""
TARGETS = (*SENSORS, "acceleration_down", *FIX_ROWS)
"""All that a state may add to; the order is that of `Couplings.target`."""
DOWN_TARGET, FIX_TARGET = len(SENSORS), len(SENSORS) + 1
"""Places in `TARGETS` of the acceleration and of the first component of a fix."""
NAVIGATION_STATES = 9
"""Errors of position, velocity and attitude, which come first in every filter."""


class Origin(StrEnum):
    """Where a configuration names a state, as paths in a ``noise.yaml``."""

    AXIS_CONSTANT = "sensors.*.*.filter.constant_sd, random_walk_density"
    """Always there: one for each axis of a sensor."""
    AXIS_PROCESSES = "sensors.*.*.filter.markov"
    """As many for each axis as it has Gauss–Markov processes."""
    AXIS_SLOPE = "sensors.*.*.filter.ramp_sd"
    """One for each axis where any of them is not zero; or by name."""
    FIX_PROCESSES = "gnss.correlated"
    """One north, east and down for each process."""
    NAME = "constants.NAME, time_constants.NAME"
    """Where its name is among the constants, with the sd of its prior."""


@dataclass(frozen=True)
class Coupling:
    """What a component of a state adds to, in proportion to its value.

    Attributes
    ----------
    component : str
        Of the state.
    into : str
        One of `TARGETS`.
    times : str
        One of `RATES`, for a sensor; empty for none.
    factor : float
        Factor.
    """

    component: str
    into: str
    times: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class FilterState:
    """A state of a filter, or a group of them of one kind, as `models.filter_states.FILTER_STATES` has it.

    Attributes
    ----------
    name : str
        Lower-case letters, digits and underscores: the key in files and on the command line.
    components : tuple of str
        Names of its numbers, such as ``x``; one that is empty where there is one number alone.
    unit : str
        SI unit of the numbers.
    meaning : str
        What it is, in a few words for tables.
    couplings : tuple of Coupling
        What it adds to.
    customary_unit : str
        Unit in which tables show it, one of `models.units.known_units`; empty for the SI unit.
    time_constant : float
        Time constant of a first-order process, s, whose stationary sd is that of the prior; infinite for a constant.
        ``time_constants`` of a configuration has precedence.
    walk_density : float
        Density of the noise that drives a random walk, unit/√s; with an infinite time constant only.
    slope_of : str
        State of as many components whose rate of change this one is.
    origin : Origin
        Where a configuration names it.
    not_linear : str
        Module with the equations of a state of this project that adds to the measurements other than in proportion.
    """

    name: str
    components: tuple[str, ...]
    unit: str
    meaning: str
    couplings: tuple[Coupling, ...] = ()
    customary_unit: str = ""
    time_constant: float = math.inf
    walk_density: float = 0.0
    slope_of: str = ""
    origin: Origin = Origin.NAME
    not_linear: str = ""

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.components)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the components in words, such as ``gyro scale x``."""
        return tuple(f"{self.meaning} {component}".rstrip() for component in self.components)


@dataclass(frozen=True)
class Process:
    """How a state changes by itself: time constant, s, and density of the noise that drives it, unit/√s."""

    time_constant: float = math.inf
    driving_density: float = 0.0


def process(state: FilterState, sd: float, time_constant: float | None = None) -> Process:
    """Return how a state changes whose prior has this sd; a time constant has precedence over the declared one.

    Raises
    ------
    ValueError
        Where the time constant is not positive.
    """
    constant = state.time_constant if time_constant is None else time_constant
    if not constant > 0.0:
        raise ValueError(
            f"the time constant of the filter state '{state.name}' must be positive, got {constant}"
        )
    if math.isinf(constant):
        return Process(constant, state.walk_density)
    return Process(constant, sd * math.sqrt(2.0 / constant))


def check_declaration(state: object) -> None:
    """Refuse a declaration that contradicts itself; called by the registry.

    Raises
    ------
    TypeError, ValueError
        One line.
    """
    if not isinstance(state, FilterState):
        raise TypeError(f"expected a FilterState, got {type(state).__name__}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", state.name):
        raise ValueError("expected a name of lower-case letters, digits and underscores")
    if not state.components or len(set(state.components)) != state.size:
        raise ValueError(f"components must be names that differ, got {state.components}")
    if not state.unit or not state.meaning:
        raise ValueError("unit and meaning must not be empty")
    if state.customary_unit and state.customary_unit not in known_units():
        raise ValueError(f"customary_unit '{state.customary_unit}' is none of {', '.join(known_units())}")
    if not state.time_constant > 0.0 or not state.walk_density >= 0.0:
        raise ValueError("time_constant must be positive and walk_density not negative")
    if math.isfinite(state.time_constant) and state.walk_density > 0.0:
        raise ValueError(
            "walk_density is that of a state without a time constant: its prior sd makes the noise of another one"
        )
    if not state.couplings and not state.slope_of and not state.not_linear:
        raise ValueError("couplings must say what it adds to, or slope_of whose slope it is")
    for one in state.couplings:
        _check_coupling(state, one)


def _check_coupling(state: FilterState, one: Coupling) -> None:
    if one.component not in state.components:
        raise ValueError(
            f"a coupling names the component '{one.component}', known are {', '.join(state.components)}"
        )
    if one.into not in TARGETS:
        raise ValueError(f"a coupling goes into '{one.into}', known are {', '.join(TARGETS)}")
    if one.times and (one.times not in RATES or one.into not in SENSORS):
        raise ValueError(
            f"a coupling into '{one.into}' is times '{one.times}': only sensors may have one of {', '.join(RATES)}"
        )
    if not math.isfinite(one.factor) or one.factor == 0.0:
        raise ValueError(f"the factor of a coupling must be finite and not 0, got {one.factor}")
