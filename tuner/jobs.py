"""One function applied to several items on all processors, with the same results as on one.

Each processor gets a forked copy of this process, which shares its memory: nothing is imported or read again, and items
are not copied. Copies end with this process, and at once where it is interrupted. Where no copy can be made (in a
thread, in a daemon such as a worker of Dask, outside Linux, where libraries of the system may not survive it) the items
are done here, one after the other. Inside a copy every stage has one processor.
"""

from __future__ import annotations

import ctypes
import math
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from io import BytesIO
from mmap import mmap
from multiprocessing import active_children, current_process, get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

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
"""Time between two looks at how far the copies are, s."""
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
    from concurrent.futures import (  # loaded when used: slow to import
        FIRST_COMPLETED,
        ProcessPoolExecutor,
        wait,
    )
    from concurrent.futures.process import BrokenProcessPool

    shares = np.frombuffer(mmap(-1, 8 * len(items)))  # memory that copies do not copy
    work = _Work(function, items, shared, shares)
    others = set(active_children())
    pool = ProcessPoolExecutor(processes, get_context("fork"), _alone, (work,))
    try:
        with _forking():
            results = [pool.submit(_packed_result, index) for index in range(len(items))]
        waiting = set(results)
        while waiting:
            waiting = wait(waiting, REPORT_INTERVAL if is_watched() else None, FIRST_COMPLETED).not_done
            reached(float(np.sum(shares)), len(items))
        return [_value(one.result(), shared) for one in results]
    except BrokenProcessPool as lost:
        raise MemoryError(
            "the system ended a process that did a part of the work; try fewer --jobs"
        ) from lost
    finally:
        for child in set(active_children()) - others:
            child.kill()
        pool.shutdown()


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
    child = get_context("fork").Process(target=_quiet, args=(function,))
    with _forking():
        child.start()
    try:
        yield
    except BaseException:
        child.kill()
        raise
    finally:
        child.join()


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


@contextmanager
def _forking() -> Iterator[None]:
    """Hold the lock of the compiler while this process is copied: a thread that a copy lacks must not have it.

    A copy begins within this block, and releases its own (`_alone`).
    """
    with _compiler_lock() or nullcontext(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, whose locks a copy does not use
        yield


def _compiler_lock() -> Any:
    """Return the lock of the compiler; None where it is not loaded."""
    compiler = sys.modules.get("numba.core.compiler_lock")
    return None if compiler is None else compiler.global_compiler_lock


@dataclass(frozen=True)
class _Work:
    """What a copy finds in its memory; `shares` (items,) are written by the copies, how much of each item is done."""

    function: Callable[[Any], Any]
    items: Sequence[Any]
    shared: Sequence[object]
    shares: npt.NDArray[np.float64]


_work: ContextVar[_Work] = ContextVar("work")


def _alone(work: _Work | None) -> None:
    """Make a copy end with its parent, use one processor, and keep its memory to itself."""
    if (lock := _compiler_lock()) is not None:
        lock.release()
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_END_WITH_PARENT, signal.SIGKILL)
    keep_freed_memory()
    _limit.set(1)
    sys.stderr = sys.__stderr__ or sys.stderr  # a progress bar of the parent has locks of its own
    os.environ.update(dict.fromkeys(THREAD_LIMITS, "1"))
    if work is not None:
        _work.set(work)


def _quiet(function: Callable[[], object]) -> None:
    """Call a function in a copy, where nobody hears how far it is or what it raises."""
    _alone(None)
    with watched(None), suppress(Exception):
        function()


def _packed_result(index: int) -> bytes:
    """Return the result of an item as bytes, in which shared objects are numbers."""
    work = _work.get()
    known = {id(one): place for place, one in enumerate(work.shared)}

    def report(_doing: str, share: float, _until: float) -> None:
        work.shares[index] = share

    with watched(report if is_watched() else None):
        found = work.function(work.items[index])
    content = BytesIO()
    pickler = pickle.Pickler(content, protocol=pickle.HIGHEST_PROTOCOL)
    pickler.persistent_id = lambda one: known.get(id(one))  # type: ignore[method-assign]
    pickler.dump(found)
    work.shares[index] = 1.0
    return content.getvalue()


def _value(content: bytes, shared: Sequence[object]) -> Any:
    unpickler = pickle.Unpickler(BytesIO(content))
    unpickler.persistent_load = lambda place: shared[place]  # type: ignore[method-assign]
    return unpickler.load()
