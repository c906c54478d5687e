"""Long work shows where it is, on standard error; standard output stays free for results."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

from tuner.formats.guard import printable
from tuner.jobs import Advance, watched

LINE_INTERVAL = 10.0
"""Time between lines on progress, s: a minute of a log file holds six."""
SHOWN_AFTER = 2.0
"""Time after which a loop shows how long it takes, s."""


@dataclass(frozen=True)
class Messages:
    """Messages and progress bars for a person; silent where `quiet`."""

    quiet: bool = False

    def say(self, text: str) -> None:
        """Print one message on standard error."""
        if not self.quiet:
            sys.stderr.write(printable(text) + "\n")
            sys.stderr.flush()

    @contextmanager
    def steps(self) -> Iterator[None]:
        """Show a bar with the time left for every loop in this block that lasts longer than `SHOWN_AFTER`.

        Nothing is shown where quiet, or where no person looks.
        """
        console = Console(stderr=True)
        if self.quiet or not console.is_terminal:
            yield
            return
        bar = _LateBar(console)
        try:
            with watched(bar):
                yield
        finally:
            bar.end()

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Silence what is logged, too, where quiet."""
        log = logging.getLogger("tuner")
        before = log.level
        if self.quiet:
            log.setLevel(logging.ERROR)
        try:
            yield
        finally:
            log.setLevel(before)

    @contextmanager
    def bar(self, title: str) -> Iterator[Advance | None]:
        """Yield a callback that moves a progress bar (None where quiet, or where no person looks)."""
        console = Console(stderr=True)
        if self.quiet or not console.is_terminal:
            yield None
            return
        with watched(None), Progress(*_columns(), console=console, transient=True) as progress:
            task = progress.add_task(title, total=None)

            def advance(done: int, total: int) -> None:
                progress.update(task, completed=done, total=total)

            yield advance

    @contextmanager
    def count(self, things: str) -> Iterator[Advance | None]:
        """Yield a callback that moves a bar, or that prints lines with the time left where no person looks."""
        if self.quiet:
            yield None
            return
        with self.bar(things) as advance:
            yield advance or _Lines(self, things)


def _columns() -> tuple[ProgressColumn, ...]:
    return (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )


class _LateBar:
    """A bar that appears when a loop has lasted for a while, and goes when it ends."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._begin = 0.0
        self._progress: Progress | None = None

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done == 0 or self._begin == 0.0:
            self._begin = now
        if done >= total:
            self.end()
        elif self._progress is None and now - self._begin > SHOWN_AFTER:
            self._progress = Progress(*_columns(), console=self._console, transient=True)
            self._progress.start()
            self._progress.add_task("working", total=total)
        if self._progress is not None:
            self._progress.update(self._progress.task_ids[0], completed=done, total=total)

    def end(self) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()
        self._progress, self._begin = None, 0.0


class _Lines:
    """Says how much is done and how long the rest will take, at most every ten seconds."""

    def __init__(self, messages: Messages, things: str) -> None:
        self._messages, self._things = messages, things
        self._start = self._last = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done == 0 or (now - self._last < LINE_INTERVAL and done < total):
            return
        self._last = now
        left = (now - self._start) * (total - done) / done
        rest = f", about {left:.0f} s left" if done < total else ""
        self._messages.say(f"{done} of {total} {self._things}{rest}")
