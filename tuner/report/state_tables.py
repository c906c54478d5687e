"""What differs between two states of a unit, in a table and as JSON."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from models.units import unit_of_samples
from tuner.diagnosis.static.compare_logs import MEAN, NOISE, Difference, StateComparison
from tuner.formats.codec import dump
from tuner.formats.customary_units import amount, digits, phrase
from tuner.report.finding_groups import changed_entry
from tuner.types import Coefficient


def state_tables(comparison: StateComparison) -> list[Table | str]:
    """Return the differences, one a row in customary units, those by cause first, with the entry that each moves."""
    if not comparison.differences:
        return ["  nothing differs: the second state has the causes and the noise of the first"]
    table = Table(title="What differs, by cause")
    for head in ("axis", "cause", "size", "at rest", "running", "change", "moves in the configuration"):
        table.add_column(head)
    for one in sorted(comparison.differences, key=lambda one: one.cause in (NOISE, MEAN)):
        table.add_row(
            one.axis,
            one.cause,
            one.parameter,
            _shown(one, one.at_rest),
            _shown(one, one.running),
            _change(one),
            one.entry or changed_entry(one.cause),
        )
    return [table]


def _shown(one: Difference, c: Coefficient | None) -> str:
    """Return a size; coefficients of noise terms in the units they are customary in."""
    if c is None:
        return "–"
    return phrase(c, one.parameter, unit_of_samples(one.axis)) if one.cause == NOISE else amount(c)


def _change(one: Difference) -> str:
    """Return the ratio of the sizes, of means the difference; in words where one state has none."""
    before, after = (None if c is None else c.value for c in (one.at_rest, one.running))
    if before is None or after is None:
        return "new" if before is None else "gone"
    if one.cause == MEAN or before == 0.0:
        return amount(Coefficient(after - before, None, None, one.running.unit if one.running else "1"))
    return f"× {digits(after / before)}"


def states_json(comparison: StateComparison) -> dict[str, Any]:
    """Return the differences and both diagnoses as plain values, schema ``tuner.states/1``."""
    return {
        "schema": "tuner.states/1",
        "differences": [_difference(one) for one in comparison.differences],
        "at_rest": dump(comparison.at_rest),
        "running": dump(comparison.running),
    }


def _difference(one: Difference) -> dict[str, Any]:
    return {
        "axis": one.axis,
        "cause": one.cause,
        "parameter": one.parameter,
        "at_rest": None if one.at_rest is None else dump(one.at_rest),
        "running": None if one.running is None else dump(one.running),
        "entry": one.entry or None,
    }
