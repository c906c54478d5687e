"""Rows that a logger writes in place of samples it does not have: every axis of a sensor exactly zero.

No accelerometer at rest or in a vehicle reads exactly zero on all axes at once, nor does a gyroscope whose usual
reading is far from zero. Where the usual reading is near zero, such rows stay: they may be samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray
from models.robust import normal_sd
from tuner.readers.bad_rows import BadRows, LogRows, expect_few

FAR_FROM_ZERO = 20.0
"""Median of an axis in sds of its noise, or steps of its quantizer, from which zero is no reading of it."""
MAX_SHARE = 0.25
"""Share of such rows above which a file is refused: between the samples that are left, too much is unknown."""
CHECKED_SAMPLES = 20_000
"""Samples from which the usual reading and its noise are taken."""


def without_placeholders(
    groups: Mapping[str, NDArray[Any]],
    valid: BoolArray | None,
    notes: list[str],
    bad: list[BadRows],
    *,
    within: LogRows,
) -> BoolArray | None:
    """Return which rows are usable, without those in which a sensor reads exactly zero on all axes.

    Parameters
    ----------
    groups : mapping of str to ndarray, shape (n, k)
        Samples of each sensor as the file has them.
    valid : ndarray of bool, shape (n,), or None
        Rows that hold numbers; None where all do.
    notes : list of str
        Notes, to which this adds.
    bad : list of BadRows
        Rows without a measurement, to which this adds.
    within : LogRows
        Which rows of the log they are.

    Raises
    ------
    DataError
        Where more than a quarter of the rows of the log are such.
    """
    count = len(next(iter(groups.values())))
    empty = np.zeros(count, bool)
    for group in groups.values():
        zero = ~group.any(axis=1)
        if zero.any() and _is_far_from_zero(group, valid):
            empty |= zero
    number = int(empty.sum())
    if not number:
        return valid
    place = f"first: data row {within.first + int(np.argmax(empty)) + 1}"
    bad.append(BadRows(number, "zero on all axes of a sensor", place, MAX_SHARE, "record again"))
    expect_few(bad, within.count)
    notes.append(f"{number} rows hold zero on all axes of a sensor ({place}): they count as missing samples")
    return ~empty if valid is None else valid & ~empty


def _is_far_from_zero(group: NDArray[Any], valid: BoolArray | None) -> bool:
    """Return whether the usual reading of an axis, zeros left out, is far from zero."""
    rows = group if valid is None else group[valid]
    some = rows[:: max(1, len(rows) // CHECKED_SAMPLES)].astype(float)
    some = some[some.any(axis=1)]
    if len(some) < 2:
        return False
    change = np.abs(np.diff(some, axis=0))
    step = np.min(change, axis=0, initial=np.inf, where=change > 0.0)
    noise = np.maximum(normal_sd(change, axis=0) / np.sqrt(2.0), step)
    return bool(np.any(np.abs(np.median(some, axis=0)) > FAR_FROM_ZERO * noise))
