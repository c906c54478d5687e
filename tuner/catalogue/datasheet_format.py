"""Sheets of sensors: a small YAML with a datasheet's own units becomes a `SensorGrade`.

::

    format: tuner-datasheet/1
    name: mpu9250
    title: InvenSense MPU-9250
    kind: typical                 # or maximum, measured; an entry may say otherwise
    rate: 100                     # Hz
    reference: PS-MPU-9250A-01    # an entry or a triad may have its own
    gyro:
      noise_density: {value: 0.01, unit: deg/s/sqrt(Hz), sided: one}
      bias_instability: {value: 5, unit: deg/h}

======================  =====================================================================================
entry of a triad        becomes
======================  =====================================================================================
noise_density           N; ``sided: one`` means σ² = d²·bandwidth, so N = d/√2; default two-sided
bias_instability        B = value/0.664, as sheets quote the Allan minimum; ``reading: level`` means B itself
random_walk             K
ramp                    R
quantization            Q, sd of the increment; ``reading: step`` means a rounding step, Q = step/√12
gauss_markov            a list of {sd: …, time_constant: …}
turn_on_sd              sd of the constant from one switch-on to the next
scale_factor_sd, misalignment_sd, g_sensitivity_sd, bandwidth, range: as named
======================  =====================================================================================
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from models.noise import GaussMarkov
from models.noise.bias_instability import ALLAN_FLOOR
from models.sensors import SensorGrade, Sourced, TriadGrade
from models.units import canonical_unit, to_si, two_sided
from tuner.formats.codec import load, refuse_unknown_keys, store, structured
from tuner.formats.document_errors import refuse
from tuner.formats.documents import parse_format
from tuner.types.number_ranges import Positive

FORMAT = "tuner-datasheet/1"

KINDS: Mapping[str, str] = MappingProxyType(
    {"typical": "datasheet typical", "maximum": "datasheet maximum", "measured": "measured"}
)
"""Kinds of numbers on a sheet, in words."""


@dataclass(frozen=True)
class _Key:
    """An entry: its field in `TriadGrade`, its units for gyro and accel, and the factors of its readings."""

    field: str
    units: Mapping[str, tuple[str, ...]]
    readings: Mapping[str, float]


def _key(field: str, gyro: str, accel: str, **readings: float) -> _Key:
    units = {
        "gyro": tuple(map(canonical_unit, gyro.split())),
        "accel": tuple(map(canonical_unit, accel.split())),
    }
    return _Key(field, units, readings or {"": 1.0})


_RATE = "rad/s deg/s deg/h arcsec/s"
_FORCE = "m/s^2 g mg ug mGal Gal"
_ANGLE = "rad mrad urad deg arcmin arcsec"
_RATIO = "1 % ppm"
_TIME = "s min h"
_SD = _key("sd", _RATE, _FORCE)
_TIME_CONSTANT = _key("time_constant", _TIME, _TIME)
_KEYS: Mapping[str, _Key] = MappingProxyType(
    {
        "quantization": _key("quantization", _ANGLE, "m/s cm/s mm/s ft/s", **{"": 1.0, "step": 12.0**-0.5}),
        "noise_density": _key(
            "white",
            "rad/s/√Hz deg/s/√Hz mdeg/s/√Hz deg/h/√Hz rad/√s deg/√s deg/√h arcsec/√s",
            "m/s^2/√Hz g/√Hz mg/√Hz ug/√Hz mGal/√Hz m/s/√s m/s/√h ft/s/√h m/s^1.5",
        ),
        "bias_instability": _key("bias_instability", _RATE, _FORCE, **{"": 1.0 / ALLAN_FLOOR, "level": 1.0}),
        "random_walk": _key(
            "random_walk",
            "rad/s^1.5 deg/s^1.5 deg/h^1.5 rad/s^2/√Hz deg/s^2/√Hz deg/h/√s deg/h/√h",
            "m/s^2.5 m/s^2/√s m/s^2/√h m/s^3/√Hz ug/√s ug/√h mg/√h",
        ),
        "ramp": _key("ramp", "rad/s^2 deg/s^2 deg/h/s deg/h^2", "m/s^3 ug/s ug/h mg/h"),
        "turn_on_sd": _key("turn_on_sd", _RATE, _FORCE),
        "scale_factor_sd": _key("scale_factor_sd", _RATIO, _RATIO),
        "misalignment_sd": _key("misalignment_sd", _ANGLE, _ANGLE),
        "g_sensitivity_sd": _key("g_sensitivity_sd", "rad/s/(m/s^2) deg/h/g", ""),
        "bandwidth": _key("bandwidth", "Hz kHz", "Hz kHz"),
        "range": _key("range", _RATE, _FORCE),
    }
)


Kind = Literal["typical", "maximum", "measured"]


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _Entry:
    """One number of a sheet, in the unit of the sheet."""

    value: Positive
    unit: str
    sided: Literal["one", "two"] | None = None
    reading: str | None = None
    kind: Kind | None = None
    reference: str | None = None


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _MarkovEntry:
    """One Gauss–Markov state of a sheet."""

    sd: _Entry
    time_constant: _Entry
    kind: Kind | None = None
    reference: str | None = None


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _TriadSheet:
    """The numbers of one triad; beside kind, reference and gauss_markov the keys of `_KEYS`."""

    kind: Kind | None = None
    reference: str | None = None
    gauss_markov: tuple[_MarkovEntry, ...] = ()
    noise_density: _Entry
    quantization: _Entry | None = None
    bias_instability: _Entry | None = None
    random_walk: _Entry | None = None
    ramp: _Entry | None = None
    turn_on_sd: _Entry | None = None
    scale_factor_sd: _Entry | None = None
    misalignment_sd: _Entry | None = None
    g_sensitivity_sd: _Entry | None = None
    bandwidth: _Entry | None = None
    range: _Entry | None = None


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _Sheet:
    """A whole sheet."""

    format: str
    name: str
    title: str | None = None
    kind: Kind | None = None
    rate: Positive
    reference: str | None = None
    notes: tuple[str, ...] = ()
    gyro: _TriadSheet | None = None
    accel: _TriadSheet | None = None


@dataclass(frozen=True)
class _Origin:
    """What a number is and where it comes from, as far as the outer parts of the sheet state it."""

    kind: Kind
    reference: str

    def within(self, part: _Sheet | _TriadSheet | _MarkovEntry | _Entry) -> _Origin:
        """Return the origin within a part that may have its own kind and reference."""
        return _Origin(part.kind or self.kind, self.reference if part.reference is None else part.reference)

    def words(self) -> str:
        """Return kind and reference: ``datasheet typical: PS-MPU-9250A-01``."""
        return f"{KINDS[self.kind]}: {self.reference}" if self.reference else KINDS[self.kind]


def parse_sheet(text: str, *, source: str) -> SensorGrade:
    """Return the grade a sheet describes.

    Parameters
    ----------
    text : str
        YAML of format ``tuner-datasheet/1``.
    source : str
        File name for messages.

    Raises
    ------
    DataError
        One line: file, place, expected, found. Unknown keys and units are refused.
    """
    return load(parse_format(text, source=source, expected_format=FORMAT), SensorGrade, source=source)


def units_of(entry: str, sensor: str) -> tuple[str, ...]:
    """Return the units in which an entry such as ``noise_density`` of ``gyro`` or ``accel`` may stand."""
    return _KEYS[entry].units[sensor]


def _grade(content: object) -> SensorGrade:
    sheet = structured(content, _Sheet)
    if sheet.gyro is None and sheet.accel is None:
        refuse("an entry 'gyro' or 'accel'", "neither")
    if not re.fullmatch("[a-z0-9]+", sheet.name):
        refuse("lower-case letters and digits", repr(sheet.name), "name")
    origin = _Origin("typical", "").within(sheet)
    return SensorGrade(
        sheet.name,
        sheet.title or sheet.name,
        Sourced(sheet.rate, origin.words()),
        _triad(sheet.gyro, "gyro", origin),
        _triad(sheet.accel, "accel", origin),
        sheet.notes,
    )


def _triad(sheet: _TriadSheet | None, sensor: str, inherited: _Origin) -> TriadGrade:
    if sheet is None:
        return TriadGrade(sensor)
    origin = inherited.within(sheet)
    numbers = {
        key.field: _sourced(entry, key, (sensor, name), origin)
        for name, key in _KEYS.items()
        if (entry := getattr(sheet, name)) is not None
    }
    states = []
    for index, state in enumerate(sheet.gauss_markov):
        place = (sensor, "gauss_markov", index)
        of_state = origin.within(state)
        sd = _sourced(state.sd, _SD, (*place, "sd"), of_state).value
        time_constant = _sourced(
            state.time_constant, _TIME_CONSTANT, (*place, "time_constant"), of_state
        ).value
        states.append(Sourced(GaussMarkov(sd, time_constant), of_state.words()))
    return TriadGrade(sensor, gauss_markov=tuple(states), **numbers)


def _sourced(entry: _Entry, key: _Key, place: tuple[str | int, ...], inherited: _Origin) -> Sourced[float]:
    """Return a number in SI with its source; `place` leads to the entry, its first key being the sensor."""
    units = key.units[str(place[0])]
    if not is_among(entry.unit, units):
        refuse(f"a unit among {', '.join(units) or 'none'}", repr(entry.unit), *place, "unit")
    if entry.reading is not None and (not entry.reading or entry.reading not in key.readings):
        known = ", ".join(filter(None, key.readings)) or "(this entry has none)"
        refuse(f"one of {known}", repr(entry.reading), *place, "reading")
    if entry.sided and key.field != "white":
        refuse("'one' or 'two' of a noise density only", repr(entry.sided), *place, "sided")
    value = to_si(entry.value, entry.unit) * key.readings[entry.reading or ""]
    return Sourced(two_sided(value) if entry.sided == "one" else value, inherited.within(entry).words())


def is_among(unit: str, units: tuple[str, ...]) -> bool:
    """Return whether a unit, in any spelling, is one of some."""
    try:
        return canonical_unit(unit) in units
    except ValueError:
        return False


store(SensorGrade, load=_grade)
