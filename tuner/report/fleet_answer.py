"""The answer of `fleet`: verdict, the units that are not plainly good, and how far units differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pandas as pd
from rich.table import Table

from tuner.formats.assumption_words import assumed_text
from tuner.formats.customary_units import digits, phrase, range_text
from tuner.production.fleet import gyro_unit_unstated
from tuner.production.outliers import FALSE_NAMING, LEAST_UNITS, threshold
from tuner.production.quantities import SYMBOLS, customary, is_logarithmic, pretty_unit, title
from tuner.production.spread import spread_text
from tuner.report.document import Document, document
from tuner.report.titled_table import titled_table
from tuner.types.fleet import Fleet, FleetUnit, Outlier

IN_WORDS = {
    "N": "white noise",
    "B": "bias instability",
    "K": "bias random walk",
    "sigma_10s": "Allan deviation at 10 s",
}
"""Symbols of quantities in words."""
NAMED_UNITS = 5
"""Units that a line names one by one: as many as fit into a line of a terminal."""
MOST_ASSUMED = 4
"""Lines on what was assumed; fleet.csv has it of every unit."""


def fleet_answer(fleet: Fleet) -> Document:
    """Return how many units keep their limits and how many stand apart, and why each is to be looked at.

    First those that stand apart, then those that cannot be used, fail, or are open.
    """
    verdicts = Counter(unit.verdict for unit in fleet.units)
    refused = sum(unit.error is not None for unit in fleet.units)
    outlying = sum(bool(unit.outliers) for unit in fleet.units)
    odd = looked_at(fleet)
    look = any(one.error or one.outliers or one.advice for one in odd)
    known = {"FAIL": verdicts["FAIL"], "LOOK": look, "OPEN": verdicts["OPEN"]}
    word = next((name for name, there in known.items() if there), "PASS")
    unstated = sum(u.measurement is not None and gyro_unit_unstated(u.measurement) for u in fleet.units)
    short = "log too short to tell" if fleet.limits else ""
    why_open = " or ".join(filter(None, (short, "gyro unit not stated" if unstated else "")))
    limits = (
        f"{verdicts['PASS']} PASS, {verdicts['FAIL']} FAIL, {verdicts['OPEN']} OPEN ({why_open})"
        if fleet.limits
        else "no limits given (--limits)"
    )
    if unstated and not fleet.limits:
        limits = f"{unstated} OPEN ({why_open}); {limits}"
    stand = "stands" if outlying == 1 else "stand"
    verdict = (
        f"Verdict: {word}: {outlying} of the {len(fleet.units)} units in {fleet.name} {stand} apart, {refused} cannot "
        f"be used; {limits}"
    )
    lines = [
        f"{one.name}: {one.verdict or ('ERROR' if one.error else 'LOOK')}: {'; '.join(reasons(one, fleet))}"
        for one in odd
    ]
    spread = frame_table(spread_frame(fleet), "Spread from unit to unit, outlying units left out")
    return document(
        [verdict, *assumed_lines(fleet)],
        lines,
        more=[judged_how(fleet), *spread],
        beyond="spread of the units",
    )


def assumed_lines(fleet: Fleet) -> list[str]:
    """Return what was assumed of the logs, a line for all units that share it, and how the unit is stated."""
    named: dict[str, list[str]] = {}
    open_units = set()
    for unit in fleet.units:
        if unit.measurement is not None and (text := assumed_text(unit.measurement.assumptions)):
            named.setdefault(text, []).append(unit.name)
            open_units |= {text} if gyro_unit_unstated(unit.measurement) else set()
    lines = []
    for text, names in named.items():
        which = f"all {len(names)} units" if len(names) == len(fleet.units) else _some(names)
        cure = "; state it with --gyro-unit" if text in open_units else ""
        lines.append(f"{which[0].upper()}{which[1:]}: {text}{cure}")
    return lines[:MOST_ASSUMED]


def _some(names: Sequence[str]) -> str:
    """Return the first names of units and how many more there are."""
    more = len(names) - NAMED_UNITS
    return ", ".join(names[:NAMED_UNITS]) + (f" and {more} more" if more > 0 else "")


def looked_at(fleet: Fleet) -> list[FleetUnit]:
    """Return the units that are not plainly good, those that stand apart first."""
    odd = [u for u in fleet.units if u.error or u.outliers or u.broken or u.advice]
    rank = {"FAIL": 2, "OPEN": 3}
    return sorted(
        odd, key=lambda u: 0 if u.outliers or u.advice else 1 if u.error else rank.get(u.verdict, 4)
    )


def spread_frame(fleet: Fleet) -> pd.DataFrame:
    """Return mean and unit-to-unit spread of each quantity, in customary units, with 95 % intervals."""
    columns = ["quantity", "unit", "units", "mean", "spread"]
    rows = []
    for name, pooled in fleet.spread.items():
        unit = fleet.channel_units[name.rpartition(".")[0]]
        rows.append(
            (
                title(name),
                pretty_unit(name, unit),
                sum(v is not None for v in pooled.values),
                phrase(pooled.value, SYMBOLS[name.rpartition(".")[2]], unit, with_unit=False),
                spread_text(name, pooled, unit),
            )
        )
    return pd.DataFrame(rows, columns=columns)


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
    return f"{title(name)} {digits(value)} {pretty_unit(name, unit)}, fleet {digits(median)} ({distance}; {score})"


def reasons(unit: FleetUnit, fleet: Fleet) -> list[str]:
    """Return why a unit is to be looked at: what mends it, what it is outlying in, limits it breaks; or its error.

    Several amplitudes of one sensor that are outlying share a line with the factors between which they lie.
    """
    if unit.error:
        return [unit.error]
    by_sensor: dict[str, list[Outlier]] = {}
    for outlier in unit.outliers:
        channel = outlier.quantity.rpartition(".")[0]
        sensor = channel.rpartition("_")[0] or channel
        by_sensor.setdefault(sensor if is_logarithmic(outlier.quantity) else outlier.quantity, []).append(
            outlier
        )
    lines = [
        outlier_text(found[0], fleet) if len(found) == 1 else _together(sensor, found, fleet)
        for sensor, found in by_sensor.items()
    ]
    return [*unit.advice, *lines, *unit.broken]


def _together(sensor: str, found: Sequence[Outlier], fleet: Fleet) -> str:
    """Say in which amplitudes a sensor stands apart: ``gyro: N of x y z × 2.9 to 3.1 the median …``."""
    axes: dict[str, list[Outlier]] = {}
    for one in found:
        axes.setdefault(one.quantity.rpartition(".")[2], []).append(one)
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
        return f"Too few units ({LEAST_UNITS} are needed) to say which stand apart."
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
