"""Largest memory of a command and of all processes that it starts, pages that several of them share counted once."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path

INTERVAL = 0.1
"""Time between two looks, s: stages of a long log last seconds."""


def processes(number: int) -> list[int]:
    """Return a process and all that it has started, and these, by their numbers."""
    found = [number]
    with contextlib.suppress(OSError):  # it ended meanwhile
        for thread in Path(f"/proc/{number}/task").iterdir():
            for child in (thread / "children").read_text().split():
                found += processes(int(child))
    return found


def proportional_size(number: int) -> float:
    """Return the memory of a process, MB, each page divided by the processes that share it; 0 of one that has ended."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{number}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return float(line.split()[1]) / 1e3
    return 0.0


class LargestMemory:
    """Watches a process while the block runs: `found` is the largest sum of sizes, MB."""

    def __init__(self, number: int) -> None:
        self.found = 0.0
        self._number = number
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> LargestMemory:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(INTERVAL):
            self.found = max(self.found, sum(map(proportional_size, processes(self._number))))
