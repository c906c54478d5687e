# mypy: disable-error-code="no-untyped-call"
"""Straight-line functions in compiled code: run by the compiler, once, on values that write instructions down.

numba infers the types of every function that a kernel calls, optimises it by itself and again in each caller:
for thousands of small ones, as of `models`, that takes minutes. So a function that is `straight` is called
while the kernel is compiled, with a `Value` in place of each number. The sum of two values is a value and an
instruction in the kernel, tuples are tuples, a loop is a row of instructions; what is left of the function is
its arithmetic, between numbers or `lanes`. Outside compiled code it remains what it is.

A condition on values is one of the kernel: the function is run once for each outcome, and what it returns
stands for either. Functions with conditions set no elements of arrays.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, infer, infer_global, signature
from numba.extending import lower_builtin

from tuner.navigation.engine.simd import LANES, VECTOR, WIDTH, elementary, spread

Function = TypeVar("Function", bound=Callable[..., Any])

_DOUBLE = ir.DoubleType()
_BYTE = ir.IntType(8)
_STRAIGHT: set[Callable[..., Any]] = set()


class _Unknown(BaseException):
    """A condition of which it is not known what comes out."""

    def __init__(self, condition: Any) -> None:
        self.condition = condition


class Writer:
    """Writes the instructions of functions where a builder of LLVM stands."""

    def __init__(self, context: Any, builder: Any) -> None:
        self.context, self.builder = context, builder
        self.clones: dict[Callable[..., Any], Callable[..., Any]] = {}
        self.outcomes: list[bool] = []

    def clone(self, function: Any) -> Callable[..., Any]:
        """Return a function that calls others through `run`, and those of numpy for those of math."""
        if function not in self.clones:
            if not isinstance(function, FunctionType):
                return function  # type: ignore[no-any-return]
            names = dict(function.__globals__)
            clone = FunctionType(function.__code__, names, function.__name__, None, function.__closure__)
            self.clones[function] = clone
            for name, other in function.__globals__.items():
                if name == "math":
                    names[name] = np
                elif isinstance(other, FunctionType) and other in _STRAIGHT:
                    names[name] = self._calling(other)
        return self.clones[function]

    def _calling(self, function: Any) -> Callable[..., Any]:
        return lambda *arguments: self.run(function, arguments)

    def run(self, function: Any, arguments: Any) -> Any:
        """Return what a function returns of values."""
        outer = self.outcomes
        try:
            return self._run(self.clone(function), arguments, [])
        finally:
            self.outcomes = outer

    def _run(self, clone: Any, arguments: Any, known: list[bool]) -> Any:
        """Run a function of whose conditions the first outcomes are known."""
        self.outcomes = list(known)
        try:
            return clone(*arguments)
        except _Unknown as found:
            answers, blocks = [], []
            with self.builder.if_else(found.condition) as branches:
                for branch, outcome in zip(branches, (True, False), strict=True):
                    with branch:
                        answers.append(self._run(clone, arguments, [*known, outcome]))
                        blocks.append(self.builder.block)
            return self._either(answers, blocks)

    def _either(self, answers: Any, blocks: Any) -> Any:
        """Return what stands for either answer."""
        if isinstance(answers[0], tuple):
            return tuple(self._either(pair, blocks) for pair in zip(*answers, strict=True))
        if answers[0] is answers[1]:
            return answers[0]
        lanes = VECTOR in [a.code.type for a in answers if isinstance(a, Value)]
        phi = self.builder.phi(VECTOR if lanes else _DOUBLE)
        for answer, block in zip(answers, blocks, strict=True):
            with self.builder.goto_block(block):
                phi.add_incoming(self.code(answer, phi.type), block)
        return Value(self, phi)

    def code(self, value: Any, kind: Any) -> Any:
        """Return a number or value as LLVM's."""
        if not isinstance(value, Value):
            return ir.Constant(kind, [float(value)] * WIDTH if kind == VECTOR else float(value))
        return spread(self.builder, value.code) if kind == VECTOR else value.code

    def given(self, kind: Any, code: Any) -> Any:
        """Return an argument of compiled code as functions see it."""
        if isinstance(kind, types.BaseTuple):
            kinds: tuple[Any, ...] = kind.types  # type: ignore[attr-defined]
            parts = [self.given(k, self.builder.extract_value(code, i)) for i, k in enumerate(kinds)]
            return tuple(parts) if (named := getattr(kind, "instance_class", None)) is None else named(*parts)
        if isinstance(kind, types.Array):
            return Elements(self, kind, code)
        if isinstance(kind, types.Boolean):
            return Condition(self, self.builder.trunc(code, ir.IntType(1)) if code.type.width > 1 else code)
        return Index(self, code) if isinstance(kind, types.Integer) else Value(self, code)

    def answer(self, result: Any) -> tuple[Any, Any]:
        """Return type and code of what a function has returned."""
        if result is None:
            return types.none, self.context.get_dummy_value()
        if isinstance(result, tuple):
            parts = [self.answer(part) for part in result]
            kind = types.BaseTuple.from_types([k for k, _ in parts], type(result))
            return kind, self.context.make_tuple(self.builder, kind, [c for _, c in parts])
        if not isinstance(result, Value):
            return types.float64, ir.Constant(_DOUBLE, float(result))
        return LANES if result.code.type == VECTOR else types.float64, result.code


class Condition:
    """What decides between instructions."""

    def __init__(self, writer: Writer, code: Any) -> None:
        self.writer, self.code = writer, code

    def __bool__(self) -> bool:
        if self.writer.outcomes:
            return self.writer.outcomes.pop(0)
        raise _Unknown(self.code)


class Index:
    """Where an element stands."""

    def __init__(self, writer: Writer, code: Any) -> None:
        self.writer, self.code = writer, code

    def __add__(self, other: int) -> Index:
        return Index(self.writer, self.writer.builder.add(self.code, ir.Constant(self.code.type, other)))


class Value:
    """A number, or lanes, that compiled code will have."""

    def __init__(self, writer: Writer, code: Any) -> None:
        self.writer, self.code = writer, code

    def _with(self, other: Any, instruction: str, *, first: bool = True) -> Any:
        lanes = VECTOR in (self.code.type, getattr(other, "code", self.code).type)
        kind = VECTOR if lanes else self.code.type
        pair = self.writer.code(self, kind), self.writer.code(other, kind)
        builder = self.writer.builder
        return Value(self.writer, getattr(builder, instruction)(*(pair if first else pair[::-1])))

    def __add__(self, other: Any) -> Any:
        return self._with(other, "fadd")

    def __radd__(self, other: Any) -> Any:
        return self._with(other, "fadd")

    def __sub__(self, other: Any) -> Any:
        return self._with(other, "fsub")

    def __rsub__(self, other: Any) -> Any:
        return self._with(other, "fsub", first=False)

    def __mul__(self, other: Any) -> Any:
        return self._with(other, "fmul")

    def __rmul__(self, other: Any) -> Any:
        return self._with(other, "fmul")

    def __truediv__(self, other: Any) -> Any:
        return self._with(other, "fdiv")

    def __rtruediv__(self, other: Any) -> Any:
        return self._with(other, "fdiv", first=False)

    def __neg__(self) -> Any:
        return Value(self.writer, self.writer.builder.fneg(self.code))

    def __lt__(self, other: float) -> Condition:
        builder = self.writer.builder
        less = builder.fcmp_ordered("<", self.code, self.writer.code(other, self.code.type))
        if self.code.type == VECTOR:
            bits = ir.IntType(WIDTH)
            less = builder.icmp_unsigned("==", builder.bitcast(less, bits), bits(2**WIDTH - 1))
        return Condition(self.writer, less)

    def __array_ufunc__(self, function: Any, _method: str, *arguments: Any) -> Any:
        """Answer a function of numpy."""
        if function is np.sin:
            return self.writer.run(sine, arguments)
        if function is np.cos:
            return self.writer.run(cosine, arguments)
        codes = [self.writer.code(a, self.code.type) for a in arguments]
        return Value(self.writer, elementary(self.writer.builder, function.__name__, codes))


class Elements:
    """An array of compiled code."""

    def __init__(self, writer: Writer, kind: Any, code: Any) -> None:
        self.writer, self.kind, self.code = writer, kind, code

    def _part(self, name: str) -> Any:
        position = self.writer.context.data_model_manager[self.kind].get_field_position(name)
        return self.writer.builder.extract_value(self.code, position)

    def _pointer(self, at: Any) -> Any:
        builder, context = self.writer.builder, self.writer.context
        kind = context.get_data_type(self.kind.dtype)
        strides, near = self._part("strides"), {"C": self.kind.ndim - 1, "F": 0}.get(self.kind.layout)
        offset = beside = ir.Constant(ir.IntType(64), 0)
        for axis, index in enumerate(at if isinstance(at, tuple) else (at,)):
            number = index.code if isinstance(index, Index) else ir.Constant(ir.IntType(64), index)
            if axis == near:
                beside = number
            else:
                offset = builder.add(offset, builder.mul(builder.extract_value(strides, axis), number))
        start = builder.bitcast(self._part("data"), _BYTE.as_pointer())
        return builder.gep(builder.bitcast(builder.gep(start, [offset]), kind.as_pointer()), [beside])

    def __getitem__(self, at: Any) -> Value:
        return Value(self.writer, self.writer.builder.load(self._pointer(at), align=8))

    def __setitem__(self, at: Any, value: Any) -> None:
        pointer = self._pointer(at)
        code = self.writer.code(value, self.writer.context.get_data_type(self.kind.dtype))
        self.writer.builder.store(code, pointer, align=8)


def sine(x: Any) -> Any:
    """Return sin x by Taylor's series for x − kπ, of size π/2 at most: the first omitted term is below 1e-17."""
    k = np.floor(x * (1.0 / np.pi) + 0.5)
    r = (x - k * np.pi) - k * 1.2246467991473532e-16  # π to 32 digits
    s = r * r
    y = 1.0 - s / 110.0 * (1.0 - s / 156.0 * (1.0 - s / 210.0 * (1.0 - s / 272.0 * (1.0 - s / 342.0))))
    y = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * y)))
    return (1.0 - 2.0 * (k - 2.0 * np.floor(0.5 * k))) * r * y


def cosine(x: Any) -> Any:
    """Return cos x."""
    return sine(x + 0.5 * np.pi)


def turned_over(rows: Any) -> Any:
    """Return eight lanes as eight others, in straight functions: number j of lane i becomes number i of lane j."""
    writer, lanes = rows[0].writer, [row.code for row in rows]
    for far in (1, 2, 4):  # two blocks of this size beside the diagonal change places
        low = [e if not e & far else WIDTH + e - far for e in range(WIDTH)]
        high = [e + far if not e & far else WIDTH + e for e in range(WIDTH)]
        masks = [ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), mask) for mask in (low, high)]
        for i in (i for i in range(WIDTH) if not i & far):
            pair = lanes[i], lanes[i + far]
            lanes[i], lanes[i + far] = (writer.builder.shuffle_vector(*pair, mask) for mask in masks)
    return tuple(Value(writer, lane) for lane in lanes)


def _kind_of(function: Any, kinds: tuple[Any, ...]) -> Any:
    """Return the type of what a function returns: it is run to no purpose."""
    context = cpu_target.target_context
    module = ir.Module()
    shape = ir.FunctionType(ir.VoidType(), [context.get_value_type(kind) for kind in kinds])
    code = ir.Function(module, shape, "tried")
    writer = Writer(context, ir.IRBuilder(code.append_basic_block()))
    arguments = [writer.given(kind, part) for kind, part in zip(kinds, code.args, strict=True)]
    return writer.answer(writer.run(function, arguments))[0]


def _register(function: Any, serves: Callable[[tuple[Any, ...]], bool], *cases: Any) -> None:
    """Let numba call a function with arguments that it `serves`; `cases` are as precise."""
    known: dict[tuple[Any, ...], Any] = {}

    class Template(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            """Return the signature of a call."""
            assert not kws
            if not serves(args):
                return None
            kinds = tuple(types.unliteral(kind) for kind in args)
            if kinds not in known:
                known[kinds] = _kind_of(function, kinds)
            return signature(known[kinds], *kinds)

    infer(Template)
    infer_global(function, types.Function(Template))

    def lower(context: Any, builder: Any, sig: Any, codes: Any) -> Any:
        writer = Writer(context, builder)
        arguments = [writer.given(kind, code) for kind, code in zip(sig.args, codes, strict=True)]
        return writer.answer(writer.run(function, arguments))[1]

    for case in cases:
        lower_builtin(function, *case)(lower)


def straight(function: Function) -> Function:
    """Let compiled code call a straight-line function."""
    _STRAIGHT.add(function)
    _register(function, lambda _: True, (types.VarArg(types.Any),))
    return function


_PAIRS = (LANES, LANES), (LANES, types.float64), (types.float64, LANES)
straight(sine)
straight(cosine)
for _function in (
    operator.add, operator.iadd, operator.sub, operator.isub,
    operator.mul, operator.imul, operator.truediv,
):  # fmt: skip
    _register(_function, lambda args: LANES in args, *_PAIRS)
