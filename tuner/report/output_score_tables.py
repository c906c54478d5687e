"""Scores of any filter's output in tables: consistency, states, causes and what to change."""

from __future__ import annotations

from rich.table import Table

from tuner.consistency.score_output import OutputScore
from tuner.report.consistency_answer import consistency_answer
from tuner.report.consistency_tables import HEADS, consistency_tables, score_rows
from tuner.report.document import Document
from tuner.report.output_cause_text import cause_text, change_text
from tuner.report.titled_table import titled_table
from tuner.types.consistency import Score


def output_score_answer(found: OutputScore) -> Document:
    """Return verdict, scores and errors, and of each cause what to change."""
    return consistency_answer(found.consistency, found.notes, _to_do(found))


def output_score_tables(found: OutputScore) -> list[Table | str]:
    """Return the answer, the scores of all and of each state, and the verdicts."""
    states = [] if found.consistency.diverged else states_table(found.states)
    return [*consistency_tables(found.consistency, found.notes, _to_do(found)), *states]


def _to_do(found: OutputScore) -> list[str]:
    """Return each cause with what to change."""
    return [f"{cause_text(cause)}: {change_text(cause)}" for cause in found.causes]


def states_table(states: tuple[Score, ...]) -> list[Table]:
    """Return the ratio of every state with its band, in a table."""
    return titled_table("each state alone: true rms ÷ predicted sd", HEADS, score_rows(states))
