"""`tuner` and `python -m tuner`: the command line, and how a request to end is answered while it is imported."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import NoReturn


def leave(number: int, _frame: FrameType | None) -> NoReturn:
    """End the process at once, without temporary files: nothing is at work that could end by itself."""
    remove = getattr(sys.modules.get("tuner.formats.files"), "remove_unfinished", None)
    if remove is not None:  # loaded whole: before, nothing was written
        remove()
    interrupted = number == signal.SIGINT
    os.write(2, b"\ntuner: interrupted\n" if interrupted else b"\ntuner: terminated\n")
    os._exit(130 if interrupted else 143)


def start() -> None:
    """Run the command line; importing it takes half a second, in which Ctrl-C must not end in a traceback."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
    from tuner.cli import main

    main()


if __name__ == "__main__":
    start()
