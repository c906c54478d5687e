"""The even time base of a log: segments, gaps, bridges.

`stamps` says which rows to keep, the interval p and how many samples are missing where. Here the rows are put
on a grid: even with interval p within a segment, each segment at its own median phase. Where stamps wander off that by
more than p, the times of a segment follow them, straight between the medians of pieces.

In a log at rest, short gaps are bridged by samples that are simulated from those beside them (`gap_bridges`) as long
as all bridges together are at most `MAX_BRIDGED_SHARE` of the samples; every other gap ends a segment. The level at a
gap is a mean of samples that thereby weigh more: the density of white noise seen at cluster times longer than that
mean rises by Σg/n (n samples, g missing in a gap), the one seen at shorter times does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import BoolArray, FloatArray, IntArray
from models.robust import normal_sd
from tuner.limits import WRONG_FACTOR
from tuner.readers.clock_change import StepChange, change_of_step
from tuner.readers.gap_bridges import bridged
from tuner.readers.timestamps import in_order, interval_and_gaps, without_duplicates
from tuner.types.records import DataError

MAX_BRIDGED_GAP = 100
"""Longest gap of a log at rest that is bridged, samples: a second without radio at 100 Hz."""
MAX_BRIDGED_SHARE = WRONG_FACTOR - 1.0
"""Largest number of bridges ÷ samples of such a log: at the longest cluster times, where white noise matters least, its
density then seems by that share larger."""
MAX_BRIDGED_IN_MOTION, MAX_SHARE_IN_MOTION = 5, 0.01
"""The same of a vehicle, by straight lines: what it did meanwhile is unknown."""
MIN_SEGMENT_SAMPLES = 3
"""Samples that one Allan point needs; shorter segments are left out."""
MAX_BROKEN_SHARE = 0.02
"""Share of rows without readings up to which they belong to the sensor: 1 % may be broken in each of two ways, and rows
of another sensor beside it are more."""
MIN_BATCHES = 32
"""Different stamps of a clock coarser than the sampling from which they give a rate: to 3 % and better."""
COARSE_CLOCK = "the clock is too coarse"
MAX_CLOCK_STEPS = 64
"""Different steps of a clock of few digits, at most: chosen to separate rounding from jitter of a fine clock."""
EQUAL_STEPS = 1e-7
"""Steps closer than this are one, s: floating point counts seconds since 1970 to 2e-7."""
_CLOCK_UNITS = sorted((*(10.0**-k for k in range(10)), *(2.0**-k for k in range(10, 46))), reverse=True)
"""Units of a clock, s: decimal places of text, and last binary places of seconds since an epoch."""
_ROUNDING_TOLERANCE = 0.15
"""Part of a unit by which stamps may miss its multiples: chosen to admit stamps of a converted unit."""
_RESOLUTION_STAMPS = 4096
"""Stamps from which the resolution is read: it is the same in all of them."""
_FINE_RESOLUTION = 1e-3
"""Resolution ÷ interval up to which rounding is too small to be called jitter."""
_MAX_STAMPS = 1 << 17
"""Stamps from which jitter and rounding are estimated: the sd is then known to 0.2 %."""


COURSE_PIECES = 600
"""Pieces of the course of the stamps: as many as a panel has pixels to show."""
_STAMPS_A_MEDIAN = 64
"""Stamps, at least, whose median shows where a clock is: to a sixth of their jitter."""
_MEDIANS_REACH = 10.0
"""Range of the medians of 600 pieces of n stamps, of chance, ÷ (jitter/√n): 1.25 times that of normal numbers."""


@dataclass(frozen=True)
class Timebase:
    """Where the rows of a log lie on an even grid.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time of each sample, s, in the clock of the stamps; even within a segment whose stamps do not wander.
    interval : float
        Sampling interval, s.
    segments : tuple of (start, stop)
        Sample ranges without a gap, at least `MIN_SEGMENT_SAMPLES` long.
    rows : ndarray of int, shape (n,), or None
        Rows of the log that are kept, in the order of time; None where all are, as they stand.
    positions : ndarray of int, shape (n,), or None
        Sample number of each kept row; None where no gap was bridged (N = n).
    duplicates, disordered, gaps, missing, bridged : int
        Rows dropped, rows out of order, gaps, samples missing in them, samples made by bridges.
    set_back : int
        How often the clock was set back: rows follow one another there.
    late : float
        By how much it still is at the end, s.
    unread : int
        Gaps that only rows without a number make: their stamps are there.
    jitter : float
        Sd of the stamping error between neighbours, s; rare late stamps left out.
    moving : bool
        Whether the log is one of a vehicle: straight lines are the bridges.
    rounding : float
        Unit that the stamps are multiples of where that shows in their steps, s; 0 for none.
    wander : float
        Largest distance of times that follow wandering stamps from even ones, s; 0 where all are even.
    left_out : int
        Samples in segments too short to use.
    change : StepChange or None
        Where the clock changes its step, so that the interval is wrong on one side.
    """

    t: FloatArray
    interval: float
    segments: tuple[tuple[int, int], ...]
    rows: IntArray | None = None
    positions: IntArray | None = None
    duplicates: int = 0
    disordered: int = 0
    set_back: int = 0
    late: float = 0.0
    gaps: int = 0
    unread: int = 0
    missing: int = 0
    bridged: int = 0
    jitter: float = 0.0
    rounding: float = 0.0
    moving: bool = False
    wander: float = 0.0
    left_out: int = 0
    change: StepChange | None = None

    def regrid(self, column: FloatArray) -> FloatArray:
        """Return a column of the log on the grid, shape (N,); straight lines stand where samples are missing."""
        kept = column if self.rows is None else column[self.rows]
        if self.positions is None:
            return kept
        return np.interp(np.arange(len(self.t)), self.positions, kept)

    def stamp_course(self, stamps: FloatArray) -> FloatArray:
        """Return how stamps, shape (n,), s, lie about the even grid, over time.

        Returns
        -------
        ndarray, shape (k, 4)
            Of up to `COURSE_PIECES` pieces: time, smallest and largest distance of a stamp from the grid, s, and the
            number of samples that are missing.
        """
        kept = stamps if self.rows is None else stamps[self.rows]
        at = self.t if self.positions is None else self.t[self.positions]
        starts = np.arange(0, len(kept), -(-len(kept) // COURSE_PIECES))
        steps = np.diff(self.t, prepend=self.t[0] - self.interval) - self.interval
        wander = np.cumsum(np.where(steps < 0.5 * self.interval, steps, 0.0))
        late = kept - at + (wander if self.positions is None else wander[self.positions])
        missing = np.zeros(len(kept))
        if self.positions is not None:
            missing[1:] = np.diff(self.positions) - 1
        smallest, largest = np.minimum.reduceat(late, starts), np.maximum.reduceat(late, starts)
        return np.column_stack([at[starts], smallest, largest, np.add.reduceat(missing, starts)])

    def bridge(self, column: FloatArray, stream: int) -> FloatArray:
        """Return the samples of axis number `stream` on the grid, shape (N,), with simulated ones in short gaps."""
        if self.positions is None or self.moving:
            return self.regrid(column)
        kept = column if self.rows is None else column[self.rows]
        return bridged(kept, self.positions, self.segments, stream)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Return what is assumed of a clock that was set back."""
        often = "once" if self.set_back == 1 else f"{self.set_back} times"
        rows = f"rows follow one another at {1.0 / self.interval:.6g} Hz, whatever their stamps"
        return (f"the clock was set back {often}: {rows}",) if self.set_back else ()

    def notes(self, *, even: bool = True) -> tuple[str, ...]:
        """Return every repair in words, with its count; `even`: whether the grid takes the place of the stamps."""
        p = self.interval
        rate = f"{1 / p:.9g} Hz"
        bridges = (
            f"lie on straight lines (gaps up to {MAX_BRIDGED_IN_MOTION} samples)"
            if self.moving
            else f"were simulated from those beside them (gaps up to {MAX_BRIDGED_GAP} samples): white noise seems "
            f"{100 * self.bridged / len(self.t):.2g} % larger at the cluster times at which drift exceeds it"
        )
        said = (
            (self.disordered > 0, f"{self.disordered} rows were out of order and were sorted by time"),
            (self.duplicates > 0, f"{self.duplicates} rows with a duplicate stamp were dropped"),
            (
                self.gaps > 0,
                f"{self.gaps} gaps with {self.missing} missing samples ({self.missing * p:.6g} s)",
            ),
            (self.bridged > 0, f"{self.bridged} missing samples {bridges}"),
            (
                self.left_out > 0,
                f"{self.left_out} samples lie in pieces shorter than {MIN_SEGMENT_SAMPLES} samples and are not used",
            ),
            (
                even and self.rounding > 0.05 * p,
                f"stamps are rounded to {self.rounding:.4g} s; samples are taken as even at {rate}",
            ),
            (
                even and self.jitter > 0.05 * p >= self.rounding,
                f"stamps scatter by {self.jitter:.3g} s (sd); samples are taken as even at {rate}",
            ),
            (
                even and self.wander > 0.0,
                f"stamps wander by up to {self.wander:.3g} s from even sampling at {rate}: times follow the stamps",
            ),
        )
        return tuple(text for is_so, text in said if is_so)


def even_timebase(
    count: int, interval: float, valid: BoolArray | None = None, *, moving: bool = False
) -> Timebase:
    """Return the time base of rows without stamps: sample i at i · interval; rows not `valid` are missing."""
    rows = np.arange(count) if valid is None else np.flatnonzero(valid)
    _require(len(rows))
    missing = np.diff(rows) - 1
    at = np.flatnonzero(missing)
    base = _on_grid(interval * rows.astype(float), interval, at, missing[at], moving=moving)
    return base if len(rows) == count else replace(base, rows=rows, unread=len(at))


def stamped_timebase(
    stamps: FloatArray,
    *,
    valid: BoolArray | None = None,
    timed: BoolArray | None = None,
    equal: Callable[[IntArray, IntArray], BoolArray] | None = None,
    resolution: float = 0.0,
    moving: bool = False,
) -> Timebase:
    """Return the time base that explains `stamps`.

    Parameters
    ----------
    stamps : ndarray, shape (n,)
        Stamps, s, counted from about the first one (large offsets cost digits).
    valid : ndarray of bool, shape (n,), optional
        False for rows that count as missing; where they are few, their stamps tell the interval all the same.
    timed : ndarray of bool, optional
        False for rows whose stamps are no time.
    equal : callable, optional
        ``equal(i, j)`` tells which pairs of rows hold equal values; without it no rows do.
    resolution : float, optional
        To what the stamps are known to be rounded, s.
    moving : bool, optional
        Whether the log is one of a vehicle.

    Raises
    ------
    DataError
        Fewer than three usable rows, a constant clock, one too coarse to give a rate, or one that runs backwards.
    """
    rows: IntArray | None = None
    usable = np.isfinite(stamps) if timed is None else timed & np.isfinite(stamps)
    if valid is not None and np.count_nonzero(~valid) > MAX_BROKEN_SHARE * len(valid):
        usable &= valid
    if not usable.all():
        rows = np.flatnonzero(usable)
    t = stamps if rows is None else stamps[rows]
    _require(len(t))
    t, rows, disordered, (back, late) = in_order(t, rows)
    t, rows, duplicates, batch = without_duplicates(t, rows, equal)
    _require(len(t))
    if batch > 0.0 and (different := round((t[-1] - t[0]) / batch) + 1) < MIN_BATCHES:
        raise DataError(
            f"{COARSE_CLOCK}: {different} different stamps in {len(t)} rows give no rate: pass --rate HZ"
        )
    interval, at, size = interval_and_gaps(t, max(batch, resolution))
    change = change_of_step(t, interval, at, size)
    if valid is not None and not (kept := valid if rows is None else valid[rows]).all():
        steps = np.ones(len(t), np.int64)
        steps[at + 1] += size
        number = np.cumsum(steps)[kept]
        rows = np.flatnonzero(kept) if rows is None else rows[kept]
        t, lost = t[kept], np.diff(number) - 1
        _require(len(t))
        at = np.flatnonzero(lost)
        size = lost[at]
    base = _on_grid(t, interval, at, size, max(batch, resolution), moving=moving)
    unread = 0 if rows is None else _unread(np.diff(rows), at, size)
    return replace(
        base,
        rows=rows,
        disordered=disordered,
        duplicates=duplicates,
        set_back=back,
        late=late,
        unread=unread,
        change=change,
    )


def _unread(ahead: IntArray, at: IntArray, size: IntArray) -> int:
    """Return how many gaps of `size` samples after kept rows `at` the rows left out fill, where `ahead` is usual."""
    between = int(np.median(ahead)) - 1
    return int(np.count_nonzero(ahead[at] - 1 - between * (size + 1) >= size))


def _require(count: int) -> None:
    if count < MIN_SEGMENT_SAMPLES:
        raise DataError(
            f"only {count} usable samples: one Allan point needs {MIN_SEGMENT_SAMPLES}; record longer"
        )


def _on_grid(
    t: FloatArray, interval: float, at: IntArray, size: IntArray, resolution: float = 0.0, *, moving: bool
) -> Timebase:
    """Return the time base of ordered stamps, rounded to `resolution`, with `size` samples missing after rows `at`."""
    longest, share = MAX_BRIDGED_GAP, MAX_BRIDGED_SHARE
    if moving:
        longest, share = MAX_BRIDGED_IN_MOTION, MAX_SHARE_IN_MOTION
    short = size <= longest
    bridged = int(size[short].sum())
    if bridged > share * len(t):
        short, bridged = np.zeros_like(short), 0
    before = np.append(0, np.cumsum(size))

    def number(rows: IntArray) -> IntArray:
        return np.asarray(rows + before[np.searchsorted(at, rows)])

    some = _some(0, len(t) - 1)
    step, whole = t[some + 1] - t[some], number(some + 1) - number(some)
    error = step - interval * whole
    rounding = rounding_of(step[whole == 1])
    jitter = _jitter(error, interval, rounding or resolution_of(t[some]))
    rounding = max(rounding, resolution)
    ends = at[~short] + 1
    grid: list[FloatArray] = []
    segments: list[tuple[int, int]] = []
    wander, left_out, filled = 0.0, 0, 0
    floor = -np.inf
    for start, stop in zip([0, *ends], [*ends, len(t)], strict=True):
        some = _some(start, stop)
        first = number(some[:1])
        count = int(number(some[-1:])[0] - first[0]) + 1
        offsets = t[some] - interval * (number(some) - first)
        late = _lateness(number(some) - first, offsets, interval + rounding, jitter, count)
        wander = max(wander, float(np.ptp(late)))
        times = late + interval * np.arange(count, dtype=float)
        grid.append(times + max(floor - float(times[0]), 0.0))
        floor = float(grid[-1][-1]) + 0.5 * interval
        if count >= MIN_SEGMENT_SAMPLES:
            segments.append((filled, filled + count))
        else:
            left_out += count
        filled += count
    if not segments:
        raise DataError(
            f"no piece of the log without a gap holds {MIN_SEGMENT_SAMPLES} samples: one Allan point needs them"
        )
    positions = None
    if bridged:
        inserted = np.zeros(len(t), np.int64)
        inserted[at[short] + 1] = size[short]
        positions = np.arange(len(t)) + np.cumsum(inserted)
    return Timebase(
        t=np.concatenate(grid) if len(grid) > 1 else grid[0],
        interval=interval,
        segments=tuple(segments),
        positions=positions,
        gaps=len(at),
        missing=int(size.sum()),
        bridged=bridged,
        jitter=jitter,
        rounding=rounding,
        moving=moving,
        wander=wander,
        left_out=left_out,
    )


def _lateness(at: IntArray, offsets: FloatArray, least: float, jitter: float, count: int) -> FloatArray:
    """Return how late the samples of a segment are against evenly spaced ones, s: a constant, or shape (count,).

    `offsets` are the stamps of samples `at`, less their even times. Where medians over pieces of the segment differ by
    more than `least`, s, and more than `jitter` explains, the lateness is interpolated linearly between these medians;
    else it is the median of all offsets.
    """
    size = max(_STAMPS_A_MEDIAN, len(at) // COURSE_PIECES)
    pieces = slice(0, len(at) // size * size)
    late = np.median(offsets[pieces].reshape(-1, size), axis=1)
    if len(late) < 2 or float(np.ptp(late)) < least + _MEDIANS_REACH * jitter / np.sqrt(size):
        return np.asarray(np.round(np.median(offsets), 9))  # no clock tells less
    middle = at[pieces].reshape(-1, size).mean(axis=1)
    slopes = np.diff(late)[[0, -1]] / np.diff(middle)[[0, -1]]
    ends = np.array([0.0, count - 1.0])
    outer = late[[0, -1]] + slopes * (ends - middle[[0, -1]])
    return np.interp(np.arange(count), np.r_[ends[0], middle, ends[1]], np.r_[outer[0], late, outer[1]])


def _some(start: int, stop: int) -> IntArray:
    """Return up to `_MAX_STAMPS` rows from start to stop, evenly chosen, the first and the last among them."""
    if stop - start <= _MAX_STAMPS:
        return np.arange(start, stop)
    return np.linspace(start, stop - 1, _MAX_STAMPS).astype(np.int64)


def rounding_of(steps: FloatArray) -> float:
    """Return the unit, s, that steps of stamps are whole multiples of; 0 where they are all equal or have none.

    A clock written with few digits has few steps, and these differ by its unit at least; the least difference is the
    unit, since an interval between two multiples is written as both.
    """
    different = np.unique(np.round(steps / EQUAL_STEPS).astype(np.int64))
    if not 1 < len(different) <= MAX_CLOCK_STEPS:
        return 0.0
    unit = float(np.diff(different).min()) * EQUAL_STEPS
    if not np.any(whole := np.round(steps / unit)):
        return 0.0
    unit *= float(np.sum(steps) / unit / np.sum(whole))
    off = np.abs(steps / unit - np.round(steps / unit))
    return unit if unit > 100.0 * EQUAL_STEPS and float(off.max()) < 0.05 else 0.0


def resolution_of(t: FloatArray) -> float:
    """Return how finely stamps are written, s: the unit that all are multiples of, or some last places.

    The unit is a decimal or a binary one: text, a counter, the last place of seconds since some epoch.
    """
    t = t[:_RESOLUTION_STAMPS]
    last = 4.0 * float(np.spacing(np.abs(t).max()))
    for unit in _CLOCK_UNITS:
        if unit <= last:
            break
        if float(np.abs(t - unit * np.rint(t / unit)).max()) <= _ROUNDING_TOLERANCE * unit:
            return unit
    return last


def _jitter(error: FloatArray, interval: float, resolution: float) -> float:
    """Return the sd of one stamp from the errors of steps, rare large ones apart.

    0 where it is no more than a fine resolution of the stamps makes: rounding to a unit u gives u/√8 at most.
    """
    usual = float(normal_sd(error))
    inner = error[np.abs(error) <= max(0.5 * interval, 5.0 * usual)]
    sd = float(np.sqrt(np.mean(inner**2) / 2.0)) if len(inner) else usual
    return sd if resolution > _FINE_RESOLUTION * interval or sd > resolution else 0.0
