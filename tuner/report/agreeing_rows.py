"""Axes whose numbers agree share a row of a table."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, Self, TypeVar


class AxesRow(Protocol):
    """A row of a table, of one axis or of several."""

    def agrees(self, other: Self) -> bool:
        """Whether all numbers of both may be the same."""

    def joined(self, other: Self) -> Self:
        """Return the row of the axes of both."""


Row = TypeVar("Row", bound=AxesRow)


def joined_rows(singles: Iterable[Row]) -> list[Row]:
    """Return rows of single axes with those that all agree with one another joined, in the order of the axes."""
    groups: list[list[Row]] = []
    rows: list[Row] = []
    for single in singles:
        at = next((i for i, group in enumerate(groups) if all(single.agrees(one) for one in group)), None)
        if at is None:
            groups.append([single])
            rows.append(single)
        else:
            groups[at].append(single)
            rows[at] = rows[at].joined(single)
    return rows
