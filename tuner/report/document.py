"""An answer before it is rendered: sentences and tables in their order, and which of them a full screen may lose."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rich.table import Table

NEXT = "Next: tuner "
"""How the line of a command to paste begins."""


@dataclass(frozen=True)
class Document:
    """What a command answers.

    Attributes
    ----------
    parts : tuple of Table or str
        What is said in any case, in its order. A sentence is not parted into lines here.
    remarks : tuple of str
        Sentences behind these, the most important first: a screen shows as many as it has room for.
    end : tuple of str
        What is said last, in any case.
    more : tuple of Table or str
        What ``--verbose``, pages and notebooks add to it.
    beyond : str
        What that is, in a few words.
    spare : tuple of sequences of (Table or str, Table or str)
        Parts that a screen without room for all shows in a shorter form, or not (""), the least needed first.
    """

    parts: tuple[Table | str, ...]
    remarks: tuple[str, ...] = ()
    end: tuple[str, ...] = ()
    more: tuple[Table | str, ...] = ()
    beyond: str = "all tables"
    spare: tuple[Sequence[tuple[Table | str, Table | str]], ...] = ()

    @property
    def whole(self) -> tuple[Table | str, ...]:
        """All that is said of the result, where no screen limits it."""
        return (*self.parts, *self.remarks, *self.more)

    def then(self, *command: str) -> Document:
        """Return the answer with the command of `tuner` that follows from it, to paste as it is."""
        return replace(self, end=(*self.end, f"{NEXT}{shlex.join(command)}"))

    def shortened(self, count: int) -> Document:
        """Return the answer with the first groups of spare parts left out or shortened."""
        parts = list(self.parts)
        for group in self.spare[:count]:
            for old, new in group:
                parts = [new if part is old else part for part in parts]
        return replace(self, parts=tuple(part for part in parts if part != ""))

    def last_line(self, left_out: int) -> str:
        """Return what is not on the screen and how it is seen; empty where nothing is left."""
        rest = f"{left_out} more remark{'s' * (left_out > 1)}" if left_out else ""
        said = " and ".join(part for part in (rest, self.beyond if self.more else "") if part)
        return f"{sentence(said)}: --verbose" if said else ""


def sentence(text: str) -> str:
    """Return a text as a sentence begins."""
    return f"{text[:1].upper()}{text[1:]}"


def document(
    parts: Iterable[Table | str],
    remarks: Iterable[str] = (),
    end: Iterable[str] = (),
    more: Iterable[Table | str] = (),
    *,
    beyond: str = "all tables",
    spare: Iterable[Sequence[tuple[Table | str, Table | str]]] = (),
) -> Document:
    """Return an answer of these contents; empty sentences are left out."""
    said, rest, last = ([one for one in content if one != ""] for content in (parts, remarks, end))
    return Document(
        tuple(said),
        tuple(map(str, rest)),
        tuple(map(str, last)),
        tuple(more),
        beyond,
        tuple(spare),
    )
