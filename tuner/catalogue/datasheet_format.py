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

from models.noise import GaussMarkov
from models.noise.bias_instability import ALLAN_FLOOR
from models.sensors import SensorGrade, Sourced, TriadGrade
from models.units import canonical_unit, to_si, two_sided
from tuner.formats.nodes import Node, document

FORMAT = "tuner-datasheet/1"

KINDS: Mapping[str, str] = MappingProxyType(
    {"typical": "datasheet typical", "maximum": "datasheet maximum", "measured": "measured"}
)
"""What a number may be, and how to say it."""


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


@dataclass(frozen=True)
class _Origin:
    """What a number is and where it comes from, as far as the sheet has said so far."""

    kind: str
    reference: str

    def within(self, node: Node) -> _Origin:
        """Return the origin below a node that may have its own kind and reference."""
        kind, reference = node.get("kind"), node.get("reference")
        if kind and kind.value not in KINDS:
            kind.refuse(f"one of {', '.join(KINDS)}", repr(kind.value))
        return _Origin(kind.text() if kind else self.kind, reference.text() if reference else self.reference)

    def words(self) -> str:
        """Say it: ``datasheet typical: PS-MPU-9250A-01``."""
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
    root = document(text, source, FORMAT)
    root.only("format", "name", "title", "kind", "rate", "reference", "notes", "gyro", "accel")
    origin = _Origin("typical", "").within(root)
    triads = {kind: _triad(root, kind, origin) for kind in ("gyro", "accel")}
    if triads["gyro"].white is None and triads["accel"].white is None:
        root.refuse("an entry 'gyro' or 'accel'", "neither")
    title, notes = root.get("title"), root.get("notes")
    name = root["name"]
    if not re.fullmatch("[a-z0-9]+", name.text()):
        name.refuse("lower-case letters and digits", repr(name.value))
    return SensorGrade(
        name.text(),
        title.text() if title else name.text(),
        Sourced(root["rate"].number(positive=True), origin.words()),
        triads["gyro"],
        triads["accel"],
        tuple(note.text() for note in notes.elements()) if notes else (),
    )


def _triad(root: Node, kind: str, inherited: _Origin) -> TriadGrade:
    node = root.get(kind)
    if node is None:
        return TriadGrade(kind)
    node.only("kind", "reference", "gauss_markov", *_KEYS)
    node["noise_density"]
    origin = inherited.within(node)
    numbers = {
        key.field: _sourced(entry, key, kind, origin)
        for name, key in _KEYS.items()
        if (entry := node.get(name))
    }
    markov = node.get("gauss_markov")
    states = tuple(_markov(entry, kind, origin) for entry in markov.elements()) if markov else ()
    return TriadGrade(kind, gauss_markov=states, **numbers)


def _markov(entry: Node, kind: str, inherited: _Origin) -> Sourced[GaussMarkov]:
    entry.only("sd", "time_constant", "kind", "reference")
    origin = inherited.within(entry)
    sd, time = (_sourced(entry[key.field], key, kind, origin).value for key in (_SD, _TIME_CONSTANT))
    return Sourced(GaussMarkov(sd, time), origin.words())


def _sourced(entry: Node, key: _Key, kind: str, inherited: _Origin) -> Sourced[float]:
    entry.only("value", "unit", "sided", "reading", "kind", "reference")
    unit = entry["unit"]
    if not _allowed(unit, key.units[kind]):
        unit.refuse(f"a unit among {', '.join(key.units[kind]) or 'none'}", repr(unit.value))
    value = to_si(entry["value"].number(positive=True), unit.text())
    reading, sided = entry.get("reading"), entry.get("sided")
    if reading and (not reading.value or reading.value not in key.readings):
        reading.refuse(
            f"one of {', '.join(filter(None, key.readings)) or '(this entry has none)'}", repr(reading.value)
        )
    if sided and (key.field != "white" or sided.value not in {"one", "two"}):
        sided.refuse("'one' or 'two', of a noise density", repr(sided.value))
    value *= key.readings[reading.text() if reading else ""]
    if sided and sided.value == "one":
        value = two_sided(value)
    return Sourced(value, inherited.within(entry).words())


def _allowed(unit: Node, units: tuple[str, ...]) -> bool:
    try:
        return canonical_unit(unit.text()) in units
    except ValueError:
        return False
