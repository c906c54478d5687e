"""Logs larger than memory become records of means: of 2, 4, 8 … samples each, so that what is kept fits.

The log is read once, in parts, each of which is put on its even grid as a whole log is (stamps, gaps, missing rows,
broken readings). Neighbouring parts without a gap continue one another, and K = 2^k samples at a time become one. A
sample is the mean rate since the one before, so a mean of K is a sample of the same noise at K times the interval τ0:
all terms of the base keep their coefficients, and the Allan variance at m K τ0 is that of the samples. Lost is what
happens within a mean: the spectrum above 1/(2 K τ0), and single samples (repeats, saturation). Of it the Allan
variances of clusters of 1, 2, 4, … K/2 samples are kept (`Record.short_clusters`): the pyramid has a fixed size.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.free_memory import free_memory
from tuner.readers.assemble import EvenRecords, Plan, checked, even
from tuner.readers.column_names import TIME_UNITS
from tuner.readers.columns import Listing
from tuner.readers.options import Options
from tuner.readers.time_base import MIN_SEGMENT_SAMPLES
from tuner.readers.time_column import WRAP_STEPS, WRAPS
from tuner.types.records import DataError, Record, ShortClusters

FloatArray = NDArray[np.float64]

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
MAX_RATE_CHANGE = 1e-3
"""Relative difference of the rates of two parts of one record; clocks of sensors drift by less."""
MIN_MEANS = 64
"""Means that a record must have; fewer where gaps leave no stretch of several means."""


@dataclass(frozen=True)
class Reduction:
    """How a log is read: `size` samples in each mean, a power of two, and rows in a part."""

    size: int
    rows: int


def reduction(listing: Listing, plan: Plan, memory: float | None) -> Reduction | None:
    """Return how a log must be reduced to fit; None where all of it fits, or its format cannot be read in parts.

    `memory`, bytes, is what the whole program may take, on one processor if need be; None for half of what is free,
    with `AXES_AT_ONCE`.
    """
    if listing.stream is None:
        return None
    allowed, at_once = (SHARE_OF_FREE * free_memory(), AXES_AT_ONCE) if memory is None else (memory, 1)
    columns = sum(map(len, plan.groups)) + (plan.layout.time is None)
    bytes_a_row = BYTES_A_NUMBER * columns + BYTES_A_ROW * at_once
    fitting = max((allowed - BASE_BYTES) / bytes_a_row, float(MIN_ROWS))
    if listing.rows <= fitting:
        return None
    size = 1 << math.ceil(math.log2(listing.rows / fitting))
    return Reduction(size, int(min(max(fitting / 2, MIN_ROWS), ROWS_IN_PART)))


def read_means(
    listing: Listing, plan: Plan, digest: str, options: Options, how: Reduction
) -> tuple[Record, ...]:
    """Return records whose samples are means of `how.size` samples of a log.

    Raises
    ------
    DataError
        What a whole log would be refused for, in any part; parts of different rates, or that go back in time.
    """
    joined: _Joined | None = None
    first: tuple[Record, ...] = ()
    for row, found in _parts(listing, plan, digest, options, how.rows):
        if joined is None:
            joined = _Joined(str(listing.path), how.size, found.records, listing.rows // how.size)
            first = found.records
        joined.add(row, found)
    if joined is None:
        msg = f"{listing.path}: no data rows"
        raise DataError(msg)
    return checked(listing, plan, joined.finished(), options, part=first)


def _parts(
    listing: Listing, plan: Plan, digest: str, options: Options, rows: int
) -> Iterator[tuple[int, EvenRecords]]:
    """Yield the number of the first row of each part, and its records; the last part is no shorter than half of one."""
    assert listing.stream is not None
    stated = plan.layout.time is not None
    row, turned, end = 0, 0.0, -math.inf
    for piece in _even_parts(listing.stream(plan.groups, rows), rows // 2):
        found = even(replace(listing, load=partial(_given, piece)), plan, digest, options)
        if not stated:
            shift = row * found.records[0].interval
            found = _later(found, shift)
        else:
            ahead = float(found.records[0].t[0]) + turned - end
            if (period := _clock_period(-ahead, found.records[0].interval)) > 0.0:
                turned += period
                note = f"the clock began anew {period:.10g} s later and was continued"
                found = replace(found, notes=(*found.notes, note))
            found = _later(found, turned) if turned else found
            end = float(found.records[0].t[-1])
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


class _Means:
    """Columns that grow to about an expected number of rows, in one block of memory from the first row on."""

    def __init__(self, width: int, expected: int) -> None:
        self.width = width
        self._rows = np.empty((expected + 1, width), order="F")
        self._count = 0

    def add(self, columns: Sequence[FloatArray]) -> None:
        """Append rows, given as columns."""
        end = self._count + len(columns[0])
        if end > len(self._rows):
            larger = np.empty((end + end // 4, self.width), order="F")
            larger[: self._count] = self._rows[: self._count]
            self._rows = larger
        for j, column in enumerate(columns):
            self._rows[self._count : end, j] = column
        self._count = end

    def finished(self) -> FloatArray:
        """Return all rows, shape (n, width), Fortran order; columns are moved together where they are."""
        flat, room, n = self._rows.reshape(-1, order="F"), len(self._rows), self._count
        for j in range(1, self.width):
            flat[j * n : (j + 1) * n] = flat[j * room : j * room + n]
        return flat[: n * self.width].reshape((n, self.width), order="F")


class _Joined:
    """Means of the parts so far, and what carries over to the next."""

    def __init__(self, source: str, size: int, first: Sequence[Record], expected: int) -> None:
        self._source, self._size = source, size
        self._first = tuple(replace(r, t=r.t[:2], y=r.y[:2], covariates={}, segments=()) for r in first)
        self._covariates = tuple(first[0].covariates)
        widths = [1, *(len(r.axes) for r in first), *(1 for _ in self._covariates)]
        self._means = [_Means(width, expected) for width in widths]
        self._count = 0
        self._segments: list[tuple[int, int]] = []
        self._rest = [np.empty(0) for width in widths for _ in range(width)]
        self._differences = np.zeros(int(math.log2(size)), np.int64)
        self._sums = np.zeros((len(self._rest), len(self._differences)))
        self._last: float | None = None
        self._samples = 0
        self._interval = 0.0
        self._gaps: list[int] = []
        self._timing: list[Mapping[str, float]] = []
        self._parts: list[tuple[int, EvenRecords]] = []

    def add(self, row: int, found: EvenRecords) -> None:
        """Take in the next part, whose first row is number `row`."""
        record = found.records[0]
        self._timing.append(record.timing)
        self._parts.append((row, replace(found, records=())))
        interval = self._interval / self._samples if self._samples else record.interval
        if abs(record.interval / interval - 1.0) > MAX_RATE_CHANGE:
            msg = (
                f"{self._source}: expected one rate, found {1.0 / interval:.6g} Hz and from data row {row + 1} on "
                f"{1.0 / record.interval:.6g} Hz: cut the log there"
            )
            raise DataError(msg)
        columns = [record.t, *(y for r in found.records for y in r.y.T)]
        nothing = np.full(len(record), np.nan)
        columns += [record.covariates.get(name, nothing) for name in self._covariates]
        for number, (start, stop) in enumerate(record.segments):
            if number > 0 or not self._continues(row, record, interval):
                self._rest = [np.empty(0) for _ in columns]
                self._segments.append((self._count, self._count))
            self._append([column[start:stop] for column in columns])
            self._last = float(record.t[stop - 1])
        used = sum(stop - start for start, stop in record.segments)
        self._samples += used
        self._interval += used * record.interval

    def _continues(self, row: int, record: Record, interval: float) -> bool:
        """Return whether a part goes on where the one before ended; a gap between the two is counted."""
        if self._last is None:
            return False
        ahead = float(record.t[record.segments[0][0]]) - self._last
        timing = record.timing
        tolerance = 0.5 * interval + timing.get("rounding", 0.0) + 4.0 * timing.get("jitter_sd", 0.0)
        if ahead < -tolerance:
            msg = (
                f"{self._source}: the stamps go back by {interval - ahead:.6g} s about data row {row + 1}, and the "
                "log is larger than the memory it may take: sort it, cut it there, or allow more by --memory"
            )
            raise DataError(msg)
        if ahead <= interval + tolerance:
            return True
        self._gaps.append(round(ahead / interval) - 1)
        return False

    def _append(self, columns: Sequence[FloatArray]) -> None:
        """Take in the samples of a stretch without a gap, one array a column."""
        beside = len(self._rest[0])
        full = (beside + len(columns[0])) // self._size * self._size
        means = []
        for number, column in enumerate(columns):
            whole = np.concatenate([self._rest[number], column])
            self._rest[number] = whole[full:].copy()
            level = whole[:full]
            for k in range(len(self._differences)):
                step = np.diff(level)
                self._sums[number, k] += float(step @ step)
                level = 0.5 * (level[0::2] + level[1::2])
            means.append(level)
        self._differences += np.maximum(full // 2 ** np.arange(len(self._differences)) - 1, 0)
        if not full:
            return
        at = 0
        for one in self._means:
            one.add(means[at : at + one.width])
            at += one.width
        self._count += len(means[0])
        self._segments[-1] = (self._segments[-1][0], self._count)

    def finished(self) -> EvenRecords:
        """Return the records of means, with what was said of the parts."""
        long = [(a, b) for a, b in self._segments if b - a >= MIN_SEGMENT_SAMPLES]
        kept = sum(b - a for a, b in long)
        interval = self._interval / max(self._samples, 1)
        if kept < MIN_MEANS:
            msg = (
                f"{self._source}: larger than the memory it may take, and its stretches without a gap are too "
                f"short for means of {self._size} samples: allow more by --memory, or cut the log"
            )
            raise DataError(msg)
        time, *others = (one.finished() for one in self._means)
        records = []
        axes = [axis for r in self._first for axis in r.axes]
        short = {axis: self._short(1 + j) for j, axis in enumerate(axes)}
        rest = others[len(self._first) :]
        covariates = {name: column[:, 0] for name, column in zip(self._covariates, rest, strict=True)}
        gone = [name for name, column in covariates.items() if np.isnan(column).any()]
        for one, y in zip(self._first, others, strict=False):
            records.append(
                replace(
                    one,
                    t=time[:, 0],
                    y=y,
                    interval=self._size * interval,
                    segments=tuple(long),
                    covariates=MappingProxyType({n: c for n, c in covariates.items() if n not in gone}),
                    timing=MappingProxyType(_merged(self._timing, self._gaps)),
                    samples_a_mean=self._size,
                    short_clusters=MappingProxyType({axis: short[axis] for axis in one.axes}),
                )
            )
        said = (
            f"the log is larger than the memory it may take: {self._samples} samples were read in parts, and each of "
            f"the {kept} that are kept is the mean of {self._size}: what is faster than "
            f"{0.5 / (self._size * interval):.4g} Hz shows only in the Allan variances of short clusters"
        )
        notes = [f"{name}: no numbers in some part of the log; left out" for name in gone]
        if lost := self._samples - self._size * kept:
            notes.append(
                f"{lost} samples at the ends of stretches without a gap fill no mean and are left out"
            )
        return EvenRecords(
            tuple(records),
            (*_common([(row, found.notes) for row, found in self._parts]), *notes),
            (said, *self._parts[0][1].assumptions),
        )

    def _short(self, column: int) -> ShortClusters:
        return ShortClusters(
            tuple(2**k for k in range(len(self._differences))),
            tuple(float(0.5 * s / n) for s, n in zip(self._sums[column], self._differences, strict=True)),
            tuple(int(n) for n in self._differences),
        )


def _merged(timing: Sequence[Mapping[str, float]], gaps: Sequence[int]) -> dict[str, float]:
    """Return what the stamps of all parts said, and the missing samples between parts: counts add up."""
    if not timing[0]:
        return {}
    names = ("gap_count", "missing", "bridged", "duplicates", "disordered")
    merged = {name: float(sum(one[name] for one in timing)) for name in names}
    merged["gap_count"] += len(gaps)
    merged["missing"] += sum(gaps)
    merged["jitter_sd"] = float(np.sqrt(np.mean([one["jitter_sd"] ** 2 for one in timing])))
    merged["rounding"] = max(one["rounding"] for one in timing)
    if "clock_ratio" in timing[0]:
        merged["clock_ratio"] = float(np.mean([one["clock_ratio"] for one in timing]))
    return merged


def _common(parts: Sequence[tuple[int, Sequence[str]]]) -> list[str]:
    """Return each kind of note once, with the part that it comes from where not all say it alike."""
    found: dict[str, list[tuple[int, str]]] = {}
    for row, notes in parts:
        for note in notes:
            found.setdefault(re.sub(r"[0-9][0-9.e+-]*", "#", note), []).append((row, note))
    said = []
    for alike in found.values():
        row, note = alike[0]
        if len(alike) == len(parts) and len({text for _, text in alike}) == 1:
            said.append(note)
            continue
        others = f", and likewise in {len(alike) - 1} other parts of {len(parts)}" if len(alike) > 1 else ""
        said.append(f"{note} (in the part from data row {row + 1} on{others})")
    return said
