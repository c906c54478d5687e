"""Long logs become records of means: of 2, 4, 8 … samples each, so that what is kept fits memory and patience.

The log is read once, in parts, each of which is put on its even grid as a whole log is (stamps, gaps, missing rows,
broken readings). Neighbouring parts without a gap continue one another, and K = 2^k samples at a time become one. A
sample is the mean rate since the one before, so a mean of K is a sample of the same noise at K times the interval τ0:
all terms of the base keep their coefficients, and the Allan variance at m K τ0 is that of the samples. Lost is what
happens within a mean: the spectrum above 1/(2 K τ0), and single samples (repeats, saturation). Of it the Allan
variances of clusters of 1, 2, 4, … K/2 samples are kept (`Record.short_clusters`): the pyramid has a fixed size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.process import free_memory
from tuner.readers.assemble import EvenRecords, Plan, checked, even
from tuner.readers.bad_rows import BadRows, LogRows, expect_few
from tuner.readers.column_names import TIME_UNITS
from tuner.readers.columns import Listing
from tuner.readers.joined_parts import JoinedParts
from tuner.readers.options import Options
from tuner.readers.time_column import WRAP_STEPS, WRAPS
from tuner.readers.time_range import between, expect_within
from tuner.types.records import DataError, Record

ROWS_IN_PART = 1 << 18
"""Rows read at a time: with the work of putting them on a grid some 100 MB."""
MIN_ROWS = 1 << 14
"""Rows from which a part tells rate, gaps and broken readings as a whole log does."""
BASE_BYTES = 400e6
"""Memory of the program without samples."""
BYTES_A_NUMBER, BYTES_A_ROW = 8.0, 330.0
"""Memory of each number of a record, and behind each row while one axis is diagnosed.

That takes 10 columns where nothing is found, 20 with four findings, 41 on the richest recording tried, with ten.
"""
SHARE_OF_FREE = 0.5
"""Part of the free memory that a log may take where nobody says how much."""
AXES_AT_ONCE = 2
"""Axes that must then have room to be diagnosed side by side, so that little time is lost to save memory."""
MOST_ROWS = 4_000_000
"""Rows that are kept where nobody says how much memory: six axes then take about a minute of processor time.

White noise is known to 1/√(2 × 4e6) = 0.04 % from them, far better than units are alike, and slower terms as well as
from all samples.
"""


@dataclass(frozen=True)
class Reduction:
    """How a log is read in parts: rows that may be kept, and rows in a part."""

    fitting: float
    rows: int

    def size(self, rows: float) -> int:
        """Return how many of so many rows become one mean: the least power of two with which they fit."""
        return 1 << max(math.ceil(math.log2(rows / self.fitting)), 0)


def reduction(listing: Listing, plan: Plan, memory: float | None) -> Reduction | None:
    """Return how a log must be reduced to fit; None where all of it fits, or its format cannot be read in parts.

    `memory`, bytes, is what the whole program may take, on one processor if need be; None for half of what is free,
    with `AXES_AT_ONCE`, and at most `MOST_ROWS`.
    """
    if listing.stream is None:
        return None
    allowed, at_once = (SHARE_OF_FREE * free_memory(), AXES_AT_ONCE) if memory is None else (memory, 1)
    columns = sum(map(len, plan.groups)) + (plan.layout.time is None)
    bytes_a_row = BYTES_A_NUMBER * columns + BYTES_A_ROW * at_once
    most = MOST_ROWS if memory is None else math.inf
    fitting = max(min((allowed - BASE_BYTES) / bytes_a_row, most), MIN_ROWS)
    if listing.rows <= fitting:
        return None
    return Reduction(fitting, int(min(max(fitting / 2, MIN_ROWS), ROWS_IN_PART)))


def read_means(
    listing: Listing,
    plan: Plan,
    digest: str,
    options: Options,
    how: Reduction,
    begin: float | None = None,
    end: float | None = None,
) -> tuple[Record, ...]:
    """Return records of means of the samples from `begin` to before `end`, s; where these fit, each sample is kept.

    Raises
    ------
    DataError
        What a whole log would be refused for, in any part; parts of different rates, or that go back in time; times
        outside the log.
    """
    joined: JoinedParts | None = None
    lower, upper = -math.inf if begin is None else begin, math.inf if end is None else end
    first: tuple[Record, ...] = ()
    start, stop = math.inf, -math.inf
    bad: list[BadRows] = []
    for row, found in _parts(listing, plan, digest, options, how.rows):
        record = found.records[0]
        bad += found.bad
        first = first or found.records
        begun, stop = float(record.t[0]), float(record.t[-1]) + record.interval
        start = min(start, begun)
        if stop <= lower or begun >= upper:
            continue
        if joined is None:
            last = min(upper, begun + (listing.rows - row) * record.interval)
            rows = max(math.ceil((last - max(lower, begun)) / record.interval), 1)
            size = how.size(rows)
            joined = JoinedParts(str(listing.path), size, found.records, rows // size)
        joined.add(row, found)
    if not first:
        raise DataError(f"{listing.path}: no data rows")
    try:
        expect_few(bad, listing.rows)
    except DataError as error:
        raise DataError(f"{listing.path}: {error}") from None
    expect_within(first, (start, stop), begin, end)
    if joined is None:
        raise DataError(f"{listing.path}: --begin and --end leave no samples: the log has a gap there")
    means = checked(listing, plan, joined.finished(), options, part=first)
    return between(means, begin, end, (start, stop))


def _parts(
    listing: Listing, plan: Plan, digest: str, options: Options, rows: int
) -> Iterator[tuple[int, EvenRecords]]:
    """Yield the number of the first row of each part, and its records; the last part is no shorter than half of one."""
    assert listing.stream is not None
    stated = plan.layout.time is not None
    row, turned, begun, end = 0, 0.0, math.inf, -math.inf
    for piece in _even_parts(listing.stream(plan.groups, rows), rows // 2):
        within = LogRows(row, max(listing.rows, row + len(piece[0])))
        found = even(replace(listing, load=partial(_given, piece)), plan, digest, options, within)
        if not stated:
            shift = row * found.records[0].interval
            found = _later(found, shift)
        else:
            ahead = float(found.records[0].t[0]) + turned - end
            if (period := _clock_period(-ahead, found.records[0].interval)) > max(end - begun, 0.0):
                turned, begun = turned + period, end
                note = f"the clock began anew {period:.10g} s later and was continued"
                found = replace(found, notes=(*found.notes, note))
            found = _later(found, turned) if turned else found
            begun, end = min(begun, float(found.records[0].t[0])), float(found.records[0].t[-1])
        yield row, found
        row += len(piece[0])


def _later(found: EvenRecords, shift: float) -> EvenRecords:
    return replace(found, records=tuple(replace(r, t=r.t + shift) for r in found.records))


def _clock_period(back: float, interval: float) -> float:
    """Return the period of a clock, s, that goes back by so much where it begins anew; 0 where none does."""
    periods = (wrap * unit for unit in TIME_UNITS.values() for wrap in WRAPS)
    return next((p for p in periods if 0.0 < p - back <= WRAP_STEPS * interval < p), 0.0)


def _given(piece: tuple[NDArray[Any], ...], _: object) -> tuple[NDArray[Any], ...]:
    return piece


def _even_parts(pieces: Iterator[tuple[NDArray[Any], ...]], least: int) -> Iterator[tuple[NDArray[Any], ...]]:
    """Join pieces, the last ones too, so that each part has `least` rows; a file without as many is one part."""
    whole: tuple[NDArray[Any], ...] | None = None
    short: list[tuple[NDArray[Any], ...]] = []
    for piece in pieces:
        short.append(piece)
        if sum(len(p[0]) for p in short) >= least:
            if whole is not None:
                yield whole
            whole, short = _joined(short), []
    if whole is not None or short:
        yield _joined([*([] if whole is None else [whole]), *short])


def _joined(pieces: Sequence[tuple[NDArray[Any], ...]]) -> tuple[NDArray[Any], ...]:
    if len(pieces) == 1:
        return pieces[0]
    return tuple(np.concatenate(column) for column in zip(*pieces, strict=True))
