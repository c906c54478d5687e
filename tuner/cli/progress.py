"""Long work shows where it is, on standard error; standard output stays free for results."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

Advance = Callable[[int, int], None]
"""Called with (done, total)."""


@dataclass(frozen=True)
class Messages:
    """Messages and progress bars for a person; silent where `quiet`."""

    quiet: bool = False

    def say(self, text: str) -> None:
        """Print one message on standard error."""
        if not self.quiet:
            sys.stderr.write(text + "\n")
            sys.stderr.flush()

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
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, transient=True) as progress:
            task = progress.add_task(title, total=None)

            def advance(done: int, total: int) -> None:
                progress.update(task, completed=done, total=total)

            yield advance
