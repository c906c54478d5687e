"""How far a long computation is, and what it is doing: tasks within tasks, each a share of the one around it.

A function that takes long is a task; `stage` says what it does next and up to which share of its time that lasts. What
is called meanwhile may be a task itself: its stages are parts of the present one. It works alike where nobody watches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import TypeVar

Item = TypeVar("Item")
Advance = Callable[[int, int], None]
"""Called with (done, total)."""
Watcher = Callable[[str, float, float], None]
"""Called with what is being done, the share of everything that is done, and the share at which this stage ends."""


@dataclass(frozen=True)
class _Task:
    """A task from share `begin` to `end` of everything, in a stage from `since` to `until`; the next is at `then`."""

    watcher: Watcher
    doing: str = ""
    begin: float = 0.0
    end: float = 1.0
    since: float = 0.0
    until: float = 1.0
    then: float = 0.0

    def at(self, share: float) -> float:
        """Return which share of everything a share of this task is."""
        return self.begin + (self.end - self.begin) * share

    @property
    def inside(self) -> _Task:
        """A task within the present stage."""
        return replace(self, begin=self.since, end=self.until, then=self.since)


_task: ContextVar[_Task | None] = ContextVar("task", default=None)


@contextmanager
def watched(watcher: Watcher | None) -> Iterator[None]:
    """Tell `watcher` how far the task in this block is, and what it is doing; None: nobody."""
    token = _task.set(None if watcher is None else _Task(watcher))
    try:
        yield
    finally:
        _task.reset(token)


def is_watched() -> bool:
    """Return whether anybody watches."""
    return _task.get() is not None


@contextmanager
def task() -> Iterator[None]:
    """Make this block, or the function decorated, one task: its stages are parts of the stage in which it is called."""
    outer = _task.get()
    if outer is None:
        yield
        return
    token = _task.set(outer.inside)
    try:
        yield
    finally:
        _task.reset(token)


def stage(doing: str, until: float) -> None:
    """Say what the present task does from now on, up to which share of its time; "" is what it did before."""
    if (now := _task.get()) is None:
        return
    end = now.at(until)
    _task.set(replace(now, doing=doing or now.doing, since=now.then, until=end, then=end))
    now.watcher(doing or now.doing, now.then, end)


def reached(done: float, total: float) -> None:
    """Say how much of the present stage is done."""
    if (now := _task.get()) is not None:
        now.watcher(now.doing, now.since + (now.until - now.since) * done / max(total, 1), now.until)


def counted(items: Sequence[Item], doing: str = "") -> Iterator[Item]:
    """Yield items one by one, each a stage of one task."""
    outer = _task.get()
    try:
        if outer is not None:
            _task.set(outer.inside)
        for done, item in enumerate(items, 1):
            stage(doing, done / len(items))
            yield item
    finally:
        _task.set(outer)


def finished() -> None:
    """Say that everything is done, or stands still for what is shown now."""
    if (now := _task.get()) is not None:
        now.watcher("", 1.0, 1.0)
