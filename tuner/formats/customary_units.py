"""Customary units of inertial sensing: what each coefficient is shown in, whatever its SI value is.

Gyro: deg/√h, deg/h, deg/h/√h, deg/h², arcsec. Accelerometer: µg/√Hz, µg, µg/√h, µg/h, mm/s.
"""

from __future__ import annotations

import math

from models.units import from_si
from tuner.types import Coefficient

_GYRO = {
    "quantization.increment_sd": "arcsec",
    "white.density": "deg/sqrt(h)",
    "bias_instability.level": "deg/h",
    "random_walk.density": "deg/h/sqrt(h)",
    "ramp.rate": "deg/h^2",
    "gauss_markov.sd": "deg/h",
    "sinusoid.amplitude": "deg/h",
    "low_pass_white.density": "deg/sqrt(h)",
    "level": "deg/h",
}
_ACCEL = {
    "quantization.increment_sd": "mm/s",
    "white.density": "ug/sqrt(Hz)",
    "bias_instability.level": "ug",
    "random_walk.density": "ug/sqrt(h)",
    "ramp.rate": "ug/h",
    "gauss_markov.sd": "ug",
    "sinusoid.amplitude": "ug",
    "low_pass_white.density": "ug/sqrt(Hz)",
    "level": "ug",
}
_EITHER = {
    "gauss_markov.time_constant": "s",
    "sinusoid.frequency": "Hz",
    "sinusoid.phase": "rad",
    "low_pass_white.cutoff": "Hz",
    "low_pass_white.order": "",
}
_PRETTY = {
    "deg/sqrt(h)": "deg/√h",
    "deg/h/sqrt(h)": "deg/h/√h",
    "deg/h^2": "deg/h²",
    "ug/sqrt(Hz)": "µg/√Hz",
    "ug/sqrt(h)": "µg/√h",
    "ug/h": "µg/h",
    "ug": "µg",
}
SYMBOLS = {
    "quantization.increment_sd": "Q",
    "white.density": "N",
    "bias_instability.level": "B",
    "random_walk.density": "K",
    "ramp.rate": "R",
    "gauss_markov.sd": "σ GM",
    "gauss_markov.time_constant": "T GM",
}
TITLES = {
    "quantization": "quantization",
    "white": "white (random walk of the integral)",
    "bias_instability": "bias instability",
    "random_walk": "rate random walk",
    "ramp": "ramp",
    "gauss_markov": "Gauss–Markov",
}


def customary_unit(quantity: str, unit: str) -> str:
    """Return the customary unit of ``white.density``, ``level``, … of a sensor with SI unit `unit`."""
    table = _GYRO if unit == "rad/s" else _ACCEL
    return table.get(quantity) or _EITHER.get(quantity, "")


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
        return f"{value:g}"
    exponent = math.floor(math.log10(abs(value)))
    if -4 <= exponent < 6:
        return f"{value:.{max(0, significant - 1 - exponent)}f}"
    return f"{value:.{significant - 1}e}"


def digits_to(value: float, half_width: float) -> str:
    """Format a value as finely as two digits of its half width call for; with many zeros, one digit of it."""
    if not (math.isfinite(half_width) and half_width > 0 and math.isfinite(value)):
        return digits(value)
    places = 1 - math.floor(math.log10(half_width))
    if not -1 <= places <= 6:
        size = math.floor(math.log10(abs(value))) if value else 0
        return digits(value, max(3, size + places))
    return f"{value:.{max(0, places)}f}"


def phrase(coefficient: Coefficient, quantity: str, unit: str, *, with_unit: bool = True) -> str:
    """Say a coefficient in words: ``0.1520 (0.1504 … 0.1536) deg/√h``, ``< 1.2 deg/h``."""
    name = f" {pretty(customary_unit(quantity, unit))}" if with_unit else ""
    if coefficient.value is not None:
        value = in_customary(coefficient.value, quantity, unit)
        if coefficient.interval is None:
            return digits(value) + name
        low, high = (in_customary(x, quantity, unit) for x in coefficient.interval)
        half = 0.5 * (high - low)
        return f"{digits_to(value, half)} ({digits_to(low, half)} … {digits_to(high, half)}){name}"
    if coefficient.upper is not None:
        return f"< {digits(in_customary(coefficient.upper, quantity, unit))}{name}"
    return "–"
