"""Data quality: tests of the samples themselves, before any noise is modelled.

Each test is exact or free of the distribution of the noise: frozen readings
(`tuner.segments.frozen`), repeated samples (`tuner.diagnosis.data_quality.repeated_samples`), saturation
(`tuner.diagnosis.data_quality.saturation`), the quantizer (`tuner.segments.quantizer`) and the time
stamps. A quantizer whose step is at most two white sd is a note: it only adds step²/12 to the variance. All other
tests use the samples outside of frozen stretches; where samples repeat the one before, saturation and quantizer are
tested on those that do not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.probability import MEDIAN_OVER_MEAN_SD, REACH_95, poisson_interval, rounding_variance
from tuner.diagnosis.data_quality.copied_samples import Lines, Packets, find_lines, find_packets
from tuner.diagnosis.data_quality.copied_stretches import find_copied_stretches
from tuner.diagnosis.data_quality.overflow import find_overflow, unwrapped
from tuner.diagnosis.data_quality.repeated_samples import find_repeated_samples
from tuner.diagnosis.data_quality.resampled import find_resampled
from tuner.diagnosis.data_quality.saturation import rails
from tuner.diagnosis.data_quality.slower_source import find_slower_source, new_readings
from tuner.formats.customary_units import digits, percent
from tuner.segments.error_codes import ErrorCodes, find_error_codes, without_error_codes
from tuner.segments.frozen import Frozen, cut, frozen, together
from tuner.segments.quantizer import quantizer_step, read_codes
from tuner.segments.wrong_readings import WrongReadings, find_wrong_readings, without_wrong_readings
from tuner.types import Coefficient
from tuner.types.clock import HALF_INTERVAL
from tuner.types.records import Record

MIN_JITTER = 1e-3
"""Jitter of the time stamps that is a finding, share of the interval.

Chosen so that what it adds to a sample, jitter × slope of the signal, stays far below the noise of a stationary log.
"""
MAX_ROUNDING_RATIO = 1.05
"""Sd of the stamps ÷ the largest that rounding makes, u/√8, up to which rounding explains all of it.

Chosen so that the sampling error of that sd, 1/√(2n) < 3 % for the 1024 samples a record needs, does not decide.
"""
DECISIVE_P_VALUE = 1e-4
"""P-value below which a test decides how the others are made, and what is reported.

Chosen near the share of one test in a data set's false-alarm budget of 0.3 %, a few dozen tests.
"""
MIN_CLOCK_DRIFT = 1e-6
"""Relative deviation of the clock that is a finding; chosen as what a quartz oscillator of good quality keeps."""


@dataclass(frozen=True)
class DataQualityTest:
    """Result of one data-quality test of a channel or sensor.

    Attributes
    ----------
    cause : str
        ``duplicates timing overflow clipping lattice repeated_packets interpolated error_code spikes``.
    channels : tuple of str
        Axes it concerns.
    statistic : float
        Size of the effect in the unit of the test.
    p_value : float
        Chance of such data without the cause; 0 where there is nothing to chance about it.
    parameters : mapping of str to Coefficient
        By the names of `models.effects`.
    note : bool
        Present, but harmless: reported, not corrected.
    text : str
        The same in words.
    stretches : tuple of (int, int)
        Samples that say nothing: frozen ones.
    level : float, optional
        Median of the samples that its readings lie about, where these are not about zero, unit.
    copies : ndarray of bool, shape (n,), optional
        Rows that are known to repeat the one before.
    """

    cause: str
    channels: tuple[str, ...]
    statistic: float
    p_value: float
    parameters: Mapping[str, Coefficient] = field(default_factory=lambda: MappingProxyType({}))
    note: bool = False
    text: str = ""
    stretches: tuple[tuple[int, int], ...] = ()
    level: float | None = None
    copies: NDArray[np.bool_] | None = None


def data_quality_tests(
    record: Record, resting: Sequence[tuple[int, int]] | None = None
) -> tuple[DataQualityTest, ...]:
    """Run every test on a record.

    Parameters
    ----------
    record : Record
        Samples of one sensor.
    resting : sequence of (start, stop), optional
        Those at rest, of which rails, steps and lines are judged; without it those of all segments. All are
        taken where samples wrap, which looks like motion.

    Returns
    -------
    tuple of DataQualityTest
        All tests, passed or not: the caller holds the p-values against its budget of false alarms.
    """
    stuck = frozen_stretches(record)
    rest = record if resting is None else replace(record, segments=tuple(resting))
    single = {axis: without_frozen(record, (axis,), stuck).pieces(axis) for axis in record.axes}
    steps = {axis: quantizer_step(pieces, record.samples_a_mean) for axis, pieces in single.items()}
    repeated = duplicates(record, steps, stuck)
    lines: dict[str, Lines] = {}
    tests = [timing(record), *stuck, *repeated]
    if all(test.p_value > DECISIVE_P_VALUE for test in repeated):
        tests += packets(record)
    for axis, pieces in single.items():
        every, fresh = pieces, without_frozen(rest, (axis,), stuck).pieces(axis)
        for test in repeated:
            if test.p_value < DECISIVE_P_VALUE and axis in test.channels:
                every = new_readings(record, axis, every, test.copies)
                fresh = new_readings(rest, axis, fresh, test.copies)
        wrapped = overflow(every, steps[axis], axis=axis, unit=record.unit)
        if wrapped.p_value < DECISIVE_P_VALUE:
            fresh = tuple(unwrapped(piece, wrapped.statistic) for piece in every)
        tests += [
            wrapped,
            quantizer_test(fresh, steps[axis], record.samples_a_mean, axis=axis, unit=record.unit),
        ]
        if record.samples_a_mean == 1:  # no rail ends a mean of samples
            tests.append(clipping(fresh, steps[axis], axis=axis, unit=record.unit))
        found = find_lines(fresh, steps[axis])
        lines[axis] = found if found.p_value < DECISIVE_P_VALUE else find_resampled(fresh)
    return (*tests, *interpolated(lines))


def without_codes(record: Record) -> tuple[Record, tuple[DataQualityTest, ...]]:
    """Return a record with other rows in place of error codes and wrong readings, and the tests that found these."""
    codes = find_error_codes(record)
    coded = without_error_codes(record, codes)
    wrong = find_wrong_readings(coded)
    tests = [_error_code_test(record, one) for one in codes] + [_wrong_test(coded, one) for one in wrong]
    tests += [_broken_test(record, axis, *one) for axis, one in record.broken.items()]
    return without_wrong_readings(coded, wrong), tuple(tests)


def _wrong_test(record: Record, found: WrongReadings) -> DataQualityTest:
    """Return the test of wrong readings of an axis: how many a second, and their median size."""
    count, size = len(found.sizes), float(np.median(found.sizes))
    half = HALF_INTERVAL * MEDIAN_OVER_MEAN_SD * float(np.std(found.sizes)) / math.sqrt(count)
    parameters = {
        "rate": _rate(record, count),
        "size": Coefficient.known(size, max(size - half, 0.0), size + half, record.unit),
    }
    return DataQualityTest(
        "spikes", (found.axis,), float(count), found.p_value, parameters, text=found.describe(record)
    )


def _broken_test(record: Record, axis: str, count: int, size: float) -> DataQualityTest:
    """Return the test of readings that no sensor makes, which the reader left out."""
    parameters = {"rate": _rate(record, count), "size": Coefficient.known(size, size, size, record.unit)}
    text = f"{count} readings are off by {digits(size, 3)} {record.unit} (median)"
    return DataQualityTest("spikes", (axis,), float(count), 0.0, parameters, text=text)


def _rate(record: Record, count: int) -> Coefficient:
    """Return how often something occurs that was counted."""
    low, high = poisson_interval(count)
    seconds = len(record) * record.interval
    return Coefficient.known(count / seconds, low / seconds, high / seconds, "1/s")


def _error_code_test(record: Record, found: ErrorCodes) -> DataQualityTest:
    """Return the test of one constant, which share of the rows has it, and where they are."""
    share, first = float(found.rows.mean()), float(record.t[found.begins[0]])
    rows, values = float(np.count_nonzero(found.rows)), set(found.values.values())
    parameters = {
        "fraction": Coefficient.known(share, share, share, "1"),
        "count": Coefficient.known(rows, rows, rows, "1"),
        "start": Coefficient.known(first, first, first, "s"),
        "length": Coefficient.known(float(found.longest), float(found.longest), float(found.longest), "1"),
    }
    if len(values) == 1:
        value = values.pop()
        parameters["value"] = Coefficient.known(value, value, value, record.unit)
    if found.period:
        period = float(found.period)
        parameters["period"] = Coefficient.known(period, period, period, "1")
    return DataQualityTest(
        "error_code", tuple(found.values), rows, found.p_value, parameters, text=found.describe(record)
    )


def timing(record: Record) -> DataQualityTest:
    """Test the time stamps of a record for gaps, jitter and the rate of the clock.

    Stamps rounded to a unit u scatter by what is f (1 − f) u²/2 ≤ u²/8 in half the variance of their steps, f the
    fraction of the interval beyond a whole number of units: that much is rounding, a note, and no jitter. The rate of
    the clock is known to a unit in the whole record then. Its interval is that of slopes within the segments: how long
    the gaps between them were is not known to a part of a sample.
    """
    said = record.timing
    gaps, scatter = said.get("gap_count", 0.0), said.get("jitter_sd", 0.0)
    unit = said.get("rounding", 0.0)
    rounded = 0.0 < scatter < MAX_ROUNDING_RATIO * unit / math.sqrt(8.0)
    jitter = 0.0 if rounded else math.sqrt(max(scatter**2 - rounding_variance(unit), 0.0)) / record.interval
    ratio = said.get("clock_ratio", 1.0)
    lengths = np.array([float(last - first) for first, last in record.segments])
    spread = REACH_95 * scatter / record.interval * math.sqrt(12.0 / max(float(np.sum(lengths**3)), 1.0))
    spread += unit / (len(record) * record.interval)
    bad = gaps > 0 or jitter > MIN_JITTER or abs(ratio - 1.0) > MIN_CLOCK_DRIFT + spread
    parameters = {"gap_count": Coefficient.known(gaps, gaps, gaps, "1")}
    text = f"{gaps:.0f} gaps"
    if jitter > 0.0:
        text += f", stamps scatter by {100 * jitter:.3g} % of the interval"
    if unit > 0.0:
        parameters["rounding"] = Coefficient.known(unit, unit, unit, "s")
        text += f", rounded to {unit:.6g} s"
    if jitter > 0.0:
        sd, error = jitter * record.interval, REACH_95 / math.sqrt(2.0 * len(record))
        parameters["jitter_sd"] = Coefficient.known(sd, sd * (1.0 - error), sd * (1.0 + error), "s")
    if "clock_ratio" in said:
        parameters["clock_ratio"] = Coefficient.known(ratio, ratio - spread, ratio + spread, "1")
        text += f", clock ratio {ratio:.8g}"
    note = rounded and not bad
    p_value = 0.0 if bad or rounded else 1.0
    return DataQualityTest("timing", record.axes, gaps, p_value, parameters, note=note, text=text)


def frozen_stretches(record: Record) -> list[DataQualityTest]:
    """Return the frozen stretches: axes that froze together in one test."""
    found = [(axis, one) for axis in record.axes if (one := frozen(record, axis)) is not None]
    return [_frozen_test(record, group) for group in together(found)]


def _frozen_test(record: Record, group: Sequence[tuple[str, Frozen]]) -> DataQualityTest:
    """Return the test of axes that froze at the same times, measured on the one in which chance adds least."""
    best = min((one for _, one in group), key=lambda one: (one.slack, one.repeated))
    (first, last), dt, n = best.longest, record.interval, len(record)
    number, slack = len(best.stretches), best.slack
    begin, length = float(record.t[first]), (last - first) * dt
    free = number * (1 + 2 * slack)
    parameters = {
        "fraction": Coefficient.known(
            best.repeated / n, max(best.repeated - free, 0) / n, (best.repeated + number) / n, "1"
        ),
        "count": Coefficient.known(float(number), float(number), float(number), "1"),
        "start": Coefficient.known(begin, begin, begin + (1 + slack) * dt, "s"),
        "duration": Coefficient.known(length, max(length - (1 + 2 * slack) * dt, dt), length, "s"),
    }
    plural = "es" if number > 1 else ""
    text = (
        f"{number} stretch{plural}, {100 * best.repeated / n:.3g} % of the samples; "
        f"the longest lasts {length:.6g} s, from {begin:.6g} s on"
    )
    return DataQualityTest(
        "duplicates",
        tuple(axis for axis, _ in group),
        float(last - first),
        max(one.p_value for _, one in group),
        parameters,
        text=text,
        stretches=tuple(
            (min(edges[0]), max(edges[1]))
            for edges in (
                tuple(zip(*same, strict=True))
                for same in zip(*(one.stretches for _, one in group), strict=True)
            )
        ),
    )


def without_frozen(record: Record, axes: tuple[str, ...], tests: Sequence[DataQualityTest]) -> Record:
    """Return some axes of a record, without the stretches in which one of them was frozen."""
    stretches = [stretch for test in tests if set(axes) & set(test.channels) for stretch in test.stretches]
    columns = [record.axes.index(axis) for axis in axes]
    if columns == list(range(columns[0], columns[0] + len(columns))):
        y = record.y[:, columns[0] : columns[0] + len(columns)]  # no copy
    else:
        y = record.y[:, columns]
    return replace(record, y=y, axes=axes, segments=cut(record.segments, stretches))


def duplicates(
    record: Record, steps: Mapping[str, float], stuck: Sequence[DataQualityTest] = ()
) -> tuple[DataQualityTest, ...]:
    """Test for repeated samples: of all axes together, and of each axis where they do not repeat together.

    Parameters
    ----------
    record : Record
        Samples of one sensor.
    steps : mapping of str to float
        Quantizer step of each axis, unit; 0 for none.
    stuck : sequence of DataQualityTest
        Those that found frozen stretches: what is in these does not count.
    """
    tests = [_duplicates(without_frozen(record, record.axes, stuck), steps)]
    if len(record.axes) > 1 and tests[0].p_value > DECISIVE_P_VALUE:
        tests += [_duplicates(without_frozen(record, (axis,), stuck), steps) for axis in record.axes]
    return tuple(tests)


def _duplicates(record: Record, steps: Mapping[str, float]) -> DataQualityTest:
    pieces = [record.y[start:stop] for start, stop in record.segments if stop - start > 2]
    slow = find_slower_source(record)
    if slow is not None:
        share, often = float(slow.copies.mean()), slow.period / slow.number
        text = f"each reading stands for {often:.4g} rows: {1.0 / (often * record.interval):.6g} Hz"
        known = {"fraction": Coefficient.known(share, share, share, "1")}
        return DataQualityTest(
            "duplicates", record.axes, often, slow.p_value, known, text=text, copies=slow.copies
        )
    repeated = find_repeated_samples(pieces, [steps[axis] for axis in record.axes])
    fraction = Coefficient.known(repeated.fraction, *repeated.interval, "1")
    text = f"{100 * repeated.fraction:.3g} % of the samples repeat the one before"
    return DataQualityTest(
        "duplicates", record.axes, repeated.statistic, repeated.p_value, {"fraction": fraction}, text=text
    )


def packets(record: Record) -> list[DataQualityTest]:
    """Test for packets that come twice: of all axes together, and of each axis where they do not come together.

    Where there are none, for whole stretches of all axes that come again.
    """
    found = [(record.axes, find_packets(record.y))]
    if len(record.axes) > 1 and found[0][1].p_value > DECISIVE_P_VALUE:
        found = [((axis,), find_packets(record.column(axis)[:, None])) for axis in record.axes]
    if not any(one.number for _, one in found):
        found = [(record.axes, find_copied_stretches(record.y))]
    return [_packets_test(axes, one) for axes, one in found if one.number]


def _packets_test(axes: tuple[str, ...], found: Packets) -> DataQualityTest:
    """Return the test of packets, with the copies as stretches that say nothing."""
    edge = np.diff(np.concatenate(([0], found.copies.astype(np.int8), [0])))
    share, length = float(found.copies.mean()), float(found.length)
    parameters = {
        "fraction": Coefficient.known(share, share, share, "1"),
        "length": Coefficient.known(length, length, length, "1"),
    }
    return DataQualityTest(
        "repeated_packets",
        axes,
        float(found.number),
        found.p_value,
        parameters,
        text=f"{found.number} packet(s) of {found.length} samples come twice",
        stretches=tuple(
            zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True)
        ),
    )


def interpolated(lines: Mapping[str, Lines]) -> list[DataQualityTest]:
    """Return the test of samples that lie on lines between their neighbours, one for all axes that have them."""
    axes = [axis for axis, found in lines.items() if found.p_value < DECISIVE_P_VALUE]
    if not axes:
        return []
    shares = sorted(lines[axis].share for axis in axes)
    parameters = {"fraction": Coefficient.known(shares[len(shares) // 2], shares[0], shares[-1], "1")}
    text = f"{100 * shares[-1]:.3g} % of the samples lie on lines between others, or follow from them"
    chance = max(lines[axis].p_value for axis in axes)
    return [DataQualityTest("interpolated", tuple(axes), shares[-1], chance, parameters, text=text)]


def overflow(pieces: Sequence[FloatArray], step: float, *, axis: str, unit: str) -> DataQualityTest:
    """Test whether samples of an axis, given as gap-free pieces (n,), wrap around the range of a register."""
    found = find_overflow(pieces, step)
    low, high, slack = found.low - 0.5 * step, found.high + 0.5 * step, found.slack
    parameters = {
        "low": Coefficient.known(low, low - slack, low + 0.5 * step, unit),
        "high": Coefficient.known(high, high - 0.5 * step, high + slack, unit),
    }
    text = (
        f"{found.count} samples beyond one end of the range of {found.low:.6g} to {found.high:.6g} {unit} "
        "came out at the other end"
    )
    level = None
    if found.p_value < DECISIVE_P_VALUE:
        level = float(np.median(np.concatenate([unwrapped(piece, high - low) for piece in pieces])))
    return DataQualityTest("overflow", (axis,), high - low, found.p_value, parameters, text=text, level=level)


def clipping(pieces: Sequence[FloatArray], step: float, *, axis: str, unit: str) -> DataQualityTest:
    """Test whether the range of an axis, given as gap-free pieces (n,), ends at rails."""
    low, high = rails(pieces, step)
    worst = min((low, high), key=lambda rail: rail.p_value)
    parameters = {
        name: Coefficient.known(rail.level, rail.level - 0.5 * step, rail.level + 0.5 * step, unit)
        for name, rail in (("low", low), ("high", high))
        if rail.p_value < DECISIVE_P_VALUE
    }
    if count := sum(rail.count for rail in (low, high) if rail.p_value < DECISIVE_P_VALUE):
        share = count / sum(map(len, pieces))
        parameters["fraction"] = Coefficient.known(share, share, share, "1")
    text = (
        f"{worst.count} samples lie at {worst.level:.6g} {unit}, none beyond; "
        f"{worst.crossings:.3g} were to be expected there"
    )
    level = float(np.median(np.concatenate(pieces))) if worst.p_value < DECISIVE_P_VALUE else None
    return DataQualityTest(
        "clipping", (axis,), worst.crossings, worst.p_value, parameters, text=text, level=level
    )


def quantizer_test(
    pieces: Sequence[FloatArray], spacing: float, samples_a_mean: int = 1, *, axis: str, unit: str
) -> DataQualityTest:
    """Test the quantizer of an axis: a note, or a finding where it is coarse, has a dead band or missing codes.

    `spacing` is the distance of the values in `pieces`, each of which is the mean of so many samples.
    """
    if spacing == 0.0:
        return DataQualityTest("lattice", (axis,), 0.0, 1.0, text="no quantizer")
    step = samples_a_mean * spacing
    codes = read_codes(pieces, step, samples_a_mean)
    p_value = 0.0 if codes.coarse else codes.p_value
    parameters = {"step": Coefficient.known(step, step, step, unit)}
    if codes.deadband > 0:
        half = 0.5 * step
        parameters["deadband"] = Coefficient.known(
            codes.deadband, max(codes.deadband - half, 0.0), codes.deadband + half, unit
        )
    ratio = step / codes.white_sd
    text = f"samples are multiples of {step:.6g} {unit}, {ratio:.3g} of the sd of the white noise"
    text += f"; {codes.missing} multiples between others never occur" if codes.missing else ""
    if codes.unevenness > 0.0:
        text += f"; the widths of codes differ by {percent(codes.unevenness)}"
    return DataQualityTest(
        "lattice",
        (axis,),
        ratio,
        p_value,
        parameters,
        note=p_value > DECISIVE_P_VALUE,
        text=text,
    )
