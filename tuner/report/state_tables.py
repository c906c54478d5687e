"""What differs between two states of a unit, in a table and as JSON."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from tuner.diagnosis.static.compare_logs import MEAN, NOISE, Difference, StateComparison
from tuner.formats.codec import dump
from tuner.formats.customary_units import amount
from tuner.types import Coefficient


def state_tables(comparison: StateComparison) -> list[Table | str]:
    """Return the differences, one a row in SI units, those by cause first."""
    if not comparison.differences:
        return ["  nothing differs: the second state has the causes and the noise of the first"]
    table = Table(title="What differs, by cause")
    for head in ("axis", "cause", "size", "at rest", "running", "moves in the configuration"):
        table.add_column(head)
    for one in sorted(comparison.differences, key=lambda one: one.cause in (NOISE, MEAN)):
        table.add_row(
            one.axis,
            one.cause,
            one.parameter,
            _shown(one.at_rest),
            _shown(one.running),
            one.entry or "nothing: taken out of the samples",
        )
    return [table]


def _shown(c: Coefficient | None) -> str:
    return "–" if c is None else amount(c)


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
