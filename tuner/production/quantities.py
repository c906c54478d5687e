"""The numbers by which units are judged: their symbols, customary units and scales.

==================  ==================================================================================================
symbol              quantity
==================  ==================================================================================================
N                   white noise density
B                   bias instability
K                   random walk density
mean                mean of a gyro axis; of accelerometers, the length of the mean specific force less standard gravity
                    (channel ``accel``): a unit at rest shows its bias only along the vertical, and gravity differs by
                    ±0.3 %
at_rest             length of the mean rate less the Earth's (channel ``gyro``)
sigma_10s           Allan deviation at 10 s
ramp                slope of the line through the samples
temperature_slope   change with the measured temperature, where that changes by 1 K
warm_up             change of the temperature over the log (channel ``temperature``)
==================  ==================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from scipy.stats import norm

from models.earth import EARTH_RATE
from models.units import STANDARD_GRAVITY
from tuner.formats.customary_units import customary_unit, in_customary, pretty
from tuner.types import LEVEL, Coefficient, Identification

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "N": "white.density",
        "B": "bias_instability.level",
        "K": "random_walk.density",
        "mean": "level",
        "at_rest": "level",
        "sigma_10s": "level",
        "ramp": "ramp.rate",
        "temperature_slope": "slope",
        "warm_up": "level",
    }
)
"""What each symbol is called elsewhere."""
IN_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "N": "white noise",
        "B": "bias instability",
        "K": "bias random walk",
        "at_rest": "rate at rest less the Earth's",
        "sigma_10s": "Allan deviation at 10 s",
        "temperature_slope": "change with temperature",
        "warm_up": "warming over the log",
    }
)
"""Symbols of quantities in words, where these are others."""
FORCE = "accel"
"""Channel that stands for the length of the specific force."""
RATE = "gyro"
"""Channel that stands for the length of the rate."""
SENSORS: Mapping[str, str] = MappingProxyType({"rad/s": "gyro", "m/s^2": "accel", "K": "temperature"})
"""Sensor by the unit of its channels."""
AMPLITUDES = ("N", "B", "K", "sigma_10s")
"""Symbols of what differs by factors; the others differ by sums."""
QUANTILE = float(norm.ppf(0.5 + 0.5 * LEVEL))
"""Half width of the interval of a normal number, in its sds."""


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
    for name, unit, symbol, truth in (
        (FORCE, "m/s^2", "mean", STANDARD_GRAVITY),
        (RATE, "rad/s", "at_rest", EARTH_RATE),
    ):
        means = [channel.mean for channel in found.channels.values() if channel.unit == unit]
        if len(means) == 3:
            units[name] = unit
            quantities[f"{name}.{symbol}"] = _excess(means, unit, truth)
    return units, quantities


def further_terms(found: Identification) -> tuple[str, ...]:
    """Return the names of the noise terms that a log shows beside N, B and K."""
    stated = {SYMBOLS[symbol].partition(".")[0] for symbol in ("N", "B", "K")}
    present = {term.name for channel in found.channels.values() for term in channel.terms if term.present}
    return tuple(sorted(present - stated))


def _excess(axes: Sequence[Coefficient], unit: str, truth: float) -> Coefficient:
    """Return the length of a mean vector less what it is of a perfect sensor, in `unit`."""
    means = [math.nan if one.value is None else one.value for one in axes]
    length = math.hypot(*means)
    if not (math.isfinite(length) and length > 0.0):
        return Coefficient(None, None, None, unit, "a mean is not known")
    halves = [0.0 if one.interval is None else 0.5 * (one.interval[1] - one.interval[0]) for one in axes]
    half = math.hypot(*(half * mean / length for half, mean in zip(halves, means, strict=True)))
    return Coefficient.known(length - truth, length - truth - half, length - truth + half, unit)


def is_logarithmic(quantity: str) -> bool:
    """Tell amplitudes, which differ by factors, from means and slopes, which differ by sums."""
    return quantity.rpartition(".")[2] in AMPLITUDES


def least_size(one: Coefficient) -> float:
    """Return the least magnitude within the interval of a number."""
    low, high = one.interval or (one.value or 0.0, one.value or 0.0)
    return max(low, -high, 0.0)


def scaled(coefficient: Coefficient, quantity: str) -> tuple[float, float] | None:
    """Return value and standard deviation on the scale on which units differ; None where there is no value."""
    value, interval = coefficient.value, coefficient.interval
    if value is None or not math.isfinite(value):
        return None
    low, high = interval or (value, value)
    if not is_logarithmic(quantity):
        return value, 0.5 * (high - low) / QUANTILE
    if value <= 0.0:
        return None
    below = math.log(value / low) if low > 0.0 else math.inf
    above = math.log(high / value) if math.isfinite(high) else math.inf
    return math.log(value), min(max(below, above), 0.5 * below + 0.5 * above) / QUANTILE


def unit_name(quantity: str, unit: str) -> str:
    """Return the customary unit of ``gyro_x.N`` in ASCII: ``deg/sqrt(h)``."""
    return customary_unit(SYMBOLS[quantity.rpartition(".")[2]], unit)


def customary(value: float, quantity: str, unit: str) -> float:
    """Convert an SI value of ``gyro_x.N`` to its customary unit."""
    return in_customary(value, SYMBOLS[quantity.rpartition(".")[2]], unit)


def title(quantity: str) -> str:
    """Return a quantity as the head of a column has it: ``gyro_x N``."""
    return quantity.replace(".", " ")


def in_words(quantity: str) -> str:
    """Return a quantity in words: ``gyro_x N``, ``gyro_x Allan deviation at 10 s``."""
    channel, _, symbol = quantity.rpartition(".")
    return f"{channel} {symbol if symbol in ('N', 'B', 'K') else IN_WORDS.get(symbol, symbol)}"


def pretty_unit(quantity: str, unit: str) -> str:
    """Return the customary unit with real symbols: ``deg/√h``."""
    return pretty(unit_name(quantity, unit))
