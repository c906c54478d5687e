"""From the columns of a file to records: time base, missing rows, units, constant axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray, FloatArray
from models.units import unit_value
from tuner.formats.axis_words import axes_text
from tuner.readers import column_names as names
from tuner.readers.bad_rows import BadRows, LogRows, expect_few
from tuner.readers.column_units import UnitChoice, sensor_unit
from tuner.readers.columns import Listing, Part
from tuner.readers.constant_axes import without_constant_axes
from tuner.readers.options import STAMP, Options, stated_rate
from tuner.readers.refusal import Change, Refusal, RowsApart
from tuner.readers.sample_grid import sample_grid
from tuner.readers.sensor_columns import NO_COLUMN, Layout, choose, exchanged, of_mavlink
from tuner.readers.time_base import Timebase
from tuner.readers.unit_checks import check_units
from tuner.readers.value_checks import about_limiting_step, limiting_step
from tuner.readers.words import as_signed
from tuner.types.one_line import printable
from tuner.types.records import DataError, Record

UNREADABLE_SHARE = 0.01
"""Largest share of rows with NaN or infinity that is repaired."""
_SI_UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


@dataclass(frozen=True)
class Plan:
    """Which columns of a file are read, in which units, and what is to be said of that."""

    layout: Layout
    units: Mapping[str, UnitChoice]
    notes: tuple[str, ...]

    @property
    def groups(self) -> list[tuple[Part, ...]]:
        """The columns to read: of each sensor, each covariate, and the time."""
        layout = self.layout
        groups = [s.parts for s in layout.sensors]
        groups += [channel.parts for channel in layout.covariates.values()]
        return groups if layout.time is None else [*groups, layout.time.parts]


@dataclass(frozen=True)
class EvenRecords:
    """Records on an even grid whose units and values were not judged yet, with what is to be said of them.

    These are notes, assumptions, those that the samples speak against, the rows that hold no measurement, how many of
    these are at the beginning and at the end, readings of an unusual clock, and how far this is set back at the end, s.
    """

    records: tuple[Record, ...]
    notes: tuple[str, ...]
    assumptions: tuple[str, ...] = ()
    bad: tuple[BadRows, ...] = ()
    edges: tuple[int, int] = (0, 0)
    late: float = 0.0


def plan_of(listing: Listing, options: Options) -> Plan:
    """Choose the columns of a file and their units; refuse a unit that is none, of a sensor that is not there, too."""
    for sensor, unit in options.unit.items():
        if unit is not None:
            names.unit_of(unit, names.UNITS[sensor], what=f"--{sensor}-unit")
    layout = choose(listing, columns=options.columns)
    notes = [*listing.notes, *layout.notes]
    units = {s.name: sensor_unit(listing, s, options, notes) for s in layout.sensors}
    return Plan(layout, units, tuple(notes))


def even(
    listing: Listing, plan: Plan, digest: str, options: Options, within: LogRows | None = None
) -> EvenRecords:
    """Read the columns and put them on an even grid, in SI units.

    `within` says which rows of a log they are; None for all.

    Raises
    ------
    DataError
        Where they cannot be, or too many rows hold no measurement.
    """
    layout, units = plan.layout, plan.units
    notes: list[str] = []
    bad: list[BadRows] = []
    time, blocks, covariates = _load(listing, plan, options)
    blocks, words = as_signed(blocks, [sensor.axes for sensor in layout.sensors])
    rate = options.rate if options.rate is not None else stated_rate(listing.meta)
    groups = {s.name: block for s, block in zip(layout.sensors, blocks, strict=True)}
    within = within or LogRows(0, len(blocks[0]))
    try:
        valid = _valid_rows(groups if time is None else groups | {"t": time}, notes, bad, within)
        base, clock = sample_grid(
            listing,
            layout,
            groups,
            time,
            covariates.pop("week", None),
            valid,
            rate,
            options,
            within=within,
            notes=notes,
            bad=bad,
        )
    except Refusal as error:
        raise type(error)(f"{listing.path}: {error}", error.changes) from None
    except DataError as error:
        raise DataError(f"{listing.path}: {error}") from None
    notes += base.notes(even=not options.stamps)
    origin = 0.0 if clock is None else clock.origin
    t = base.t + origin if origin else base.t
    course = None if clock is None else base.stamp_course(clock.stamps) + np.array([origin, 0.0, 0.0, 0.0])
    channels = {
        name: filled
        for name, column in covariates.items()
        if (filled := _covariate(base, name, column, layout.covariates[name].unit, notes)) is not None
    }
    if options.stamps and clock is not None:
        channels[STAMP] = base.regrid(clock.stamps) + origin
    records = []
    for number, (sensor, block) in enumerate(zip(layout.sensors, blocks, strict=True)):
        choice = units[sensor.name]
        unit = choice.unit
        factor = unit_value(unit) * choice.scale / (base.interval if unit in names.INCREMENT_UNITS else 1.0)
        y = _regridded(base, block, choice.offset, factor, 3 * number)
        if unit in names.INCREMENT_UNITS:
            notes.append(
                f"{sensor.name}: increments in {unit} were divided by the interval {base.interval:.9g} s"
            )
        records.append(
            Record(
                name=sensor.name,
                t=t,
                y=y,
                axes=sensor.axes,
                unit=_SI_UNITS[sensor.name],
                interval=base.interval,
                segments=base.segments,
                covariates=MappingProxyType(channels),
                source=printable(listing.path.name),
                digest=digest,
                timing=MappingProxyType({} if clock is None else _timing(base, rate)),
                broken=MappingProxyType(_broken(bad, sensor.axes, factor)),
                stamp_course=course,
            )
        )
    kept = base.rows
    edges = (0, 0) if kept is None else (int(kept.min()), len(blocks[0]) - 1 - int(kept.max()))
    assumptions = (*words, *(() if clock is None else clock.assumptions), *base.assumptions)
    return EvenRecords(tuple(records), tuple(notes), assumptions, bad=tuple(bad), edges=edges, late=base.late)


def checked(
    listing: Listing, plan: Plan, found: EvenRecords, options: Options, part: Sequence[Record] | None = None
) -> tuple[Record, ...]:
    """Judge units and values, leave out constant axes, and say everything that is to be known of the records.

    Where the records hold means, `part` are samples as the log has them, by which units and quantizers are judged.
    """
    records, notes, assumptions = found.records, [*plan.notes, *found.notes], list(found.assumptions)
    single = records if part is None else part
    if not any(np.ptp(record.y[:, j]) > 0.0 for record in records for j in range(len(record.axes))):
        raise DataError(
            f"{listing.path}: every axis is constant: a sensor that was off, or the wrong columns; "
            "choose others with --columns"
        )
    varying = [one for record in single for one in _telling(record)]
    remarks, said_first = check_units(
        str(listing.path),
        varying,
        plan.units,
        assume_si=options.assume_si,
        tried=options.tried,
        kinds=options.requested != "sums",
        others=(*of_mavlink(plan.layout), *exchanged(plan.layout)),
        exchange=partial(exchanged, plan.layout),
    )
    notes += remarks
    live = without_constant_axes(records, notes, keep=options.constant_axes)
    steps = {}
    for axis, one, y in ((a, r, y) for r in single for a, y in zip(r.axes, r.y.T, strict=True)):
        if any(axis in record.axes for record in live) and (step := limiting_step(y)) is not None:
            steps[axis] = step
            notes.append(about_limiting_step(axis, step, one.unit))
    first = [said_first[record.name] for record in live if record.name in said_first]
    assumptions = [*(one.text for one in first), *assumptions]
    contradicted = [*(one.contradicted for one in first if one.contradicted), *plan.layout.unread]
    kept = {axis for record in live for axis in record.axes}
    if lost := [axis for record in records for axis in record.axes if axis not in kept]:
        contradicted.append(f"{axes_text(lost)}, left out: constant, dead or no measurement")
    for sensor in live:
        for (axis, y), (other, again) in combinations(zip(sensor.axes, sensor.y.T, strict=True), 2):
            if np.array_equal(y, again):
                contradicted.append(
                    f"{axes_text([axis, other])}, one column twice: they agree sample for sample"
                )
    said = tuple(dict.fromkeys(printable(note) for note in [*assumptions, *notes]))
    return tuple(
        replace(
            record,
            notes=said,
            assumptions=tuple(assumptions),
            contradicted=tuple(contradicted),
            unit_unstated=record.name in said_first and said_first[record.name].unstated,
            limiting_steps=MappingProxyType({axis: steps[axis] for axis in record.axes if axis in steps}),
        )
        for record in live
    )


def _telling(record: Record) -> list[Record]:
    """Return a sensor without what says nothing of its unit: constant gyroscopes; a constant axis may hold gravity."""
    live = np.ptp(record.y, axis=0) > 0.0
    if record.name == "accel" or live.all():
        return [record] if live.any() else []
    axes = tuple(axis for axis, moves in zip(record.axes, live, strict=True) if moves)
    return [replace(record, y=record.y[:, live], axes=axes)] if axes else []


def _load(
    listing: Listing, plan: Plan, options: Options
) -> tuple[NDArray[Any] | None, list[NDArray[Any]], dict[str, FloatArray]]:
    """Return the time column, one block a sensor, and the covariates."""
    layout = plan.layout
    loaded = listing.load(plan.groups)
    count = len(layout.sensors)
    blocks = list(loaded[:count])
    lengths = {s.name: len(b) for s, b in zip(layout.sensors, blocks, strict=True)}
    if layout.time is not None:
        lengths["t"] = len(loaded[-1])
    if len(set(lengths.values())) > 1:
        sizes = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise DataError(
            f"{listing.path}: columns must have one length: {sizes} rows; choose others with --columns"
        )
    if not len(blocks[0]):
        raise DataError(f"{listing.path}: no data rows")
    if NO_COLUMN in (options.columns or {}).values() and len(blocks) == 1 and blocks[0].dtype.kind == "f":
        own = (
            np.isfinite(blocks[0]).any(axis=1).reshape(-1)
        )  # rows of the sensor that is left out are none of this one's
        loaded = tuple(group[own] if len(group) == len(own) else group for group in loaded)
        blocks = [np.asfortranarray(loaded[0])]
    covariates = {
        name: np.asarray(column[:, 0], float)
        for name, column in zip(layout.covariates, loaded[count:], strict=False)
    }
    for name, column in covariates.items():
        if len(column) != len(blocks[0]):
            leave = ", or none by --columns temperature=none" if name == "temperature" else ""
            raise DataError(
                f"{listing.path}: {name}: expected a value for each of {len(blocks[0])} samples, got {len(column)}; "
                f"give it at every sample, choose another with --columns {name}=NAME{leave}"
            )
    return (loaded[-1][:, 0] if layout.time is not None else None), blocks, covariates


def _valid_rows(
    groups: Mapping[str, NDArray[Any]], notes: list[str], bad: list[BadRows], within: LogRows
) -> BoolArray | None:
    """Return which rows hold a number in every group (None: all); trim streams to their common span."""
    masks = {}
    for name, group in groups.items():
        if group.dtype.kind == "f":
            finite = np.isfinite(group)
            mask = finite.all(axis=1) if finite.ndim == 2 else finite
            if not mask.all():
                masks[name] = mask
    if not masks:
        return None
    count = len(next(iter(groups.values())))
    first, last = 0, count
    part = f" in data rows {within.first + 1} to {within.first + count}" if count < within.count else ""
    for name, mask in masks.items():
        if not mask.any():
            cure = (
                "leave it out by --columns t=none --rate HZ"
                if name == "t"
                else "choose others with --columns"
            )
            raise DataError(f"{name} holds no row without NaN{part}: {cure}")
        if within.first == 0:
            first = max(first, int(mask.argmax()))
        if within.first + count >= within.count:
            last = min(last, count - int(mask[::-1].argmax()))
    valid: BoolArray = np.logical_and.reduce(list(masks.values()))
    if {"gyro", "accel"} <= masks.keys() and 2 * np.count_nonzero(
        (masks["gyro"] ^ masks["accel"])[first:last]
    ) > count:
        sizes = ", ".join(f"{name} in {np.count_nonzero(masks[name])}" for name in ("gyro", "accel"))
        raise RowsApart(
            f"gyro and accel stand in different rows ({sizes} of {count}), as two topics in one table do: they cannot "
            "be read together",
            [Change(columns={name: NO_COLUMN}) for name in ("accel", "gyro")],
        )
    number = int((~valid[first:last]).sum())
    if number:
        row = within.first + first + int(np.argmin(valid[first:last])) + 1
        cure = (
            "leave the time column out by --columns t=none --rate HZ"
            if "t" in masks
            else "choose other columns"
        )
        place = f"first: data row {row}"
        bad.append(BadRows(number, "NaN or infinity", place, UNREADABLE_SHARE, f"cut them out, or {cure}"))
        expect_few(bad, within.count - (count - (last - first)))
    if not valid.any():
        raise DataError(f"gyro and accel do not overlap in time{part}")
    if count - (last - first):
        notes.append(
            f"{count - (last - first)} rows before or after the common span of the sensors were left out"
        )
    if number:
        notes.append(f"{number} rows with NaN or infinity count as missing samples")
    return valid


def _covariate(
    base: Timebase, name: str, column: FloatArray, unit: str | None, notes: list[str]
) -> FloatArray | None:
    """Return a covariate on the grid, its own missing values interpolated; None where it holds no number.

    A temperature in kelvin becomes °C; other units stay as found.
    """
    finite = np.isfinite(column)
    if not finite.any():
        notes.append(f"{name}: no numbers; left out")
        return None
    if not finite.all():
        notes.append(f"{name}: {int((~finite).sum())} missing values were interpolated")
        column = np.interp(np.arange(len(column)), np.flatnonzero(finite), column[finite])
    if name == "temperature" and unit is not None:
        known = names.known_unit(unit)
        if known == "K":
            column = column - 273.15
        elif known != "degC":
            notes.append(f"temperature is kept in '{unit}' as found")
    return base.regrid(column)


def _regridded(base: Timebase, block: NDArray[Any], offset: float, factor: float, first: int) -> FloatArray:
    """Return (block - offset) · factor on the grid, of axes from number `first`; an even block is scaled in place."""
    if base.rows is None and base.positions is None and block.dtype == np.float64:
        y: FloatArray = block
    else:
        y = np.empty((len(base.t), block.shape[1]), order="F")
        for j in range(block.shape[1]):
            y[:, j] = base.bridge(block[:, j], first + j)
    if offset:
        y -= offset
    if factor != 1.0:
        y *= factor
    return y


def _broken(bad: Sequence[BadRows], axes: Sequence[str], factor: float) -> dict[str, tuple[int, float]]:
    """Return by axis how many readings are broken, and how far off they are, in SI (median)."""
    off = {axis: values for one in bad for axis, values in one.off.items() if axis in axes}
    return {axis: (len(values), abs(factor) * float(np.median(values))) for axis, values in off.items()}


def _timing(base: Timebase, rate: float | None) -> dict[str, float]:
    timing = {
        "gap_count": float(base.gaps - base.unread),
        "missing": float(base.missing),
        "bridged": float(base.bridged),
        "duplicates": float(base.duplicates),
        "disordered": float(base.disordered),
        "jitter_sd": base.jitter,
        "rounding": base.rounding,
    }
    return timing if rate is None else timing | {"clock_ratio": rate * base.interval}
