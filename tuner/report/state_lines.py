"""What differs between two states of a unit, in lines and as JSON."""

from __future__ import annotations

from typing import Any

from models.units import unit_of_samples
from tuner.diagnosis.static.compare_logs import MEAN, NOISE, Difference, StateComparison
from tuner.formats.axis_words import axes_text
from tuner.formats.codec import dump
from tuner.formats.customary_units import amount, digits, phrase
from tuner.formats.grouping import grouped
from tuner.report.finding_groups import changed_entry
from tuner.types import Coefficient
from tuner.types.coefficient import apart


def state_lines(comparison: StateComparison) -> list[str]:
    """Return the differences in customary units, those by cause first, with the entry that each moves.

    One line for what axes of one sensor have alike: a cause at one place, or a coefficient of the noise that changed in
    one direction. The sizes are those of the axis that changed most.
    """
    if not comparison.differences:
        return ["  nothing differs: the second state has the causes and the noise of the first"]
    causes_first = sorted(comparison.differences, key=lambda one: one.cause in (NOISE, MEAN))
    groups = grouped(causes_first, lambda group, one: _alike(group[0], one))
    return ["What differs, by cause: at rest → running", *(f"  {_line(group)}" for group in groups)]


def _alike(one: Difference, other: Difference) -> bool:
    """Return whether two axes of a sensor differ between the states by the same thing."""
    return _kind(one) == _kind(other) and all(
        not apart(value, other.place.get(name)) for name, value in one.place.items()
    )


def _kind(one: Difference) -> tuple[str, str, str, int]:
    return one.cause, one.parameter, one.axis.partition("_")[0], _direction(one)


def _direction(one: Difference) -> int:
    """Return whether a size grew, 1, or not, −1; 0 of what one state does not have, and of means."""
    before, after = _values(one)
    return 0 if before is None or after is None or one.cause == MEAN else 1 if after > before else -1


def _values(one: Difference) -> tuple[float | None, float | None]:
    before, after = (None if c is None else c.value for c in (one.at_rest, one.running))
    return before, after


def _extent(one: Difference) -> float:
    """Return how much one axis changed, to be compared with others: a ratio, or the size of what is new or gone."""
    before, after = _values(one)
    if before is None or after is None:
        return abs(after or before or 0.0)
    if one.cause == MEAN or before * after <= 0.0:
        return abs(after - before)
    return max(after / before, before / after)


def _line(group: list[Difference]) -> str:
    """Return one difference in words: what, where, in which axes, how much, and what it moves."""
    most = max(group, key=_extent)
    what = most.parameter.replace(".", "_") if most.cause == NOISE else most.cause
    place = ", ".join(f"{name.replace('_', ' ')} {amount(value)}" for name, value in most.place.items())
    axes = axes_text([one.axis for one in group])
    where = f" ({place})" if place else ""
    line = f"{what.replace('_', ' ')}{where} in {axes}: {_change(most)}"
    entry = most.entry
    if len(group) > 1:
        line += f", most in {axes_text([most.axis])}"
        entry = entry and f"{entry.rpartition('.')[2]} of {axes}"
    return f"{line}; moves {entry or changed_entry(most.cause)}"


def _change(one: Difference) -> str:
    """Return the sizes in both states and their ratio, of means the difference; in words where one state has none."""
    before, after = _values(one)
    size = "" if one.cause in (NOISE, MEAN) else f"{one.parameter.replace('_', ' ')} "
    if before is None or after is None:
        return (
            f"new, {size}{_shown(one, one.running)}"
            if before is None
            else f"gone, {size}{_shown(one, one.at_rest)}"
        )
    if one.cause == MEAN or before == 0.0:
        change = amount(Coefficient(after - before, None, None, one.running.unit if one.running else "1"))
        change = f"{'+' if after > before else ''}{change}"
    else:
        change = f"× {digits(after / before)}"
    return f"{change}, {size}{_shown(one, one.at_rest)} → {_shown(one, one.running)}"


def _shown(one: Difference, c: Coefficient | None) -> str:
    """Return a size; coefficients of noise terms in the units they are customary in."""
    if c is None:
        return "–"
    return phrase(c, one.parameter, unit_of_samples(one.axis)) if one.cause == NOISE else amount(c)


def states_json(comparison: StateComparison) -> dict[str, Any]:
    """Return the differences and both diagnoses as plain values, schema ``tuner.states/1``."""
    return {
        "schema": "tuner.states/1",
        "differences": [{**dump(one), "entry": one.entry or None} for one in comparison.differences],
        "at_rest": dump(comparison.at_rest),
        "running": dump(comparison.running),
    }
