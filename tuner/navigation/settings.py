"""Settings of a filter: the states, their driving noise and the prior that follow from a `FilterConfig`.

Each axis has a bias state, the turn-on constant with its random walk, and one Gauss–Markov state for every
rung of its ladder; a ramp gives the slope of the bias a state; correlated GNSS error has its own. Further
states (scale factors, lever arm, …, those of other packages) are named with the sd of their prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from models.arrays import FloatArray
from models.filter_states import FILTER_STATES, Origin, named_state, process
from models.state_layout import AxisNoise, ErrorModel, error_model
from tuner.navigation.fix_sd_model import FixSdModel
from tuner.types import FilterConfig
from tuner.types.records import DataError

GYROS, ACCELS = ("gyro_x", "gyro_y", "gyro_z"), ("accel_x", "accel_y", "accel_z")
COVARIANCE_STEP = 0.1
"""Longest step of the covariance, s: see `models.error_state` for what it costs."""
DEFAULT_GATE = 5.0
"""Gate where the configuration has none, sigmas."""
MAX_REFUSING_TIME = 10.0
"""Time with nothing but refused fixes after which one is used, s."""
NO_CONSTANTS: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class FilterSettings:
    """A filter before its first measurement (SI).

    Attributes
    ----------
    model : ErrorModel
        The n states and what drives them.
    initial_sd : ndarray, shape (n,)
        Square root of the diagonal of P0.
    gate : float
        A fix further from its prediction than this many sigmas (in the sense of `chi2_gate`) is not used.
    lever_arm : tuple of 3 floats
        From the inertial unit to the antenna, in b, m.
    covariance_step : float
        Longest step in which the covariance is advanced, s; the mechanisation takes every sample.
    position_sd, velocity_sd : tuple of 3 floats or None
        What the configuration says of a fix, north, east, down, m and m/s; None where it names no receiver: what
        is reported holds.
    patience : float
        After so long with nothing but refused positions, or velocities, the next one is used whatever the
        gate says, s: the filter, not the receiver, is lost.
    fix_sd_models : tuple of 2 FixSdModel or None
        How the sds of positions and of velocities stand to the reported ones. None: not measured, and the larger of
        the reported and the configured sd counts.
    velocity_lag : float
        How much later the velocities of fixes are than their positions, s: mended by the inertial unit.
    gravity_excess : float
        Excess of gravity over its formula, m/s², as far as it is known; a `gravity` state is added to it.
    """

    model: ErrorModel
    initial_sd: FloatArray
    gate: float = DEFAULT_GATE
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    covariance_step: float = COVARIANCE_STEP
    position_sd: tuple[float, float, float] | None = None
    velocity_sd: tuple[float, float, float] | None = None
    patience: float = MAX_REFUSING_TIME
    fix_sd_models: tuple[FixSdModel, FixSdModel] | None = None
    velocity_lag: float = 0.0
    gravity_excess: float = 0.0

    @property
    def size(self) -> int:
        """Number of states."""
        return self.model.layout.size


def filter_settings(
    config: FilterConfig,
    *,
    constants: Mapping[str, float] = NO_CONSTANTS,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    covariance_step: float = COVARIANCE_STEP,
) -> FilterSettings:
    """Return the filter that a configuration describes.

    Parameters
    ----------
    config : FilterConfig
        All six axes.
    constants : mapping of str to float
        Further states, names of `models.filter_states.named_states`, with the sd of their prior, SI; those of the
        configuration itself are left to the caller.
    lever_arm : tuple of 3 floats
        From the inertial unit to the antenna, in b, m.
    covariance_step : float
        Longest step of the covariance, s.

    Raises
    ------
    DataError
        Where an axis is missing.
    RegistryError
        Where a state is not declared.
    """
    missing = [axis for axis in GYROS + ACCELS if axis not in config.channels]
    if missing:
        raise DataError(
            f"{config.name}: expected six axes, {', '.join(missing)} missing; complete it (--complete GRADE)"
        )
    wanted = {named_state(name).name: sd for name, sd in constants.items()}
    for sensor, axes in (("gyro", GYROS), ("accel", ACCELS)):
        if any(config.channels[axis].ramp_sd > 0.0 for axis in axes):
            wanted.setdefault(f"{sensor}_ramp", 0.0)  # each axis has its own prior
    correlated = config.gnss.correlated if config.gnss is not None else ()
    model = error_model(
        [_axis(config, axis) for axis in GYROS],
        [_axis(config, axis) for axis in ACCELS],
        gnss_markov=correlated,
        processes={
            name: process(FILTER_STATES[name], value, config.time_constants.get(name))
            for name, value in wanted.items()
        },
    )
    at, sd = model.layout, np.zeros(model.layout.size)
    first = config.initial
    sd[at["position"]], sd[at["velocity"]] = first.position, first.velocity
    sd[at["attitude"]] = (first.tilt, first.tilt, first.heading)
    for name, value in wanted.items():
        sd[at[name]] = value
    for sensor, axes in (("gyro", GYROS), ("accel", ACCELS)):
        noise = [config.channels[axis] for axis in axes]
        sd[at[f"{sensor}_bias"]] = [channel.constant_sd for channel in noise]
        if f"{sensor}_markov" in at:
            sd[at[f"{sensor}_markov"]] = [state.sd for channel in noise for state in channel.markov]
        if f"{sensor}_ramp" in at:
            prior = wanted[f"{sensor}_ramp"]
            sd[at[f"{sensor}_ramp"]] = [channel.ramp_sd or prior for channel in noise]
    if "gnss_position" in at:
        own = at["gnss_position"]
        down = config.gnss.correlated_down if config.gnss is not None else 1.0
        sd[own] = [state.sd * factor for state in correlated for factor in (1.0, 1.0, down)]
        drive = model.driving_density.copy()
        drive[own.start + 2 : own.stop : 3] *= down
        model = replace(model, driving_density=drive)
    gnss = config.gnss
    if gnss is None:
        return FilterSettings(model, sd, DEFAULT_GATE, lever_arm, covariance_step)
    return FilterSettings(
        model, sd, gnss.gate, lever_arm, covariance_step, gnss.position_sd, gnss.velocity_sd
    )


def total_bias(model: ErrorModel) -> FloatArray:
    """Return the matrix (15, n) that takes the states to position, velocity, attitude and the six biases.

    The bias of an axis is the sum of its constant and its Gauss–Markov states: what a truth can be compared
    with, whatever states stand for it.
    """
    m = np.zeros((15, model.layout.size))
    rows = error_rows(model)
    own = np.flatnonzero((rows >= 0) & (rows < 15))
    m[rows[own], own] = 1.0
    return m


def error_rows(model: ErrorModel) -> NDArray[np.int64]:
    """Return the error that each state is a part of, shape (n,).

    Errors 0 … 8 are those of navigation, 9 … 14 the total biases, those from 15 on the further states one by one; −1 is
    the error of a fix, which nothing else can be compared with.
    """
    at, rows, count = model.layout, np.full(model.layout.size, -1), 15
    rows[:9] = range(9)
    for name, components in model.components.items():
        origin = FILTER_STATES[name].origin
        if origin in (Origin.AXIS_CONSTANT, Origin.AXIS_PROCESSES):
            rows[at[name]] = np.array(components) + (9 if name.startswith("gyro") else 12)
        elif origin is not Origin.FIX_PROCESSES:
            rows[at[name]] = range(count, count + len(components))
            count += len(components)
    return rows


def further_states(model: ErrorModel) -> dict[str, slice]:
    """Return the further states of a filter by name, and their places among them (the errors from 15 on)."""
    rows = error_rows(model)
    return {
        name: slice(int(own[0]) - 15, int(own[-1]) - 14)
        for name in model.components
        if (own := rows[model.layout[name]])[0] >= 15
    }


def chi2_gate(sigmas: float, dof: int) -> float:
    """Return the χ² limit that `dof` components exceed as rarely as one normal number exceeds `sigmas`."""
    return float(chdtri(dof, math.erfc(sigmas / math.sqrt(2.0))))


def _axis(config: FilterConfig, axis: str) -> AxisNoise:
    noise = config.channels[axis]
    return AxisNoise(noise.white_density, noise.random_walk_density, markov=noise.markov)
