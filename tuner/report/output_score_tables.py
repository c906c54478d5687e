"""Scores of any filter's output in tables: consistency, states, causes and what to change."""

from __future__ import annotations

from rich.table import Table

from tuner.consistency.score_output import OutputScore
from tuner.report.consistency_answer import consistency_answer
from tuner.report.consistency_tables import consistency_tables
from tuner.report.document import Document
from tuner.report.output_cause_text import cause_text, change_text
from tuner.types.consistency import Score


def output_score_answer(found: OutputScore) -> Document:
    """Return verdict, scores and errors, and of each cause what to change."""
    causes = [f"{cause_text(cause)}: {change_text(cause)}" for cause in found.causes]
    return consistency_answer(found.consistency, found.notes, causes)


def output_score_tables(found: OutputScore) -> list[Table | str]:
    """Return the scores of all, of each state, the verdicts and what explains them."""
    blocks = consistency_tables(found.consistency, found.notes)
    if found.states and not found.consistency.diverged:
        blocks = [states_table(found.states), *blocks]
    for cause in found.causes:
        blocks.append(f"  {cause_text(cause)}")
        blocks.append(f"  {change_text(cause)}")
    return blocks


def states_table(states: tuple[Score, ...]) -> Table:
    """Return the ratio of every state with its band."""
    table = Table(title="each state alone: true rms ÷ predicted sd")
    for name in ("state", "ratio", "for the filter", "verdict"):
        table.add_column(name, justify="left" if name == "state" else "right")
    for one in states:
        low, high = ((limit / one.dof) ** 0.5 for limit in one.band)
        said = "" if one.consistent else "optimistic" if one.ratio > 1.0 else "pessimistic"
        table.add_row(one.name.replace("_", " "), f"{one.ratio:.3f}", f"{low:.2f} … {high:.2f}", said)
    return table
