"""The records of the compiled filter: its layout and all that it changes; the last axis of arrays is the filters'.

One record of arrays, whose sizes are constants of compilation, for one filter or `BATCH_SIZE`, of at most `MAX_STATES`.
Compiled functions take it as their first argument `m`.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.navigation.engine.layout import (
    CONSTANT_COUNT,
    CONSTRAINT_LENGTH,
    DOWN_INPUT,
    GROUP_SIZE,
    NUMBERS,
    TABLE_ROWS,
    Layout,
    indices,
)
from tuner.navigation.engine.random_normal import RANDOM_ROWS

Field = tuple[str, str, tuple[int, ...]]  # name, type and shape of a field of a record

MAX_STATES = 96
"""Room for states; what of it is not used costs no time. Rows of matrices are longer by one element for `BATCH_SIZE`
filters, else by eight, so that the distances of rows, and of matrices, are not near multiples of 4096 bytes, which
share the same lines of the cache."""
CACHE_LINE = 64
"""Bytes of a line of the cache."""
UNREACHED_LIMIT = 1e300
"""Later than any time, s, and larger than any χ²: no fix is refused, no gate is set."""

POSITION_ROW, VELOCITY_ROW, ATTITUDE_ROW = indices(0, 3, 6)
"""Rows of `State.rows`: latitude, longitude, height; velocity; quaternion."""
(START_ROW,) = indices(10)
"""… the same at the start of the covariance step."""
(PREVIOUS_ROW,) = indices(20)
"""… increments of the sample before."""
(SAMPLE_ROW,) = indices(26)
"""… increments of the sample, of calibrated sensors."""
ANGLE_SUM_ROW, VELOCITY_SUM_ROW = indices(32, 35)
"""… sums since the start of the covariance step: of angles in b, of velocity increments in n."""
(BIAS_ROW,) = indices(38)
"""… biases of the six sensors."""
(PHI_ROW,) = indices(44)
"""… the 43 numbers of Φ of the navigation errors, see `transition.linearise`."""
(CALIBRATED_ROW,) = indices(87)
"""… calibrated rates and forces in b."""
CALIBRATION_ROW, INVERSE_ROW = indices(93, 129)
"""… A and its inverse, row by row."""
WHITE_ROW, TRUE_DENSITY_ROW = indices(165, 171)
"""… squares of the white densities of the sensors as configured; their true white densities."""
REFUSED_ROW = 177
"""… since when positions and velocities have been refused."""
ROW_COUNT = 179

ESTIMATE, UNIT, SENSITIVITY, DECAY, PROCESS_VARIANCE, SCALED_VARIANCE, RATE, DRIVING_DENSITY = range(8)
"""Fields of `State.states`: estimates; c, P being that of the states divided by it; S c; exp(−dt/T); the process
noise of a step, and this by c²; 1/T, 1/s; squared densities of the driving noise."""
FIELD_COUNT = 8

COLUMN_MULTIPLE = 8
"""Columns of one filter are padded to a multiple of this, so that packed loops have no remainder."""


JACOBIAN_ROWS, SENSOR_ROWS, INNOVATION_ROWS, BLOCK_ROWS, ROOT_ROWS, SENSOR_INVERSE_ROWS, COVARIANCE_ROWS = (
    indices(0, 6, 12, 18, 24, 30, 43)
)
"""Rows of `State.scratch`, for the use of a fix by one filter, six each: H; rates and forces by the states,
or a gain; H P, later L⁻¹ H P; a part of S; its Cholesky factor; inverse of A; S."""
INNOVATION, CORRECTION, ESTIMATES, CALIBRATED, MEASURED, WHITENED, LIMITS = indices(*range(36, 43))
"""… innovations; estimated errors; estimates of the other states; calibrated rates and forces; measured ones without
biases; innovations by the inverse factor; χ² limits of position and velocity."""
SCRATCH_ROWS = 49


class State(NamedTuple):
    """The records of W filters, and views of the arrays that are set or read outside of compiled code."""

    memory: NDArray[np.void]  # (1,), the record of all but
    covariance: NDArray[np.void]  # (1,), that of P,
    inputs: NDArray[np.void]  # (1,), that of S P: of six sensors, and of the acceleration down,
    each: NDArray[np.void]  # (1,), that of P_each, covariances while fixes are used; of one filter that of P
    rows: FloatArray  # (ROW_COUNT, W), see above
    states: FloatArray  # (FIELD_COUNT, MAX_STATES, W), of the states, see above
    P: FloatArray  # (rows, columns, W); what is behind the states is 0
    stream: NDArray[np.uint64]  # (4, W), states of the streams of white noise


@cache
def record_types(filters: int) -> tuple[np.dtype[np.void], ...]:
    """Return the four records of one filter, or of `BATCH_SIZE`.

    Arrays that one loop reads and writes at variable indices are in different records: of two such places in one
    record LLVM does not know that they differ.
    """
    f, i, one, length = "f8", "i8", filters == 1, MAX_STATES
    columns = length + 8 if one else length + 1
    P: Field = ("P", f, (length + GROUP_SIZE - 1, columns, filters))
    fields: list[Field] = [
        ("rows", f, (ROW_COUNT, filters)),
        ("states", f, (FIELD_COUNT, length, filters)),
        ("coupling", f, (GROUP_SIZE * length, filters)),  # the elements of S c that `Layout.groups` stand for
        ("scratch", f, (SCRATCH_ROWS, length)),
        ("stream", "u8", (4, filters)),
        ("words", "u8", (RANDOM_ROWS, filters)),
        ("numbers", f, (RANDOM_ROWS, filters)),  # the same memory
        ("fix", f, (CONSTRAINT_LENGTH,)),  # the measurement in use
        ("sd", f, (filters, 6)),
        ("use", i, (2,)),
        ("table", i, (TABLE_ROWS, length)),
        ("constants", f, (CONSTANT_COUNT,)),
        ("groups", i, (length, 4)),
        ("further", i, (2 * length, 3)),
        ("factor", f, (2 * length,)),
        *((name, i, ()) for name in NUMBERS),
        ("group_count", i, ()),
        ("further_count", i, ()),
        ("ramps", i, ()),
        ("filters", i, ()),
        ("batches", i, ()),  # 1, which LLVM does not know
    ]
    inputs: Field = ("inputs", f, (DOWN_INPUT + 1, columns, filters))
    each: Field = ("P_each", f, (filters, length, length + 8))
    return tuple(_record(own) for own in (fields, [P], [inputs], [each]))


def _record(fields: list[Field]) -> np.dtype[np.void]:
    """Return a record whose fields are aligned to cache lines."""
    offsets, end = {}, 0
    for name, kind, shape in fields:
        offsets[name] = end
        end += -(-np.dtype((kind, shape)).itemsize // CACHE_LINE) * CACHE_LINE
    if "numbers" in offsets:
        offsets["numbers"] = offsets["words"]
    return np.dtype(
        {
            "names": [name for name, _, _ in fields],
            "formats": [(kind, shape) for _, kind, shape in fields],
            "offsets": [offsets[name] for name, _, _ in fields],
            "itemsize": end,
        }
    )


def new_state(lay: Layout, filters: int) -> State:
    """Return the record of one filter, or of `BATCH_SIZE`: A = I, process noise of the layout, else 0.

    Raises
    ------
    ValueError
        Where there are more than `MAX_STATES`, or these add to more than the record has room for.
    """
    n, further = lay.size, len(lay.further)
    if n > MAX_STATES:
        raise ValueError(f"at most {MAX_STATES} states can be compiled, got {n}")
    if further > 2 * MAX_STATES:
        raise ValueError(
            f"at most {2 * MAX_STATES} couplings of declared states can be compiled, got {further}"
        )
    kind, *kinds = record_types(filters)
    memory, covariance, inputs = (_zeros(own.itemsize).view(own) for own in (kind, *kinds[:2]))
    shared = filters == 1  # its covariance needs no copy
    each = (covariance.view(np.uint8)[: kinds[2].itemsize] if shared else _zeros(kinds[2].itemsize)).view(
        kinds[2]
    )
    m = memory[0]
    rows, states = m["rows"], m["states"]
    rows[INVERSE_ROW : INVERSE_ROW + 36 : 7] = 1.0
    rows[WHITE_ROW : WHITE_ROW + 6] = lay.white[:, None]
    rows[REFUSED_ROW : REFUSED_ROW + 2] = UNREACHED_LIMIT
    states[UNIT] = states[SENSITIVITY] = 1.0
    states[RATE, :n], states[DRIVING_DENSITY, :n] = lay.rate[:, None], lay.process_noise[:, None]
    m["table"][:, :n], m["constants"][:] = lay.table(), lay.constants()
    m["groups"][: len(lay.groups)] = lay.groups
    m["further"][:further], m["factor"][:further], m["further_count"] = lay.further, lay.factor, further
    for name, value in zip(NUMBERS, lay.numbers(), strict=True):
        m[name] = value
    m["batches"] = 1
    m["group_count"], m["ramps"], m["filters"] = len(lay.groups), len(lay.ramps), filters
    return State(memory, covariance, inputs, each, rows, states, covariance[0]["P"], m["stream"])


def _zeros(size: int) -> NDArray[np.uint8]:
    """Return so many bytes, aligned to a cache line, so that no packed load crosses two of them."""
    room = np.zeros(size + CACHE_LINE, dtype=np.uint8)
    skip = -room.ctypes.data % CACHE_LINE
    return room[skip : skip + size]
