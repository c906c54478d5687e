"""Parts of one log that were recorded under one condition: at rest, or at one temperature.

A coefficient of a whole log is a mean over its conditions. `still_parts` and `temperature_parts` cut the log
where these change, so that the parts can be identified on their own and compared (`tuner.identification.comparison`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from tuner.formats.axis_words import axes_text
from tuner.readers.time_base import MAX_BRIDGED_GAP
from tuner.segments.error_codes import find_error_codes, without_error_codes
from tuner.segments.frozen import cut, frozen, together
from tuner.segments.stand_stills import MIN_PART_SECONDS, MIN_SECONDS
from tuner.segments.stationary import Segments, cut_to_still, find_motion
from tuner.segments.withheld_noise import expect_noise
from tuner.segments.wrong_readings import find_wrong_readings, without_wrong_readings
from tuner.types.records import DataError, Record

MAX_PARTS = 8
"""Parts that are compared: the longest ones."""
MIN_PART_SAMPLES = 1024
"""Samples below which a part is not identified: its Allan curve would have two decades."""
MIN_RUN_SAMPLES = 64
"""Samples below which a run within a bin of temperature is left out."""
TEMPERATURE_BINS = 3
"""Bins of temperature, each with as many samples as the others: cold, medium, warm."""
SMOOTHING_TIME = 60.0
"""Length of the moving mean of the temperature, s: a reading that alternates between steps is one temperature."""
MIN_TEMPERATURE_RANGE = 1.0
"""Range of temperature below which there are no bins, K."""


@dataclass(frozen=True)
class Part:
    """A part of a log under one condition; `name` says which."""

    name: str
    records: tuple[Record, ...]


def clocks(records: Sequence[Record]) -> list[list[Record]]:
    """Return the records grouped by the clock they share."""
    groups: list[list[Record]] = []
    for record in records:
        for group in groups:
            first = group[0]
            if first.segments == record.segments and np.array_equal(first.t, record.t):
                group.append(record)
                break
        else:
            groups.append([record])
    return groups


def at_rest(records: Sequence[Record], say: Callable[[str], None] = lambda _: None) -> tuple[Record, ...]:
    """Return the records without error codes, cut to the parts in which the sensor stood still.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one log; those on one clock are judged together.
    say : callable, optional
        Receives a line about error codes and any motion.

    Raises
    ------
    DataError
        Nothing stands still, or the noise was taken out of the samples.
    """

    def resting(group: Sequence[Record]) -> Sequence[Record]:
        try:
            motion = find_motion(group)
        except DataError:
            return group
        return cut_to_still(group, motion)

    answer = _by_clock(tuple(map(_while_measured, without_codes(records))), resting)
    for line in dict.fromkeys(
        note for new, old in zip(answer, records, strict=True) for note in new.notes if note not in old.notes
    ):
        say(line)
    return expect_noise(answer)


def _while_measured(record: Record) -> Record:
    """Return a record without the long stretches in which axes are frozen: no rest, but no measurement.

    Where some axes stop while others go on, the sensor is not in order; all at once, its records are.
    """
    found = [(axis, one) for axis in record.axes if (one := frozen(record, axis))]
    long = {
        axis: tuple((a, b) for a, b in one.stretches if b - a > MAX_BRIDGED_GAP)
        for group in together(found)
        for axis, one in [(axes_text([axis for axis, _ in group]), group[0][1])]
    }
    left = cut(record.segments, sorted(stretch for stretches in long.values() for stretch in stretches))
    if left == record.segments or sum(b - a for a, b in left) < MIN_PART_SAMPLES:
        return record
    whole, faults = len(record) * record.interval, []
    for axes, stretches in long.items():
        seconds = sum(b - a for a, b in stretches) * record.interval
        faults += [f"{axes}: frozen for {seconds:.3g} s of {whole:.3g} s"] * (seconds > 0.0)
    some = faults if axes_text(record.axes) not in long else []
    notes = (f"{text}, left out" for text in faults)
    return replace(
        record,
        segments=left,
        notes=(*record.notes, *notes),
        contradicted=(*record.contradicted, *some),
    )


def without_codes(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records with other rows in place of error codes and wrong readings, which are no motion."""
    coded = [without_error_codes(record, find_error_codes(record)) for record in records]
    return tuple(without_wrong_readings(record, find_wrong_readings(record)) for record in coded)


def expect_rest(records: Sequence[Record]) -> None:
    """Refuse records at rest that are too short for the settings of a filter.

    A bias wanders over seconds and more: parts shorter than a pause of a hand show nothing of it, however many they
    are, and less than eight seconds of longer ones do not tell noise from motion.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one log, cut to their parts at rest.

    Raises
    ------
    DataError
        Parts of `MIN_SECONDS` or more make up less than `MIN_PART_SECONDS`.
    """
    for record in records:
        if text := too_short_for(record):
            raise DataError(
                f"{record.source}: too short for {text}: record longer, at rest and without losing samples"
            )


def too_short_for(record: Record) -> str:
    """Return what a record at rest is too short for, and why; "" where settings of a filter can be made of it."""
    lengths = [(stop - start) * record.interval for start, stop in record.segments]
    # Half a sample is left for the rounding of lengths to whole samples.
    long = [length for length in lengths if length > MIN_SECONDS - 0.5 * record.interval]
    if sum(long) + 0.5 * record.interval >= MIN_PART_SECONDS:
        return ""
    parts = f" in {len(lengths)} parts, the longest {max(lengths):.2g} s" if len(lengths) > 1 else ""
    return (
        f"settings of a filter, which need parts of {MIN_SECONDS:g} s or more at rest that make up "
        f"{MIN_PART_SECONDS:g} s, found {sum(lengths):.3g} s{parts}"
    )


def without_knocks(
    records: Sequence[Record],
) -> tuple[tuple[Record, ...], Mapping[str, Segments], Mapping[str, Segments]]:
    """Return whole records without knocks, and by axis the parts used as rest and those that moved.

    Where these are not known, an axis has none.
    """
    parts: dict[str, Segments] = {}
    moving: dict[str, Segments] = {}

    def bridged(group: Sequence[Record]) -> Sequence[Record]:
        try:
            motion = find_motion(group)
            resting = cut_to_still(group, motion)
        except DataError:
            return group
        axes = [axis for record in group for axis in record.axes]
        parts.update(dict.fromkeys(axes, resting[0].segments))
        moving.update(dict.fromkeys(axes, motion.moving))
        if not motion.knocks:
            return group
        return [replace(record, y=rest.y) for record, rest in zip(group, resting, strict=True)]

    return _by_clock(records, bridged), parts, moving


def _by_clock(
    records: Sequence[Record], change: Callable[[Sequence[Record]], Sequence[Record]]
) -> tuple[Record, ...]:
    """Return the records, in their order, after a change of those on each clock."""
    changed: dict[int, Record] = {}
    for group in clocks(records):
        for before, after in zip(group, change(group), strict=True):
            changed[id(before)] = after
    return tuple(changed[id(record)] for record in records)


def still_parts(records: Sequence[Record]) -> tuple[Part, ...]:
    """Return the longest stretches between motions, in order of time.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one log on one clock.

    Raises
    ------
    DataError
        Fewer than two stretches of `MIN_PART_SAMPLES` samples.
    """
    first = _one_clock(records)
    measured = without_codes(records)
    resting, _, _ = without_knocks(measured)
    still = [piece for piece in find_motion(measured).still if piece[1] - piece[0] >= MIN_PART_SAMPLES]
    longest = sorted(sorted(still, key=lambda piece: piece[0] - piece[1])[:MAX_PARTS])
    if len(longest) < 2:
        raise DataError(
            f"{first.source}: expected two or more stretches at rest of {MIN_PART_SAMPLES} samples, parted by motion, "
            f"found {len(longest)}; compare two logs instead"
        )
    return tuple(
        Part(f"{first.t[start]:.0f}–{first.t[stop - 1]:.0f} s", _cut(resting, ((start, stop),)))
        for start, stop in longest
    )


def temperature_parts(records: Sequence[Record]) -> tuple[Part, ...]:
    """Return the log at rest in bins of temperature, the coldest first, each with a third of the samples.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one log on one clock, with the covariate ``temperature``.

    Raises
    ------
    DataError
        No temperature, too little of it, or bins too short.
    """
    first = _one_clock(records)
    if "temperature" not in first.covariates:
        raise DataError(
            f"{first.source}: expected a column 'temperature', found none; --columns temperature=COLUMN names it"
        )
    celsius = uniform_filter1d(first.covariates["temperature"], max(1, round(SMOOTHING_TIME * first.rate)))
    if not np.ptp(celsius) >= MIN_TEMPERATURE_RANGE:
        raise DataError(
            f"{first.source}: the temperature stays within {np.ptp(celsius):.2g} K, "
            f"expected {MIN_TEMPERATURE_RANGE:g} K or more"
        )
    edges = np.quantile(celsius, np.linspace(0.0, 1.0, TEMPERATURE_BINS + 1))
    chosen = np.clip(np.searchsorted(edges, celsius, side="right") - 1, 0, TEMPERATURE_BINS - 1)
    resting = at_rest(records)
    parts = []
    for k in range(TEMPERATURE_BINS):
        segments = _runs(chosen == k, resting[0].segments)
        if sum(stop - start for start, stop in segments) >= MIN_PART_SAMPLES:
            name = f"{edges[k]:.1f}–{edges[k + 1]:.1f} °C"
            parts.append(Part(name, _cut(resting, segments)))
    if len(parts) < 2:
        raise DataError(
            f"{first.source}: expected two bins of temperature with {MIN_PART_SAMPLES} samples; record longer"
        )
    return tuple(parts)


def _one_clock(records: Sequence[Record]) -> Record:
    if len(clocks(records)) > 1:
        raise DataError(
            f"{records[0].source}: expected sensors on one clock, found several; compare one sensor at a time"
        )
    return records[0]


def _cut(records: Sequence[Record], segments: Segments) -> tuple[Record, ...]:
    return tuple(replace(record, segments=segments) for record in records)


def _runs(chosen: NDArray[np.bool_], segments: Segments) -> Segments:
    """Return the runs of chosen samples within segments, those long enough for an Allan variance."""
    runs = []
    for start, stop in segments:
        inside = np.concatenate(([False], chosen[start:stop], [False])).astype(np.int8)
        change = np.flatnonzero(np.diff(inside)) + start
        runs += [
            (int(a), int(b))
            for a, b in zip(change[::2], change[1::2], strict=True)
            if b - a >= MIN_RUN_SAMPLES
        ]
    return tuple(runs)
