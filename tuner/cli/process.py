"""Surroundings of a command: closed or limited output streams, signals that end it, a place for compiled code."""

from __future__ import annotations

import math
import os
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import models
from tuner.formats.files import WRITING, remove_unfinished, temporary_place

ANSWER_TIME = 0.5
"""Time in which what runs must answer a request to end, s: then the process ends all the same."""
REQUESTS = {
    int(getattr(signal, name)): status
    for name, status in (("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 143))
    if hasattr(signal, name)
}
"""Requests to end, with the exit status that each leads to."""
ANSWERS = {130: "interrupted", 143: "terminated"}
"""What is said of them."""


WITHOUT_BAR = b"\r\x1b[2K\x1b[?25h"
"""What clears the line of a terminal and shows the cursor, which a progress bar hides."""


class Terminated(BaseException):
    """A request to end was received; unlike an error it passes every handler, and temporary files are removed."""


ENDS = (KeyboardInterrupt, Terminated)


@contextmanager
def termination() -> Iterator[None]:
    """Turn a request to end (SIGTERM, and SIGHUP where it exists) into `Terminated`, and see that it is answered.

    Python hands over a signal between two of its own steps. Compiled code and a wait for threads have none: where the
    block has not ended `ANSWER_TIME` after a request, a second thread removes temporary files and ends the process. So
    it is where Python drops the exception as it came in a destructor; that is not printed.
    """

    def end(_number: int, _frame: FrameType | None) -> NoReturn:
        raise Terminated

    handlers = {
        number: end if status == 143 else signal.default_int_handler for number, status in REQUESTS.items()
    }
    before = [
        (number, signal.signal(number, handler))
        for number, handler in handlers.items()
        if signal.getsignal(number) != signal.SIG_IGN
    ]
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    hook = sys.unraisablehook
    sys.unraisablehook = lambda found: None if isinstance(found.exc_value, ENDS) else hook(found)
    woken = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_end_what_does_not, args=(receiver,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(woken)
        sys.unraisablehook = hook
        sender.close()
        for number, handler in before:
            signal.signal(number, handler)


def _end_what_does_not(receiver: socket.socket) -> None:
    """End the process some time after a signal came through a socket, unless the socket is closed before."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, REQUESTS)  # they are for the main thread
    request: int | None = None
    deadline = math.inf
    while (left := deadline - time.monotonic()) > 0.0:
        receiver.settimeout(None if request is None else left)
        try:
            numbers = receiver.recv(64)
        except TimeoutError:
            break
        if not numbers:
            return
        requests = [number for number in numbers if number in REQUESTS]
        if request is None and requests:
            request, deadline = requests[0], time.monotonic() + ANSWER_TIME
    assert request is not None
    WRITING.acquire()
    with suppress(OSError):
        if os.isatty(2):
            os.write(2, WITHOUT_BAR)
        os.write(2, f"\n{answer(REQUESTS[request])}\n".encode())
    remove_unfinished()  # last: what still runs could write such a file again
    os._exit(REQUESTS[request])


def answer(status: int) -> str:
    """Return the last line of a process that ends on a request."""
    return f"tuner: {ANSWERS[status]}; no file is left half-written"


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
    with temporary_place(Path(tempfile.mkdtemp(prefix="tuner-kernels-"))) as folder:
        os.environ["NUMBA_CACHE_DIR"] = str(folder)
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
