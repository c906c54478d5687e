"""The unit of the columns of a sensor: as the user states it, else the file, else SI; size and zero of a count."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from tuner.readers import column_names as names
from tuner.readers.columns import Listing
from tuner.readers.options import Options
from tuner.readers.sensor_columns import Sensor
from tuner.types.records import DataError

_SIZED = re.compile(r"(?P<inverse>1/)?(?P<number>\d+(?:\.\d+)?(?:e-?\d+)?)[ *·]*(?P<unit>\D.*)")
"""A unit with the size of one count, such as ``1/131 deg/s``."""


@dataclass(frozen=True)
class UnitChoice:
    """In which unit a sensor is read.

    Attributes
    ----------
    unit : str
        One of `column_names.UNITS`.
    offset, scale : float
        Count taken as zero, and units in one count.
    basis : str
        Who says so: the ``user``, the ``file``, nobody (``assumed``), or the owner will (``requested``).
    """

    unit: str
    offset: float = 0.0
    scale: float = 1.0
    basis: Literal["user", "file", "assumed", "requested"] = "assumed"


def sensor_unit(listing: Listing, sensor: Sensor, options: Options, notes: list[str]) -> UnitChoice:
    """Return the unit a sensor is read in: as the user states, else the file; else SI, as an assumption."""
    name = sensor.name
    allowed = names.UNITS[name]
    option, scale = options.unit.get(name), options.scale.get(name)
    what = f"{listing.path}: {name}"
    stated = sensor.unit
    unit = names.unit_of(option, allowed, what=f"--{name}-unit") if option is not None else None
    sized = None if stated is None else _size_of_count(stated, allowed)
    counts = sized is not None or (stated is not None and names.known_unit(stated) == "count")
    offset = 0.0
    array = sensor.parts[0].array
    if array in listing.unsigned and (counts or scale is not None):
        offset = 2.0 ** (listing.unsigned[array] - 1)
        notes.append(f"{name}: unsigned counts: {offset:.0f} was taken as zero")
    if options.requested == name:
        return UnitChoice(unit or allowed[0], offset, 1.0, "requested")
    if scale is not None:
        if unit is None:
            unit = allowed[0] if counts or stated is None else names.unit_of(stated, allowed, what=what)
        notes.append(f"{name}: counts times {scale:.9g} {unit}")
        return UnitChoice(unit, offset, scale, "user")
    if counts or (stated is None and array in listing.integer and _lsb(listing.meta, name) is not None):
        lsb = sized or _lsb(listing.meta, name)
        if lsb is None:
            raise DataError(
                f"{what}: '{array}' holds counts: pass --{name}-scale, the {unit or allowed[0]} in one count"
            )
        notes.append(f"{name}: counts times {lsb[0]:.9g} {lsb[1]} (as the file states)")
        return UnitChoice(lsb[1], offset, lsb[0], "file")
    if unit is not None:
        return UnitChoice(unit, offset, 1.0, "user")
    if stated is not None:
        basis: Literal["file", "assumed"] = "assumed" if _only_named(listing, array) else "file"
        if names.known_unit(stated) not in allowed:
            raise DataError(
                f"{what}: unknown unit '{stated}': expected one of {', '.join(allowed)}; for another one pass "
                f"--{name}-unit {allowed[0]} --{name}-scale X with the {allowed[0]} in one '{stated}'"
            )
        return UnitChoice(names.unit_of(stated, allowed, what=what), offset, 1.0, basis)
    found = _unit_in_meta(listing.meta, name, notes)
    return UnitChoice(allowed[0], offset) if found is None else UnitChoice(found, offset, 1.0, "file")


def _size_of_count(stated: str, allowed: Sequence[str]) -> tuple[float, str] | None:
    """Return size and unit of one count from a unit such as ``1/131 deg/s``; None where it states none."""
    found = _SIZED.fullmatch(stated.strip())
    unit = names.known_unit(found["unit"]) if found else None
    if found is None or unit is None or unit not in allowed:
        return None
    size = float(found["number"])
    if not 0.0 < size < math.inf:
        return None
    return (1.0 / size if found["inverse"] else size), unit


def _only_named(listing: Listing, array: str) -> bool:
    """Return whether the unit of a column is a guess: the format's, or from a name of an angle or increments."""
    parsed = names.parse_name(array)
    named = (
        parsed.unit or names.unit_in_words(parsed.plain, "gyro") or names.unit_in_words(parsed.plain, "accel")
    )
    return (array in listing.guessed or parsed.angle) or (
        names.increments(parsed.plain) and named is None and array not in listing.units
    )


def _lsb(meta: Mapping[str, Any], sensor: str) -> tuple[float, str] | None:
    """Return size and unit of one count from meta entries such as ``gyro_lsb_dps``."""
    begins = f"{sensor}_lsb_"
    stated = ((str(key), v) for key, v in meta.items() if str(key).startswith(begins))
    sizes = ((key, float(v)) for key, v in stated if isinstance(v, int | float))
    return next(
        (
            (size, names.unit_of(key.removeprefix(begins), names.UNITS[sensor], what=key))
            for key, size in sizes
        ),
        None,
    )


def _unit_in_meta(meta: Mapping[str, Any], sensor: str, notes: list[str]) -> str | None:
    """Return the unit that meta states as ``gyro_unit``, or in words ("accel m/s2, gyro rad/s")."""
    direct = meta.get(f"{sensor}_unit")
    if isinstance(direct, str):
        return names.unit_of(direct, names.UNITS[sensor], what=f"meta '{sensor}_unit'")
    found = re.findall(rf"\b{sensor}\w*\s+([a-z°][\w°/^²]*)", str(meta.get("units", "")))
    units = {unit for word in found if (unit := names.known_unit(word)) in names.UNITS[sensor]}
    if len(units) != 1:
        return None
    unit = units.pop()
    if unit != names.UNITS[sensor][0]:
        notes.append(f"{sensor}: {unit}, as the file's meta says")
    return unit
