"""Customary units of inertial sensing, each the SI value of one unit.

``5 * DEG_PER_HOUR`` is 5 deg/h in rad/s; `to_si` and `from_si` do the same by the name of the unit. SI here
is rad, s, m. Square roots may be written ``sqrt(h)`` or ``√h``, micro ``u`` or ``µ``, squares ``^2``
or ``²``.

Noise densities are two-sided (σ² = N²/dt); one quoted as σ² = d² · bandwidth is one-sided: see `two_sided`.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

DEG: Final = float(np.pi / 180.0)
ARCMIN: Final = DEG / 60.0
ARCSEC: Final = DEG / 3600.0
HOUR: Final = 3600.0
DEG_PER_SECOND: Final = DEG
DEG_PER_HOUR: Final = DEG / HOUR
DEG_PER_SQRT_HOUR: Final = DEG / 60.0
DEG_PER_HOUR_PER_SQRT_HZ: Final = DEG_PER_HOUR
DEG_PER_SECOND_PER_SQRT_HZ: Final = DEG
DEG_PER_HOUR_SQRT_HOUR: Final = DEG_PER_HOUR / 60.0
DEG_PER_HOUR_SQUARED: Final = DEG_PER_HOUR / HOUR
STANDARD_GRAVITY: Final = 9.80665
G: Final = STANDARD_GRAVITY
MILLI_G: Final = 1e-3 * STANDARD_GRAVITY
MICRO_G: Final = 1e-6 * STANDARD_GRAVITY
GAL: Final = 1e-2
MGAL: Final = 1e-5
FOOT: Final = 0.3048
KNOT: Final = 1852.0 / HOUR
MILE_PER_HOUR: Final = 1609.344 / HOUR
MICRO_G_PER_SQRT_HZ: Final = MICRO_G
MILLI_G_PER_SQRT_HZ: Final = MILLI_G
MGAL_PER_SQRT_HZ: Final = MGAL
METRE_PER_SECOND_PER_SQRT_HOUR: Final = 1.0 / 60.0
FOOT_PER_SECOND_PER_SQRT_HOUR: Final = FOOT / 60.0
MICRO_G_PER_SQRT_HOUR: Final = MICRO_G / 60.0
MICRO_G_PER_HOUR: Final = MICRO_G / HOUR

_UNITS: Final[dict[str, float]] = {
    # pure numbers, times, frequencies
    "1": 1.0,
    "%": 1e-2,
    "ppm": 1e-6,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": HOUR,
    "Hz": 1.0,
    "kHz": 1e3,
    # angle
    "rad": 1.0,
    "mrad": 1e-3,
    "urad": 1e-6,
    "deg": DEG,
    "arcmin": ARCMIN,
    "arcsec": ARCSEC,
    # angular rate
    "rad/s": 1.0,
    "mrad/s": 1e-3,
    "deg/s": DEG_PER_SECOND,
    "mdeg/s": 1e-3 * DEG_PER_SECOND,
    "deg/h": DEG_PER_HOUR,
    "arcsec/s": ARCSEC,
    # angular random walk N
    "rad/s^0.5": 1.0,
    "deg/s^0.5": DEG,
    "deg/h^0.5": DEG_PER_SQRT_HOUR,
    "arcsec/s^0.5": ARCSEC,
    "rad/s/Hz^0.5": 1.0,
    "deg/s/Hz^0.5": DEG_PER_SECOND_PER_SQRT_HZ,
    "mdeg/s/Hz^0.5": 1e-3 * DEG_PER_SECOND_PER_SQRT_HZ,
    "deg/h/Hz^0.5": DEG_PER_HOUR_PER_SQRT_HZ,
    # rate random walk K
    "rad/s^1.5": 1.0,
    "deg/s^1.5": DEG,
    "deg/h^1.5": DEG_PER_HOUR_SQRT_HOUR,
    "rad/s^2/Hz^0.5": 1.0,
    "deg/s^2/Hz^0.5": DEG,
    "deg/h/s^0.5": DEG_PER_HOUR,
    "deg/h/h^0.5": DEG_PER_HOUR_SQRT_HOUR,
    # rate ramp R
    "rad/s^2": 1.0,
    "deg/s^2": DEG,
    "deg/h/s": DEG_PER_HOUR,
    "deg/h^2": DEG_PER_HOUR_SQUARED,
    # velocity, position
    "m": 1.0,
    "cm": 1e-2,
    "km": 1e3,
    "mm": 1e-3,
    "ft": FOOT,
    "m/s": 1.0,
    "cm/s": 1e-2,
    "mm/s": 1e-3,
    "km/h": 1.0 / 3.6,
    "ft/s": FOOT,
    "kn": KNOT,
    "mph": MILE_PER_HOUR,
    # acceleration
    "m/s^2": 1.0,
    "cm/s^2": GAL,
    "ft/s^2": FOOT,
    "g": G,
    "mg": MILLI_G,
    "ug": MICRO_G,
    "Gal": GAL,
    "mGal": MGAL,
    # velocity random walk N
    "m/s^1.5": 1.0,
    "m/s/s^0.5": 1.0,
    "m/s/h^0.5": METRE_PER_SECOND_PER_SQRT_HOUR,
    "ft/s/h^0.5": FOOT_PER_SECOND_PER_SQRT_HOUR,
    "m/s^2/Hz^0.5": 1.0,
    "g/Hz^0.5": G,
    "mg/Hz^0.5": MILLI_G_PER_SQRT_HZ,
    "ug/Hz^0.5": MICRO_G_PER_SQRT_HZ,
    "mGal/Hz^0.5": MGAL_PER_SQRT_HZ,
    # acceleration random walk K
    "m/s^2.5": 1.0,
    "m/s^2/s^0.5": 1.0,
    "m/s^2/h^0.5": 1.0 / 60.0,
    "m/s^3/Hz^0.5": 1.0,
    "ug/s^0.5": MICRO_G,
    "ug/h^0.5": MICRO_G_PER_SQRT_HOUR,
    "mg/h^0.5": MILLI_G / 60.0,
    # acceleration ramp R
    "m/s^3": 1.0,
    "ug/s": MICRO_G,
    "ug/h": MICRO_G_PER_HOUR,
    "mg/h": MILLI_G / HOUR,
    # bias per temperature
    "rad/s/K": 1.0,
    "deg/s/K": DEG_PER_SECOND,
    "deg/h/K": DEG_PER_HOUR,
    "m/s^2/K": 1.0,
    "mg/K": MILLI_G,
    "ug/K": MICRO_G,
    # sensitivities
    "deg/h/g": DEG_PER_HOUR / G,
    "rad/s/(m/s^2)": 1.0,
    # temperature
    "degC": 1.0,
    "K": 1.0,
}

_SPELLINGS: Final = (
    (re.compile(r"\s+"), ""),
    (re.compile(r"\bhr\b"), "h"),
    (re.compile("dps"), "deg/s"),
    (re.compile("″"), "arcsec"),
    (re.compile("[µμ]"), "u"),
    (re.compile("°C"), "degC"),
    (re.compile("°/"), "deg/"),
    (re.compile("°$"), "deg"),
    (re.compile(r"√\(?(Hz|h|s)\)?"), r"\1^0.5"),
    (re.compile(r"sqrt\((Hz|h|s)\)"), r"\1^0.5"),
    (re.compile(r"rt(Hz|h|s)\b"), r"\1^0.5"),
    (re.compile("²"), "^2"),
    (re.compile("³"), "^3"),
    (re.compile(r"\*\*"), "^"),
    (re.compile(r"\^\(?1/2\)?"), "^0.5"),
    (re.compile(r"\^\(?3/2\)?"), "^1.5"),
    (re.compile(r"\bdeg/sec\b"), "deg/s"),
)


def canonical_unit(unit: str) -> str:
    """Return the one spelling of a unit in this module: ``deg/√h`` and ``°/sqrt(hr)`` are both ``deg/h^0.5``.

    Raises
    ------
    ValueError
        For an unknown unit, with the list of the known ones.
    """
    key = unit
    for pattern, replacement in _SPELLINGS:
        key = pattern.sub(replacement, key)
    if key not in _UNITS:
        raise ValueError(f"unknown unit '{unit}'; known are {', '.join(known_units())}")
    return key


def unit_value(unit: str) -> float:
    """Return the SI value of one unit.

    Raises
    ------
    ValueError
        For an unknown unit, with the list of the known ones.
    """
    return _UNITS[canonical_unit(unit)]


def known_units() -> tuple[str, ...]:
    """Return every unit that `to_si` reads, square roots written ``sqrt(h)``."""
    return tuple(re.sub(r"(Hz|h|s)\^0\.5", r"sqrt(\1)", key) for key in _UNITS)


def to_si(value: float, unit: str) -> float:
    """Convert a value to SI (rad, s, m).

    >>> round(to_si(1.0, "deg/√h"), 10)
    0.0002908882
    """
    return value * unit_value(unit)


def from_si(value: float, unit: str) -> float:
    """Convert an SI value to a unit.

    >>> round(from_si(1.0, "deg/h"), 3)
    206264.806
    """
    return value / unit_value(unit)


def two_sided(density: float) -> float:
    """Return the two-sided density N of a one-sided one d (σ² = d² · bandwidth): d/√2."""
    return float(density / np.sqrt(2.0))


def time_derivative(unit: str, power: float) -> str:
    """Return an SI unit divided by s^power.

    >>> time_derivative("rad/s", -0.5), time_derivative("m/s^2", 1)
    ('rad/s^0.5', 'm/s^3')
    """
    base, _, seconds = unit.partition("/s")
    total = (float(seconds.removeprefix("^") or 1.0) if "/s" in unit else 0.0) + power
    if total == 0.0:
        return base
    return f"{base}/s" if total == 1.0 else f"{base}/s^{total:g}"


def unit_of_samples(sensor: str) -> str:
    """Return the SI unit of the samples of a sensor or an axis: ``gyro``, ``gyroscope``, ``gyro_x`` or ``accel_x``."""
    return "rad/s" if sensor.startswith("gyro") else "m/s^2"
