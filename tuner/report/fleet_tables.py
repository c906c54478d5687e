"""A fleet in the terminal: a few lines, and a table of the units that are not plainly good."""

from __future__ import annotations

from collections import Counter

from rich.table import Table

from tuner.formats.customary_units import digits
from tuner.production.quantities import customary, is_logarithmic, pretty_unit, title
from tuner.types.fleet import Fleet, Outlier

SHOWN_UNITS = 20
"""Rows of the table in the terminal: a screen; the files have all."""
SHOWN_OUTLIERS = 2
"""Outlying quantities of a unit in the terminal: the most distant ones; the files have all."""


def summary(fleet: Fleet) -> list[str]:
    """Return how many units there are, how many keep their limits, and how many stand apart."""
    verdicts = Counter(unit.verdict for unit in fleet.units)
    refused = sum(unit.error is not None for unit in fleet.units)
    outlying = sum(bool(unit.outliers) for unit in fleet.units)
    lines = [f"{fleet.name}: {len(fleet.units)} units, {outlying} outlying, {refused} that cannot be used"]
    if fleet.limits:
        lines.append(
            f"limits: {verdicts['PASS']} PASS, {verdicts['FAIL']} FAIL, {verdicts['OPEN']} OPEN "
            f"(log too short to tell), {verdicts['ERROR']} ERROR"
        )
    return lines


def outlier_text(outlier: Outlier, fleet: Fleet) -> str:
    """Say in which quantity a unit stands apart: ``gyro_x N 0.52 deg/√h, fleet 0.0091 (× 57; score 80, limit 6.1)``."""
    name = outlier.quantity
    unit = fleet.channel_units[name.rpartition(".")[0]]
    value, median = (customary(x, name, unit) for x in (outlier.value, outlier.median))
    distance = (
        f"× {digits(value / median)}"
        if is_logarithmic(name)
        else f"{'+' if value > median else '−'}{digits(abs(value - median))}"
    )
    score = f"score {digits(outlier.score, 2)}, threshold {digits(outlier.threshold, 2)}"
    return f"{title(name)} {digits(value)} {pretty_unit(name, unit)}, fleet {digits(median)} ({distance}; {score})"


def fleet_tables(fleet: Fleet) -> list[Table | str]:
    """Return the summary and the units to look at: those that stand apart, cannot be used, fail, are open."""
    table = Table(title="Units to look at", show_lines=True)
    for head in ("unit", "verdict", "why"):
        table.add_column(head, overflow="fold")
    odd = [u for u in fleet.units if u.error or u.outliers or u.broken]
    rank = {"FAIL": 2, "OPEN": 3}
    odd.sort(key=lambda u: 0 if u.outliers or u.advice else 1 if u.error else rank.get(u.verdict or "", 4))
    for unit in odd[:SHOWN_UNITS]:
        why = [unit.error] if unit.error else [*unit.advice, *unit.broken]
        if not unit.error:
            why += [outlier_text(o, fleet) for o in unit.outliers[:SHOWN_OUTLIERS]]
            more = len(unit.outliers) - SHOWN_OUTLIERS
            why += [f"and {more} more outlying quantities"] if more > 0 else []
        table.add_row(unit.name, unit.verdict or ("ERROR" if unit.error else ""), "\n".join(why))
    answer: list[Table | str] = [*summary(fleet)]
    if odd:
        answer.append(table)
    if len(odd) > SHOWN_UNITS:
        answer.append(f"and {len(odd) - SHOWN_UNITS} more, in fleet.csv")
    return answer
