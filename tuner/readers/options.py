"""What the user states beside a file, and the rate that a file states."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

STAMP = "stamp"
"""Channel with the stamps as the file has them, where a reader wants them."""
_RATE_KEYS = ("rate_hz", "rate", "fs", "sample_rate", "sample_rate_hz", "sampling_rate", "frequency_hz")


@dataclass(frozen=True)
class Options:
    """What the user states beside the file; `tried` and `requested` are of a reading tried before it is advised.

    `requested` names a sensor whose size of a count only its owner knows; `part` is begin and end of what is used, s.
    """

    rate: float | None
    unit: Mapping[str, str | None]
    scale: Mapping[str, float | None]
    columns: Mapping[str, str] | None
    constant_axes: bool = False
    assume_si: bool = False
    stamps: bool = False
    tried: bool = False
    requested: str = ""
    part: tuple[float, float] = (-math.inf, math.inf)


def stated_rate(meta: Mapping[str, Any]) -> float | None:
    """Return the rate that meta states, Hz, or None."""
    stated = (meta.get(key) for key in _RATE_KEYS)
    return next((float(v) for v in stated if isinstance(v, int | float) and v > 0), None)
