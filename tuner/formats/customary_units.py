"""Customary units of inertial sensing: what each coefficient is shown in, whatever its SI value is.

Gyro: deg/√h, deg/h, deg/h/√h, deg/h², arcsec. Accelerometer: µg/√Hz, µg, µg/√h, µg/h, mm/s.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from models.noise import TERMS
from models.units import DEG, DEG_PER_HOUR, DEG_PER_SECOND, MICRO_G, MILLI_G, G, from_si
from tuner.types import Coefficient

_CUSTOMARY = {
    "rad/s": {-1.0: "arcsec", -0.5: "deg/sqrt(h)", 0.0: "deg/h", 0.5: "deg/h/sqrt(h)", 1.0: "deg/h^2"},
    "m/s^2": {-1.0: "mm/s", -0.5: "ug/sqrt(Hz)", 0.0: "ug", 0.5: "ug/sqrt(h)", 1.0: "ug/h"},
    "K": {0.0: "K"},
}
"""Customary unit of a number that differs from the rate by a power of 1/s, by unit of the rate and that power."""
_PRETTY = {
    "deg/sqrt(h)": "deg/√h",
    "deg/h/sqrt(h)": "deg/h/√h",
    "deg/h^2": "deg/h²",
    "ug/sqrt(Hz)": "µg/√Hz",
    "ug/sqrt(h)": "µg/√h",
    "ug/h": "µg/h",
    "ug": "µg",
    "ug/K": "µg/K",
}

_UNIT_SIZES = {
    "rad/s": ((DEG_PER_HOUR, "deg/h"), (DEG_PER_SECOND, "deg/s")),
    "m/s^2": ((MICRO_G, "µg"), (MILLI_G, "mg"), (G, "g")),
    "rad": ((DEG, "deg"),),
    "relative": ((0.01, "%"),),
}
"""Customary units of each SI unit with their sizes, the smallest first."""
_DENSITY_UNITS = {
    "rad/s/√Hz": "deg/sqrt(h)",
    "m/s^2/√Hz": "ug/sqrt(Hz)",
    "rad/s/√s": "deg/h/sqrt(h)",
    "m/s^2/√s": "ug/sqrt(h)",
}
EXACT_DIGITS = 4
"""Digits of a number without an interval, such as the time of an event."""
_LARGEST_NUMBER = 1000.0
"""Number from which the next larger unit is taken."""


def symbol(quantity: str) -> str:
    """Return the symbol of ``white.density``, and so on: ``N``; its words where it has none."""
    name, _, parameter = quantity.partition(".")
    kind = TERMS.get(name)
    if kind is not None and parameter in kind.PARAMETERS[: len(kind.SYMBOLS)]:
        return kind.SYMBOLS[kind.PARAMETERS.index(parameter)]
    return quantity.replace(".", " ")


def term_title(term: str) -> str:
    """Return what tables call a noise term; nothing where its name says it."""
    kind = TERMS.get(term)
    return "" if kind is None else kind.title


def customary_unit(quantity: str, unit: str) -> str:
    """Return the customary unit of ``white.density``, ``level``, ``slope``, … of a sensor with SI unit `unit`."""
    customary = _CUSTOMARY.get(unit, _CUSTOMARY["m/s^2"])
    if quantity in ("level", "slope"):
        return customary[0.0] + "/K" * (quantity == "slope")
    name, _, parameter = quantity.partition(".")
    kind = TERMS.get(name)
    units = {} if kind is None else dict(zip(kind.PARAMETERS, kind.UNITS, strict=False))
    of_parameter = units.get(parameter, "")
    return of_parameter if isinstance(of_parameter, str) else customary.get(of_parameter, "")


def pretty(unit: str) -> str:
    """Return a unit with real symbols: ``deg/√h``."""
    return _PRETTY.get(unit, unit)


def in_customary(value: float, quantity: str, unit: str) -> float:
    """Convert an SI value of `quantity` to its customary unit."""
    target = customary_unit(quantity, unit)
    return float(from_si(value, target)) if target else value


def digits(value: float, significant: int = 3) -> str:
    """Format to `significant` digits without needless exponents."""
    if value == 0 or not math.isfinite(value):
        return f"{value + 0.0:g}"
    exponent = _exponent(value, significant)
    if -4 <= exponent < 6:
        return f"{value:.{max(0, significant - 1 - exponent)}f}"
    return f"{value:.{significant - 1}e}"


def _exponent(value: float, significant: int) -> int:
    """Return the power of ten of a value rounded to so many digits: of 9.997 to three digits that of 10.0."""
    return int(f"{value:.{significant - 1}e}".partition("e")[2])


def percent(share: float, significant: int = 2) -> str:
    """Return a share in per cent to `significant` digits without an exponent: ``2.8 %``, ``100 %``."""
    return f"{float(f'{100.0 * share:.{significant}g}'):g} %"


def stamp(time: float) -> str:
    """Return a time on the clock of a log, s, to the millisecond: stamps may be seconds since 1970."""
    return f"{round(time, 3) + 0.0:.3f}".rstrip("0").removesuffix(".")  # -0.0 + 0.0 is 0.0


def since(begin: float, unit: str = "s") -> str:
    """Return the label of an axis of time that counts from `begin`, s on the clock of the log."""
    return f"time, {unit}" if begin == 0.0 else f"time since {stamp(begin)} s, {unit}"


def digits_to(value: float, half_width: float) -> str:
    """Format a value as finely as two digits of its half width call for; with many zeros, one digit of it."""
    if not (math.isfinite(half_width) and half_width > 0 and math.isfinite(value)):
        return digits(value)
    places = 1 - _exponent(half_width, 2)
    if not -1 <= places <= 6:
        size = math.floor(math.log10(abs(value))) if value else 0
        return digits(value, max(3, size + places))
    return f"{value:.{max(0, places)}f}"


MAX_ASYMMETRY = 0.2
"""Difference of the halves of an interval ÷ the larger one up to which ± is said: its first digit is that of both."""


def with_interval(value: float, low: float, high: float, *, between: str = " … ") -> str:
    """Say a number with its interval: ``0.152 ± 0.016``; both ends where it is not symmetric: ``339 (200 … 663)``."""
    above, below, half = high - value, value - low, 0.5 * (high - low)
    if math.isinf(high):
        return f"{digits(value)} (from {digits(low)})"
    if not half > 0.0:
        return digits(value)
    if abs(above - below) > MAX_ASYMMETRY * max(above, below):
        return f"{digits_to(value, half)} ({digits_to(low, half)}{between}{digits_to(high, half)})"
    return f"{digits_to(value, half)} ± {digits(half, 2)}"


def phrase(coefficient: Coefficient, quantity: str, unit: str, *, with_unit: bool = True) -> str:
    """Say a coefficient in words: ``0.1520 ± 0.0016 deg/√h``, ``< 1.2 deg/h``."""
    name = f" {pretty(customary_unit(quantity, unit))}" if with_unit else ""
    return _said(coefficient, 1.0 / in_customary(1.0, quantity, unit), name, "<", 3)


def amount(coefficient: Coefficient) -> str:
    """Say a coefficient of any SI unit in a customary one of its size: ``81.5 ± 4.5 deg/h``, ``below 0.3 mg``."""
    number = coefficient.upper if coefficient.value is None else coefficient.value
    if number is None:
        return "–"
    return _said(coefficient, *_unit_for(coefficient.unit, number), "below", EXACT_DIGITS)


def range_text(values: Collection[float], unit: str = "1", significant: int = 3) -> str:
    """Return the least and the largest of values of an SI unit, once where they are alike, in a customary unit."""
    least, most = min(values), max(values)
    size, name = _unit_for(unit, max(most, -least))
    ends = dict.fromkeys(digits(one / size, significant) for one in (least, most))
    return (" to +" if least < 0.0 < most else " to ").join(ends) + name


def _said(c: Coefficient, size: float, unit: str, below: str, exact: int) -> str:
    """Say a coefficient in a unit of that size: with its interval, its limit, or to `exact` digits without either."""
    if c.value is None:
        return "–" if c.upper is None else f"{below} {digits(c.upper / size)}{unit}"
    if c.interval is None or c.interval[0] == c.interval[1]:
        return f"{digits(c.value / size, exact)}{unit}"
    low, high = (end / size for end in c.interval)
    return with_interval(c.value / size, low, high) + unit


def _unit_for(unit: str, number: float) -> tuple[float, str]:
    """Return size and name, behind a space, of the customary unit for a number of an SI unit."""
    if unit in _DENSITY_UNITS:
        return 1.0 / float(from_si(1.0, _DENSITY_UNITS[unit])), f" {pretty(_DENSITY_UNITS[unit])}"
    base, per = (unit[:-2], "/K") if unit.endswith("/K") else (unit, "")
    sizes = _UNIT_SIZES.get(base)
    if sizes is None:
        return 1.0, "" if unit == "1" else f" {unit}"
    size, name = next((one for one in sizes if abs(number) < _LARGEST_NUMBER * one[0]), sizes[-1])
    return size, f" {name}{per}"
