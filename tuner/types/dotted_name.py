"""Names of two parts with a dot between, as files and messages have them."""

from __future__ import annotations

from dataclasses import astuple
from typing import Any, ClassVar, Self


class DottedName:
    """Base of a dataclass of two texts that is written ``FIRST.SECOND``; the second may hold dots itself.

    Raises
    ------
    ValueError
        Where one of the two is empty, or the first holds a dot.
    """

    kind: ClassVar[str]
    """What it names and how it is written, for messages."""

    def __post_init__(self) -> None:
        first, second = _parts(self)
        if not first or not second or "." in first:
            raise ValueError(f"{self.kind}, got '{self}'")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return what a text names."""
        first, _, second = text.partition(".")
        make: Any = cls
        name: Self = make(first, second)
        return name

    def __str__(self) -> str:
        return ".".join(_parts(self))


def _parts(name: Any) -> tuple[str, str]:
    first, second = astuple(name)
    return first, second
