# mypy: disable-error-code="no-untyped-call, untyped-decorator, call-arg"
"""The arrays of a compiled run: what one filter, or eight together, hold, and how kernels see it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from tuner.navigation.engine.numba_pipeline import PART, compiled
from tuner.navigation.engine.predict_column import NUMBERS
from tuner.navigation.engine.simd import WIDTH, aligned, as_columns, as_lanes, as_numbers
from tuner.navigation.engine.types import NEVER, Layout

FloatArray = NDArray[np.float64]


class Memory(NamedTuple):
    """All that one filter, or eight together, hold: arrays whose last axis counts the filters.

    States stand in padded columns where there is one filter, so that eight columns fill a value of lanes.
    """

    state: FloatArray  # (10, w) latitude, longitude, height, velocity, quaternion
    x: FloatArray  # (n, w)
    P: FloatArray  # (rows, columns, w), rows and columns padded
    rows: FloatArray  # (9, 8, w), rows of T as columns but for the last; unused where there are eight filters
    ninth: FloatArray  # (9, 1, w), the last, likewise
    noise: FloatArray  # (8, 8, w), Γᵀ likewise
    gamma: FloatArray  # (9, 6 and padding, w), Γ
    inverse: FloatArray  # (6, 6 and padding, w), of A
    matrix: FloatArray  # (6, 6, w), A
    bias: FloatArray  # (6, w)
    step: FloatArray  # (numbers, w), `columns.Step`
    slant: FloatArray  # (columns, w), the elements of S c
    true: FloatArray  # (6, w), calibrated mean rates and forces in b
    rate: FloatArray  # (n, w), 1/T of each state, 1/s
    drive: FloatArray  # (n, w), squares of the driving densities
    decay: FloatArray  # (columns, w), exp(−dt/T)
    shrunk: FloatArray  # (columns, w), c: P is that of the states divided by it
    growth: FloatArray  # (columns, w), exp(2 dt/T)
    grown: FloatArray  # (columns, w), 1/c²
    driven: FloatArray  # (n, w), variance driven in a step
    white: FloatArray  # (6, w), squares of the believed white densities of the sensors
    density: FloatArray  # (6, w), true white densities
    stream: FloatArray  # (4, w), bits of the streams of white noise
    slow: FloatArray  # (s, 6, w), other errors of rates and forces
    refused: FloatArray  # (2, w), since when positions and velocities have been refused
    each: tuple[int, ...]  # w of them: compiled code knows how long a tuple is


class Work(NamedTuple):
    """`Memory` as kernels see it: by elements, and (ending in _c) by columns, eight numbers in a value."""

    state: Any
    x: Any
    P: Any
    P_c: Any
    rows_c: Any  # the first nine rows of P as columns
    over_c: Any  # all rows of these columns, where they are wanted when P is turned over
    ninth: Any
    noise_c: Any
    gamma: Any
    gamma_c: Any
    inverse: Any
    inverse_c: Any
    matrix: Any
    bias: Any
    step: Any
    slant: Any
    slant_c: Any
    true: Any
    decay: Any
    decay_c: Any
    shrunk: Any
    shrunk_c: Any
    growth: Any
    growth_c: Any
    grown: Any
    grown_c: Any
    driven: Any
    white: Any
    density: Any
    stream: Any
    slow: Any
    apart: bool  # whether `rows` and `noise` are copies


def memory(lay: Layout, filters: int) -> Memory:
    """Return the memory of one filter, or of `WIDTH`: A = I, S of ones, the drives of the layout, all else 0."""
    size = lay.size
    pad = WIDTH // filters

    def room(*shape: int) -> FloatArray:
        return aligned(*shape, filters)

    columns, sensors = (-(-count // pad) * pad for count in (size, 6))
    empty = Memory(
        state=room(10),
        x=room(size),
        P=room(columns, columns),
        rows=room(9, pad),
        ninth=room(9, 1),
        noise=room(WIDTH, pad),
        gamma=room(9, sensors),
        inverse=room(6, sensors),
        matrix=room(6, 6),
        bias=room(6),
        step=room(NUMBERS),
        slant=room(columns),
        true=room(6),
        rate=room(size),
        drive=room(size),
        decay=room(columns),
        shrunk=room(columns),
        growth=room(columns),
        grown=room(columns),
        driven=room(size),
        white=room(6),
        density=room(6),
        stream=room(4),
        slow=room(1, 6),
        refused=room(2),
        each=tuple(range(filters)),
    )
    empty.inverse[range(6), range(6)] = empty.slant[:] = empty.grown[:] = 1.0
    empty.rate[:], empty.drive[:], empty.white[:] = lay.rate[:, None], lay.drive[:, None], lay.white[:, None]
    empty.shrunk[:] = 1.0
    empty.refused[:] = NEVER
    return empty


@compiled
def _copies(m: Memory) -> Any:
    """Return `rows`, P and `noise`."""
    return as_columns(m.rows), as_columns(m.P), as_columns(m.noise)


@compiled
def _views_of(m: Memory) -> Any:
    """Return the first nine rows of P as columns, all of them, and Γᵀ."""
    P = as_lanes(m.P)
    return P[:9].T, P.T, as_lanes(m.gamma).T


def _views(element: Any, turn: Any, apart: bool) -> Callable[[Memory], Work]:
    """Return the function that makes `Work` of `Memory` with elements seen through `element`."""

    @compiled
    def views(m: Memory) -> Work:
        rows, over, noise = turn(m)
        return Work(
            element(m.state),
            element(m.x),
            element(m.P),
            as_columns(m.P),
            rows,
            over,
            element(m.ninth),
            noise,
            element(m.gamma),
            as_columns(m.gamma),
            element(m.inverse),
            as_columns(m.inverse),
            element(m.matrix),
            element(m.bias),
            element(m.step),
            element(m.slant),
            as_columns(m.slant),
            element(m.true),
            element(m.decay),
            as_columns(m.decay),
            element(m.shrunk),
            as_columns(m.shrunk),
            element(m.growth),
            as_columns(m.growth),
            element(m.grown),
            as_columns(m.grown),
            element(m.driven),
            element(m.white),
            element(m.density),
            element(m.stream),
            element(m.slow),
            apart,
        )

    return views


_ONE, _EIGHT = _views(as_numbers, _copies, True), _views(as_lanes, _views_of, False)


def work_of(m: Memory, each: tuple[int, ...]) -> Work:
    """Return the memory of as many filters as the tuple is long, as kernels see it."""
    raise NotImplementedError


@overload(work_of, jit_options=PART)
def _choose_work(m: Any, each: Any) -> Any:  # noqa: ARG001
    views = _ONE if len(each) == 1 else _EIGHT

    def implementation(m: Any, each: Any) -> Any:  # noqa: ARG001
        return views(m)

    return implementation


@compiled
def copy_out(many: FloatArray, w: int, one: FloatArray) -> None:
    """Copy the covariance (n, n) of filter w out of those of all, (n, columns, …)."""
    for i in range(len(one)):
        for j in range(len(one)):
            one[i, j] = many[i, j, w]


@compiled
def copy_in(many: FloatArray, w: int, one: FloatArray) -> None:
    """Copy the covariance of filter w back."""
    for i in range(len(one)):
        for j in range(len(one)):
            many[i, j, w] = one[i, j]
