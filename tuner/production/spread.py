"""How far units differ: mean and unit-to-unit spread of every quantity, and the fleet as a grade that is read anywhere.

Each quantity of each axis is pooled over the units by `tuner.identification.several_logs`: the spread is what is left
when the uncertainty of each estimate is taken out, with its interval by the Q profile. Amplitudes spread by ratios.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence

import yaml

from tuner.catalogue.datasheet_format import FORMAT
from tuner.formats.assumption_words import assumed_text
from tuner.formats.customary_units import digits, phrase
from tuner.identification.several_logs import pool_coefficients
from tuner.production.quantities import (
    SENSORS,
    SYMBOLS,
    customary,
    is_logarithmic,
    pretty_unit,
)
from tuner.types import PooledCoefficient
from tuner.types.fleet import Fleet, UnitMeasurement

ENTRIES: Mapping[str, str] = {"N": "noise_density", "B": "bias_instability", "K": "random_walk"}
"""Entry of a grade that each symbol becomes."""


def spread(measurements: Sequence[UnitMeasurement]) -> dict[str, PooledCoefficient]:
    """Return mean and spread of every quantity that at least two units show with an interval."""
    names = dict.fromkeys(name for one in measurements for name in one.quantities)
    found = {}
    for name in names:
        values = [one.quantities.get(name) for one in measurements]
        usable = [
            v
            for v in values
            if v is None
            or v.value is None
            or (v.interval is not None and v.interval[1] > v.interval[0] and _has_log(name, v.interval[0]))
        ]
        pooled = pool_coefficients(name, usable, logarithmic=is_logarithmic(name))
        if pooled is not None:
            found[name] = pooled
    return found


def _has_log(name: str, low: float) -> bool:
    return low > 0.0 or not is_logarithmic(name)


def spread_text(name: str, pooled: PooledCoefficient, unit: str) -> str:
    """Say how far units differ: ``5.1 (3.9 … 7.0) %``, ``< 2.0 %``, ``12 (9 … 15) deg/h``."""
    one = pooled.spread
    if is_logarithmic(name):
        if one.value is None or one.interval is None:
            return "–" if not one.upper else f"< {digits(100 * one.upper, 2)} %"
        low, high = one.interval
        return f"{digits(100 * one.value, 2)} ({digits(100 * low, 2)} … {digits(100 * high, 2)}) %"
    return phrase(one, SYMBOLS[name.rpartition(".")[2]], unit)


def grade_yaml(fleet: Fleet) -> str | None:
    """Return the fleet as a sheet of format ``tuner-datasheet/1``; None where no sensor has a noise density.

    A value is the geometric mean over the axes of the mean of the units; turn-on sds are the unit-to-unit spread of
    the means. Each entry says of every axis the mean and the spread with their 95 % intervals.
    """
    measured = [unit for unit in fleet.units if unit.measurement is not None]
    used = [unit for unit in measured if not unit.outliers]
    reference = f"{len(used)} units, 95 % intervals"
    triads = {}
    for si, sensor in SENSORS.items():
        of_sensor = {
            name: pooled
            for name, pooled in fleet.spread.items()
            if fleet.channel_units[name.rpartition(".")[0]] == si
        }
        triad = {
            entry: found
            for symbol, entry in ENTRIES.items()
            if (found := _entry(symbol, of_sensor, si, len(used))) is not None
        }
        if "noise_density" in triad:
            turn_on = _turn_on(of_sensor, si)
            triads[sensor] = triad | ({} if turn_on is None else {"turn_on_sd": turn_on})
    if not triads:
        return None
    rates = sorted(unit.measurement.rate for unit in used if unit.measurement is not None)
    outlying = [unit.name for unit in measured if unit.outliers]
    notes = ["Values: geometric means over axes and units. The turn-on sds are the spread from unit to unit."]
    notes += [f"Outlying and not used: {', '.join(outlying)}"] if outlying else []
    assumed = Counter(assumed_text(u.measurement.assumptions) for u in used if u.measurement is not None)
    notes += [f"{n} of {len(used)} units: {text}" for text, n in sorted(assumed.items()) if text]
    further = Counter(term for u in used if u.measurement is not None for term in u.measurement.further)
    notes += [
        f"{n} of {len(used)} units also show {term}, which is not stated here"
        for term, n in sorted(further.items())
    ]
    sheet = {
        "format": FORMAT,
        "name": re.sub("[^a-z0-9]", "", fleet.name.lower()) or "fleet",
        "title": f"Fleet {fleet.name}, {reference}",
        "kind": "measured",
        "rate": float(f"{rates[len(rates) // 2]:.6g}"),
        "reference": reference,
        "notes": notes,
        **triads,
    }
    return str(yaml.safe_dump(sheet, sort_keys=False, allow_unicode=True, width=1000))


def _entry(
    symbol: str, pooled: Mapping[str, PooledCoefficient], unit: str, count: int
) -> dict[str, object] | None:
    """Return an entry of a grade; None where not half of the units show the term on any axis."""
    axes = {name: one for name, one in pooled.items() if name.endswith(f".{symbol}")}
    shown = {n: p for n, p in axes.items() if 2 * sum(v is not None for v in p.values) >= count}
    values = [p.value.value for p in shown.values() if p.value.value is not None]
    if not values:
        return None
    middle = math.exp(sum(map(math.log, values)) / len(values))
    name = next(iter(shown))
    entry: dict[str, object] = {
        "value": float(f"{customary(middle, name, unit):.4g}"),
        "unit": pretty_unit(name, unit),
        "reference": "; ".join(_axis_text(n, p, unit) for n, p in shown.items()),
    }
    return entry | ({"reading": "level"} if symbol == "B" else {})


def _turn_on(pooled: Mapping[str, PooledCoefficient], unit: str) -> dict[str, object] | None:
    means = {n: p for n, p in pooled.items() if n.endswith(".mean") and p.spread.value}
    if not means:
        return None
    sd = math.sqrt(sum((p.spread.value or 0.0) ** 2 for p in means.values()) / len(means))
    name = next(iter(means))
    return {
        "value": float(f"{customary(sd, name, unit):.4g}"),
        "unit": pretty_unit(name, unit),
        "reference": "; ".join(_axis_text(n, p, unit) for n, p in means.items()),
    }


def _axis_text(name: str, pooled: PooledCoefficient, unit: str) -> str:
    value = phrase(pooled.value, SYMBOLS[name.rpartition(".")[2]], unit)
    return f"{name.rpartition('.')[0]} {value}, unit to unit {spread_text(name, pooled, unit)}"
