"""Things that belong together in groups, in the order of the first of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")
K = TypeVar("K")


def grouped(every: Iterable[T], belongs: Callable[[list[T], T], bool]) -> list[list[T]]:
    """Return groups: each thing in the first one that it belongs to, or in one of its own."""
    groups: list[list[T]] = []
    for one in every:
        home = next((group for group in groups if belongs(group, one)), None)
        if home is None:
            groups.append([one])
        else:
            home.append(one)
    return groups


def gathered(pairs: Iterable[tuple[K, T]]) -> dict[K, list[T]]:
    """Return what stands behind each key of (key, thing), in the order of the first of each."""
    found: dict[K, list[T]] = {}
    for key, one in pairs:
        found.setdefault(key, []).append(one)
    return found
