"""Long work shows where it is, on standard error; standard output stays free for results."""

from __future__ import annotations

import logging
import math
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from tuner.stages import Advance, reached, watched
from tuner.types.one_line import printable

LINE_INTERVAL = 10.0
"""Time between lines on progress, s: a minute of a log file holds six."""
SHOWN_AFTER = 1.0
"""Time after which a command shows how far it is, s: starting has taken another by then."""
BAR_WIDTH = 16
"""Columns of the bar itself; words take the rest of the line."""


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
        """Show what is done in this block and the time left, where it takes longer than `SHOWN_AFTER`.

        Nothing is shown where quiet, or where no person looks.
        """
        console = Console(stderr=True)
        if self.quiet or not console.is_terminal:
            yield
            return
        bar = _Bar(console)
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

    def count(self, things: str) -> Advance | None:
        """Return a callback that moves the bar, or prints lines with the time left where no person looks."""
        if self.quiet:
            return None
        return reached if Console(stderr=True).is_terminal else _Lines(self, things)


class _Bar:
    """What is done, how much of everything is, and how long the rest takes; gone where something else is shown."""

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)),
            BarColumn(BAR_WIDTH),
            TextColumn("{task.percentage:>3.0f} %", table_column=Column(no_wrap=True)),
            _TimeLeft(self),
            console=console,
            expand=True,
            transient=True,
            redirect_stdout=False,
        )
        self._line = self._progress.add_task("starting", total=1.0)
        self._begin = self._at = time.monotonic()
        self._share, self._until = 0.0, 1.0
        self._lock = threading.Lock()
        self._waiting: threading.Timer | None = None
        self._wait()

    def __call__(self, doing: str, share: float, until: float) -> None:
        if share >= 1.0:
            self.end()
            return
        if share > self._share:
            self._share, self._at = share, time.monotonic()
        self._until = max(until, self._share)
        self._progress.update(self._line, completed=self._share, description=doing or "working")
        self._wait()

    def _wait(self) -> None:
        """Show the bar after a while; it stays hidden where the work has ended before."""
        with self._lock:
            if self._waiting is None:
                self._waiting = threading.Timer(SHOWN_AFTER, self._show)
                self._waiting.daemon = True
                self._waiting.start()

    def _show(self) -> None:
        with self._lock:
            if self._waiting is not None:
                self._progress.start()

    def end(self) -> None:
        """Take the bar away."""
        with self._lock:
            if self._waiting is not None:
                self._waiting.cancel()
                self._waiting = None
                self._progress.stop()

    def time_left(self) -> str:
        """Return how long the rest takes if it goes on as fast as before; a stage that lasts longer slows it."""
        passed = time.monotonic() - self._begin
        slowest = passed / self._until if self._until > 0.0 else math.inf
        if self._share == 0.0:
            return f"over {_amount(slowest - passed)} left" if self._until < 1.0 else ""
        whole = max((self._at - self._begin) / self._share, slowest)
        return f"about {_amount(whole - passed)} left"


class _TimeLeft(ProgressColumn):
    """The last words of the line."""

    def __init__(self, bar: _Bar) -> None:
        super().__init__(Column(no_wrap=True))
        self._bar = bar

    def render(self, task: Task) -> Text:  # noqa: ARG002
        """Return the time left."""
        return Text(self._bar.time_left())


def _amount(seconds: float) -> str:
    """Return a time to come in words; the last seconds are not counted."""
    return f"{max(seconds, 1.0):.0f} s" if seconds < 99.5 else f"{seconds / 60.0:.0f} min"


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
        rest = f", about {_amount((now - self._start) * (total - done) / done)} left" if done < total else ""
        self._messages.say(f"{done} of {total} {self._things}{rest}")
