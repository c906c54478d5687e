"""Axes that hold no noise: constant ones, and constants that slipped a few times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from tuner.types.records import Record

MIN_CHANGES = 16
"""Changes of value below which an axis is a constant that slipped, not noise: no variance is known from fewer."""
ROWS_AT_ONCE = 1 << 16
"""Rows treated at a time, so that memory stays bounded."""


def without_constant_axes(records: Sequence[Record], notes: list[str], *, keep: bool) -> list[Record]:
    """Leave out constant axes, or keep them beside others that are not; a sensor of nothing else goes."""
    live = []
    for record in records:
        moving = [j for j in range(record.y.shape[1]) if np.ptp(record.y[:, j]) > 0]
        if stuck := [
            j for j in moving if _changes(record.y[:, j]) < MIN_CHANGES < len(record) / 10 and not keep
        ]:
            moving = [j for j in moving if j not in stuck]
            shown = ", ".join(record.axes[j] for j in stuck)
            notes.append(
                f"{len(stuck)} axes that change fewer than {MIN_CHANGES} times hold no noise and were left out: {shown}"
            )
        dead = [a for j, a in enumerate(record.axes) if np.ptp(record.y[:, j]) == 0.0]
        if dead:
            handling = "kept" if keep and moving else "left out"
            notes.append(f"constant from first to last sample and {handling}: {', '.join(dead)}")
        if len(moving) == len(record.axes) or (keep and moving):
            live.append(record)
        elif moving:
            live.append(replace(record, y=record.y[:, moving], axes=tuple(record.axes[j] for j in moving)))
    return live


def _changes(y: FloatArray) -> int:
    return sum(
        int(np.count_nonzero(np.diff(y[i : i + ROWS_AT_ONCE + 1]))) for i in range(0, len(y), ROWS_AT_ONCE)
    )
