"""What a process meets beside its input: closed and foreign streams, termination, no place for compiled kernels."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import models


class Terminated(BaseException):
    """A request to end was received; unlike an error it passes every handler, and temporary files are removed."""


@contextmanager
def termination() -> Iterator[None]:
    """Turn a request to end (SIGTERM, and SIGHUP where it exists) into `Terminated`."""

    def end(_number: int, _frame: FrameType | None) -> NoReturn:
        raise Terminated

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = [
        (number, signal.signal(number, end))
        for number in numbers
        if signal.getsignal(number) == signal.SIG_DFL
    ]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def robust_streams() -> None:
    """Make both output streams usable: closed ones lead nowhere, characters they do not know become ``?``."""
    for name in ("stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


@contextmanager
def kernel_cache() -> Iterator[None]:
    """Give numba a folder for compiled kernels where neither the package nor the user has one that can be written.

    The folder lives as long as the process: kernels are then compiled at every start.
    """
    if "NUMBA_CACHE_DIR" in os.environ or _cache_is_writable():
        yield
        return
    with tempfile.TemporaryDirectory(prefix="tuner-kernels-") as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        yield


def _cache_is_writable() -> bool:
    """Return whether numba finds a place: beside the package, or in the user's folder for caches."""
    if os.access(Path(models.__file__).parent.parent, os.W_OK):
        return True
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("HOME") or os.environ.get("LOCALAPPDATA")
    if not home:
        return False
    folder = Path(home)
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK)
