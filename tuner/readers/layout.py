"""Which columns of a file are the sensors: by name, or as the user maps them.

Rules, in order: what `columns` maps; a column named as ours or by an alias (`names.STEMS`); of arrays whose
name only contains a sensor's (``gyro_raw``, ``gyro_dps_1``) one named raw before others, then the longest,
and for the second sensor the one with the same ending and length as the first. A choice between several is
told in a note.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from tuner.readers import names
from tuner.readers.listing import Listing, Part
from tuner.records import DataError

AXES = ("x", "y", "z")
_SLICE = re.compile(r"^(?P<name>.+?)\[(?P<start>\d+)(?::(?P<stop>\d+))?\]$")


@dataclass(frozen=True)
class Sensor:
    """One sensor of a file: its columns, the axes they are, and their unit where one is stated."""

    name: str
    parts: tuple[Part, ...]
    axes: tuple[str, ...]
    unit: str | None


@dataclass(frozen=True)
class Layout:
    """What to read: time and its unit (or None), sensors, and further channels on the same clock."""

    time: Part | None
    time_unit: str | None
    sensors: tuple[Sensor, ...]
    covariates: Mapping[str, Part]
    covariate_units: Mapping[str, str | None]
    notes: tuple[str, ...]


def parse_columns(text: str) -> dict[str, str]:
    """Parse ``gyro=imu0[3:6],accel=imu0[0:3],t=stamp [ms]`` into a mapping of names to columns."""
    mapped = {}
    for entry in text.split(","):
        name, equals, column = entry.partition("=")
        if not equals or not name.strip() or not column.strip():
            msg = f"--columns: expected NAME=COLUMN, found '{entry.strip()}'"
            raise DataError(msg)
        mapped[name.strip()] = column.strip()
    return mapped


def choose(listing: Listing, *, columns: Mapping[str, str] | None = None) -> Layout:
    """Choose the columns of a file.

    Raises
    ------
    DataError
        Nothing that looks like a gyroscope or accelerometer, several candidates of equal right, or a mapped
        column that is not there.
    """
    parsed = {array: names.parse_name(array) for array in listing.shapes}
    mapped = {role: _mapped(listing, parsed, role, value) for role, value in (columns or {}).items()}
    notes: list[str] = []
    by_name = _by_name(parsed, {part.array for parts, _ in mapped.values() for part in parts})
    sensors: list[Sensor] = []
    for name in names.SENSORS:
        sensor = (
            _sensor_as_mapped(listing, name, mapped)
            or _sensor_by_name(listing, name, by_name, parsed)
            or _sensor_by_word(listing, name, parsed, sensors, notes)
        )
        if sensor is not None:
            sensors.append(sensor)
    if not sensors:
        raise DataError(_nothing_found(listing))
    time, time_unit = _single(listing, "t", mapped, by_name, parsed)
    covariates, covariate_units = {}, {}
    others = [role for role in mapped if role != "t" and role.split("_")[0] not in names.SENSORS]
    for role in dict.fromkeys(["temperature", *others]):
        part, unit = _single(listing, role, mapped, by_name, parsed)
        if part is not None:
            covariates[role], covariate_units[role] = part, unit
    return Layout(time, time_unit, tuple(sensors), covariates, covariate_units, tuple(notes))


def offered(listing: Listing) -> str:
    """Return what the file offers, in one line."""
    shown = [name if shape in ((0,), ()) else f"{name} {shape}" for name, shape in listing.shapes.items()]
    return (
        ", ".join(shown[:16]) + (f" and {len(shown) - 16} more" if len(shown) > 16 else "")
        if shown
        else "nothing"
    )


def _nothing_found(listing: Listing) -> str:
    wide = next((name for name, shape in listing.shapes.items() if len(shape) == 2 and shape[1] >= 6), None)
    single = next(iter(listing.shapes), "NAME")
    example = f"gyro={wide}[3:6],accel={wide}[0:3]" if wide else f"gyro_x={single}"
    return (
        f"{listing.path}: no gyro or accel column: expected names such as gyro_x or an (n, 3) array gyro, "
        "found "
        f"{offered(listing)}; map them with --columns, such as --columns '{example}'"
    )


def _mapped(
    listing: Listing, parsed: Mapping[str, names.ColumnName], role: str, value: str
) -> tuple[tuple[Part, ...], str | None]:
    """Return the columns and the unit that the user means by `value`."""
    unit = None
    if value not in listing.shapes:
        match = _SLICE.match(value)
        if match is None:
            stated = names.parse_name(value)
            if stated.unit is not None and "[" in value:
                value, unit = value[: value.index("[")].strip(), stated.unit
        else:
            value = match["name"]
    else:
        match = None
    array = _find(listing, parsed, role, value)
    width = listing.shapes[array][1] if len(listing.shapes[array]) == 2 else 1
    sensor = role.split("_")[0]
    if unit is None:
        unit = (
            _unit(listing, sensor, parsed[array])
            if sensor in names.SENSORS
            else _stated(listing, parsed[array])
        )
    if len(listing.shapes[array]) < 2:
        if match is not None:
            msg = (
                f"{listing.path}: --columns {role}={value}[…]: '{array}' has one column and cannot be sliced"
            )
            raise DataError(msg)
        return (Part(array),), unit
    start = int(match["start"]) if match else 0
    stop = (int(match["stop"]) if match["stop"] else start + 1) if match else width
    if not start < stop <= width:
        msg = (
            f"{listing.path}: --columns {role}={value}[{start}:{stop}]: '{array}' has columns 0 to "
            f"{width - 1}"
        )
        raise DataError(msg)
    return tuple(Part(array, j) for j in range(start, stop)), unit


def _find(listing: Listing, parsed: Mapping[str, names.ColumnName], role: str, value: str) -> str:
    if value in listing.shapes:
        return value
    plain = names.parse_name(value).plain
    same = [array for array in listing.shapes if parsed[array].plain == plain]
    if len(same) != 1:
        found = f"{len(same)} columns of that name" if same else f"found {offered(listing)}"
        msg = f"{listing.path}: --columns {role}={value}: no column '{value}': {found}"
        raise DataError(msg)
    return same[0]


def _by_name(parsed: Mapping[str, names.ColumnName], taken: set[str]) -> dict[str, list[tuple[int, str]]]:
    """Return the arrays of each role with their rank, best first."""
    found: dict[str, list[tuple[int, str]]] = {}
    for array, name in parsed.items():
        role = names.role_of(name)
        if role is not None and array not in taken:
            found.setdefault(role[0], []).append((role[1], array))
    return {role: sorted(arrays, key=lambda a: a[0]) for role, arrays in found.items()}


def _best(listing: Listing, role: str, arrays: list[tuple[int, str]]) -> str:
    best = [array for rank, array in arrays if rank == arrays[0][0]]
    if len(best) > 1:
        msg = (
            f"{listing.path}: several columns could be {role}: {', '.join(best)}; "
            f"choose one with --columns '{role}={best[0]}'"
        )
        raise DataError(msg)
    return best[0]


def _sensor_as_mapped(
    listing: Listing, name: str, mapped: Mapping[str, tuple[tuple[Part, ...], str | None]]
) -> Sensor | None:
    if name in mapped:
        parts, unit = mapped[name]
        if not 1 <= len(parts) <= 3:
            msg = (
                f"{listing.path}: --columns {name}: expected up to 3 columns, found {len(parts)} in "
                f"'{parts[0].array}'; "
                f"slice it, such as {name}={parts[0].array}[0:3]"
            )
            raise DataError(msg)
        return Sensor(name, parts, tuple(f"{name}_{a}" for a in AXES[: len(parts)]), unit)
    roles = [f"{name}_{a}" for a in AXES if f"{name}_{a}" in mapped]
    if not roles:
        return None
    units = {mapped[role][1] for role in roles}
    return Sensor(
        name, tuple(mapped[role][0][0] for role in roles), tuple(roles), _one_unit(listing, name, units)
    )


def _sensor_by_name(
    listing: Listing,
    name: str,
    by_name: Mapping[str, list[tuple[int, str]]],
    parsed: Mapping[str, names.ColumnName],
) -> Sensor | None:
    roles = [f"{name}_{a}" for a in AXES if f"{name}_{a}" in by_name]
    if roles:
        arrays = [_best(listing, role, by_name[role]) for role in roles]
        units = {_unit(listing, name, parsed[a]) for a in arrays}
        return Sensor(name, tuple(Part(a) for a in arrays), tuple(roles), _one_unit(listing, name, units))
    whole = [(rank, array) for rank, array in by_name.get(name, []) if _is_triad(listing, array)]
    if not whole:
        return None
    array = _best(listing, name, whole)
    return _triad(name, array, _unit(listing, name, parsed[array]))


def _sensor_by_word(
    listing: Listing,
    name: str,
    parsed: Mapping[str, names.ColumnName],
    chosen: list[Sensor],
    notes: list[str],
) -> Sensor | None:
    arrays = [a for a in parsed if _is_triad(listing, a) and names.sensor_of(parsed[a].plain) == name]
    if not arrays:
        return None
    lengths = {a: listing.shapes[a][0] for a in arrays}
    fellow = chosen[0].parts[0].array if chosen else None

    def right(array: str) -> tuple[bool, bool, bool, int]:
        same_end = fellow is not None and _ending(parsed[fellow].plain) == _ending(parsed[array].plain)
        same_length = fellow is None or listing.shapes[fellow][:1] == listing.shapes[array][:1]
        return not same_length, not same_end, "raw" not in parsed[array].plain.split("_"), -lengths[array]

    best = min(arrays, key=right)
    if len(arrays) > 1:
        rest = ", ".join(a for a in arrays if a != best)
        notes.append(
            f"{name} is '{best}' (raw before processed, then the longest); --columns {name}=… chooses {rest}"
        )
    return _triad(name, best, _unit(listing, name, parsed[best]))


def _ending(plain: str) -> str:
    return plain.rsplit("_", 1)[-1]


def _triad(name: str, array: str, unit: str | None) -> Sensor:
    return Sensor(name, tuple(Part(array, j) for j in range(3)), tuple(f"{name}_{a}" for a in AXES), unit)


def _is_triad(listing: Listing, array: str) -> bool:
    shape = listing.shapes[array]
    return len(shape) == 2 and shape[1] == 3


def _unit(listing: Listing, sensor: str, name: names.ColumnName) -> str | None:
    """Return the unit stated beside a column, in its name, or by the word increments."""
    stated = _stated(listing, name)
    if stated is not None:
        return stated
    if names.increments(name.plain):
        return "rad" if sensor == "gyro" else "m/s"
    return names.unit_in_words(name.plain, sensor)


def _stated(listing: Listing, name: names.ColumnName) -> str | None:
    return name.unit or listing.units.get(name.written)


def _one_unit(listing: Listing, sensor: str, units: set[str | None]) -> str | None:
    if len(units) > 1:
        shown = ", ".join(sorted(str(u) for u in units))
        msg = f"{listing.path}: the axes of {sensor} have different units ({shown}): pass --{sensor}-unit"
        raise DataError(msg)
    return units.pop()


def _single(
    listing: Listing,
    role: str,
    mapped: Mapping[str, tuple[tuple[Part, ...], str | None]],
    by_name: Mapping[str, list[tuple[int, str]]],
    parsed: Mapping[str, names.ColumnName],
) -> tuple[Part | None, str | None]:
    """Return the one column of a role and its stated unit."""
    if role in mapped:
        parts, unit = mapped[role]
        if len(parts) != 1:
            msg = (
                f"{listing.path}: --columns {role}: expected one column, found {len(parts)}; slice it, such "
                f"as {role}={parts[0].array}[0]"
            )
            raise DataError(msg)
        return parts[0], unit
    arrays = [(rank, a) for rank, a in by_name.get(role, []) if len(listing.shapes[a]) == 1]
    if not arrays:
        return None, None
    array = _best(listing, role, arrays)
    return Part(array), _stated(listing, parsed[array])
