"""The error state of a navigation filter: blocks of states, their order, and the noise that drives them.

`StateLayout` is the one place that knows the order of the states; `ErrorModel` adds the numbers. Position, velocity
and attitude come first, each along north, east and down (m, m/s, rad as a rotation vector in n), then the blocks of
`models.filter_states.FILTER_STATES` that the filter has, in the order in which they are declared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from models.arrays import FloatArray, IntArray
from models.filter_states import FILTER_STATES, Process, named_state
from models.filter_states.built_in import BUILT_IN
from models.filter_states.declaration import DOWN_TARGET, FIX_TARGET, RATES, TARGETS
from models.noise.gauss_markov import GaussMarkov

NAVIGATION_BLOCKS = ("position", "velocity", "attitude")
"""Blocks of three that come first, and whose dynamics are those of `models.error_state`."""
NO_PROCESSES: Mapping[str, Process] = MappingProxyType({})
"""Named states that change by themselves, where none does."""


@dataclass(frozen=True)
class AxisNoise:
    """Noise of one sensor axis.

    Attributes
    ----------
    white_density : float
        White noise, unit/√Hz.
    walk_density : float
        Drive of the bias state, unit/√s.
    bias_time_constant : float
        Time constant of the bias state, s; infinite for a constant or random walk.
    markov : tuple of GaussMarkov
        Further Gauss–Markov biases.
    """

    white_density: float
    walk_density: float = 0.0
    bias_time_constant: float = math.inf
    markov: tuple[GaussMarkov, ...] = ()

    def __post_init__(self) -> None:
        for name in ("white_density", "walk_density"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"'{name}' must not be negative, got {getattr(self, name)}")
        if not self.bias_time_constant > 0.0:
            raise ValueError(f"'bias_time_constant' must be positive, got {self.bias_time_constant}")


@dataclass(frozen=True)
class StateLayout:
    """Names, sizes and places of the blocks of an error state.

    Attributes
    ----------
    blocks : tuple of (str, int)
        Name and size, in order. Blocks of size 0 are left out.
    """

    blocks: tuple[tuple[str, int], ...]

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Place of every block by name."""
        ends = np.cumsum([size for _, size in self.blocks]).tolist()
        return {name: slice(end - size, end) for (name, size), end in zip(self.blocks, ends, strict=True)}

    @property
    def size(self) -> int:
        """Number of states."""
        return sum(size for _, size in self.blocks)

    def __contains__(self, name: object) -> bool:
        return name in self.slices

    def __getitem__(self, name: str) -> slice:
        return self.slices[name]

    def start(self, name: str) -> int:
        """Return the index of the first state of a block, −1 where the block is absent."""
        return self.slices[name].start if name in self.slices else -1


class Couplings(NamedTuple):
    """What the states of a filter add to, c terms: element `state` times `factor`, and times a rate where `source` ≥ 0.

    Attributes
    ----------
    state, target, source : ndarray of int, shape (c,)
        Index of the state, of `TARGETS`, and of `RATES` or −1.
    factor : ndarray, shape (c,)
        Factor.
    """

    state: IntArray
    target: IntArray
    source: IntArray
    factor: FloatArray

    def into(self, first: int, end: int) -> Couplings:
        """Return the terms that add to the targets first … end − 1, counted from the first."""
        own = (self.target >= first) & (self.target < end)
        return Couplings(self.state[own], self.target[own] - first, self.source[own], self.factor[own])


@dataclass(frozen=True)
class ErrorModel:
    """States of a filter with their time constants and driving noise (SI).

    Attributes
    ----------
    layout : StateLayout
        Where the states stand.
    gyro_density, accel_density : ndarray, shape (3,)
        White noise of the sensors, rad/s/√Hz and m/s²/√Hz.
    time_constant : ndarray, shape (n,)
        Time constant of each state, s; infinite for all that does not decay.
    driving_density : ndarray, shape (n,)
        White drive of each state, unit/√s; 0 for constants and for position, velocity and attitude.
    components : mapping of str to tuple of int
        Which component of its declaration each state of a block is, for all blocks but position, velocity and attitude.
    """

    layout: StateLayout
    gyro_density: FloatArray
    accel_density: FloatArray
    time_constant: FloatArray
    driving_density: FloatArray
    components: Mapping[str, tuple[int, ...]]

    @property
    def gyro_markov_axes(self) -> tuple[int, ...]:
        """Axis 0, 1, 2 to which each Gauss–Markov bias of the gyros belongs."""
        return self.components.get("gyro_markov", ())

    @property
    def accel_markov_axes(self) -> tuple[int, ...]:
        """Axis 0, 1, 2 to which each Gauss–Markov bias of the accelerometers belongs."""
        return self.components.get("accel_markov", ())

    @cached_property
    def couplings(self) -> Couplings:
        """What every state adds to, in the order of the states."""
        rows: list[tuple[int, int, int]] = []
        factors: list[float] = []
        for name, components in self.components.items():
            declared = FILTER_STATES[name]
            for j, component in enumerate(components):
                for one in declared.couplings:
                    if one.component == declared.components[component]:
                        felt = RATES.index(one.times) if one.times else -1
                        rows.append((self.layout[name].start + j, TARGETS.index(one.into), felt))
                        factors.append(one.factor)
        state, target, source = np.array(rows, dtype=np.int64).reshape(-1, 3).T
        return Couplings(state, target, source, np.array(factors))

    @cached_property
    def sensor_couplings(self) -> Couplings:
        """Those that add to the error of a sensor, 0 … 5."""
        return self.couplings.into(0, DOWN_TARGET)

    @cached_property
    def down_couplings(self) -> Couplings:
        """Those that add to the acceleration down."""
        return self.couplings.into(DOWN_TARGET, FIX_TARGET)

    @cached_property
    def fix_couplings(self) -> Couplings:
        """Those that add to a component of a fix, 0 … 5."""
        return self.couplings.into(FIX_TARGET, len(TARGETS))

    @cached_property
    def slopes(self) -> IntArray:
        """Index of the state that is the slope of each, −1 for none; shape (n,)."""
        slope = np.full(self.layout.size, -1)
        for name in self.components:
            of = FILTER_STATES[name].slope_of
            if of in self.layout:
                slope[self.layout[of]] = range(self.layout[name].start, self.layout[name].stop)
        return slope


def error_model(
    gyro: Sequence[AxisNoise],
    accel: Sequence[AxisNoise],
    *,
    gnss_markov: Sequence[GaussMarkov] = (),
    constants: Sequence[str] = (),
    processes: Mapping[str, Process] = NO_PROCESSES,
) -> ErrorModel:
    """Return the error model of a filter: layout, time constants and driving noise.

    Parameters
    ----------
    gyro, accel : sequence of 3 AxisNoise
        Axes x, y, z.
    gnss_markov : sequence of GaussMarkov
        Correlated errors of the position fixes, each along north, east and down.
    constants : sequence of str
        Names of further states that do not change by themselves.
    processes : mapping of str to Process
        Names of further states, and how they change.

    Raises
    ------
    ValueError
        Not three axes; a name not declared, or not open to configurations (`RegistryError`); the slope of a state
        that has another number of components, or that the filter does not have.
    """
    if len(gyro) != 3 or len(accel) != 3:
        raise ValueError(f"'gyro' and 'accel' must have 3 axes, got {len(gyro)} and {len(accel)}")
    further = {named_state(name).name: processes.get(name, Process()) for name in (*constants, *processes)}
    groups: dict[str, list[tuple[int, Process]]] = {}
    for name, axes in (("gyro_bias", gyro), ("accel_bias", accel)):
        groups[name] = [(i, Process(a.bias_time_constant, a.walk_density)) for i, a in enumerate(axes)]
    for name, axes in (("gyro_markov", gyro), ("accel_markov", accel)):
        groups[name] = [(i, _markov(m)) for i, a in enumerate(axes) for m in a.markov]
    for name, change in further.items():
        groups[name] = [(i, change) for i in range(FILTER_STATES[name].size)]
    groups["gnss_position"] = [(i, _markov(m)) for m in gnss_markov for i in range(3)]
    order = [name for name in (*_BUILT_IN_NAMES, *further) if groups.get(name)]
    groups = {name: groups[name] for name in dict.fromkeys(order)}
    layout = StateLayout(
        (*((name, 3) for name in NAVIGATION_BLOCKS), *((name, len(own)) for name, own in groups.items()))
    )
    _check_slopes(groups)
    time_constant, driving_noise = np.full(layout.size, np.inf), np.zeros(layout.size)
    for name, own in groups.items():
        time_constant[layout[name]] = [p.time_constant for _, p in own]
        driving_noise[layout[name]] = [p.driving_density for _, p in own]
    return ErrorModel(
        layout,
        np.array([a.white_density for a in gyro]),
        np.array([a.white_density for a in accel]),
        time_constant,
        driving_noise,
        {name: tuple(i for i, _ in own) for name, own in groups.items()},
    )


_BUILT_IN_NAMES = tuple(state.name for state in BUILT_IN)
"""In their order in a filter; states of other packages follow in the order in which a configuration names them."""


def _markov(state: GaussMarkov) -> Process:
    return Process(state.time_constant, state.driving_density)


def _check_slopes(groups: Mapping[str, Sequence[object]]) -> None:
    """Refuse a slope without the state that it is the slope of."""
    for name, own in groups.items():
        of = FILTER_STATES[name].slope_of
        if of and len(groups.get(of, ())) != len(own):
            raise ValueError(
                f"filter state '{name}' is the slope of '{of}': expected {len(own)} of these in the filter, "
                f"found {len(groups.get(of, ()))}"
            )
