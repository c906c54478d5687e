"""The answer of `fleet`: verdict, the units that are not plainly good, and how far units differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pandas as pd
from rich.table import Table

from tuner.formats.assumption_words import assumed_text
from tuner.formats.customary_units import digits, phrase, range_text
from tuner.formats.grouping import gathered
from tuner.production.limits import GRAVITY
from tuner.production.outliers import FALSE_NAMING, LEAST_UNITS, threshold
from tuner.production.quantities import (
    IN_WORDS,
    SENSORS,
    SYMBOLS,
    customary,
    in_words,
    is_logarithmic,
    pretty_unit,
)
from tuner.production.spread import spread_text
from tuner.report.document import Document, document, sentence
from tuner.report.titled_table import titled_table
from tuner.types.fleet import Fleet, FleetUnit, Outlier

NAMED_UNITS = 5
"""Units that a line names one by one: as many as fit into a line of a terminal."""
MOST_ASSUMED = 4
"""Lines on what was assumed; fleet.csv has it of every unit."""


def fleet_answer(fleet: Fleet) -> Document:
    """Return how many units keep their limits and how many stand apart, and a line a unit that is not plainly good.

    The worst first: those that fail, cannot be used, are to be looked at, or are open.
    """
    verdicts = Counter(map(verdict_of, fleet.units))
    outlying = sum(bool(unit.outliers) for unit in fleet.units)
    odd = looked_at(fleet)
    word = next((name for name in RANKS if name and verdicts[name]), "PASS")
    unstated = sum(u.measurement is not None and u.measurement.unit_unstated for u in fleet.units)
    limited = any(limit != GRAVITY for limit in fleet.limits)
    why_open = " or ".join(
        filter(None, ("log too short to tell" if limited else "", "gyro unit not stated" if unstated else ""))
    )
    counts = ", ".join(
        f"{verdicts[name]} {name}" + (f" ({why_open})" if name == "OPEN" and why_open else "")
        for name in ("PASS", "LOOK", "FAIL", "OPEN")
        if limited or verdicts[name]
    )
    limits = "" if limited else "no limits given (--limits, --datasheet)"
    stand = "stands" if outlying == 1 else "stand"
    units = f"the {len(fleet.units)} units in {fleet.name}"
    few = word != "ERROR" and not fleet.comparisons
    apart = f"{units} are {TOO_FEW}" if few else f"{outlying} of {units} {stand} apart"
    if word == "PASS" and few and not limited:
        word = "OPEN"
    verdict = (
        f"Verdict: {word}: {apart}, "
        f"{verdicts['ERROR']} cannot be used; {'; '.join(filter(None, (counts, limits)))}"
    )
    spread = frame_table(spread_frame(fleet), "Spread from unit to unit, outlying units left out")
    return document(
        [verdict, *assumed_lines(fleet), NOT_TESTED],
        [f"{one.name}: {verdict_of(one)}: {reason_of(one, fleet)}" for one in odd],
        more=[derived_limits(fleet), judged_how(fleet), *spread],
        beyond="spread of the units",
    )


TOO_FEW = f"too few to say which stand apart ({LEAST_UNITS} are needed)"
"""What is said of so few units that the median of them may be that of sick ones."""
NOT_TESTED = (
    "Not tested, as minutes in one pose at rest do not show it: scale factors and misalignment, bias of single "
    "accelerometers, B and K of a data sheet"
)
"""What is said once of what no log of a fleet shows."""


def derived_limits(fleet: Fleet) -> str:
    """Return the limits that nobody stated, with what they are derived from."""
    said = []
    for limit in (limit for limit in fleet.limits if limit.basis):
        unit = next(si for si, sensor in SENSORS.items() if sensor == limit.sensor)
        quantity = f"{limit.sensor}.{limit.symbol}"
        size = f"{digits(customary(limit.largest, quantity, unit))} {pretty_unit(quantity, unit)}"
        said.append(f"{in_words(quantity)} {size} ({limit.basis})")
    return f"Limits that were not stated: {', '.join(said)}."


def assumed_lines(fleet: Fleet) -> list[str]:
    """Return what was assumed of the logs, a line for all units that share it, and how the unit is stated."""
    measured = [(unit.name, unit.measurement) for unit in fleet.units if unit.measurement is not None]
    named = gathered((assumed_text(one.assumptions), (name, one.unit_unstated)) for name, one in measured)
    lines = []
    for text, units in named.items():
        names = [name for name, _ in units]
        which = f"all {len(names)} units" if len(names) == len(fleet.units) else _some(names)
        cure = "; state it with --gyro-unit" if any(unstated for _, unstated in units) else ""
        lines += [f"{sentence(which)}: {text}{cure}"] if text else []
    return lines[:MOST_ASSUMED]


def _some(names: Sequence[str]) -> str:
    """Return the first names of units and how many more there are."""
    more = len(names) - NAMED_UNITS
    return ", ".join(names[:NAMED_UNITS]) + (f" and {more} more" if more > 0 else "")


RANKS = ("FAIL", "ERROR", "LOOK", "OPEN", "PASS", "")
"""Verdicts, the worst first."""


def verdict_of(unit: FleetUnit) -> str:
    """Return the verdict of a unit; without one, that of a log that cannot be used."""
    return unit.verdict or ("ERROR" if unit.error else "")


def worst_first(fleet: Fleet) -> list[FleetUnit]:
    """Return the units, the worst first."""
    return sorted(fleet.units, key=lambda unit: RANKS.index(verdict_of(unit)))


def looked_at(fleet: Fleet) -> list[FleetUnit]:
    """Return the units that are not plainly good, the worst first."""
    return [unit for unit in worst_first(fleet) if verdict_of(unit) not in ("", "PASS")]


def reason_of(unit: FleetUnit, fleet: Fleet) -> str:
    """Return the first reason of a verdict, and how many more there are; "" for none."""
    first, *others = reasons(unit, fleet) or [""]
    return first + (f" (and {len(others)} more in fleet.csv)" if others else "")


def spread_frame(fleet: Fleet) -> pd.DataFrame:
    """Return mean and unit-to-unit spread of each quantity, in customary units, with 95 % intervals."""
    units = [fleet.channel_units[name.rpartition(".")[0]] for name in fleet.spread]
    rows = [
        (
            in_words(name),
            pretty_unit(name, unit),
            sum(v is not None for v in pooled.values),
            phrase(pooled.value, SYMBOLS[name.rpartition(".")[2]], unit, with_unit=False),
            spread_text(name, pooled, unit),
        )
        for (name, pooled), unit in zip(fleet.spread.items(), units, strict=True)
    ]
    return pd.DataFrame(rows, columns=["quantity", "unit", "units", "mean", "spread"])


def frame_table(frame: pd.DataFrame, head: str = "") -> list[Table]:
    """Return a data frame as a table; without rows there is none."""
    rows = frame.astype(str).itertuples(index=False)
    return titled_table(head, [str(name) for name in frame.columns], rows, words=len(frame.columns))


def outlier_text(outlier: Outlier, fleet: Fleet) -> str:
    """Say in which quantity a unit stands apart: ``gyro_x N 0.52 deg/√h, fleet 0.0091 (× 57; 80 robust sds …)``."""
    name = outlier.quantity
    unit = fleet.channel_units[name.rpartition(".")[0]]
    value, median = (customary(x, name, unit) for x in (outlier.value, outlier.median))
    distance = (
        f"× {digits(value / median)}"
        if is_logarithmic(name)
        else f"{'+' if value > median else '−'}{digits(abs(value - median))}"
    )
    score = _distance_text([outlier])
    return f"{in_words(name)} {digits(value)} {pretty_unit(name, unit)}, fleet {digits(median)} ({distance}; {score})"


def reasons(unit: FleetUnit, fleet: Fleet) -> list[str]:
    """Return why a unit is to be looked at: what mends it, what it is outlying in, limits it breaks; or its error.

    Several amplitudes of one sensor that are outlying share a line with the factors between which they lie.
    """
    if unit.error:
        return [unit.error.removeprefix(f"{unit.file}: ")]
    by_sensor = gathered(
        (_sensor(one) if is_logarithmic(one.quantity) else one.quantity, one) for one in unit.outliers
    )
    lines = [
        "noisy axis: " * _noisy_axis(found)
        + (outlier_text(found[0], fleet) if len(found) == 1 else _together(sensor, found, fleet))
        for sensor, found in by_sensor.items()
    ]
    first, last = (unit.broken, ()) if unit.verdict == "FAIL" else ((), unit.broken)
    return [*unit.advice, *first, *lines, *last]


def _sensor(outlier: Outlier) -> str:
    channel = outlier.quantity.rpartition(".")[0]
    return channel.rpartition("_")[0] or channel


def _noisy_axis(found: Sequence[Outlier]) -> bool:
    """Return whether amplitudes are those of one axis that is too noisy."""
    (first, *_), axes = found, {one.quantity.rpartition(".")[0] for one in found}
    return len(axes) == 1 and is_logarithmic(first.quantity) and first.value > first.median


def _together(sensor: str, found: Sequence[Outlier], fleet: Fleet) -> str:
    """Say in which amplitudes a sensor stands apart: ``gyro: N of x y z × 2.9 to 3.1 the median …``."""
    axes = gathered((one.quantity.rpartition(".")[2], one) for one in found)
    parts = []
    for symbol in (symbol for symbol in SYMBOLS if symbol in axes):
        alike = axes[symbol]
        letters = " ".join(sorted(one.quantity.rpartition(".")[0].rpartition("_")[2] for one in alike))
        ratios = [one.value / one.median for one in alike]
        name = alike[0].quantity
        unit = fleet.channel_units[name.rpartition(".")[0]]
        values = range_text([customary(one.value, one.quantity, unit) for one in alike], significant=2)
        size = f"{values} {pretty_unit(name, unit)}"
        parts.append(
            f"{IN_WORDS.get(symbol, symbol)} of {letters} {size}, {range_text(ratios, significant=2)} ×"
        )
    return f"{sensor}: {', '.join(parts)} the median of the units ({_distance_text(found)})"


def _distance_text(found: Sequence[Outlier]) -> str:
    """Return how far numbers lie from the median of a fleet, in sds of its units, and how far chance reaches."""
    scores = range_text([one.score for one in found], significant=2)
    return (
        f"{scores} sds of the other units; chance reaches {digits(found[0].threshold, 2)} in one of "
        f"{1.0 / FALSE_NAMING:g} lots"
    )


def judged_how(fleet: Fleet) -> str:
    """Say how outlying units were found."""
    if not fleet.comparisons:
        return f"The units are {TOO_FEW}."
    thresholds = sorted({digits(o.threshold, 2) for u in fleet.units for o in u.outliers})
    measured = sum(unit.measurement is not None for unit in fleet.units)
    if not thresholds and measured >= LEAST_UNITS:
        thresholds = [digits(threshold(measured, fleet.comparisons), 2)]
    at = f" (threshold{'s' * (len(thresholds) > 1)} {', '.join(thresholds)})" if thresholds else ""
    return (
        f"Outlying: more robust standard deviations from the median of the fleet than a sound fleet would show "
        f"in any of {fleet.comparisons} numbers with a chance above {100 * FALSE_NAMING:g} %{at}: median and MAD, "
        "Student's t with 0.37 (n − 1) degrees of freedom, Bonferroni."
    )
