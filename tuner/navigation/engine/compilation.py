"""How the filter is compiled: numba's options, the functions of `models` it may call.

LLVM turns an innermost loop into packed instructions where it knows how far the rows of arrays are apart and nothing
is called. So the arrays of the filter are fields of one record (`state`), whose sizes are constants of compilation,
and a function with such a loop (`block`) calls nothing that is not inlined (`inlined`). References to a record are
not counted, and it is one argument.
"""

from __future__ import annotations

import gc
import logging
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from numba import njit, types
from numba.extending import intrinsic, register_jitable

from models import earth, error_state, strapdown, taylor, vector3

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILING_AFTER = 1.0
"""Time after which a function that is not in memory is said to compile, s: twice what loading it from disk takes."""

WIDE_VECTORS = '"prefer-vector-width"="512"'
"""Attribute of a function in LLVM's language."""

_OPTIONS: dict[str, Any] = {"error_model": "numpy"}
_INNER = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _hint(builder: Any, attribute: str) -> None:
    """Give LLVM a hint on the function that is being compiled; a release that refuses it compiles without."""
    with suppress(AttributeError, TypeError, ValueError):
        builder.function.attributes.update([attribute])


def _widen(_context: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        _hint(builder, WIDE_VECTORS)
        return context.get_dummy_value()

    return types.none(), generate


prefer_wide_vectors = cast(Callable[[], None], intrinsic(_widen))
"""Called in a compiled function with loops over filters or columns: LLVM is to use the widest registers there are.

Where a processor has registers of 512 bits LLVM uses half of them by default, to spare the clock of the first such
processors; twice the width takes a quarter off the time of many filters. The hint is an attribute of the function.
Other processors ignore it."""


def _small(_context: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        _hint(builder, "optsize")
        return context.get_dummy_value()

    return types.none(), generate


prefer_small_code = cast(Callable[[], None], intrinsic(_small))
"""Called in a compiled function that takes little of the time: LLVM is not to unroll its loops, and compiles faster."""


def inlined(function: Function) -> Function:
    """Compile a function that LLVM is to inline wherever it is called."""
    return cast(Function, njit(forceinline=True, **_INNER)(function))


def block(function: Function) -> Function:
    """Compile a part of the filter that only compiled code calls."""
    return cast(Function, njit(**_INNER)(function))


def merged(function: Function) -> Function:
    """Compile a part of the filter that is called once as a part of its caller, which LLVM then optimises once."""
    return cast(Function, njit(inline="always", **_INNER)(function))


def entry(function: Function) -> Function:
    """Compile a function that Python calls; it is kept on disk."""
    return cast(Function, njit(cache=True, nogil=True, **_OPTIONS)(function))


for _function in (
    *vector3.KERNELS, *taylor.KERNELS, *earth.KERNELS, *strapdown.KERNELS, *error_state.KERNELS,
):  # fmt: skip
    register_jitable(forceinline=True, **_INNER)(_function)


def checksum(*sources: ModuleType) -> int:
    """Return a number that changes with the code of modules."""
    total = 1
    for source in sources:
        total = zlib.crc32(Path(str(source.__file__)).read_bytes(), total)
    return total


def _announce(function: Any) -> None:
    """Say that the filter is being compiled, once in a process and only while this part of it is."""
    if not function.signatures:
        _say()


@cache
def _say() -> None:
    logging.getLogger("tuner").warning(
        "tuner: compiling the filter for this machine, once; it takes about 20 s"
    )


@contextmanager
def compiling(function: Any) -> Iterator[None]:
    """Around a call of a compiled function: say that it compiles where it takes longer than loading from disk.

    Until it is in memory no garbage is collected: there is little, and looking for it takes an eighth of the time.
    """
    if function.signatures:
        yield
        return
    notice = threading.Timer(COMPILING_AFTER, _announce, [function])
    notice.daemon = True
    collects = gc.isenabled()
    gc.disable()
    notice.start()
    try:
        yield
    finally:
        notice.cancel()
        if collects:
            gc.enable()


@inlined
def count(m: Any) -> int:
    """Return how many filters there are, for short loops: LLVM unrolls one of known length instead of packing it.

    A known factor of the length spares it the instructions for a rest.
    """
    return 1 if m.rows.shape[1] == 1 else m.rows.shape[1] * m.batches


@inlined
def vector(array: Any, row: int, w: int) -> Any:
    """Return three rows of filter w."""
    return array[row, w], array[row + 1, w], array[row + 2, w]


@inlined
def quaternion(array: Any, row: int, w: int) -> Any:
    """Return four rows of filter w."""
    return array[row, w], array[row + 1, w], array[row + 2, w], array[row + 3, w]


@inlined
def put_quaternion(array: Any, row: int, w: int, q: Any) -> None:
    """Set four rows of filter w."""
    array[row, w] = q[0]
    array[row + 1, w] = q[1]
    array[row + 2, w] = q[2]
    array[row + 3, w] = q[3]


@inlined
def put(array: Any, row: int, w: int, a: Any) -> None:
    """Set three rows of filter w."""
    array[row, w] = a[0]
    array[row + 1, w] = a[1]
    array[row + 2, w] = a[2]
