"""From stamps as logged to an even time base: order, duplicates, interval, gaps.

A stamp is modelled as t_i = a + p k_i + e_i: p is the interval, k_i the number of the sample since the start
(it jumps where samples are missing) and e_i the stamping error (rounding, jitter). What is found:

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
    A step over 1.5 p plus the slack of the stamping error holds round(step/p) − 1 missing samples. Where the
    slack is not small against p the step is measured between medians of nine stamps on either side, so that
    one late stamp is not a gap.
bridges
    Gaps of at most `BRIDGE` samples are filled by linear interpolation as long as all of them together are at
    most `BRIDGED_SHARE` of the samples; every other gap ends a segment. A bridge of g samples changes the sum
    of white samples around it: the estimate of white density N rises by at most Σ(g + g²/2)/(2n) at long
    cluster times and falls by at most Σ(g + 1)/(2n) at the shortest (n samples, first order).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tuner.records import DataError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

BRIDGE = 5
"""Longest gap that is bridged, samples."""
BRIDGED_SHARE = 0.01
"""Largest share of all samples that may come from bridges."""
SHORTEST = 3
"""Samples that one Allan point needs; shorter segments are left out."""

_BATCHED = 0.01
_DISORDERED = 0.10
_WINDOW = 9
_BATCHES = 32


@dataclass(frozen=True)
class Timebase:
    """Where the rows of a log lie on an even grid.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time of each sample, s, in the clock of the stamps; even within a segment.
    interval : float
        Sampling interval, s.
    segments : tuple of (start, stop)
        Sample ranges without a gap, at least `SHORTEST` long.
    rows : ndarray of int, shape (n,), or None
        Rows of the log that are kept, in the order of time; None where all are, as they stand.
    positions : ndarray of int, shape (n,), or None
        Sample number of each kept row; None where no gap was bridged (N = n).
    duplicates, disordered, gaps, missing, bridged : int
        Rows dropped, rows out of order, gaps, samples missing in them, samples made by bridges.
    jitter : float
        Robust sd of the stamping error between neighbours, s.
    bias : (float, float)
        Bounds of the relative bias of white density N from bridges (lowest, highest).
    wander : float
        Largest distance of a stamp from the even grid of its segment, s.
    left_out : int
        Samples in segments too short to use.
    """

    t: FloatArray
    interval: float
    segments: tuple[tuple[int, int], ...]
    rows: IntArray | None = None
    positions: IntArray | None = None
    duplicates: int = 0
    disordered: int = 0
    gaps: int = 0
    missing: int = 0
    bridged: int = 0
    jitter: float = 0.0
    bias: tuple[float, float] = (0.0, 0.0)
    wander: float = 0.0
    left_out: int = 0

    def regrid(self, column: FloatArray) -> FloatArray:
        """Return a column of the log on the grid, shape (N,); bridges are linear interpolations."""
        kept = column if self.rows is None else column[self.rows]
        if self.positions is None:
            return kept
        return np.interp(np.arange(len(self.t)), self.positions, kept)

    def notes(self) -> tuple[str, ...]:
        """Return every repair in words, with its count."""
        p = self.interval
        said = []
        if self.disordered:
            said.append(f"{self.disordered} rows were out of order and were sorted by time")
        if self.duplicates:
            said.append(f"{self.duplicates} duplicate rows were dropped")
        if self.gaps:
            said.append(f"{self.gaps} gaps with {self.missing} missing samples ({self.missing * p:.6g} s)")
        if self.bridged:
            low, high = self.bias
            said.append(
                f"{self.bridged} missing samples were bridged by linear interpolation (gaps up to {BRIDGE} "
                "samples); "
                f"this biases white density N by no more than {100 * low:+.3g} .. {100 * high:+.3g} %"
            )
        if self.left_out:
            said.append(
                f"{self.left_out} samples lie in pieces shorter than {SHORTEST} samples and are not used"
            )
        if self.jitter > 0.05 * p:
            said.append(
                f"stamps scatter by {self.jitter:.3g} s (sd); samples are taken as even at {1 / p:.9g} Hz"
            )
        if self.wander > 10 * max(p, self.jitter):
            said.append(f"stamps wander by up to {self.wander:.3g} s from even sampling at {1 / p:.9g} Hz")
        return tuple(said)


def even_timebase(count: int, interval: float, valid: BoolArray | None = None) -> Timebase:
    """Return the time base of rows without stamps: sample i at i · interval; rows not `valid` are missing."""
    if valid is None or valid.all():
        return _on_grid(
            interval * np.arange(count, dtype=float), interval, np.zeros(max(count - 1, 0), np.int64)
        )
    rows = np.flatnonzero(valid)
    _require(len(rows))
    base = _on_grid(interval * rows.astype(float), interval, np.diff(rows) - 1)
    return replace(base, rows=rows)


def stamped_timebase(
    stamps: FloatArray,
    *,
    valid: BoolArray | None = None,
    equal: Callable[[IntArray, IntArray], BoolArray] | None = None,
) -> Timebase:
    """Return the time base that explains `stamps`.

    Parameters
    ----------
    stamps : ndarray, shape (n,)
        Stamps, s, counted from about the first one (large offsets cost digits).
    valid : ndarray of bool, shape (n,), optional
        False for rows that count as missing.
    equal : callable, optional
        ``equal(i, j)`` tells which pairs of rows hold equal values; without it no rows do.

    Raises
    ------
    DataError
        Fewer than three usable rows, a constant clock, or a clock that runs backwards.
    """
    rows: IntArray | None = None
    usable = np.isfinite(stamps) if valid is None else valid & np.isfinite(stamps)
    if not usable.all():
        rows = np.flatnonzero(usable)
    t = stamps if rows is None else stamps[rows]
    _require(len(t))
    t, rows, disordered = _sorted(t, rows)
    t, rows, duplicates, batch = _unique(t, rows, equal)
    _require(len(t))
    interval, missing = _interval_and_gaps(t, batch)
    base = _on_grid(t, interval, missing)
    return replace(base, rows=rows, disordered=disordered, duplicates=duplicates)


def _require(count: int) -> None:
    if count < SHORTEST:
        msg = f"only {count} usable samples: one Allan point needs {SHORTEST}; record longer"
        raise DataError(msg)


def _sorted(t: FloatArray, rows: IntArray | None) -> tuple[FloatArray, IntArray | None, int]:
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


def _unique(
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


def _interval_and_gaps(t: FloatArray, batch: float) -> tuple[float, IntArray]:
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
    slack = resolution if scatter <= 2.0 * resolution else 4.0 * scatter
    for _ in range(3):
        candidates = np.flatnonzero(step > 1.5 * interval + slack)
        lost = step[candidates] if slack < 0.2 * interval else _median_steps(t, candidates, interval)
        missing[:] = 0
        missing[candidates] = np.maximum(np.rint(lost / interval) - 1, 0)
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
            shown = np.abs(step - np.median(step)) > 0.5 * unit
            return unit if shown.mean() > 1e-3 else 0.0
    return 0.0


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


def _slope(number: IntArray, t: FloatArray) -> float:
    x = number - number.mean()
    return float(x @ t) / float(x @ x)


def _median_steps(t: FloatArray, candidates: IntArray, interval: float) -> FloatArray:
    """Return the steps of the clock after each candidate row between medians on either side, shape (m,)."""
    reach = np.arange(_WINDOW)
    edges = np.concatenate(([-1], candidates, [len(t) - 1]))
    low, high = edges[:-2, None] + 1, edges[2:, None]
    before = np.maximum(candidates[:, None] - reach, low)
    after = np.minimum(candidates[:, None] + 1 + reach, high)
    detrended: FloatArray = (
        np.median(t[after] - interval * after, axis=1)
        - np.median(t[before] - interval * before, axis=1)
        + interval
    )
    return detrended


def _on_grid(t: FloatArray, interval: float, missing: IntArray) -> Timebase:
    """Return the time base of ordered stamps with a known interval and known gaps."""
    at = np.flatnonzero(missing)
    size = missing[at]
    short = size <= BRIDGE
    bridged = int(size[short].sum())
    if bridged > BRIDGED_SHARE * len(t):
        short, bridged = np.zeros_like(short), 0
    number = np.concatenate(([0], np.cumsum(missing + 1)))
    ends = at[~short] + 1
    starts = np.concatenate(([0], ends))
    stops = np.concatenate((ends, [len(t)]))
    jitter = 1.4826 * float(np.median(np.abs(np.diff(t) - interval * (missing + 1)))) / np.sqrt(2.0)

    grid: list[FloatArray] = []
    segments: list[tuple[int, int]] = []
    wander, left_out, filled = 0.0, 0, 0
    floor = -np.inf
    for start, stop in zip(starts, stops, strict=True):
        count = int(number[stop - 1] - number[start]) + 1
        offsets = t[start:stop] - interval * (number[start:stop] - number[start])
        begin = max(float(np.median(offsets)), floor)
        wander = max(wander, float(np.abs(offsets - begin).max()))
        grid.append(begin + interval * np.arange(count, dtype=float))
        floor = float(grid[-1][-1]) + 0.5 * interval
        if count >= SHORTEST:
            segments.append((filled, filled + count))
        else:
            left_out += count
        filled += count
    if not segments:
        msg = f"no piece of the log without a gap holds {SHORTEST} samples: one Allan point needs them"
        raise DataError(msg)
    positions = None
    if bridged:
        inserted = np.zeros(len(missing), np.int64)
        inserted[at[short]] = size[short]
        positions = np.concatenate(([0], np.cumsum(inserted + 1)))
    g = size[short]
    return Timebase(
        t=np.concatenate(grid) if len(grid) > 1 else grid[0],
        interval=interval,
        segments=tuple(segments),
        positions=positions,
        gaps=len(at),
        missing=int(size.sum()),
        bridged=bridged,
        jitter=float(jitter),
        bias=(-float((g + 1).sum()) / (2 * len(t)), float((g + g * g / 2).sum()) / (2 * len(t))),
        wander=wander,
        left_out=left_out,
    )
