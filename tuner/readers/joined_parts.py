"""Parts of a log that is read once, joined to records of means of 2, 4, 8 … samples of it.

Neighbouring parts without a gap continue one another, and a short gap between them is bridged as in a part. Of what
happens within a mean, the Allan variances of shorter clusters are kept, from all samples.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from models.arrays import FloatArray
from tuner.readers.assemble import EvenRecords
from tuner.readers.gap_bridges import bridged
from tuner.readers.time_base import MAX_BRIDGED_GAP, MIN_SEGMENT_SAMPLES
from tuner.types.records import DataError, Record, ShortClusters

MAX_RATE_CHANGE = 1e-3
"""Relative difference of the rates of two parts of one record; clocks of sensors drift by less."""
BESIDE_SAMPLES = 1024
"""Samples on either side of a gap between two parts by which it is bridged: their correlations are known to 0.03."""
MIN_MEANS = 64
"""Means that a record must have; fewer where gaps leave no stretch of several means."""


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


class JoinedParts:
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
        self._before = self._rest
        self._differences = np.zeros(int(math.log2(size)), np.int64)
        self._sums = np.zeros((len(self._rest), len(self._differences)))
        self._last: float | None = None
        self._late = 0.0
        self._samples = 0
        self._interval = 0.0
        self._gaps, self._unread, self._lost, self._bridged = 0, 0, 0, 0
        self._timing: list[Mapping[str, float]] = []
        self._parts: list[tuple[int, EvenRecords]] = []

    def add(self, row: int, found: EvenRecords) -> None:
        """Take in the next part, whose first row is number `row`."""
        record = replace(found.records[0], t=found.records[0].t + self._late)
        self._late += found.late
        self._timing.append(record.timing)
        self._parts.append((row, replace(found, records=())))
        interval = self._interval / self._samples if self._samples else record.interval
        if abs(record.interval / interval - 1.0) > MAX_RATE_CHANGE:
            raise DataError(
                f"{self._source}: expected one rate, found {1.0 / interval:.6g} Hz and from data row {row + 1} on "
                f"{1.0 / record.interval:.6g} Hz: cut the log there"
            )
        columns = [record.t, *(y for r in found.records for y in r.y.T)]
        nothing = np.full(len(record), np.nan)
        columns += [record.covariates.get(name, nothing) for name in self._covariates]
        unread = self._unread + found.edges[0]
        for number, (start, stop) in enumerate(record.segments):
            stretch = [column[start:stop] for column in columns]
            lost = self._lost_before(row, record, interval, unread) if number == 0 else None
            if lost is None or lost > MAX_BRIDGED_GAP:
                self._rest = [np.empty(0) for _ in columns]
                self._segments.append((self._count, self._count))
                self._before = self._rest
            elif lost:
                self._append(_between(self._before, stretch, lost, len(columns) - 1 - len(self._covariates)))
                self._bridged += lost
            self._append(stretch)
            self._last = float(record.t[stop - 1])
            self._before = [
                np.concatenate([old, new])[-BESIDE_SAMPLES:]
                for old, new in zip(self._before, (one[-BESIDE_SAMPLES:] for one in stretch), strict=True)
            ]
        self._unread = found.edges[1]
        used = sum(stop - start for start, stop in record.segments)
        self._samples += used
        self._interval += used * record.interval

    def _lost_before(self, row: int, record: Record, interval: float, unread: int) -> int | None:
        """Return how many samples are missing between the part before and this one; None where there is none before.

        Of them, `unread` at most have stamps, which makes no gap of the clock.
        """
        if self._last is None:
            return None
        ahead = float(record.t[record.segments[0][0]]) - self._last
        timing = record.timing
        tolerance = 0.5 * interval + timing.get("rounding", 0.0) + 4.0 * timing.get("jitter_sd", 0.0)
        if ahead < -tolerance:
            raise DataError(
                f"{self._source}: the stamps go back by {interval - ahead:.6g} s about data row {row + 1}, and the "
                "log is too long to be sorted: sort it, cut it there, or allow more by --memory"
            )
        if ahead <= interval + tolerance:
            return 0
        lost = round(ahead / interval) - 1
        self._lost += lost
        if lost > unread:
            self._gaps += 1
        return lost

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
            raise DataError(
                f"{self._source}: too long to be kept whole, and its stretches without a gap are too "
                f"short for means of {self._size} samples: allow more by --memory, or cut the log"
            )
        time, *others = (one.finished() for one in self._means)
        records = []
        axes = [axis for r in self._first for axis in r.axes]
        short = {axis: self._short(1 + j) for j, axis in enumerate(axes)} if self._size > 1 else {}
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
                    timing=MappingProxyType(self._merged()),
                    broken=MappingProxyType({}),
                    samples_a_mean=self._size,
                    short_clusters=MappingProxyType(
                        {axis: short[axis] for axis in one.axes if axis in short}
                    ),
                )
            )
        said = (
            f"the log is long: means of {self._size} of its {self._samples} samples are kept, {kept}, and of what is "
            f"faster than {0.5 / (self._size * interval):.4g} Hz the Allan variances alone; --begin and --end keep all "
            "samples of a part, --memory GB more of the whole"
        )
        notes = [f"{name}: no numbers in some part of the log; left out" for name in gone]
        if self._bridged:
            notes.append(
                f"{self._bridged} missing samples between parts were simulated from those beside them"
            )
        if lost := self._samples + self._bridged - self._size * kept:
            notes.append(
                f"{lost} samples at the ends of stretches without a gap fill no mean and are left out"
            )
        return EvenRecords(
            tuple(records),
            (*_common([(row, found.notes) for row, found in self._parts]), *notes),
            (
                *([said] if self._size > 1 else []),
                *dict.fromkeys(a for _, one in self._parts for a in one.assumptions),
            ),
        )

    def _merged(self) -> dict[str, float]:
        """Return what the stamps of all parts said, and the missing samples between parts: counts add up."""
        timing = self._timing
        if not timing[0]:
            return {}
        between = {"gap_count": self._gaps, "missing": self._lost, "bridged": self._bridged}
        names = (*between, "duplicates", "disordered")
        merged = {name: float(sum(one[name] for one in timing) + between.get(name, 0)) for name in names}
        merged["jitter_sd"] = float(np.sqrt(np.mean([one["jitter_sd"] ** 2 for one in timing])))
        merged["rounding"] = max(one["rounding"] for one in timing)
        if "clock_ratio" in timing[0]:
            merged["clock_ratio"] = float(np.mean([one["clock_ratio"] for one in timing]))
        return merged

    def _short(self, column: int) -> ShortClusters:
        return ShortClusters(
            tuple(2**k for k in range(len(self._differences))),
            tuple(float(0.5 * s / n) for s, n in zip(self._sums[column], self._differences, strict=True)),
            tuple(int(n) for n in self._differences),
        )


def _between(
    before: Sequence[FloatArray], after: Sequence[FloatArray], lost: int, axes: int
) -> list[FloatArray]:
    """Return samples in place of those lost between two stretches, one array a column: the time, axes, covariates."""
    first, last = len(before[0]), min(len(after[0]), BESIDE_SAMPLES)
    places = np.concatenate([np.arange(first), first + lost + np.arange(last)])
    grid = (0, first + lost + last)
    found = []
    for number, (left, right) in enumerate(zip(before, after, strict=True)):
        samples = np.concatenate([left, right[:last]])
        if 1 <= number <= axes:
            whole = bridged(samples, places, (grid,), number)
        else:
            whole = np.interp(np.arange(*grid), places, samples)
        found.append(whole[first : first + lost])
    return found


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
