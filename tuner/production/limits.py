"""Limits of production: the largest noise, drift and offset that a unit may have: stated, of a sheet, or of gravity.

::

    format: tuner-limits/1
    gyro:
      N: 0.3 deg/√h
      allan_deviation_10s: 12 deg/h
      ramp: 0.3 deg/h/s
      temperature_slope: 20 deg/h/K
      at_rest: 0.5 deg/s
    accel:
      N: 120 µg/√Hz
      at_rest: 10 mg
    temperature:
      warm_up: 5 K

Every axis of a sensor must stay below its limit. A unit fails where the whole interval of an estimate is beyond; where
only the estimate is, or the bound of a term that is not found, the log leaves the limit open. The symbols are those of
`tuner.production.quantities`; the units are those of data sheets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from models.units import STANDARD_GRAVITY, to_si
from tuner.catalogue.datasheet_format import KINDS, is_among, units_of
from tuner.formats.axis_words import axes_text
from tuner.formats.codec import load, refuse_unknown_keys, store, structured
from tuner.formats.customary_units import digits
from tuner.formats.document_errors import refuse
from tuner.formats.documents import parse_format, read_text
from tuner.limits import LOCAL_GRAVITY, SHEET_FACTOR, SHEET_SDS
from tuner.production.quantities import (
    FORCE,
    SENSORS,
    customary,
    in_words,
    least_size,
    pretty_unit,
    quantities_of,
)
from tuner.readers.unit_evidence import GRAVITY_TOLERANCE, why_times_gravity
from tuner.types import Identification
from tuner.types.fleet import Limit, UnitMeasurement

FORMAT = "tuner-limits/1"
ENTRIES: Mapping[str, str] = MappingProxyType(
    {
        "N": "noise_density",
        "B": "bias_instability",
        "K": "random_walk",
        "mean": "turn_on_sd",
        "at_rest": "turn_on_sd",
        "allan_deviation_10s": "bias_instability",
        "ramp": "ramp",
    }
)
"""Entry of a data sheet that has the units of each limit of a sensor."""
OTHER_UNITS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "gyro temperature_slope": ("rad/s/K", "deg/s/K", "deg/h/K"),
        "accel temperature_slope": ("m/s^2/K", "mg/K", "ug/K"),
        "temperature warm_up": ("K",),
    }
)
"""Units of limits that no data sheet has."""
SYMBOLS: Mapping[str, str] = MappingProxyType({"allan_deviation_10s": "sigma_10s", "accel at_rest": "mean"})
"""Symbol of the quantity of each limit that is called otherwise, of one sensor or of all."""
GRAVITY = Limit("accel", "mean", GRAVITY_TOLERANCE * STANDARD_GRAVITY, "as of any sensor")
"""Limit of every triad of accelerometers at rest."""
SHOWN = ("N", "sigma_10s", "ramp")
"""Symbols of the numbers of a sheet that a log of minutes shows: of B and K it shows one as the other."""


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _LimitSheet:
    """A whole file of limits: by sensor the largest values, each a number and a unit."""

    format: str
    gyro: Mapping[str, str] = field(default_factory=dict)
    accel: Mapping[str, str] = field(default_factory=dict)
    temperature: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Limits:
    """All limits of a file."""

    limits: tuple[Limit, ...]


def read_limits(path: str | Path) -> tuple[Limit, ...]:
    """Read a YAML of format ``tuner-limits/1``.

    Raises
    ------
    DataError
        One line: file, place, expected, found.
    """
    text = read_text(Path(path), expected=f"YAML of format {FORMAT}")
    content = parse_format(text, source=str(path), expected_format=FORMAT)
    return load(content, _Limits, source=str(path)).limits


def all_limits(stated: Sequence[Limit], sheet: Identification | None) -> tuple[Limit, ...]:
    """Return the limits that are stated, those of a sheet of what is not, and gravity where neither limits it."""
    known = {(one.sensor, one.symbol): one for one in [GRAVITY, *_of_sheet(sheet), *stated]}
    return tuple(known.values())


def _of_sheet(sheet: Identification | None) -> list[Limit]:
    """Return the limits that follow from the numbers of a sheet, each with what it is derived from."""
    if sheet is None:
        return []
    name, found = sheet.source.get("name", "the sheet"), []
    units, quantities = quantities_of(sheet)
    for quantity, one in quantities.items():
        channel, _, symbol = quantity.rpartition(".")
        if one.value is not None and symbol in SHOWN:
            factor = 1.0 if str(one.reason).startswith(KINDS["maximum"]) else SHEET_FACTOR
            basis = f"{factor:g} × that of {name}"
            found.append(Limit(SENSORS[units[channel]], symbol, factor * one.value, basis))
    for axis, sd in sheet.source.get("turn_on_sd", {}).items():
        largest, symbol, sensor = SHEET_SDS * sd, "at_rest", axis.partition("_")[0]
        if sensor == FORCE:
            scale = SHEET_SDS * sheet.source.get("scale_factor_sd", {}).get(sensor, 0.0)
            largest = math.hypot(largest, scale * STANDARD_GRAVITY) + LOCAL_GRAVITY * STANDARD_GRAVITY
            symbol = "mean"
        found.append(Limit(sensor, symbol, largest, f"{SHEET_SDS:g} sds of {name}"))
    return found


FAILS = "{axes} {name} {span} > {most}"
"""What is said of estimates beyond a limit, with their intervals."""
OPEN = "{axes} {name} {span} > {most}, but not by its interval"
"""What is said of estimates beyond a limit that their intervals hold."""
BOUND = "{axes} {name} only known to be < {span}, the limit is {most}"
"""What is said of bounds beyond a limit."""


def judge(measurement: UnitMeasurement, limits: Sequence[Limit]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what breaks limits, and what leaves limits open, in words."""
    failed: list[str] = []
    unclear: list[str] = []
    for limit in limits:
        name, most = in_words(f".{limit.symbol}").strip(), ""
        beyond: dict[str, list[tuple[str, float]]] = {}
        for quantity, found in measurement.quantities.items():
            channel, _, symbol = quantity.rpartition(".")
            unit = measurement.units[channel]
            if symbol != limit.symbol or SENSORS.get(unit) != limit.sensor:
                continue
            most = f"{digits(customary(limit.largest, quantity, unit))} {pretty_unit(quantity, unit)}"
            most += f" ({limit.basis})" if limit.basis else ""
            number = found.upper if found.value is None else found.value
            if number is None:
                unclear.append(f"{in_words(quantity)} is not shown by this log, the limit is {most}")
            elif abs(number) > limit.largest:
                said = BOUND if found.value is None else FAILS if least_size(found) > limit.largest else OPEN
                beyond.setdefault(said, []).append((channel, customary(number, quantity, unit)))
        if not most:
            unclear.append(f"{limit.sensor} {name} is not in this log")
        for said, axes in beyond.items():
            text = said.format(
                axes=axes_text([channel for channel, _ in axes]), name=name, span=_span(axes), most=most
            )
            if (limit.sensor, limit.symbol) == (FORCE, "mean"):
                text = _of_gravity(measurement.quantities[f"{FORCE}.mean"].value or 0.0, limit)
            (failed if said is FAILS else unclear).append(text)
    return tuple(failed), tuple(unclear)


def _of_gravity(excess: float, limit: Limit) -> str:
    """Say how accelerometers at rest miss gravity, and what does that."""
    ratio = 1.0 + excess / STANDARD_GRAVITY
    room = digits(limit.largest / STANDARD_GRAVITY, 2)
    basis = f", {limit.basis}" if limit.basis else ""
    return (
        f"accel reads {digits(ratio)} g at rest{why_times_gravity(ratio)}; the limit is 1 ± {room} g{basis}"
    )


def _span(found: Sequence[tuple[str, float]]) -> str:
    """Return the values in words: one, or the smallest to the largest."""
    shown = list(dict.fromkeys(digits(value) for _, value in sorted(found, key=lambda one: abs(one[1]))))
    return shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}"


def _limits(content: object) -> _Limits:
    sheet: _LimitSheet = structured(content, _LimitSheet)
    limits = [
        Limit(sensor, SYMBOLS.get(f"{sensor} {key}", SYMBOLS.get(key, key)), _value(text, sensor, key))
        for sensor in SENSORS.values()
        for key, text in getattr(sheet, sensor).items()
    ]
    if not limits:
        refuse("a limit, such as 'gyro: {N: 0.3 deg/√h}'", "none")
    return _Limits(tuple(limits))


def _value(text: str, sensor: str, key: str) -> float:
    number, _, unit = text.strip().partition(" ")
    units = OTHER_UNITS.get(f"{sensor} {key}", ())
    if key in ENTRIES and sensor != "temperature":
        units = units_of(ENTRIES[key], sensor)
    if not units:
        known = [*ENTRIES, "temperature_slope"] if sensor != "temperature" else ["warm_up"]
        refuse(f"a limit among {', '.join(known)}", repr(key), sensor)
    expected = f"a positive number and a unit among {', '.join(units)}"
    try:
        value = float(number)
    except ValueError:
        refuse(expected, repr(text), sensor, key)
    if not (0.0 < value < math.inf and is_among(unit.strip(), units)):
        refuse(expected, repr(text), sensor, key)
    return to_si(value, unit.strip())


store(_Limits, load=_limits)
