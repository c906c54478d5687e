"""The one verdict on a result: for what it can be used, and why not for more."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Use(StrEnum):
    """What a result can be used for; of each group of words the better ones first."""

    USABLE = "usable"
    USABLE_EXCEPT = "usable except"
    DO_NOT_USE = "do not use"
    HONEST = "honest"
    TOO_SHORT = "too short to judge"
    PESSIMISTIC = "pessimistic"
    OPTIMISTIC = "optimistic"
    NOTHING_CONTRADICTS = "nothing contradicts"
    EXPLAINED = "causes found"
    NOT_EXPLAINED = "not explained"
    BETTER = "better"
    NOT_WORSE = "not worse"
    DIFFERENT = "different"
    WORSE = "worse"

    @property
    def good(self) -> bool:
        """Whether this is the word of an answer without reservation; else ``--strict`` ends with exit status 1."""
        return self in GOOD


GOOD = (Use.USABLE, Use.HONEST, Use.NOTHING_CONTRADICTS, Use.EXPLAINED, Use.BETTER, Use.NOT_WORSE)
"""Words of answers without reservation."""


@dataclass(frozen=True)
class Reason:
    """Why a result cannot be used for more than `use`: one sentence with its numbers."""

    use: Use
    text: str


@dataclass(frozen=True)
class Judgement:
    """The verdict on a result.

    Attributes
    ----------
    use : Use
        What it can be used for.
    reasons : tuple of str
        Why not for more, the gravest first; of a good verdict what it rests on.
    """

    use: Use
    reasons: tuple[str, ...] = ()

    @property
    def good(self) -> bool:
        """Whether the verdict has no reservation."""
        return self.use.good

    @property
    def text(self) -> str:
        """The verdict with all its reasons, in one sentence."""
        if not self.reasons:
            return f"{self.use}"
        return f"{self.use}: {'; '.join(self.reasons)}"


def judged(best: Use, reasons: Iterable[Reason]) -> Judgement:
    """Return the verdict that all reasons allow: the gravest use among them, with the gravest reasons first.

    Parameters
    ----------
    best : Use
        The verdict without any reason.
    reasons : iterable of Reason
        Uses of the same group as `best`.
    """
    order = list(Use)
    found = sorted(reasons, key=lambda one: -order.index(one.use))
    use = found[0].use if found and order.index(found[0].use) > order.index(best) else best
    return Judgement(use, tuple(dict.fromkeys(one.text for one in found)))
