"""A note on a run of a filter that names a cause: it stands beside the verdict."""

from __future__ import annotations

from collections.abc import Iterable

from tuner.types.one_line import printable


class NamedCause(str):
    """A note in four parts: what and where, how sure that is, what it changes, what was done or is to be done."""

    __slots__ = ()

    @classmethod
    def of(cls, what: str, certainty: str, effect: str, done: str) -> NamedCause:
        """Return the note; `certainty` is ``certain`` or ``likely``, with the reason where it has one."""
        return cls(printable(f"{what} ({certainty}): {effect}; {done}"))


def one_line(notes: Iterable[str]) -> tuple[str, ...]:
    """Return notes as printable lines; a named cause is one already."""
    return tuple(note if isinstance(note, NamedCause) else printable(note) for note in notes)


def separated(notes: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return the named causes among notes, as sentences, and the other notes."""
    causes, others = [], []
    for note in notes:
        if isinstance(note, NamedCause):
            causes.append(f"{note[:1].upper()}{note[1:]}")
        else:
            others.append(note)
    return causes, others
