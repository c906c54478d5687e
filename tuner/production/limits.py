"""Limits of production: the largest noise and mean that a unit may have, from a small YAML.

::

    format: tuner-limits/1
    gyro:
      N: 0.3 deg/√h
      B: 10 deg/h
      mean: 0.5 deg/s
    accel:
      N: 120 µg/√Hz

Every axis of a sensor must stay below its limit: the estimate is compared, and the bound where a term is not found.
The symbols are those of `tuner.production.quantities`; the units are those of data sheets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from models.units import to_si
from tuner.catalogue.datasheet_format import is_unit_of, units_of
from tuner.formats.codec import load, refuse_unknown_keys, store, structured
from tuner.formats.customary_units import digits
from tuner.formats.document_errors import refuse
from tuner.formats.documents import parse_format, read_text
from tuner.production.quantities import SENSORS, customary, pretty_unit, title
from tuner.types.fleet import Limit, UnitMeasurement

FORMAT = "tuner-limits/1"
ENTRIES = {"N": "noise_density", "B": "bias_instability", "K": "random_walk", "mean": "turn_on_sd"}
"""Entry of a data sheet that has the units of each symbol."""


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _SensorLimits:
    """Largest values of one sensor, each a number and a unit."""

    N: str | None = None
    B: str | None = None
    K: str | None = None
    mean: str | None = None


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _LimitSheet:
    """A whole file of limits."""

    format: str
    gyro: _SensorLimits | None = None
    accel: _SensorLimits | None = None


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


def judge(measurement: UnitMeasurement, limits: tuple[Limit, ...]) -> tuple[str, tuple[str, ...]]:
    """Return PASS, FAIL or OPEN, and what breaks or leaves open which limit."""
    failed: list[str] = []
    unclear: list[str] = []
    for limit in limits:
        judged = 0
        beyond: list[tuple[str, float]] = []
        bounds: list[tuple[str, float]] = []
        most = ""
        for quantity, found in measurement.quantities.items():
            channel, _, symbol = quantity.rpartition(".")
            unit = measurement.units[channel]
            if symbol != limit.symbol or SENSORS.get(unit) != limit.sensor:
                continue
            judged += 1
            most = f"{digits(customary(limit.largest, quantity, unit))} {pretty_unit(quantity, unit)}"
            if found.value is not None:
                if abs(found.value) > limit.largest:
                    beyond.append((channel, customary(found.value, quantity, unit)))
            elif found.upper is None:
                unclear.append(f"{title(quantity)} is not shown by this log, the limit is {most}")
            elif found.upper > limit.largest:
                bounds.append((channel, customary(found.upper, quantity, unit)))
        if beyond:
            failed.append(f"{_axes(beyond)} {limit.symbol} {_span(beyond)} > {most}")
        if bounds:
            unclear.append(
                f"{_axes(bounds)} {limit.symbol} only known to be < {_span(bounds)}, the limit is {most}"
            )
        if not judged:
            unclear.append(f"{limit.sensor} {limit.symbol} is not in this log")
    return "FAIL" if failed else "OPEN" if unclear else "PASS", (*failed, *unclear)


def _axes(found: Sequence[tuple[str, float]]) -> str:
    """Return the channels in words: ``gyro x y z``."""
    sensors: dict[str, list[str]] = {}
    for channel, _ in found:
        sensor, _, axis = channel.partition("_")
        sensors.setdefault(sensor, []).append(axis)
    return ", ".join(" ".join([sensor, *axes]).strip() for sensor, axes in sensors.items())


def _span(found: Sequence[tuple[str, float]]) -> str:
    """Return the values in words: one, or the smallest to the largest."""
    shown = list(dict.fromkeys(digits(value) for _, value in sorted(found, key=lambda one: abs(one[1]))))
    return shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}"


def _limits(content: object) -> _Limits:
    sheet: _LimitSheet = structured(content, _LimitSheet)
    limits = []
    for sensor, entries in (("gyro", sheet.gyro), ("accel", sheet.accel)):
        for symbol, entry in ENTRIES.items():
            text = None if entries is None else getattr(entries, symbol)
            if text is not None:
                limits.append(Limit(sensor, symbol, _value(text, entry, sensor, symbol)))
    if not limits:
        refuse("a limit, such as 'gyro: {N: 0.3 deg/√h}'", "none")
    return _Limits(tuple(limits))


def _value(text: str, entry: str, sensor: str, symbol: str) -> float:
    number, _, unit = text.strip().partition(" ")
    expected = "a positive number and a unit"
    try:
        value = float(number)
    except ValueError:
        refuse(expected, repr(text), sensor, symbol)
    if not 0.0 < value < float("inf"):
        refuse(expected, repr(text), sensor, symbol)
    if not is_unit_of(unit.strip(), entry, sensor):
        refuse(f"{expected} among {', '.join(units_of(entry, sensor))}", repr(text), sensor, symbol)
    return to_si(value, unit.strip())


store(_Limits, load=_limits)
