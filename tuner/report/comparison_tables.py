"""Sensors side by side, built-in grades, and the plan of a static test, in tables."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from models.sensors import SensorGrade
from tuner.formats.customary_units import (
    customary_unit,
    digits,
    in_customary,
    phrase,
    pretty,
    symbol,
)
from tuner.identification.comparison import ComparedCoefficient, Comparison
from tuner.identification.record_length import Plan
from tuner.report.coefficient_text import LEVEL_NAMES

UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


def comparison_tables(comparison: Comparison) -> list[Table | str]:
    """Return one table an axis; the last column says whether the last source differs from the first."""
    answer: list[Table | str] = []
    for axis, rows in comparison.axes.items():
        unit = comparison.units[axis]
        table = Table(title=axis)
        for head in ("", *comparison.names, f"{comparison.names[-1]} ÷ {comparison.names[0]}"):
            table.add_column(head, justify="right" if head else "left")
        for row in rows:
            quantity = row.name if "." in row.name else "level"
            label = (
                f"{LEVEL_NAMES.get(row.name) or symbol(row.name)}, {pretty(customary_unit(quantity, unit))}"
            )
            cells = ["–" if v is None else phrase(v, quantity, unit, with_unit=False) for v in row.values]
            table.add_row(label, *cells, _ratio(row))
        answer.append(table)
    return answer


def _ratio(row: ComparedCoefficient) -> str:
    if row.ratio is None:
        return {None: "–", True: "differs", False: "agrees"}[row.differs]
    if row.ratio_interval is None:
        return f"{digits(row.ratio)} (no interval)"
    low, high = row.ratio_interval
    return f"{digits(row.ratio)} ({digits(low)} … {digits(high)}) {'differs' if row.differs else 'agrees'}"


def grade_tables(grades: Sequence[SensorGrade]) -> list[Table | str]:
    """Return the built-in grades, one a row, in customary units."""
    table = Table(title="Built-in sensor grades (references: configs/sensors)")
    shown = ("white.density", "bias_instability.level", "random_walk.density")
    columns = [(kind, quantity) for kind in UNITS for quantity in shown]
    table.add_column("name")
    table.add_column("sensor")
    for kind, quantity in columns:
        unit = UNITS[kind]
        table.add_column(
            f"{kind} {symbol(quantity)}, {pretty(customary_unit(quantity, unit))}", justify="right"
        )
    for grade in grades:
        values = {
            (kind, f"{term.name}.{field}"): getattr(term, field)
            for kind in UNITS
            for term in grade.noise_model(kind).terms
            for field in term.PARAMETERS
        }
        cells = [
            "–" if column not in values else digits(in_customary(values[column], column[1], UNITS[column[0]]))
            for column in columns
        ]
        table.add_row(grade.key, grade.title, *cells)
    return [table]


def plan_tables(plan: Plan, unit: str, title: str) -> list[Table | str]:
    """Return what a planned test shows of each term, and the cluster rule."""
    table = Table(title=f"{title}: {digits(plan.hours)} h, wanted accuracy {100 * plan.accuracy:g} %")
    for head in ("term", "assumed", "best possible sd", "shown?", "hours for the wanted accuracy"):
        table.add_column(head, justify="left" if head == "term" else "right")
    for p in plan.parameters:
        value = f"{digits(in_customary(p.value, p.name, unit))} {pretty(customary_unit(p.name, unit))}"
        hours = "more than 10 000" if p.hours is None else digits(p.hours)
        spread = f"{digits(100 * p.relative_sd, 2)} %" if p.relative_sd < 10 else "> 1000 %"
        table.add_row(symbol(p.name), value, spread, "yes" if p.shown else "no: only a bound", hours)
    rule = (
        f"  cluster rule: {100 * plan.accuracy:g} % on a single Allan point needs {plan.clusters} clusters, "
        f"here up to τ = {digits(plan.longest_tau)} s"
    )
    return [table, rule]
