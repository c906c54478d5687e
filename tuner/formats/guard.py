"""Every fault of an input becomes one printable line; no text from outside reaches a terminal unchecked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeVar

from tuner.formats.files import keep_input
from tuner.types.one_line import printable
from tuner.types.records import DataError

P = ParamSpec("P")
R = TypeVar("R")

LONGEST_REASON = 200
"""Characters that the words of a library may take in a message."""


def reason(error: BaseException) -> str:
    """Return what an error of a library says, short and printable; its kind where it says nothing."""
    return printable(str(error), longest=LONGEST_REASON) or type(error).__name__


@dataclass(frozen=True)
class input_guard:
    """Turn every error of reading an input into a `DataError` that names it and what was expected.

    Libraries raise errors of any kind for damaged files, and a file may state sizes that no memory holds. A missing
    package and an interruption pass unchanged. A command that reads a file in this block writes none over it.
    """

    source: object
    expected: str

    def __enter__(self) -> None:
        if isinstance(self.source, Path):
            keep_input(self.source)

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if not isinstance(error, Exception) or isinstance(error, DataError | ImportError):
            return
        if isinstance(error, FileNotFoundError):
            whole = error.filename == str(self.source)
            missing = "no such file" if whole else f"it lacks a file, {reason(error)}"
            raise DataError(f"{self.source}: {missing}") from None
        if isinstance(error, MemoryError):
            found = "one that states more than the memory holds; split it, or convert it anew"
        elif isinstance(error, RecursionError):
            found = "one nested too deeply"
        else:  # whatever a library raises for a damaged file
            found = f"{type(error).__name__}: {reason(error)}; is it damaged? save or export it anew"
        raise DataError(f"{self.source}: cannot be read as {self.expected}: {found}") from None


def guarded(source: object, expected: str, read: Callable[P, R]) -> Callable[P, R]:
    """Return a function of reading whose errors become `DataError`, as by `input_guard`."""

    def inner(*args: P.args, **kwargs: P.kwargs) -> R:
        with input_guard(source, expected):
            return read(*args, **kwargs)

    return inner
