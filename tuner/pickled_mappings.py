"""Read-only mappings in results can be pickled and copied, so that other processes take results and give them back."""

from __future__ import annotations

import copyreg
from types import MappingProxyType
from typing import Any


def allow_pickled_mappings() -> None:
    """Let `pickle` and `copy` make a read-only mapping again from what it holds, which they refuse by themselves."""
    copyreg.pickle(MappingProxyType, _of_mapping)


def _of_mapping(mapping: MappingProxyType[Any, Any]) -> tuple[Any, ...]:
    return _read_only, (dict(mapping),)


def _read_only(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)
