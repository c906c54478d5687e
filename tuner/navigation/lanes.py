# mypy: disable-error-code="no-untyped-call, untyped-decorator, call-arg"
"""Eight numbers that go through compiled code as one value, on as few instructions as the processor can.

The kernels of the filter are written for numbers. Called with `Lanes` in place of some of them, the same lines
advance eight filters at once, or eight columns of one covariance::

    as_numbers(a)     (…, 1) → array (…) of numbers
    as_lanes(a)       (…, 8) → array (…) of lanes, one for each filter
    as_columns(a)     (…, columns, filters) → array (…, columns · filters/8) of lanes, whichever follow

All three are views. Arithmetic goes lane by lane, numbers stand for eight equal ones; a comparison holds where it
holds in every lane.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

WIDTH = 8
"""Numbers in a value: as many as the widest registers hold."""
ALIGNMENT = 64
"""Of arrays of lanes, bytes."""

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
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
        super().__init__(manager, kind, _VECTOR)


def aligned(*shape: int) -> FloatArray:
    """Return zeros, shape `shape`, that begin where wide loads are fast."""
    size = 8 * math.prod(shape)
    memory = np.zeros(size + ALIGNMENT, dtype=np.uint8)
    skip = -memory.ctypes.data % ALIGNMENT
    return memory[skip : skip + size].view(np.float64).reshape(shape)


def _spread(builder: Any, kind: Any, value: Any) -> Any:
    """Return lanes as they are, a number eight times."""
    if isinstance(kind, LanesType):
        return value
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(nothing, value, _INDEX(0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(_INDEX, WIDTH), [0] * WIDTH))


@lower_cast(types.float64, LanesType)
def _number_to_lanes(_context: Any, builder: Any, kind: Any, _to: Any, value: Any) -> Any:
    return _spread(builder, kind, value)


PAIRS = ((LANES, LANES), (LANES, _NUMBER), (_NUMBER, LANES))


def _declare(function: Callable[..., Any], result: Any, *arguments: tuple[Any, ...]) -> None:
    """Tell numba the types of a function of lanes."""

    class Template(ConcreteTemplate):
        cases = [signature(result, *kinds) for kinds in arguments]  # noqa: RUF012

    infer_global(function)(Template)


def _arithmetic(function: Callable[..., Any], instruction: str) -> None:
    def lower(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (_spread(builder, kind, value) for kind, value in zip(sig.args, args, strict=True))
        return getattr(builder, instruction)(a, b)

    _declare(function, LANES, *PAIRS)
    for pair in PAIRS:
        lower_builtin(function, *pair)(lower)


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.iadd, "fadd"),
    (operator.sub, "fsub"),
    (operator.isub, "fsub"),
    (operator.mul, "fmul"),
    (operator.imul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _arithmetic(_function, _instruction)

_declare(operator.neg, LANES, (LANES,))
_declare(operator.lt, types.boolean, (LANES, _NUMBER))


@lower_builtin(operator.neg, LANES)
def _negative(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


@lower_builtin(operator.lt, LANES, _NUMBER)
def _all_less(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    mask = builder.fcmp_ordered("<", args[0], _spread(builder, _NUMBER, args[1]))
    bits = ir.IntType(WIDTH)
    return builder.icmp_unsigned("==", builder.bitcast(mask, bits), bits(2**WIDTH - 1))


def _of_llvm(name: str) -> Any:
    """Return LLVM's function of lanes of that name."""

    @intrinsic
    def call(_context: Any, x: Any) -> Any:
        def generate(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
            kind = ir.FunctionType(_VECTOR, [_VECTOR])
            function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
            return builder.call(function, args)

        return x(x), generate

    return call


_sqrt, _floor = _of_llvm("sqrt"), _of_llvm("floor")


def _root(x: Any) -> Any:
    """Return √x."""
    return _sqrt(x)


def _sine(x: Any) -> Any:
    """Return sin x by Taylor's series for x − kπ, of size π/2 at most: the first omitted term is below 1e-17."""
    k = _floor(x * (1.0 / math.pi) + 0.5)
    r = (x - k * math.pi) - k * 1.2246467991473532e-16  # π to 32 digits
    s = r * r
    y = 1.0 - s / 110.0 * (1.0 - s / 156.0 * (1.0 - s / 210.0 * (1.0 - s / 272.0 * (1.0 - s / 342.0))))
    y = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * y)))
    return (1.0 - 2.0 * (k - 2.0 * _floor(0.5 * k))) * r * y


def _cosine(x: Any) -> Any:
    """Return cos x."""
    return np.sin(x + 0.5 * math.pi)


def _implement(function: Callable[..., Any], lanes: Callable[..., Any]) -> None:
    """Let compiled code call a function of numbers with lanes."""

    def choose(x: Any) -> Any:
        return lanes if isinstance(x, LanesType) else None

    overload(function, jit_options={"fastmath": True, "forceinline": True})(choose)


for _module in (math, np):
    _implement(_module.sqrt, _root)
    _implement(_module.sin, _sine)
    _implement(_module.cos, _cosine)


@intrinsic
def _signed(_context: Any, x: Any, y: Any) -> Any:
    def generate(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR, _VECTOR])
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.copysign.v{WIDTH}f64")
        return builder.call(function, (_spread(builder, sig.args[0], args[0]), args[1]))

    return y(x, y), generate


def _copysign(x: Any, y: Any) -> Any:
    """Return x with the signs of y."""
    return _signed(x, y)


@overload(np.copysign)
def _choose_copysign(x: Any, y: Any) -> Any:  # noqa: ARG001
    return _copysign if isinstance(y, LanesType) else None


@intrinsic
def turned_over(_context: Any, rows: Any) -> Any:
    """Return eight lanes as eight others: number j of lane i becomes number i of lane j."""

    def generate(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        lanes = cgutils.unpack_tuple(builder, args[0])
        for far in (1, 2, 4):  # two blocks of this size beside the diagonal change places
            low = [e if not e & far else WIDTH + e - far for e in range(WIDTH)]
            high = [e + far if not e & far else WIDTH + e for e in range(WIDTH)]
            for i in (i for i in range(WIDTH) if not i & far):
                pair = lanes[i], lanes[i + far]
                lanes[i], lanes[i + far] = (
                    builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(_INDEX, WIDTH), mask))
                    for mask in (low, high)
                )
        return cgutils.pack_array(builder, lanes)

    return rows(rows), generate


def _view(kind: Any, lost: int) -> Any:
    """Return a function that sees an array of numbers as one of `kind`.

    The last `lost` axes go: none; one of length 1 or 8; or two whose lengths have a product that 8 divides, of
    which one stays, of the product ÷ 8. A view does not own the memory and so costs nothing to hand about.
    """

    @intrinsic
    def see(_context: Any, array: Any) -> Any:
        of = array.dtype if kind is None else kind
        seen = types.Array(of, array.ndim - (lost > 0), "C", aligned=of is not LANES)

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source = context.make_array(sig.args[0])(context, builder, args[0])
            target = context.make_array(seen)(context, builder)
            size = context.get_abi_sizeof(context.get_data_type(of))
            axes = cgutils.unpack_tuple(builder, source.shape)
            number = axes[0].type
            shape = axes[: len(axes) - lost]
            if lost == 2:
                shape.append(builder.udiv(builder.mul(axes[-2], axes[-1]), number(WIDTH)))
            strides: list[Any] = []
            step = number(size)
            for axis in reversed(shape):
                strides.insert(0, step)
                step = builder.mul(step, axis)
            pointer = builder.bitcast(source.data, context.get_data_type(of).as_pointer())
            populate_array(
                target, data=pointer, shape=shape, strides=strides, itemsize=number(size), meminfo=None
            )
            return target._getvalue()

        return seen(array), generate

    return see


as_numbers, as_lanes, as_columns = _view(_NUMBER, 1), _view(LANES, 1), _view(LANES, 2)
borrowed = _view(None, 0)
"""The same array, not owned."""
