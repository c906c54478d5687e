"""Reading in a child process, so that a file on which a library hangs or ends the process is refused like any other.

The HDF5 library loops for ever on some damaged files, and no handler of ours would run again. Where the system cannot
fork (Windows), reading happens in this process.
"""

from __future__ import annotations

import faulthandler
import mmap
import os
import select
import signal
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import reason
from tuner.types.records import DataError

LONGEST_LISTING = 10.0
"""Time for opening a file and listing what is in it: gigabytes take less than one."""
BYTES_A_SECOND = 2e6
"""Slowest reading of samples that is waited for: a worn disk with small compressed pieces."""


def array_from_child(
    source: str, shape: tuple[int, ...], dtype: np.dtype[Any], read: Callable[[], NDArray[Any]]
) -> NDArray[Any]:
    """Return the array that `read` gives in a child process, through memory that both have.

    Raises
    ------
    DataError
        Where reading fails, hangs or ends the child, or the array has another size.
    """
    size = int(np.prod(shape)) * dtype.itemsize
    if not hasattr(os, "fork"):
        return read()
    memory = mmap.mmap(-1, max(size, 1))
    shared: NDArray[Any] = np.frombuffer(memory, dtype, int(np.prod(shape))).reshape(shape)

    def work() -> None:
        found = read()
        if found.shape != shape:
            raise ValueError(f"an array of shape {found.shape} where {shape} was stated")
        shared[...] = found

    check_in_child(source, work, seconds=LONGEST_LISTING + size / BYTES_A_SECOND)
    return shared


def check_in_child(source: str, work: Callable[[], object], *, seconds: float | None = None) -> None:
    """Check a file in a child process, and raise what went wrong there.

    Raises
    ------
    DataError
        Where it fails, takes longer than `seconds` (by default `LONGEST_LISTING`), or ends the child.
    """
    seconds = LONGEST_LISTING if seconds is None else seconds
    if not hasattr(os, "fork"):
        work()
        return
    receiver, sender = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads: the child uses none of their locks
        child = os.fork()
    if child == 0:
        _work_and_leave(work, sender)
    os.close(sender)
    try:
        said = _until_end(receiver, seconds)
    except BaseException:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    finally:
        os.close(receiver)
    if said is None:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if said is None:
        raise DataError(
            f"{source}: reading it does not end (waited {seconds:.0f} s); is it damaged? save or export it anew"
        )
    if status:
        found = said.decode("utf-8", errors="replace") or "the library ended the process"
        raise DataError(f"{source}: cannot be read: {found}; is it damaged? save or export it anew")


def _work_and_leave(work: Callable[[], object], sender: int) -> None:
    """Do the work of the child and end it, without what a process does at its end."""
    code = 1
    try:
        faulthandler.disable()  # the parent says that it crashed
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        work()
        code = 0
    except BaseException as error:
        os.write(sender, reason(error).encode("utf-8", errors="replace")[:4000])
    finally:
        os._exit(code)


def _until_end(receiver: int, seconds: float) -> bytes | None:
    """Return what the child says before it ends; None where it does not end in time."""
    said, end = b"", time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        ready, _, _ = select.select([receiver], [], [], left)
        if ready:
            piece = os.read(receiver, 4096)
            if not piece:
                return said
            said += piece
    return None
