"""Which columns of a file are the sensors: as the user maps them, or by name.

Rules, in order: what the user maps; a column named as ours or by an alias (`column_names.STEMS`); of arrays whose
name only contains a sensor's (``gyro_raw``, ``gyro_dps_1``) one named raw before others, then the longest,
and for the second sensor the one with the same length and ending as the first. Each choice gets a note.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tuner.readers import column_names as names
from tuner.readers.column_mapping import AXES, Chosen, offered, parts_of, resolve, stated_unit
from tuner.readers.columns import Listing, Part
from tuner.readers.refusal import Change, Refusal
from tuner.types.records import DataError

Parsed = Mapping[str, names.ColumnName]
Candidates = Mapping[str, list[tuple[int, str]]]

NO_COLUMN = "none"
"""What ``--columns t=none`` says: the stamps are no use, samples are even at the rate that is stated."""
MAX_NAMED = 12
"""Columns named in a note, at most: the rest is counted."""


@dataclass(frozen=True)
class Sensor:
    """One sensor of a file: its columns, the axes they are, and their unit where one is stated."""

    name: str
    parts: tuple[Part, ...]
    axes: tuple[str, ...]
    unit: str | None


@dataclass(frozen=True)
class Layout:
    """What to read: time (or None), sensors, further channels on the same clock, and sensors that may stand unread."""

    time: Chosen | None
    sensors: tuple[Sensor, ...]
    covariates: Mapping[str, Chosen]
    notes: tuple[str, ...]
    unread: tuple[str, ...] = ()


def choose(listing: Listing, *, columns: Mapping[str, str] | None = None) -> Layout:
    """Choose the columns of a file.

    Raises
    ------
    DataError
        Nothing that looks like a gyroscope or accelerometer, several candidates of equal right, or a mapped
        column that is not there.
    """
    parsed = {array: names.parse_name(array) for array in listing.shapes}
    columns = dict(columns or {})
    absent = {
        role
        for role in ("t", "temperature", *names.SENSORS)
        if columns.get(role) == NO_COLUMN and NO_COLUMN not in listing.shapes
    }
    columns = {role: name for role, name in columns.items() if role not in absent}
    mapped = resolve(listing, columns)
    by_name = _by_name(parsed, {part.array for chosen in mapped.values() for part in chosen.parts})
    notes: list[str] = []
    sensors: list[Sensor] = []
    for name in (sensor for sensor in names.SENSORS if sensor not in absent):
        sensor = _sensor(listing, name, mapped) or _sensor(
            listing,
            name,
            _by_alias(listing, name, by_name, parsed) or _by_word(listing, name, parsed, sensors, notes),
        )
        if sensor is not None:
            sensors.append(sensor)
    if not sensors:
        raise _nothing_found(listing)
    others = [role for role in mapped if role != "t" and role.split("_")[0] not in names.SENSORS]
    channels = {
        role: channel
        for role in dict.fromkeys(["t", "temperature", *others])
        if role not in absent
        and (channel := _channel(listing, role, mapped, by_name, parsed, notes)) is not None
    }
    if "t" in mapped and "temperature" not in mapped and "temperature" in channels:
        rows, values = (listing.shapes[channels[role].parts[0].array][0] for role in ("t", "temperature"))
        if rows != values:
            del channels["temperature"]
            notes.append(f"temperature: its {values} values are not of the {rows} stamps chosen: left out")
    if (week := _week(listing, channels.get("t"), parsed)) is not None:
        channels["week"] = week
    used = {part.array for sensor in sensors for part in sensor.parts}
    used |= {channel.parts[0].array for channel in channels.values()}
    left = (array for array in listing.shapes if array not in used)
    unread: list[str] = []
    if unused := [array for array in left if names.sensor_of(parsed[array].plain) not in absent]:
        for name in set(names.SENSORS) - absent - {sensor.name for sensor in sensors}:
            like = [array for array in unused if names.sensor_of(parsed[array].plain) == name]
            if len(like) >= len("xyz"):
                unread.append(
                    f"{name}: none of its columns is read, as no known name or unit fits {', '.join(like[:3])}: "
                    f"name them, such as by --columns '{name}_x=…'"
                )
        notes += unread
        more = f" and {len(unused) - MAX_NAMED} more" if len(unused) > MAX_NAMED else ""
        notes.append(f"columns not used: {', '.join(unused[:MAX_NAMED])}{more}")
    return Layout(channels.pop("t", None), tuple(sensors), channels, tuple(notes), tuple(unread))


def exchanged(layout: Layout, letters: str = "xyz") -> tuple[Change, ...]:
    """Return the columns that exchange axes of gyro and accel, each in the unit of its name; none without both."""
    if len(layout.sensors) != 2:
        return ()
    gyro, accel = layout.sensors
    if len(gyro.parts) != len(accel.parts):
        return ()
    columns: dict[str, str] = {}
    for one, other in ((gyro, accel), (accel, gyro)):
        unit = f" [{one.unit}]" if one.unit is not None else ""
        columns |= {
            axis: f"{names.without_unit(str(part))}{unit}"
            for axis, own, its in zip(one.axes, one.parts, other.parts, strict=True)
            for part in (its if axis[-1] in letters else own,)
        }
    return (Change(columns=columns),)


def of_mavlink(layout: Layout) -> tuple[Change, ...]:
    """Return the units of MAVLink's scaled readings for columns that have its names; none for others."""
    parts = [str(part) for sensor in layout.sensors for part in sensor.parts]
    if not all(names.is_mavlink(part) for part in parts):
        return ()
    units = {"accel": "mg", "gyro": "mrad/s"}
    there = {sensor.name: units[sensor.name] for sensor in layout.sensors}
    return (Change(there, when=f"where {parts[0]} is a scaled reading of MAVLink"),)


_MATRICES: Mapping[int, tuple[Mapping[str, str], ...]] = {
    3: ({"accel": "0:3"}, {"gyro": "0:3"}),
    4: ({"t": "0", "accel": "1:4"}, {"t": "0", "gyro": "1:4"}),
    6: ({"gyro": "3:6", "accel": "0:3"}, {"gyro": "0:3", "accel": "3:6"}),
    7: ({"t": "0", "gyro": "4:7", "accel": "1:4"}, {"t": "0", "gyro": "1:4", "accel": "4:7"}),
    8: (
        {"t": "0", "gyro": "4:7", "accel": "1:4"},
        {"t": "0", "gyro": "1:4", "accel": "4:7"},
        {"t": "1", "gyro": "5:8", "accel": "2:5"},
        {"t": "1", "gyro": "2:5", "accel": "5:8"},
        {"gyro": "3:6", "accel": "0:3"},
        {"gyro": "0:3", "accel": "3:6"},
    ),
}
"""What the columns of an array without names may be, by their number; 8 and more alike."""


def _nothing_found(listing: Listing) -> DataError:
    """Return the refusal of a file without a sensor, with the columns of a wide array as readings."""
    wide = next((name for name, shape in listing.shapes.items() if len(shape) == 2 and shape[1] >= 3), None)
    single = next(iter(listing.shapes)) if len(listing.shapes) == 1 else "NAME"  # the first is often the time
    width = 0 if wide is None else listing.shapes[wide][1]
    layouts = _MATRICES.get(min(width, 8), ())
    named = [parts for parts in layouts if any(role[:3] in str(wide).lower() for role in parts)]
    changes = [
        Change(columns={role: f"{wide}[{part}]" for role, part in parts.items()})
        for parts in named or layouts
    ]
    why = "; ".join([note for note in listing.notes if "left out" in note][:3])
    found = (
        f"{listing.path}: no gyro or accel column: expected names such as gyro_x or an (n, 3) array gyro, "
        f"found {offered(listing)}{why and f' ({why})'}"
    )
    if changes:
        return Refusal(found, changes)
    if not listing.shapes:
        return DataError(found)
    return DataError(f"{found}; map them with --columns, such as --columns 'gyro_x={single}'")


def _by_name(parsed: Parsed, taken: set[str]) -> dict[str, list[tuple[int, str]]]:
    """Return the arrays of each role with their rank, best first; rates go before increments of the same rank."""
    found: dict[str, list[tuple[int, str]]] = {}
    for array, name in parsed.items():
        role = names.role_of(name)
        if role is not None and array not in taken:
            found.setdefault(role[0], []).append((2 * role[1] + names.increments(name.plain), array))
    return {role: sorted(arrays, key=lambda a: a[0]) for role, arrays in found.items()}


def _only(listing: Listing, role: str, arrays: list[tuple[int, str]]) -> str:
    """Return the one array of the best rank."""
    best = [array for rank, array in arrays if rank == arrays[0][0]]
    if len(best) > 1:
        raise DataError(
            f"{listing.path}: several columns could be {role}: {', '.join(best)}; "
            f"choose one with --columns '{role}=NAME'"
        )
    return best[0]


def _sensor(listing: Listing, name: str, chosen: Mapping[str, Chosen]) -> Sensor | None:
    """Return a sensor of the columns chosen for it as a whole or for its axes; None where there are none."""
    if (whole := chosen.get(name)) is not None:
        return Sensor(name, whole.parts, tuple(f"{name}_{a}" for a in AXES[: len(whole.parts)]), whole.unit)
    axes = tuple(axis for a in AXES if (axis := f"{name}_{a}") in chosen)
    if not axes:
        return None
    units = {chosen[axis].unit for axis in axes}
    if len(units) > 1:
        shown = ", ".join(sorted(str(u) for u in units))
        raise DataError(
            f"{listing.path}: the axes of {name} have different units ({shown}): write them in one unit"
        )
    return Sensor(name, tuple(chosen[axis].parts[0] for axis in axes), axes, units.pop())


def _by_alias(listing: Listing, name: str, by_name: Candidates, parsed: Parsed) -> dict[str, Chosen]:
    """Return the columns named as the axes of a sensor or, where there are none, an array named as it."""
    found: dict[str, list[tuple[int, str]]] = {}
    for roles, shape in (([f"{name}_{a}" for a in AXES], ()), ([name], (3,))):
        fitting = {r: [c for c in by_name.get(r, []) if listing.shapes[c[1]][1:] == shape] for r in roles}
        found = found or {role: candidates for role, candidates in fitting.items() if candidates}
    arrays = {role: _only(listing, role, candidates) for role, candidates in found.items()}
    return {
        role: Chosen(parts_of(listing, array), stated_unit(listing, parsed[array], name))
        for role, array in arrays.items()
    }


def _by_word(
    listing: Listing, name: str, parsed: Parsed, chosen: list[Sensor], notes: list[str]
) -> dict[str, Chosen]:
    """Return the array whose name contains that of a sensor, the best of several."""
    arrays = [a for a in parsed if listing.shapes[a][1:] == (3,) and names.sensor_of(parsed[a].plain) == name]
    if not arrays:
        return {}
    fellow = chosen[0].parts[0].array if chosen else None

    def order(array: str) -> tuple[bool, bool, bool, int]:
        same_length = fellow is None or listing.shapes[fellow][0] == listing.shapes[array][0]
        same_end = fellow is not None and (
            parsed[fellow].plain.rpartition("_")[2] == parsed[array].plain.rpartition("_")[2]
        )
        raw = "raw" in parsed[array].plain.split("_")
        return not same_length, not same_end, not raw, -listing.shapes[array][0]

    best = min(arrays, key=order)
    if len(arrays) > 1:
        rest = ", ".join(a for a in arrays if a != best)
        rule = "raw before processed, then the longest" if fellow is None else f"it goes with '{fellow}'"
        notes.append(f"{name} is '{best}' ({rule}); --columns {name}=… chooses {rest}")
    return {name: Chosen(parts_of(listing, best), stated_unit(listing, parsed[best], name))}


def _week(listing: Listing, time: Chosen | None, parsed: Parsed) -> Chosen | None:
    """Return the column of the GPS week, where the time is that of the week."""
    if time is None or parsed[time.parts[0].array].plain not in names.TIME_OF_WEEK:
        return None
    weeks = [a for a in parsed if parsed[a].plain in names.WEEK and len(listing.shapes[a]) == 1]
    return Chosen((Part(weeks[0]),), None) if len(weeks) == 1 else None


def _channel(
    listing: Listing,
    role: str,
    mapped: Mapping[str, Chosen],
    by_name: Candidates,
    parsed: Parsed,
    notes: list[str],
) -> Chosen | None:
    """Return the column of a role: as mapped, or the first in the order of the table of aliases."""
    if role in mapped:
        return mapped[role]
    arrays = [(rank, a) for rank, a in by_name.get(role, []) if len(listing.shapes[a]) == 1]
    if not arrays:
        return None
    best = [a for rank, a in arrays if rank == arrays[0][0]]
    aliases = names.TIME if role == "t" else names.TEMPERATURE
    array = min(
        best, key=lambda a: aliases.index(parsed[a].plain) if parsed[a].plain in aliases else len(aliases)
    )
    if len(best) > 1:
        rest = ", ".join(a for a in best if a != array)
        notes.append(f"{role} is '{array}'; --columns {role}=… chooses {rest}")
    return Chosen((Part(array),), stated_unit(listing, parsed[array]))
