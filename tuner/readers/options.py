"""What a file or its user states: units, the size of a count, the rate."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tuner.readers import column_names as names
from tuner.readers.column_choice import Sensor
from tuner.readers.columns import Listing
from tuner.types.records import DataError

_RATE_KEYS = ("rate_hz", "rate", "fs", "sample_rate", "sample_rate_hz", "sampling_rate", "frequency_hz")


@dataclass(frozen=True)
class Options:
    """What the user states beside the file."""

    rate: float | None
    unit: Mapping[str, str | None]
    scale: Mapping[str, float | None]
    columns: Mapping[str, str] | None
    constant_axes: bool = False


def sensor_unit(
    listing: Listing, sensor: Sensor, options: Options, notes: list[str]
) -> tuple[str, float, float]:
    """Return a sensor's unit, the offset of its counts, and its scale, unit a count."""
    name = sensor.name
    allowed = names.UNITS[name]
    option, scale = options.unit.get(name), options.scale.get(name)
    what = f"{listing.path}: {name}"
    stated = sensor.unit
    unit = names.unit_of(option, allowed, what=f"--{name}-unit") if option is not None else None
    counts = stated is not None and names.is_count(stated)
    offset = 0.0
    array = sensor.parts[0].array
    if array in listing.unsigned and (counts or scale is not None):
        offset = 2.0 ** (listing.unsigned[array] - 1)
        notes.append(f"{name}: unsigned counts: {offset:.0f} was taken as zero")
    if scale is not None:
        if unit is None:
            unit = allowed[0] if counts or stated is None else names.unit_of(stated, allowed, what=what)
        notes.append(f"{name}: counts times {scale:.9g} {unit}")
        return unit, offset, scale
    if counts or (stated is None and array in listing.integer and _lsb(listing.meta, name) is not None):
        lsb = _lsb(listing.meta, name)
        if lsb is None:
            msg = (
                f"{what}: '{array}' holds counts: pass --{name}-scale, the {unit or allowed[0]} in one count"
            )
            raise DataError(msg)
        notes.append(f"{name}: counts times {lsb[0]:.9g} {lsb[1]} (as the file states)")
        return lsb[1], offset, lsb[0]
    if unit is not None:
        return unit, offset, 1.0
    if stated is not None:
        return names.unit_of(stated, allowed, what=what), offset, 1.0
    return _unit_in_meta(listing.meta, name, notes) or allowed[0], offset, 1.0


def _lsb(meta: Mapping[str, Any], sensor: str) -> tuple[float, str] | None:
    """Return size and unit of one count from meta entries such as ``gyro_lsb_dps``."""
    for key, value in meta.items():
        if str(key).startswith(f"{sensor}_lsb_") and isinstance(value, int | float):
            return float(value), names.unit_of(
                str(key).removeprefix(f"{sensor}_lsb_"), names.UNITS[sensor], what=key
            )
    return None


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


def stated_rate(meta: Mapping[str, Any]) -> float | None:
    """Return the rate that meta states, Hz, or None."""
    for key in _RATE_KEYS:
        value = meta.get(key)
        if isinstance(value, int | float) and value > 0:
            return float(value)
    return None
