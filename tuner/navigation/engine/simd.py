# mypy: disable-error-code="no-untyped-call, untyped-decorator, call-arg"
"""Eight numbers that go through compiled code as one value, on as few instructions as the processor can.

The kernels of the filter are written for numbers. Called with lanes in place of some of them, the same lines
advance eight filters at once, or eight columns of one covariance::

    as_numbers(a)     (…, 1) → array (…) of numbers
    as_lanes(a)       (…, 8) → array (…) of lanes, one for each filter
    as_columns(a)     (…, columns, filters) → array (…, columns · filters/8) of lanes, whichever follow
    as_rows(a)        (…, columns) → array (…, columns/8) of lanes

All are views. Arithmetic goes lane by lane, numbers stand for eight equal ones; a comparison holds where it
holds in every lane.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.extending import intrinsic, lower_cast, models, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

WIDTH = 8
"""Numbers in a value: as many as the widest registers hold."""
ALIGNMENT = 64
"""Of arrays of lanes, bytes."""

VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INDEX = ir.IntType(32)
_NUMBER = types.float64


class LanesType(types.Type):
    """Type of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="lanes")

    def can_convert_from(self, _context: Any, other: Any) -> Any:
        """Numbers can stand for lanes."""
        return Conversion.safe if isinstance(other, types.Float) else None


LANES = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


def aligned(*shape: int) -> FloatArray:
    """Return zeros, shape `shape`, that begin where wide loads are fast."""
    size = 8 * math.prod(shape)
    memory = np.zeros(size + ALIGNMENT, dtype=np.uint8)
    skip = -memory.ctypes.data % ALIGNMENT
    return memory[skip : skip + size].view(np.float64).reshape(shape)


def spread(builder: Any, value: Any) -> Any:
    """Return lanes as they are, a number eight times."""
    if value.type == VECTOR:
        return value
    nothing = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(nothing, value, _INDEX(0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(_INDEX, WIDTH), [0] * WIDTH))


@lower_cast(types.float64, LanesType)
def _number_to_lanes(_context: Any, builder: Any, _kind: Any, _to: Any, value: Any) -> Any:
    return spread(builder, value)


def elementary(builder: Any, name: str, values: Any) -> Any:
    """Return LLVM's function of that name of numbers or lanes, all of one kind."""
    kind = values[0].type
    shape = ir.FunctionType(kind, [kind] * len(values))
    suffix = f"v{WIDTH}f64" if kind == VECTOR else "f64"
    function = cgutils.get_or_insert_function(builder.module, shape, f"llvm.{name}.{suffix}")
    return builder.call(function, values)


def _view(kind: Any, lost: int) -> Any:
    """Return a function that sees an array of numbers as one of `kind`.

    The last `lost` axes go: none, and the last counts an eighth; one of length 1 or 8; or two whose lengths have a
    product that 8 divides, of which one stays, of the product ÷ 8.
    """

    @intrinsic
    def see(_context: Any, array: Any) -> Any:
        seen = types.Array(kind, array.ndim - (lost > 0), "C", aligned=kind is not LANES)

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source = context.make_array(sig.args[0])(context, builder, args[0])
            target = context.make_array(seen)(context, builder)
            size = context.get_abi_sizeof(context.get_data_type(kind))
            axes = cgutils.unpack_tuple(builder, source.shape)
            number = axes[0].type
            shape = axes[: len(axes) - lost]
            if lost == 2:
                shape.append(builder.udiv(builder.mul(axes[-2], axes[-1]), number(WIDTH)))
            if lost == 0:
                shape[-1] = builder.udiv(shape[-1], number(WIDTH))
            strides: list[Any] = []
            step = number(size)
            for axis in reversed(shape):
                strides.insert(0, step)
                step = builder.mul(step, axis)
            pointer = builder.bitcast(source.data, context.get_data_type(kind).as_pointer())
            populate_array(
                target, data=pointer, shape=shape, strides=strides, itemsize=number(size), meminfo=None
            )
            return target._getvalue()

        return seen(array), generate

    return see


as_numbers, as_lanes, as_columns, as_rows = (
    _view(_NUMBER, 1), _view(LANES, 1), _view(LANES, 2), _view(LANES, 0)
)  # fmt: skip
