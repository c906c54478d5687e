"""One function applied to several items on all processors, with the same results as on one.

Each processor gets a forked copy of this process, which shares its memory: nothing is imported or read again, and items
are not copied. Copies take the next item as they finish one, and send results through a pipe. They end with this
process, and at once where it is interrupted. Where no copy can be made (in a thread, in a daemon such as a worker of
Dask, outside Linux, where libraries of the system may not survive it) the items are done here, one after the other.
Inside a copy every stage has one processor.
"""

from __future__ import annotations

import ctypes
import math
import os
import pickle
import selectors
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from io import BytesIO
from multiprocessing import current_process
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, TypeVar

from tuner.process import (
    allow_pickled_mappings,
    free_memory,
    keep_freed_memory,
    return_freed_memory,
    used_memory,
)
from tuner.stages import counted, is_watched, reached, watched

allow_pickled_mappings()

Item = TypeVar("Item")
Result = TypeVar("Result")

THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Variables by which numerical libraries learn their number of threads when they are loaded."""
REPORT_INTERVAL = 0.2
"""Time between two words of a copy on how far it is, s."""
BYTES_AT_ONCE = 1 << 20
"""Most bytes taken from a pipe in one go."""
_END_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux: the signal that a process gets when its parent ends."""

_limit: ContextVar[int | None] = ContextVar("processors", default=None)
_memory: ContextVar[float] = ContextVar("memory", default=math.inf)


def usable() -> int:
    """Return how many processors this stage may use.

    That is the number given to `limited`; else the environment variable ``NUMBA_NUM_THREADS``; else those that the
    system lets this process run on.
    """
    given = _limit.get()
    if given is not None:
        return given
    stated = os.environ.get("NUMBA_NUM_THREADS", "")
    if stated.isdecimal() and int(stated) > 0:
        return int(stated)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def limited(processors: int | None) -> Iterator[None]:
    """Let everything in this block use at most so many processors; None changes nothing."""
    token = _limit.set(usable() if processors is None else processors)
    try:
        yield
    finally:
        _limit.reset(token)


@contextmanager
def within(memory: float | None) -> Iterator[None]:
    """Let the processes that this block makes take, with this one, at most so many bytes; None changes nothing."""
    token = _memory.set(_memory.get() if memory is None else memory)
    try:
        yield
    finally:
        _memory.reset(token)


def each(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    shared: Sequence[object] = (),
    memory: float = 0.0,
) -> list[Result]:
    """Return the function of each item, in their order; computed in parallel where `usable` allows.

    Parameters
    ----------
    function : callable
        What it returns, and what it raises, must be picklable. What it changes is seen by no other item.
    items : sequence
        Given to it one by one; those that take long should come first.
    shared : sequence of object
        Objects of this process that results may contain: they are handed back as themselves and not as copies.
    memory : float
        Bytes that one item takes beside what this process has; 0 for as many as this process has.

    Raises
    ------
    Exception
        Whatever the function raises, of the first item for which it does.
    """
    processes = min(usable(), len(items))
    if processes > 1:
        return_freed_memory()
        processes = min(processes, _affordable(memory))
    if processes < 2 or not _can_copy():
        return [function(item) for item in counted(items)]
    numbers = _numbers(len(items))
    children: dict[int, int] = {}
    try:
        for _ in range(processes):
            receiver, child = _copy(function, items, shared, numbers, tuple(children))
            children[receiver] = child
        found = _collected(tuple(children), shared, len(items))
    finally:
        os.close(numbers)
        for receiver, child in children.items():
            os.close(receiver)
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if len(found) < len(items):
        raise MemoryError("the system ended a process that did a part of the work; try fewer --jobs")
    results = []
    for index in range(len(items)):
        failed, value = found[index]
        if failed:
            raise value
        results.append(value)
    return results


def on_disk(compiled: Any) -> bool:
    """Return whether numba has code of a function, perhaps of an older source, on disk; or compiles nothing at all."""
    if not hasattr(compiled, "stats"):
        return True
    return any(Path(str(compiled.stats.cache_path)).glob(f"*{compiled.py_func.__qualname__}-*.nbi"))


@contextmanager
def beside(function: Callable[[], object]) -> Iterator[None]:
    """Run a function in a copy of this process while the block runs, where there is a processor for it.

    What it returns or raises is lost: it is for what stays on disk. The block ends when both have.
    """
    if usable() < 2 or not _can_copy():
        yield
        return
    child = _fork()
    if child == 0:
        try:
            _alone()
            with watched(None):
                function()
        finally:
            os._exit(0)
    try:
        yield
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        os.waitpid(child, 0)


def _affordable(memory: float) -> int:
    """Return how many copies of so many bytes each are allowed beside this process; 0 for as many as it has."""
    mine = used_memory()
    if math.isnan(mine):
        return sys.maxsize
    return int(min(max(min(free_memory(), _memory.get() - mine), 0.0) / (memory or mine), 1e6))


def _can_copy() -> bool:
    """Return whether this process may fork: the copy would lack its other threads, but not their locks."""
    return (
        sys.platform == "linux"
        and threading.current_thread() is threading.main_thread()
        and not current_process().daemon
    )


def _numbers(count: int) -> int:
    """Return the end of a pipe from which copies read the number of their next item, 4 bytes each."""
    receiver, sender = os.pipe()
    os.write(sender, b"".join(number.to_bytes(4, "little") for number in range(count)))
    os.close(sender)
    return receiver


def _copy(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    shared: Sequence[object],
    numbers: int,
    others: Sequence[int],
) -> tuple[int, int]:
    """Fork a process that does items until none is left; return the pipe of its results, and its number."""
    receiver, sender = os.pipe()
    child = _fork()
    if child == 0:
        _work_and_leave(function, items, shared, numbers, (receiver, *others), sender)
    os.close(sender)
    return receiver, child


def _fork() -> int:
    with warnings.catch_warnings(), _no_compilation():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, whose locks a copy does not use
        return os.fork()


def _alone() -> None:
    """Make a copy end with its parent, use one processor, and keep its memory to itself."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_END_WITH_PARENT, signal.SIGKILL)
    keep_freed_memory()
    _limit.set(1)
    sys.stderr = sys.__stderr__ or sys.stderr  # a progress bar of the parent has locks of its own
    os.environ.update(dict.fromkeys(THREAD_LIMITS, "1"))


def _no_compilation() -> AbstractContextManager[Any]:
    """Return the lock of the compiler; a thread that a copy lacks must not have it."""
    compiler = sys.modules.get("numba.core.compiler_lock")
    return nullcontext() if compiler is None else compiler.global_compiler_lock


def _work_and_leave(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    shared: Sequence[object],
    numbers: int,
    others: Sequence[int],
    sender: int,
) -> NoReturn:
    """Do the work of a copy and end it, without what a process does at its end."""
    try:
        _alone()
        for other in others:
            os.close(other)
        with open(sender, "wb") as pipe:
            while number := os.read(numbers, 4):
                index = int.from_bytes(number, "little")
                with watched(_Report(pipe, index) if is_watched() else None):
                    content = _packed(index, function, items[index], shared)
                _send(pipe, content)
    finally:
        os._exit(0)


def _send(pipe: BinaryIO, content: bytes) -> None:
    pipe.write(len(content).to_bytes(8, "little"))
    pipe.write(content)
    pipe.flush()


@dataclass
class _Report:
    """Sends how much of an item is done, not too often, as a result that neither failed nor is one."""

    pipe: BinaryIO
    index: int
    last: float = 0.0

    def __call__(self, _doing: str, share: float, _until: float) -> None:
        if (now := time.monotonic()) - self.last > REPORT_INTERVAL:
            self.last = now
            _send(self.pipe, pickle.dumps((self.index, None, share)))


def _packed(index: int, function: Callable[[Item], Result], item: Item, shared: Sequence[object]) -> bytes:
    """Return number, failure and result of an item as bytes."""
    try:
        return _bytes((index, False, function(item)), shared)
    except Exception as error:
        try:
            return _bytes((index, True, error), shared)
        except Exception:
            return _bytes((index, True, RuntimeError(f"{type(error).__name__}: {error}")), shared)


def _bytes(value: object, shared: Sequence[object]) -> bytes:
    known = {id(one): place for place, one in enumerate(shared)}
    content = BytesIO()
    pickler = pickle.Pickler(content, protocol=pickle.HIGHEST_PROTOCOL)
    pickler.persistent_id = lambda one: known.get(id(one))  # type: ignore[method-assign]
    pickler.dump(value)
    return content.getvalue()


def _collected(receivers: Sequence[int], shared: Sequence[object], count: int) -> dict[int, tuple[bool, Any]]:
    """Return what copies send until the last of them ends: whether an item failed, and its result, by number."""
    content = {receiver: bytearray() for receiver in receivers}
    found: dict[int, tuple[bool, Any]] = {}
    shares = dict.fromkeys(range(count), 0.0)
    with selectors.DefaultSelector() as selector:
        for receiver in receivers:
            selector.register(receiver, selectors.EVENT_READ)
        while selector.get_map():
            for key, _ in selector.select():
                piece = os.read(key.fd, BYTES_AT_ONCE)
                if not piece:
                    selector.unregister(key.fd)
                mine = content[key.fd]
                mine += piece
                while len(mine) >= 8 and len(mine) >= 8 + (size := int.from_bytes(mine[:8], "little")):
                    with memoryview(mine) as sent:
                        index, failed, value = _value(bytes(sent[8 : 8 + size]), shared)
                    del mine[: 8 + size]
                    if failed is not None:
                        found[index] = (failed, value)
                    shares[index] = value if failed is None else 1.0
                    reached(sum(shares.values()), count)
    return found


def _value(content: bytes, shared: Sequence[object]) -> Any:
    unpickler = pickle.Unpickler(BytesIO(content))
    unpickler.persistent_load = lambda place: shared[place]  # type: ignore[method-assign]
    return unpickler.load()
