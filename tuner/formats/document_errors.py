"""An entry of a document that is not what it must be: what was expected, what was found, and where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn, Self

from tuner.types.one_line import printable

MAX_SHOWN = 80
"""Characters of a value in a message."""
MAX_SHOWN_BITS = 256
"""Bits of a whole number that is shown with its digits."""


class Mismatch(ValueError):
    """An entry that is not what the document must have there; `path` leads to it from the entry being read."""

    def __init__(self, expected: str, found: str, path: tuple[str | int, ...] = ()) -> None:
        super().__init__(f"expected {expected}, got {found}")
        self.path = path

    def within(self, *path: str | int) -> Self:
        """Return the error with the keys that lead to the entry being read in front of its place."""
        self.path = (*path, *self.path)
        return self


def shown(value: object) -> str:
    """Return a value as a document has it."""
    words = {None: "null", True: "true", False: "false"}
    if value is None or isinstance(value, bool):
        return words[value]
    if isinstance(value, int) and value.bit_length() > MAX_SHOWN_BITS:
        return f"a whole number of {value.bit_length()} bits"
    return printable(repr(value), longest=MAX_SHOWN)


def place(source: str, path: Sequence[str | int]) -> str:
    """Return a place in a document as messages name it: ``mine.yaml: gnss.correlated[0].sd``."""
    steps = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    if ": " in source:  # the source names a part of a document already
        return source + steps
    return f"{source}: {steps.removeprefix('.')}" if steps else source


def refuse(expected: str, found: str, *path: str | int) -> NoReturn:
    """Raise the error of an entry that is not what it must be; `path` leads to it from the entry being read."""
    raise Mismatch(expected, found, path)
