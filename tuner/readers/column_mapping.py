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
class Mapped:
    """Columns that the user chose, with their unit where he or the file states one."""

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


def resolve(listing: Listing, columns: Mapping[str, str]) -> dict[str, Mapped]:
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


def _resolve(listing: Listing, parsed: Mapping[str, names.ColumnName], role: str, value: str) -> Mapped:
    """Return the columns and the unit that the user means by `value`."""
    name, sliced, unit = value, None, None
    if value not in listing.shapes:
        sliced = _SLICE.match(value)
        stated = _UNIT.match(value)
        if sliced is not None:
            name = sliced["name"]
        elif stated is not None:
            name, unit = stated["name"], stated["unit"]
            if name not in listing.shapes and (sliced := _SLICE.match(name)) is not None:
                name = sliced["name"]
    array = _find(listing, parsed, role, name)
    sensor = role.split("_")[0] if role.split("_")[0] in names.SENSORS else None
    unit = unit or stated_unit(listing, parsed[array], sensor)
    shape = listing.shapes[array]
    if len(shape) == 1:
        if sliced is not None:
            raise DataError(
                f"{listing.path}: --columns {role}={value}: '{array}' has one column and cannot be sliced"
            )
        return Mapped((Part(array),), unit)
    start, stop = 0, shape[1]
    if sliced is not None:
        start = int(sliced["start"])
        stop = int(sliced["stop"]) if sliced["stop"] else start + 1
    if not start < stop <= shape[1]:
        raise DataError(
            f"{listing.path}: --columns {role}={value}: '{array}' has columns 0 to {shape[1] - 1}"
        )
    return Mapped(tuple(Part(array, j) for j in range(start, stop)), unit)


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
