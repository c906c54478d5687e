"""The numbers by which units are judged: their symbols, customary units and scales.

===========  =======================================================================================================
symbol       quantity
===========  =======================================================================================================
N            white noise density
B            bias instability
K            random walk density
mean         mean of a gyro axis; of accelerometers, the length of the mean specific force less standard gravity
             (channel ``accel``): a unit at rest shows its bias only along the vertical, and gravity differs by ±0.3 %
sigma_10s    Allan deviation at 10 s; of it no limit is stated
===========  =======================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from scipy.stats import norm

from models.units import STANDARD_GRAVITY
from tuner.formats.customary_units import customary_unit, in_customary, pretty
from tuner.types import LEVEL, Coefficient, Identification

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "N": "white.density",
        "B": "bias_instability.level",
        "K": "random_walk.density",
        "mean": "level",
        "sigma_10s": "level",
    }
)
"""What each symbol is called elsewhere."""
FORCE = "accel"
"""Channel that stands for the length of the specific force."""
SENSORS: Mapping[str, str] = MappingProxyType({"rad/s": "gyro", "m/s^2": "accel"})
"""Sensor by the unit of its channels."""
_QUANTILE = float(norm.ppf(0.5 + 0.5 * LEVEL))


def quantities_of(found: Identification) -> tuple[dict[str, str], dict[str, Coefficient]]:
    """Return the unit of each channel, and the quantities by channel and symbol, such as ``gyro_x.N``."""
    units = {axis: channel.unit for axis, channel in found.channels.items()}
    quantities: dict[str, Coefficient] = {}
    for axis, channel in found.channels.items():
        for symbol in ("N", "B", "K"):
            term, _, parameter = SYMBOLS[symbol].partition(".")
            estimate = channel.term(term)
            if estimate is not None and parameter in estimate.coefficients:
                quantities[f"{axis}.{symbol}"] = estimate.coefficients[parameter]
        if channel.unit == "rad/s":
            quantities[f"{axis}.mean"] = channel.mean
        quantities[f"{axis}.sigma_10s"] = channel.sigma_10s
    forces = [channel.mean for channel in found.channels.values() if channel.unit == "m/s^2"]
    if len(forces) == 3:
        units[FORCE] = "m/s^2"
        quantities[f"{FORCE}.mean"] = _excess(forces)
    return units, quantities


def further_terms(found: Identification) -> tuple[str, ...]:
    """Return the names of the noise terms that a log shows beside N, B and K."""
    stated = {SYMBOLS[symbol].partition(".")[0] for symbol in ("N", "B", "K")}
    present = {term.name for channel in found.channels.values() for term in channel.terms if term.present}
    return tuple(sorted(present - stated))


def _excess(forces: list[Coefficient]) -> Coefficient:
    """Return the length of a specific force less standard gravity, m/s²."""
    means = [math.nan if one.value is None else one.value for one in forces]
    length = math.hypot(*means)
    if not (math.isfinite(length) and length > 0.0):
        return Coefficient(None, None, None, "m/s^2", "a mean is not known")
    halves = [0.0 if one.interval is None else 0.5 * (one.interval[1] - one.interval[0]) for one in forces]
    half = math.hypot(*(half * mean / length for half, mean in zip(halves, means, strict=True)))
    excess = length - STANDARD_GRAVITY
    return Coefficient.known(excess, excess - half, excess + half, "m/s^2")


def is_logarithmic(quantity: str) -> bool:
    """Tell amplitudes, which differ by factors, from means, which differ by sums."""
    return not quantity.endswith(".mean")


def scaled(coefficient: Coefficient, quantity: str) -> tuple[float, float] | None:
    """Return value and standard deviation on the scale on which units differ; None where there is no value."""
    value, interval = coefficient.value, coefficient.interval
    if value is None or not math.isfinite(value):
        return None
    low, high = interval or (value, value)
    if not is_logarithmic(quantity):
        return value, 0.5 * (high - low) / _QUANTILE
    if value <= 0.0:
        return None
    below = math.log(value / low) if low > 0.0 else math.inf
    above = math.log(high / value) if math.isfinite(high) else math.inf
    return math.log(value), min(max(below, above), 0.5 * below + 0.5 * above) / _QUANTILE


def unit_name(quantity: str, unit: str) -> str:
    """Return the customary unit of ``gyro_x.N`` in ASCII: ``deg/sqrt(h)``."""
    return customary_unit(SYMBOLS[quantity.rpartition(".")[2]], unit)


def customary(value: float, quantity: str, unit: str) -> float:
    """Convert an SI value of ``gyro_x.N`` to its customary unit."""
    return in_customary(value, SYMBOLS[quantity.rpartition(".")[2]], unit)


def title(quantity: str) -> str:
    """Return a quantity in words: ``gyro_x N``."""
    return quantity.replace(".", " ")


def pretty_unit(quantity: str, unit: str) -> str:
    """Return the customary unit with real symbols: ``deg/√h``."""
    return pretty(unit_name(quantity, unit))
