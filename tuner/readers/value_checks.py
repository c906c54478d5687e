"""Single readings that no sensor makes: far from their neighbours, which agree with one another.

A broken cell or a glitch of the bus stands alone; what a sensor feels does not: it moves several axes at once, and its
filter spreads it over several samples. Smaller outliers are the diagnosis's subject (`tuner.diagnosis`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray, IntArray
from models.robust import normal_sd
from tuner.readers.bad_rows import BadRows, LogRows, expect_few

SPIKE_DISTANCE = 200.0
"""Distance from the neighbours, in noise sds and in spreads of the neighbours, that no reading has: normal noise ends
at 7, the largest outliers that sensors make are at some 50, and a broken cell begins at 1000."""
MOVED_DISTANCE = 20.0
"""Distance in a second column from which a row is one in which the unit moved."""
SURE_DISTANCE = 1e5
"""Distance of a broken row: the whole range of a consumer gyroscope, 2000 deg/s, is 4e4 noise sds."""
SLOW_INTERVAL = 0.11
"""Interval, s, from which a motion can lie between two samples: hands move a unit within some tenths of a second."""
NEIGHBOURS_EACH_SIDE = 3
"""Samples on either side that say where a sample should be."""
MAX_SPIKE_SHARE = 0.01
"""Share of such rows above which a file is refused."""
ROWS_AT_ONCE = 1 << 16
"""Rows treated at a time, so that memory stays bounded."""
NOISE_SAMPLES = 20_000
"""Steps from which the noise is taken: its median is then known to 1 %."""

MIN_SHARE_ON_CODES = 0.9
"""Least share of samples on values that occur more than once, which are then the codes of a quantizer: samples of a
float log repeat only where they are clipped."""
WELL_DITHERED = 0.35
"""Sd in steps from which the variance of the codes is no less than that of the noise, wherever the mean lies."""
QUANTIZER_SAMPLES = 1 << 16
"""Samples from which a limiting quantizer is seen."""
QUANTIZER_LAGS = (1, 8, 64)
"""Distances of samples that are compared: filtered noise moves little from one sample to the next."""
MIN_FAR_SHARE = 0.0043
"""Share of such pairs two steps or more apart, the least that normal noise of `WELL_DITHERED` steps has (its mean in
the middle between two codes; 0.0117 at a code). Less noise than 0.3 steps has less, wherever its mean lies."""
MAX_LEVELS = 1000
"""Values among which a step is looked for: an axis that a quantizer limits moves by drift alone."""


def without_spikes(
    groups: Mapping[str, NDArray[Any]],
    axes: Sequence[str],
    valid: BoolArray | None,
    notes: list[str],
    bad: list[BadRows],
    *,
    within: LogRows,
    interval: float,
) -> BoolArray | None:
    """Return which rows are usable, without those of single readings that no sensor makes.

    Parameters
    ----------
    groups : mapping of str to ndarray, shape (n, k)
        Samples of each sensor as the file has them.
    axes : sequence of str
        Names of all columns in order.
    valid : ndarray of bool, shape (n,), or None
        Rows that hold numbers; None where all do.
    notes : list of str
        Notes, to which this adds.
    bad : list of BadRows
        Rows without a measurement, to which this adds.
    within : LogRows
        Which rows of the log they are.
    interval : float
        Of the samples, s: in slow logs a short motion is a single reading.

    Raises
    ------
    DataError
        Where more than 1 % of the rows of the log are such.
    """
    count = len(next(iter(groups.values())))
    rows = np.arange(count) if valid is None else np.flatnonzero(valid)
    columns = [group[:, j] for group in groups.values() for j in range(group.shape[1])]
    chosen = columns if valid is None else [column[rows] for column in columns]
    found = [rows[at] for at in spikes(chosen, slow=interval > SLOW_INTERVAL)]
    every = np.unique(np.concatenate(found)) if found else np.zeros(0, np.int64)
    if not len(every):
        return valid
    axis, column, mine = next((a, c, f) for a, c, f in zip(axes, columns, found, strict=True) if len(f))
    place = f"first: {axis} {column[mine[0]]:.4g} in data row {within.first + mine[0] + 1}"
    what = f"a reading more than {SPIKE_DISTANCE:g} noise sds from its neighbours"
    off = np.abs(column - np.nanmean(column)) / max(float(np.ptp(column[rows])), 1e-300)
    cure = "remove them"
    if np.mean(off[rows] > 0.25) > 1.0 - MAX_SPIKE_SHARE:
        cure = (
            f"{axis} jumps from one end of its range to the other: give its codes their sign, or leave it out"
        )
    far = {
        a: np.abs(c[f].astype(float) - np.nanmedian(c))
        for a, c, f in zip(axes, columns, found, strict=True)
        if len(f)
    }
    bad.append(BadRows(len(every), what, place, MAX_SPIKE_SHARE, cure, far))
    expect_few(bad, within.count)
    notes.append(f"{len(every)} rows hold {what} ({place}): they count as missing samples")
    usable = np.ones(count, bool) if valid is None else valid.copy()
    usable[every] = False
    return usable


def spikes(columns: Sequence[NDArray[Any]], *, slow: bool = False) -> list[IntArray]:
    """Return for each column the rows in which it alone has a reading that no sensor makes; columns have no gaps.

    Where several columns leave their neighbours in one row, or the log is slow, that is motion, unless one does by
    `SURE_DISTANCE`.
    """
    if not columns or len(columns[0]) < 2 * NEIGHBOURS_EACH_SIDE + 1:
        return [np.zeros(0, np.int64) for _ in columns]
    limits = [_noise(y) for y in columns]
    far = [_far(y, noise) for y, noise in zip(columns, limits, strict=True)]
    rows = np.unique(np.concatenate(far))
    if not len(rows):
        return far
    distances = np.array([_distances(y, rows, noise) for y, noise in zip(columns, limits, strict=True)])
    alone = (distances > MOVED_DISTANCE).sum(axis=0) == 1
    likely = alone & (not slow)
    return [rows[(d > SURE_DISTANCE) | ((d > SPIKE_DISTANCE) & likely)] for d in distances]


def _far(y: NDArray[Any], noise: float) -> IntArray:
    """Return rows beside which a column jumps by `SPIKE_DISTANCE` noise sds, shape (m,)."""
    found = [np.zeros(0, np.int64)]
    for start in range(0, len(y) - 1, ROWS_AT_ONCE):
        piece = y[start : start + ROWS_AT_ONCE + 1].astype(float)
        with np.errstate(over="ignore"):
            jumps = start + np.flatnonzero(np.abs(np.diff(piece)) > SPIKE_DISTANCE * noise)
        found += [jumps, jumps + 1]
    return np.unique(np.concatenate(found))


def _distances(y: NDArray[Any], rows: IntArray, noise: float) -> NDArray[np.float64]:
    """Return how far rows are from the median of their neighbours, in noise sds or spreads of these, shape (m,)."""
    reach = np.concatenate([np.arange(-NEIGHBOURS_EACH_SIDE, 0), np.arange(1, NEIGHBOURS_EACH_SIDE + 1)])
    begin = np.clip(rows, NEIGHBOURS_EACH_SIDE, len(y) - 1 - NEIGHBOURS_EACH_SIDE)
    around = begin[:, None] + reach
    near = y[np.where(around == rows[:, None], begin[:, None], around)].astype(float)
    middle = np.median(near, axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        spread = np.median(np.abs(near - middle[:, None]), axis=1)
        distance: NDArray[np.float64] = np.abs(y[rows].astype(float) - middle) / np.maximum(noise, spread)
    return distance


def limiting_step(y: NDArray[Any]) -> float | None:
    """Return the quantizer step of an axis whose noise it hides, in the unit of the samples; None where it does not.

    White noise of sd s on a step q shows as s² + q²/12, nearly, from s = 0.35 q on; below, the variance of the codes
    depends on where between two of them the mean lies, from 0 to q²/4, and tells next to nothing about s. Whether s is
    less shows in how seldom samples are two steps apart.
    """
    some = y[:QUANTIZER_SAMPLES]
    levels, count = np.unique(some, return_counts=True)
    repeated = count > 1
    levels = levels[repeated]
    if not 2 <= len(levels) <= MAX_LEVELS or count[repeated].sum() < MIN_SHARE_ON_CODES * len(some):
        return None
    step = float(np.diff(levels).min())
    far = (
        np.mean(np.abs(some[lag:] - some[:-lag]) > 1.5 * step) for lag in QUANTIZER_LAGS if lag < len(some)
    )
    return step if all(share < MIN_FAR_SHARE for share in far) else None


def about_limiting_step(axis: str, step: float, unit: str) -> str:
    """Say what is known of the noise of an axis that its quantizer limits; how large it may be, its codes show."""
    return (
        f"{axis} is limited by its quantizer: steps of {step:.4g} {unit} hide noise below {WELL_DITHERED * step:.3g}; "
        "its white noise is known as a limit only"
    )


def _noise(y: NDArray[Any]) -> float:
    """Return the robust sd of the samples, from the steps between neighbours that differ; infinity where none do.

    Readings that merely repeat, in a fast logger or between two codes, say nothing about it.
    """
    stride = max(1, len(y) // NOISE_SAMPLES)
    with np.errstate(over="ignore"):
        step = np.abs(y[1::stride].astype(float) - y[:-1:stride].astype(float))
    moved = step[step > 0.0]
    return float(normal_sd(moved) / np.sqrt(2.0)) if len(moved) else np.inf
