"""The states of a filter as plain numbers and arrays: the part of a `FilterSettings` that the compiled filter uses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from models.arrays import FloatArray, IntArray
from models.filter_states.declaration import DOWN_TARGET, NAVIGATION_STATES
from tuner.navigation.settings import FilterSettings, chi2_gate, error_rows


def indices(*numbers: int) -> tuple[Any, ...]:
    """Return numbers for arguments of compiled functions: for each of Python's constants numba compiles once more."""
    return tuple(np.int64(number) for number in numbers)


POSITION, VELOCITY, ATTITUDE = indices(0, 3, 6)
"""First of the three states of each."""
GYROS, ACCELEROMETERS = indices(0, 3)
"""Inputs of the navigation equations: the first of each."""
BIAS_STATES = 6
"""States that follow: the biases of gyros and accelerometers."""
DOWN_INPUT = 6
"""Input of the navigation equations behind the six sensors: acceleration down, m/s²."""
BATCH_SIZE = 16
"""Filters side by side; LLVM does not vectorise loops of fewer with checks for overlap, more do not fit the cache."""
GROUP_SIZE = 4
"""States whose effect on an input is summed at once."""


NUMBERS = ("size", "gravity", "lever", "delay", "gnss", "processes", "ideal")
"""Whole numbers of a layout."""
ROW, SOURCE, SLOPE, TOTAL = range(4)
"""Rows of `Layout.table`."""
TABLE_ROWS = 4
"""… how many there are."""
ARM_INDEX, GATE_INDEX, PATIENCE_INDEX, GRAVITY_INDEX = 0, 3, 4, 5
"""Elements of `Layout.constants`."""
CONSTANT_COUNT = 6
"""… how many there are."""

CONSTRAINT_CODE = 3
"""A constraint in place of a fix with position (1) or position and velocity (2)."""
KIND_COLUMN, RATE_COLUMNS, SLIP_COLUMNS, MOUNTING_COLUMNS, STATE_COLUMN, LIMIT_COLUMN = 6, 7, 13, 16, 25, 26
CONSTRAINT_LENGTH = 27
"""Columns of a constraint behind those of a fix: see `measurement_models`; and how many there are."""


class Layout(NamedTuple):
    """A filter as plain numbers.

    Attributes
    ----------
    size : int
        n.
    rate : ndarray, shape (n,)
        1/T of each state, 1/s.
    process_noise : ndarray, shape (n,)
        Squared density of the noise that drives each state.
    white : ndarray, shape (6,)
        Squares of the white densities of gyros and accelerometers.
    row, source : ndarray of int, shape (n,)
        Column j of S has its one element in row `row[j]` (−1: none): the true rate `source[j]`, or 1 for −1.
    slope : ndarray of int, shape (n,)
        Index of the state that is the slope of state j, −1 for none.
    ramps : ndarray of int, shape (r,)
        The states that have one.
    gravity, lever, delay, gnss : int
        First index of these blocks, −1 where absent.
    processes : int
        Gauss–Markov processes in the GNSS position.
    total : ndarray of int, shape (n,)
        Which error a state is a part of: `settings.error_rows`.
    ideal : bool
        No scale factors, misalignments or g-sensitivity.
    groups : ndarray of int, shape (g, 4)
        Neighbouring states behind the biases that add to one input of the navigation equations: which (sensor 0 … 5
        or `DOWN_INPUT`), the first of them, how many (at most `GROUP_SIZE`), and whether they are parts of its bias
        (1 or 0).
    arm : ndarray, shape (3,)
        Nominal lever arm, m.
    gate : float
        χ² limit of three components.
    covariance_step : float
        Longest step of the covariance, s.
    patience : float
        Time with refused fixes only after which the next is used, s.
    further : ndarray of int, shape (e, 3)
        What other states add to: state, target of `models.filter_states.declaration.TARGETS`, true rate 0 … 5 or −1.
        The loops over `row` and `source` know states that add to one sensor, with factor 1.
    factor : ndarray, shape (e,)
        Factors of these.
    gravity_excess : float
        Excess of gravity over its formula, as far as it is known, m/s².
    """

    size: int
    rate: FloatArray
    process_noise: FloatArray
    white: FloatArray
    row: IntArray
    source: IntArray
    slope: IntArray
    ramps: IntArray
    gravity: int
    lever: int
    delay: int
    gnss: int
    processes: int
    total: IntArray
    ideal: bool
    groups: IntArray
    arm: FloatArray
    gate: float
    covariance_step: float
    patience: float
    further: IntArray
    factor: FloatArray
    gravity_excess: float

    def numbers(self) -> tuple[int, ...]:
        """Return the values of `NUMBERS`."""
        return tuple(int(getattr(self, name)) for name in NUMBERS)

    def table(self) -> IntArray:
        """Return row, source, slope and total of each state, shape (4, n)."""
        return np.stack([self.row, self.source, self.slope, self.total]).astype(np.int64)

    def constants(self) -> FloatArray:
        """Return lever arm, gate, patience and excess of gravity."""
        return np.array([*self.arm, self.gate, self.patience, self.gravity_excess])


def layout_of(settings: FilterSettings) -> Layout:
    """Return a filter as plain numbers."""
    model = settings.model
    at, n = model.layout, model.layout.size
    row, source = np.full(n, -1), np.full(n, -1)
    slope = model.slopes
    gnss = at["gnss_position"] if "gnss_position" in at else slice(0, 0)
    gravity = at.start("gravity")
    own = model.couplings
    alone = np.bincount(own.state, minlength=n)[own.state] == 1
    simple = alone & (own.target < DOWN_TARGET) & (own.factor == 1.0)
    row[own.state[simple]], source[own.state[simple]] = own.target[simple], own.source[simple]
    known = simple | (own.state == gravity) | ((own.state >= gnss.start) & (own.state < gnss.stop))
    further = np.stack([own.state, own.target, own.source], axis=-1)[~known]
    return Layout(
        n,
        1.0 / model.time_constant,
        model.driving_density**2,
        np.concatenate([model.gyro_density, model.accel_density]) ** 2,
        row,
        source,
        slope,
        np.flatnonzero(slope >= 0),
        gravity,
        at.start("lever_arm"),
        at.start("time_offset"),
        at.start("gnss_position"),
        (gnss.stop - gnss.start) // 3,
        error_rows(model),
        not (own.source >= 0).any(),
        grouped(row, source, gravity),
        np.array(settings.lever_arm, dtype=float),
        chi2_gate(settings.gate, 3),
        settings.covariance_step,
        settings.patience,
        further,
        own.factor[~known],
        settings.gravity_excess,
    )


def with_sensor_states(lay: Layout, rows: IntArray) -> Layout:
    """Return a layout with further states behind its own, each a part of the error of a sensor 0 … 5."""
    more = len(rows)
    row = np.concatenate([lay.row, rows])
    source = np.pad(lay.source, (0, more), constant_values=-1)
    return lay._replace(
        size=lay.size + more,
        rate=np.pad(lay.rate, (0, more)),
        process_noise=np.pad(lay.process_noise, (0, more)),
        row=row,
        source=source,
        slope=np.pad(lay.slope, (0, more), constant_values=-1),
        total=np.concatenate([lay.total, NAVIGATION_STATES + rows]),
        groups=grouped(row, source, lay.gravity),
    )


def grouped(row: IntArray, source: IntArray, gravity: int) -> IntArray:
    """Return `groups` of a layout."""
    groups: list[list[int]] = []
    for s in range(NAVIGATION_STATES + BIAS_STATES, len(row)):
        own = DOWN_INPUT if s == gravity else int(row[s])
        part = int(own < DOWN_INPUT and source[s] < 0)
        if own < 0:
            continue
        if groups and groups[-1][0] == own and sum(groups[-1][1:3]) == s and groups[-1][3] == part:
            groups[-1][2] += 1
            if groups[-1][2] <= GROUP_SIZE:
                continue
            groups[-1][2] -= 1
        groups.append([own, s, 1, part])
    return np.array(groups, dtype=np.int64).reshape(-1, 4)
