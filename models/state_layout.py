"""The error state of a navigation filter: blocks of states, their order, and the noise that drives them.

`StateLayout` is the one place that knows the order of the states; `ErrorModel` adds the numbers. Both come
from the description of each sensor axis by `error_model`.

================== ====== ============================================================= ==============
block              states meaning                                                       behaviour
================== ====== ============================================================= ==============
position           3      north, east, down, m                                          dynamics
velocity           3      north, east, down, m/s                                        dynamics
attitude           3      rotation vector in n, rad                                     dynamics
gyro_bias          3      turn-on constant, with its random walk, rad/s                 walk or GM
accel_bias         3      the same, m/s²                                                walk or GM
gyro_markov        ≥ 0    Gauss–Markov biases, axis by axis (a ladder for flicker)      GM
accel_markov       ≥ 0    the same                                                      GM
gyro_ramp          0, 3   slope of the bias, rad/s²                                     constant
accel_ramp         0, 3   the same, m/s³                                                constant
gyro_scale         0, 3   scale factor errors, diagonal of K                            constant
accel_scale        0, 3   the same                                                      constant
gyro_misalignment  0, 6   K: xy, xz, yx, yz, zx, zy                                     constant
accel_misalignment 0, 6   the same                                                      constant
g_sensitivity      0, 9   gyro error by specific force, rows, rad/s per m/s²            constant
lever_arm          0, 3   from the inertial unit to the antenna, in b, m                constant
time_offset        0, 1   delay of the receiver, s                                      constant
mounting           0, 3   rotation vector of the unit in the vehicle, in b, rad         constant
gravity            0, 1   excess of gravity, m/s²                                       constant
gnss_position      ≥ 0    correlated position error, n-e-d for each process, m          GM
================== ====== ============================================================= ==============
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from models.noise.gauss_markov import GaussMarkov

FloatArray = NDArray[np.float64]

OPTIONAL_BLOCKS = {
    "gyro_ramp": 3,
    "accel_ramp": 3,
    "gyro_scale": 3,
    "accel_scale": 3,
    "gyro_misalignment": 6,
    "accel_misalignment": 6,
    "g_sensitivity": 9,
    "lever_arm": 3,
    "time_offset": 1,
    "mounting": 3,
    "gravity": 1,
}
"""Blocks of constants that a model may ask for by name, and their sizes."""


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
                msg = f"'{name}' must not be negative, got {getattr(self, name)}"
                raise ValueError(msg)
        if not self.bias_time_constant > 0.0:
            msg = f"'bias_time_constant' must be positive, got {self.bias_time_constant}"
            raise ValueError(msg)


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
    gyro_markov_axes, accel_markov_axes : tuple of int
        Axis 0, 1, 2 to which each Gauss–Markov bias belongs.
    """

    layout: StateLayout
    gyro_density: FloatArray
    accel_density: FloatArray
    time_constant: FloatArray
    driving_density: FloatArray
    gyro_markov_axes: tuple[int, ...]
    accel_markov_axes: tuple[int, ...]


def error_model(
    gyro: Sequence[AxisNoise],
    accel: Sequence[AxisNoise],
    *,
    gnss_markov: Sequence[GaussMarkov] = (),
    constants: Sequence[str] = (),
) -> ErrorModel:
    """Return the error model of a filter: layout, time constants and driving noise.

    Parameters
    ----------
    gyro, accel : sequence of 3 AxisNoise
        Axes x, y, z.
    gnss_markov : sequence of GaussMarkov
        Correlated errors of the position fixes, each along north, east and down.
    constants : sequence of str
        Names of `OPTIONAL_BLOCKS` blocks.
    """
    if len(gyro) != 3 or len(accel) != 3:
        msg = f"'gyro' and 'accel' must have 3 axes, got {len(gyro)} and {len(accel)}"
        raise ValueError(msg)
    unknown = set(constants) - set(OPTIONAL_BLOCKS)
    if unknown:
        msg = f"'constants' must be among {', '.join(OPTIONAL_BLOCKS)}, got {', '.join(sorted(unknown))}"
        raise ValueError(msg)
    ladders = {
        "gyro_markov": [(axis, m) for axis, noise in enumerate(gyro) for m in noise.markov],
        "accel_markov": [(axis, m) for axis, noise in enumerate(accel) for m in noise.markov],
        "gnss_position": [(axis, m) for m in gnss_markov for axis in range(3)],
    }
    sizes = {"position": 3, "velocity": 3, "attitude": 3, "gyro_bias": 3, "accel_bias": 3}
    sizes |= {name: len(ladders[name]) for name in ("gyro_markov", "accel_markov")}
    sizes |= {name: size for name, size in OPTIONAL_BLOCKS.items() if name in constants}
    sizes["gnss_position"] = len(ladders["gnss_position"])
    layout = StateLayout(tuple((name, size) for name, size in sizes.items() if size))

    time_constant, driving_noise = np.full(layout.size, np.inf), np.zeros(layout.size)
    for name, axes in (("gyro_bias", gyro), ("accel_bias", accel)):
        time_constant[layout[name]] = [a.bias_time_constant for a in axes]
        driving_noise[layout[name]] = [a.walk_density for a in axes]
    for name, ladder in ladders.items():
        if ladder:
            time_constant[layout[name]] = [m.time_constant for _, m in ladder]
            driving_noise[layout[name]] = [m.driving_density for _, m in ladder]
    return ErrorModel(
        layout,
        np.array([a.white_density for a in gyro]),
        np.array([a.white_density for a in accel]),
        time_constant,
        driving_noise,
        tuple(axis for axis, _ in ladders["gyro_markov"]),
        tuple(axis for axis, _ in ladders["accel_markov"]),
    )
