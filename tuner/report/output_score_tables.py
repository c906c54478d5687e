"""The answer of `score`, on the output of any filter: scores, what to change, and each state."""

from __future__ import annotations

from rich.table import Table

from tuner.consistency.score_output import OutputScore
from tuner.report.consistency_answer import HEADS, consistency_answer, score_rows
from tuner.report.document import Document, sentence
from tuner.report.output_cause_text import cause_text, change_text
from tuner.report.titled_table import titled_table


def output_score_answer(found: OutputScore) -> Document:
    """Return verdict, scores and errors, and of each cause what to change."""
    causes = [sentence(f"{cause_text(cause)}: {change_text(cause)}") for cause in found.causes]
    without = found.without_constants
    if without is not None:
        number = sum(cause.constant for cause in found.causes)
        causes.insert(number, f"Without {'it' if number == 1 else 'them'}: {without.shown.honesty.text}")
    return consistency_answer(found.consistency, found.notes, causes=causes, more=states_table(found))


def states_table(found: OutputScore) -> list[Table]:
    """Return the ratio of every state with its band, in a table; of a filter that diverged none."""
    states = () if found.consistency.diverged else found.states
    return titled_table("each state alone: true rms ÷ predicted sd", HEADS, score_rows(states))
