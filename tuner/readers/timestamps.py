"""Order, duplicates, interval and missing samples, from the time stamps of a log.

A stamp is modelled as t_i = a + p k_i + e_i: p is the interval, k_i the number of the sample since the start
(it jumps where samples are missing) and e_i the stamping error (rounding, jitter).

wrong stamps
    A row whose neighbours leave the time of one sample between them, and whose stamp lies elsewhere, is where it
    belongs: its stamp is replaced by the mean of theirs.
order
    Other stamps behind an earlier one are sorted; more than 10 % of them is a clock that was reset, not disorder. A run
    of rows whose time rows before it have is one of a clock that was set back: rows follow one another, so it goes on
    after the row before, and so do all later rows unless the clock is set on again behind it.
duplicates
    Of rows with one stamp and equal values the first stays. Rows with one stamp and different values are
    dropped too where they are rare (1 %); where they are the rule, the stamps are coarser than the sampling
    or written in batches, and the rows of a batch are spread at the usual interval. Equal values are copies there if
    they are more common than among neighbours with two stamps, which are two samples for certain.
interval
    Pooled least-squares slope of t on k; it starts from the median difference. If one line explains
    all stamps within their resolution (1 ms stamps of a 400 Hz log), nothing is missing. Nor is it where samples were
    stamped as they arrived, in bursts: uneven steps that are mostly far below the mean one, but stay near one line.
gaps
    A step over 1.5 p, or over p by more than the stamping error explains, is a gap if it shifts the clock
    against the row number permanently: a late stamp that is followed by shorter steps is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from models.arrays import BoolArray, FloatArray, IntArray
from models.robust import normal_sd
from tuner.types.records import DataError

_MAX_EQUAL_SHARE = 0.01
"""Share of rows with the stamp of the row before above which stamps are coarse, not repeated by mistake."""
MAX_DISORDERED_SHARE = 0.10
"""Share of rows behind an earlier stamp above which the clock was reset; fewer are sorted."""
_MIN_SET_BACK = 32
"""Rows in a row behind an earlier stamp that may be of a clock set back: jitter puts few in a row in another order."""
_MIN_COVERED = 0.5
"""Rows that have the time of such a run ÷ its own, from which it is one: 1, and 0 of a packet that came late."""
_SET_ON_ROWS, _SET_ON_SHARE = 3, 0.05
"""Rows behind such a run within which the clock is set on again, if it is; how near a later step has to be to what it
was set back by, steps or share of it, to set it on."""
_RATE_SHARE, _RATE_ROWS = 0.25, 4096
"""Share of the rows, or rows, over which steps are averaged for the usual one: many rows may share a stamp."""
_SHIFT_ROWS = 32
"""Rows on either side whose lower quartiles measure a shift of the clock: chosen to average the jitter of stamps."""
_DELAY_CANDIDATES = 8
"""Candidates within which a shift that is taken back was a delay: chosen for bursts of late packets."""
_CANDIDATES_AT_ONCE = 100_000
"""Candidates treated at a time, so that memory stays bounded: 50 MB."""
_MIN_BATCHES = 32
"""Batches from which their length is known."""
_MIN_ARRIVALS = 1000
"""Stamps from which those of bursts, which stay near one line, differ from those of lost samples, which do not."""
_MAX_BURST_STEP = 0.5
"""Usual step ÷ mean step up to which the usual one may be that within bursts."""
_MIN_BURST_SCATTER = 0.1
"""Sd of the steps within bursts ÷ the usual one from which they are no intervals of a sensor that samples in bursts."""
_LONGEST_SILENCE, _USUAL_SILENCES = 1.0, 0.999
"""Time between bursts up to which a buffer fills, s, and the share of the steps that are shorter; sensors that sleep to
save power do so for longer."""
_MAX_WANDERING = 0.3
"""Sd of the stamps about one line ÷ that of sums of as many independent steps, s √(n/15), up to which nothing is lost.

The chance of less is below 1e-8: with losses the clock wanders off the row number as a random walk.
"""
_MIN_ODD_STEPS = 8
"""Steps of two units from which their even distances cannot be chance."""
_ROWS_AT_ONCE = 1 << 20
"""Rows treated at a time, so that memory stays bounded: 8 MB a column."""


def without_wrong_stamps(t: FloatArray) -> tuple[FloatArray, int]:
    """Return stamps with those replaced that do not fit where they stand, and how many these were.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Stamps in the order of the rows, s.
    """
    step = np.diff(t)
    if len(t) < 3 or not np.any(step < 0.0):
        return t, 0
    low, high = t[:-2], t[2:]
    elsewhere = (t[1:-1] < low) | (t[1:-1] > high)
    wrong = 1 + np.flatnonzero(elsewhere & (high - low > 1.5 * float(np.nanmedian(step))))
    if len(wrong) > MAX_DISORDERED_SHARE * len(t):
        return t, 0
    mended = t.copy()
    mended[wrong] = 0.5 * (t[wrong - 1] + t[wrong + 1])
    return mended, len(wrong)


def in_order(
    t: FloatArray, rows: IntArray | None
) -> tuple[FloatArray, IntArray | None, int, tuple[int, float]]:
    """Return stamps in order, their rows, and how many were behind an earlier one.

    Behind them stands how often the clock was set back, and by how much, s, it still is at the end.
    """
    if (t[1:] >= t[:-1]).all():
        return t, rows, 0, (0, 0.0)
    behind = np.flatnonzero(t < np.maximum.accumulate(t))
    if len(behind) > MAX_DISORDERED_SHARE * len(t):
        raise DataError(
            f"time runs backwards at row {behind[0] + 1} and stays behind for {len(behind)} of {len(t)} rows (a clock "
            "that was reset?): split the log there, or leave the time column out by --columns t=none --rate HZ"
        )
    mended, back = _gone_on(t, behind)
    left = int(np.count_nonzero(mended < np.maximum.accumulate(mended)))
    order = np.argsort(mended, kind="stable")
    late = float(mended[-1] - t[-1])
    return mended[order], order if rows is None else rows[order], left, (back, late)


def _gone_on(t: FloatArray, behind: IntArray) -> tuple[FloatArray, int]:
    """Return stamps of a clock that is not set back, and how often it was, by rows behind an earlier stamp."""
    ordered, usual = np.delete(t, behind), _usual_step(t)
    mended, back = t.copy(), 0
    for run in np.split(behind, np.flatnonzero(np.diff(behind) > 1) + 1):
        if len(run) < _MIN_SET_BACK:
            continue
        inside = np.searchsorted(ordered, t[run].max(), side="right") - np.searchsorted(ordered, t[run].min())
        if inside <= _MIN_COVERED * len(run):
            continue
        first, end = int(run[0]), int(run[-1]) + 1
        late = mended[first - 1] + usual - mended[first]
        behind_it = min(end + _SET_ON_ROWS, len(t) - 1)
        goes_on = mended[first - 1] + usual * (behind_it - first + 1)  # as rows follow one another
        if abs(mended[behind_it] - goes_on) < abs(mended[behind_it] + late - goes_on):
            end += int(np.argmax(np.diff(t[end - 1 : behind_it + 1])))
        else:
            on = np.abs(np.diff(mended[end:]) - late - usual) < max(
                _SET_ON_ROWS * usual, _SET_ON_SHARE * late
            )
            end = end + 1 + int(np.argmax(on)) if on.any() else len(t)
        mended[first:end] += late
        back += 1
    return mended, back


def _usual_step(t: FloatArray) -> float:
    """Return the usual time from row to row, s, whatever rows share a stamp."""
    rows = min(_RATE_ROWS, max(int(_RATE_SHARE * len(t)), 1))
    return float(np.median(t[rows:] - t[:-rows])) / rows


def without_duplicates(
    t: FloatArray, rows: IntArray | None, equal: Callable[[IntArray, IntArray], BoolArray] | None
) -> tuple[FloatArray, IntArray | None, int, float]:
    """Return stamps without duplicates, their rows, how many were dropped, and the length of a batch, s."""
    later = np.flatnonzero(t[1:] == t[:-1]) + 1
    if not len(later):
        return t, rows, 0, 0.0
    if len(later) == len(t) - 1:
        raise DataError(
            "the time column is constant: choose one with --columns t=NAME, or none by --columns t=none --rate HZ"
        )
    drop = later
    if len(later) > _MAX_EQUAL_SHARE * len(t):
        at = later if rows is None else rows[later]
        before = later - 1 if rows is None else rows[later - 1]
        drop = later[equal(at, before)] if equal is not None else later[:0]
        if equal is not None and len(drop):
            new = np.flatnonzero(t[1:] > t[:-1]) + 1
            by_chance = float(
                np.mean(equal(*((new, new - 1) if rows is None else (rows[new], rows[new - 1]))))
            )
            copied = len(drop) - by_chance * len(later)
            if copied < 0.5 * (1.0 - by_chance) * len(drop):
                drop = later[:0]
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
    reach = min(_MIN_BATCHES, len(first) - 1)
    usual = float(np.median((t[first[reach:]] - t[first[:-reach]]) / (first[reach:] - first[:-reach])))
    size = np.diff(np.append(first, len(t)))
    within = np.arange(len(t)) - np.repeat(first, size)
    return t + usual * within, float(np.median(np.diff(t[first])))


def interval_and_gaps(t: FloatArray, batch: float) -> tuple[float, IntArray, IntArray]:
    """Return the interval, the rows after which samples are missing, and how many."""
    step = np.diff(t)
    usual = float(np.median(step))
    if batch == 0.0 and _arrive_in_bursts(t, step, usual):
        return _slope(t, np.zeros(0, np.int64), np.zeros(0, np.int64)), *2 * (np.zeros(0, np.int64),)
    resolution = max(batch, _resolution(t, step))
    breaks = np.flatnonzero(step > 2.5 * usual + 2.0 * resolution)
    interval, worst = _pooled_slope(t, breaks + 1)
    if worst <= max(resolution, 0.25 * interval):
        return interval, *_present(breaks, np.rint(step[breaks] / interval).astype(np.int64) - 1)
    if resolution == 0.0:
        interval = usual
    scatter = float(normal_sd(step - usual))
    rounded = scatter <= 2.0 * resolution
    at = size = np.zeros(0, np.int64)
    for _ in range(3):
        excess = 0.5 * interval + resolution if rounded else max(0.5 * interval, 4.0 * scatter)
        candidates = np.flatnonzero(step > interval + excess)
        if len(candidates):
            at, size = _present(candidates, _lost(t, step, candidates, interval))
        refined = _slope(t, at, size)
        if abs(refined - interval) <= 1e-9 * interval:
            break
        interval = refined
    return interval, at, size


def _arrive_in_bursts(t: FloatArray, step: FloatArray, usual: float) -> bool:
    """Return whether stamps are times of arrival in bursts, by steps whose median is given, and nothing is missing."""
    if len(t) < _MIN_ARRIVALS or usual > _MAX_BURST_STEP * float(np.mean(step)):
        return False
    if float(step[step < 2.0 * usual].std()) < _MIN_BURST_SCATTER * usual:
        return False
    if float(np.quantile(step, _USUAL_SILENCES)) > _LONGEST_SILENCE:
        return False
    number = np.arange(len(t)) - 0.5 * (len(t) - 1)
    late = t - t.mean() - number * (float(number @ t) / float(number @ number))
    wandering = float(step.std()) * math.sqrt(len(t) / 15.0)
    return float(late.std()) < _MAX_WANDERING * wandering


def _present(at: IntArray, size: IntArray) -> tuple[IntArray, IntArray]:
    return at[size > 0], size[size > 0]


def _resolution(t: FloatArray, step: FloatArray) -> float:
    """Return the decimal step the stamps are visibly rounded to, s; 0 where rounding does not show."""
    for digits in range(7):
        unit = 10.0**-digits
        scaled = t[:4096] / unit
        if np.abs(scaled - np.rint(scaled)).max() < 1e-3:
            return unit if _rounding_shows(np.rint(step[:_ROWS_AT_ONCE] / unit)) else 0.0
    return 0.0


def _rounding_shows(step: FloatArray) -> bool:
    """Return whether steps, in units of the resolution, vary by rounding.

    Rounded steps are m and m ± 1. At m = 1 a step of two may as well be a lost sample: rounding puts them at
    even distances, losses do not.
    """
    usual = np.median(step)
    odd = np.flatnonzero(np.abs(step - usual) == 1)
    if usual > 1:
        return bool(len(odd) > 1e-3 * len(step))
    distance = np.diff(odd)
    return len(odd) > _MIN_ODD_STEPS and bool(distance.max() <= 1.5 * distance.min() + 1)


def _pooled_slope(t: FloatArray, cuts: IntArray) -> tuple[float, float]:
    """Return the common slope of t on the row number in the pieces between cuts, and the largest residual."""
    pieces = np.split(t, cuts)
    product = spread = 0.0
    for piece in pieces:
        spread += len(piece) * (len(piece) ** 2 - 1.0) / 12.0
        for number, block in _blocks(piece):
            product += float((number - 0.5 * (len(piece) - 1)) @ block)
    slope = product / spread if spread > 0.0 else float(np.median(np.diff(t)))
    worst = 0.0
    for piece in pieces:
        residuals = (block - slope * number for number, block in _blocks(piece))
        extremes = [(r.min(), r.max(), r.sum()) for r in residuals]
        low, high, total = np.array(extremes).T
        mean = total.sum() / len(piece)
        worst = max(worst, float(high.max() - mean), float(mean - low.min()))
    return slope, worst


def _blocks(piece: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield row numbers and stamps from the start of a piece, a block at a time."""
    for start in range(0, len(piece), _ROWS_AT_ONCE):
        block = piece[start : start + _ROWS_AT_ONCE] - piece[0]
        yield np.arange(start, start + len(block), dtype=float), block


def _lost(t: FloatArray, step: FloatArray, candidates: IntArray, interval: float) -> IntArray:
    """Return how many samples are missing after each candidate row, shape (m,).

    The shift of the clock against the row number is measured between the lower quartiles of up to `_SHIFT_ROWS`
    rows on either side (late stamps are more common than early ones), after the hurried stamps that follow a
    late one, and never across another candidate. A shift that is taken back within `_DELAY_CANDIDATES` candidates was
    a delay.
    """
    settled = np.append(np.flatnonzero(step >= 0.5 * interval), len(step))
    first = settled[np.searchsorted(settled, candidates + 1)]
    low = np.concatenate(([0], candidates[:-1] + 1))
    high = np.append(candidates[1:], len(t) - 1)
    shift = np.empty(len(candidates))
    reach = np.arange(_SHIFT_ROWS)
    for start in range(0, len(candidates), _CANDIDATES_AT_ONCE):
        piece = slice(start, start + _CANDIDATES_AT_ONCE)
        before = np.maximum(candidates[piece, None] - reach, low[piece, None])
        after = np.minimum(first[piece, None] + reach, high[piece, None])
        shift[piece] = _quartile(t, after, interval) - _quartile(t, before, interval)
    total = np.cumsum(np.rint(shift / interval).astype(np.int64))
    lasting = total.copy()
    for later in range(1, min(_DELAY_CANDIDATES, len(total))):
        lasting[:-later] = np.minimum(lasting[:-later], total[later:])
    return np.maximum(np.diff(lasting, prepend=0), 0)


def _quartile(t: FloatArray, rows: IntArray, interval: float) -> FloatArray:
    """Return the lower quartile of t - interval · row over each line of `rows`."""
    detrended = t[rows] - interval * rows
    place = rows.shape[1] // 4
    return np.asarray(np.partition(detrended, place, axis=1)[:, place])


def _slope(t: FloatArray, at: IntArray, size: IntArray) -> float:
    """Return the slope of t on the sample number, which jumps by `size` after the rows `at`."""
    number = np.arange(len(t), dtype=float)
    number += np.repeat(np.cumsum(np.append(0, size)), np.diff(at + 1, prepend=0, append=len(t)))
    number -= number.mean()
    return float(number @ t) / float(number @ number)
