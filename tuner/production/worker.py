"""A process that answers tasks: `python -m tuner.production.worker`, started by `tuner.production.workers`.

It reads a function and then tasks from standard input, pickled, and writes the answers to standard output, until its
input is closed. The keyboard interrupts the process that started it, which then ends this one.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import sys
import warnings
from contextlib import suppress


def serve() -> None:
    """Answer tasks until there are no more; whatever a library prints does not get among the answers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    warnings.simplefilter("ignore", RuntimeWarning)
    logging.getLogger("tuner").setLevel(logging.ERROR)
    with suppress(EOFError, BrokenPipeError):
        attempt = pickle.load(sys.stdin.buffer)
        while True:
            answer = attempt(pickle.load(sys.stdin.buffer))
            pickle.dump(answer, answers)
            answers.flush()


if __name__ == "__main__":
    serve()
