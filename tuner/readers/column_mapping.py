"""What the user maps by ``--columns NAME=COLUMN,…``: our names to columns and slices of the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from tuner.readers import column_names as names
from tuner.readers.columns import Listing, Part
from tuner.types.records import DataError

AXES = ("x", "y", "z")
_SLICE = re.compile(r"^(?P<name>.+?)\[(?P<start>\d+)(?::(?P<stop>\d+))?\]$")
_UNIT = re.compile(r"^(?P<name>.+?)\s*\[(?P<unit>[^\]]+)\]$")


@dataclass(frozen=True)
class Chosen:
    """Columns that are one thing, with their unit where the user or the file states one."""

    parts: tuple[Part, ...]
    unit: str | None


def parse_columns(text: str) -> dict[str, str]:
    """Parse ``gyro=imu0[3:6],accel=imu0[0:3],t=stamp [ms]`` into a mapping of names to columns."""
    mapped = {}
    for entry in text.split(","):
        name, equals, column = entry.partition("=")
        if not equals or not name.strip() or not column.strip():
            raise DataError(f"--columns: expected NAME=COLUMN, found '{entry.strip()}'")
        mapped[name.strip()] = column.strip()
    return mapped


def resolve(listing: Listing, columns: Mapping[str, str]) -> dict[str, Chosen]:
    """Find the columns that the user maps, by role: ``t gyro accel gyro_x … temperature`` or a free name.

    Raises
    ------
    DataError
        A column that is not there, a slice out of range, or more columns than a role takes.
    """
    parsed = {array: names.parse_name(array) for array in listing.shapes}
    resolved = {}
    for name, value in columns.items():
        known = names.role_of(names.parse_name(name))
        role = known[0] if known is not None and known[1] == 0 else name
        found = _resolve(listing, parsed, role, value)
        most = 3 if role in names.SENSORS else 1
        if len(found.parts) > most:
            array = found.parts[0].array
            raise DataError(
                f"{listing.path}: --columns {name}={value}: expected "
                f"{'1 column' if most == 1 else 'up to 3'}, found {len(found.parts)}; slice it, such as "
                f"{name}={array}[0{':3' if most == 3 else ''}]"
            )
        resolved[role] = found
    return resolved


def stated_unit(listing: Listing, name: names.ColumnName, sensor: str | None = None) -> str | None:
    """Return the unit stated beside a column or, of a sensor, in the words of its name."""
    unit, typed = name.unit, listing.units.get(name.written)
    if typed is not None:
        known = names.known_unit(typed), None if unit is None else names.known_unit(unit)
        if None not in known and known[0] != known[1]:
            raise DataError(
                f"{listing.path}: column '{name.written}' says {unit}, the file states {typed}: rename it, or choose "
                f"the unit, such as --columns 'NAME={name.written} [{typed}]'"
            )
        unit = typed
    if unit is not None or sensor is None:
        return unit
    if names.increments(name.plain):
        return "rad" if sensor == "gyro" else "m/s"
    return names.unit_in_words(name.plain, sensor)


def offered(listing: Listing) -> str:
    """Return what the file offers, in one line."""
    shown = [name if shape == (0,) else f"{name} {shape}" for name, shape in listing.shapes.items()]
    more = f" and {len(shown) - 16} more" if len(shown) > 16 else ""
    return ", ".join(shown[:16]) + more if shown else "no numbers"


def _resolve(listing: Listing, parsed: Mapping[str, names.ColumnName], role: str, value: str) -> Chosen:
    """Return the columns and the unit that the user means by `value`."""
    name, sliced, unit = value, None, None
    if value not in listing.shapes and not _SLICE.match(value) and (stated := _UNIT.match(value)) is not None:
        name, unit = stated["name"], stated["unit"]
    if name not in listing.shapes and (sliced := _SLICE.match(name)) is not None:
        name = sliced["name"]
    array = _find(listing, parsed, role, name)
    sensor = role.split("_")[0] if role.split("_")[0] in names.SENSORS else None
    unit = unit or stated_unit(listing, parsed[array], sensor)
    whole = parts_of(listing, array)
    if sliced is None:
        return Chosen(whole, unit)
    if whole[0].column is None:
        raise DataError(
            f"{listing.path}: --columns {role}={value}: '{array}' has one column and cannot be sliced"
        )
    start = int(sliced["start"])
    stop = int(sliced["stop"]) if sliced["stop"] else start + 1
    if not start < stop <= len(whole):
        raise DataError(
            f"{listing.path}: --columns {role}={value}: '{array}' has columns 0 to {len(whole) - 1}"
        )
    return Chosen(whole[start:stop], unit)


def parts_of(listing: Listing, array: str) -> tuple[Part, ...]:
    """Return the columns of an array."""
    shape = listing.shapes[array]
    return (Part(array),) if len(shape) == 1 else tuple(Part(array, j) for j in range(shape[1]))


def _find(listing: Listing, parsed: Mapping[str, names.ColumnName], role: str, name: str) -> str:
    """Return the array of that name, exactly or but for case, separators and unit."""
    if name in listing.shapes:
        return name
    plain = names.parse_name(name).plain
    same = [array for array in listing.shapes if parsed[array].plain == plain]
    if len(same) != 1:
        found = f"{len(same)} columns of that name" if same else f"found {offered(listing)}"
        raise DataError(f"{listing.path}: --columns {role}={name}: no column '{name}': {found}")
    return same[0]
