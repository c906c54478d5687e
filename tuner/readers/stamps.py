"""What stamps say of the clock: order, duplicates, interval, missing samples.

A stamp is modelled as t_i = a + p k_i + e_i: p is the interval, k_i the number of the sample since the start
(it jumps where samples are missing) and e_i the stamping error (rounding, jitter).

order
    Stamps behind an earlier one are sorted; more than 10 % of them is a clock that was reset, not disorder.
duplicates
    Of rows with one stamp and equal values the first stays. Rows with one stamp and different values are
    dropped too where they are rare (1 %); where they are the rule, the stamps are coarser than the sampling
    or written in batches, and the rows of a batch are spread at the usual interval.
interval
    Pooled least-squares slope of t on k; it starts from the median difference. If one straight line explains
    all stamps within their resolution (1 ms stamps of a 400 Hz log), nothing is missing.
gaps
    A step over 1.5 p, or over p by more than the stamping error explains, is a gap if it shifts the clock
    against the row
    number for good: a stamp that is late, with hurried ones behind it, is not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tuner.records import DataError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_BATCHED = 0.01
_DISORDERED = 0.10
_WINDOW = 32
_PATIENCE = 8
_PIECE = 100_000
_BATCHES = 32
_EVEN = 8


def in_order(t: FloatArray, rows: IntArray | None) -> tuple[FloatArray, IntArray | None, int]:
    """Return stamps in order, their rows and how many were behind an earlier stamp."""
    if (t[1:] >= t[:-1]).all():
        return t, rows, 0
    behind = np.flatnonzero(t < np.maximum.accumulate(t))
    if len(behind) > _DISORDERED * len(t):
        msg = (
            f"time runs backwards at row {behind[0] + 1} and stays behind for {len(behind)} of {len(t)} "
            "rows (a clock "
            "that was reset?): split the log there, or leave the time column out and pass --rate"
        )
        raise DataError(msg)
    order = np.argsort(t, kind="stable")
    return t[order], order if rows is None else rows[order], len(behind)


def without_duplicates(
    t: FloatArray, rows: IntArray | None, equal: Callable[[IntArray, IntArray], BoolArray] | None
) -> tuple[FloatArray, IntArray | None, int, float]:
    """Return stamps without duplicates, their rows, how many were dropped, and the length of a batch, s."""
    later = np.flatnonzero(t[1:] == t[:-1]) + 1
    if not len(later):
        return t, rows, 0, 0.0
    if len(later) == len(t) - 1:
        msg = "the time column is constant: pass the right column with --columns t=NAME, or --rate"
        raise DataError(msg)
    drop = later
    if len(later) > _BATCHED * len(t):
        at = later if rows is None else rows[later]
        before = later - 1 if rows is None else rows[later - 1]
        drop = later[equal(at, before)] if equal is not None else later[:0]
    if len(drop):
        kept = np.ones(len(t), bool)
        kept[drop] = False
        t, rows = t[kept], np.flatnonzero(kept) if rows is None else rows[kept]
    spread, length = _spread(t)
    return spread, rows, len(drop), length


def _spread(t: FloatArray) -> tuple[FloatArray, float]:
    """Return stamps with the rows of each batch spread, and the usual length of a batch, s."""
    first = np.flatnonzero(np.concatenate(([True], t[1:] != t[:-1])))
    if len(first) == len(t):
        return t, 0.0
    reach = min(_BATCHES, len(first) - 1)
    usual = float(np.median((t[first[reach:]] - t[first[:-reach]]) / (first[reach:] - first[:-reach])))
    size = np.diff(np.append(first, len(t)))
    within = np.arange(len(t)) - np.repeat(first, size)
    return t + usual * within, float(np.median(np.diff(t[first])))


def interval_and_gaps(t: FloatArray, batch: float) -> tuple[float, IntArray]:
    """Return the interval and how many samples are missing after each stamp but the last, shape (n - 1,)."""
    step = np.diff(t)
    usual = float(np.median(step))
    resolution = max(batch, _resolution(t, step))
    breaks = np.flatnonzero(step > 2.5 * usual + 2.0 * resolution) + 1
    interval, residual = _pooled_slope(t, np.concatenate(([0], breaks)))
    missing = np.zeros(len(step), np.int64)
    if np.abs(residual).max() <= max(resolution, 0.25 * interval):
        missing[breaks - 1] = np.maximum(np.rint(step[breaks - 1] / interval) - 1, 0)
        return interval, missing
    if resolution == 0.0:
        interval = usual
    scatter = 1.4826 * float(np.median(np.abs(step - usual)))
    rounded = scatter <= 2.0 * resolution
    for _ in range(3):
        excess = 0.5 * interval + resolution if rounded else max(0.5 * interval, 4.0 * scatter)
        candidates = np.flatnonzero(step > interval + excess)
        missing[:] = 0
        if len(candidates):
            missing[candidates] = _lost(t, step, candidates, interval)
        refined = _slope(np.concatenate(([0], np.cumsum(missing + 1))), t)
        if abs(refined - interval) <= 1e-9 * interval:
            break
        interval = refined
    return interval, missing


def _resolution(t: FloatArray, step: FloatArray) -> float:
    """Return the decimal step the stamps are visibly rounded to, s; 0 where rounding does not show."""
    for digits in range(7):
        unit = 10.0**-digits
        scaled = t[:4096] / unit
        if np.abs(scaled - np.rint(scaled)).max() < 1e-3:
            return unit if _rounding_shows(np.rint(step / unit)) else 0.0
    return 0.0


def _rounding_shows(step: FloatArray) -> bool:
    """Tell whether steps, in units of the resolution, vary by rounding.

    Rounded steps are m and m ± 1. At m = 1 a step of two may as well be a lost sample: rounding puts them at
    even distances, losses do not.
    """
    usual = np.median(step)
    odd = np.flatnonzero(np.abs(step - usual) == 1)
    if usual > 1:
        return bool(len(odd) > 1e-3 * len(step))
    distance = np.diff(odd)
    return len(odd) > _EVEN and bool(distance.max() <= 1.5 * distance.min() + 1)


def _pooled_slope(t: FloatArray, starts: IntArray) -> tuple[float, FloatArray]:
    """Return the common slope of t on the row number within pieces, and the residuals, shape (n,)."""
    size = np.diff(np.append(starts, len(t)))
    number = np.arange(len(t), dtype=float)
    number -= np.repeat(starts + 0.5 * (size - 1), size)
    centred = t - np.repeat(np.add.reduceat(t, starts) / size, size)
    spread = float(number @ number)
    slope = float(number @ centred) / spread if spread > 0 else float(np.median(np.diff(t)))
    centred -= slope * number
    return slope, centred


def _lost(t: FloatArray, step: FloatArray, candidates: IntArray, interval: float) -> IntArray:
    """Return how many samples are missing after each candidate row, shape (m,).

    The shift of the clock against the row number is measured between the lower quartiles of up to `_WINDOW`
    rows on either side (late stamps are more common than early ones), after the hurried stamps that follow a
    late one, and never across another candidate. A shift that is taken back within `_PATIENCE` candidates was
    a delay.
    """
    settled = np.where(step < 0.5 * interval, len(step), np.arange(len(step)))
    settled = np.minimum.accumulate(settled[::-1])[::-1]
    first = np.append(settled, len(step))[candidates + 1]
    low = np.concatenate(([0], candidates[:-1] + 1))
    high = np.append(candidates[1:], len(t) - 1)
    shift = np.empty(len(candidates))
    reach = np.arange(_WINDOW)
    for start in range(0, len(candidates), _PIECE):
        piece = slice(start, start + _PIECE)
        before = np.maximum(candidates[piece, None] - reach, low[piece, None])
        after = np.minimum(first[piece, None] + reach, high[piece, None])
        shift[piece] = _quartile(t, after, interval) - _quartile(t, before, interval)
    total = np.cumsum(np.rint(shift / interval).astype(np.int64))
    lasting = total.copy()
    for later in range(1, min(_PATIENCE, len(total))):
        lasting[:-later] = np.minimum(lasting[:-later], total[later:])
    lost: IntArray = np.maximum(np.diff(lasting, prepend=0), 0)
    return lost


def _quartile(t: FloatArray, rows: IntArray, interval: float) -> FloatArray:
    """Return the lower quartile of t - interval · row over each line of `rows`."""
    detrended = t[rows] - interval * rows
    place = rows.shape[1] // 4
    quartile: FloatArray = np.partition(detrended, place, axis=1)[:, place]
    return quartile


def _slope(number: IntArray, t: FloatArray) -> float:
    x = number - number.mean()
    return float(x @ t) / float(x @ x)
