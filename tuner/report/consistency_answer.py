"""The answer of `check`, `navigate` and `score`: verdict, scores, errors, what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rich.table import Table

from tuner.formats.customary_units import digits, percent
from tuner.formats.reference_words import reference_line
from tuner.limits import SHOWN_FINDINGS
from tuner.report.document import Document, document
from tuner.report.verdict_text import verdict_text
from tuner.types.consistency import Consistency, Score
from tuner.types.honesty import claims, is_off, ratio_text
from tuner.types.named_cause import separated
from tuner.types.verdict import Severity

OFF = "*"
"""Mark behind a ratio that is shown to be off 1."""
NAMES = {
    "nees": "all states (NEES)",
    "position": "position, 3-D",
    "velocity": "velocity, 3-D",
    "attitude": "attitude, 3-D",
    "gyro_bias": "gyro bias",
    "accel_bias": "accelerometer bias",
    "nis": "innovations (NIS)",
    "nis_position": "position innovations (NIS)",
    "nis_velocity": "velocity innovations (NIS)",
}
"""Scores in an answer, where their names are none."""


def consistency_answer(
    found: Consistency, notes: Sequence[str] = (), to_do: Sequence[str] = (), about: str = ""
) -> Document:
    """Return the verdict on a filter with its reason, its scores and errors, what to do, and notes that have room.

    Parameters
    ----------
    found : Consistency
        Scores of a filter.
    notes : sequence of str, optional
        What was repaired, found and assumed; causes that it names stand behind the verdict.
    to_do : sequence of str, optional
        What explains the verdict and what to change, and where files are.
    about : str, optional
        What was scored on what.
    """
    found = found.shown
    causes, others = separated(notes)
    named = [*reference_line(notes), *causes[:SHOWN_FINDINGS], *explanation_lines(found)]
    said = [about, f"Verdict: {found.honesty.text}", *named]
    table = [_score_table(found)] if found.scores or found.errors else []
    return document(
        [*said, *table, *_further(found), *to_do],
        [*causes[SHOWN_FINDINGS:], *(f"Note: {note}" for note in others)],
        beyond="every score with its band",
    )


def explanation_lines(found: Consistency) -> list[str]:
    """Return why a filter diverged, or which setting explains its scores best; nothing where it is honest."""
    if found.honesty.good:
        return []
    explained = [one for one in found.verdicts if one.severity in (Severity.EXPLANATION, Severity.DIVERGED)]
    texts = [verdict_text(replace(one, explanations=one.explanations[:1])) for one in explained[:2]]
    return [f"{text[:1].upper()}{text[1:]}" for text in texts]


def _score_table(found: Consistency) -> Table:
    """Return errors, and errors ÷ what was predicted of every score, with its interval."""
    error = "error" if found.has_truth else "distance"
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in ("", f"{error}, rms", f"{error} ÷ predicted (95 %)"):
        table.add_column(head, no_wrap=True)
    errors = _errors(found)
    outages = {one.score.name: one for one in found.outages}
    off = _off(found)
    innovations = {one.name: one for one in found.nis[len(found.nis) > 1 :]}  # the first is of all together
    for one in found.scores:
        if one in found.nis and one.name not in innovations:
            continue
        outage = outages.get(one.name)
        size = errors.pop(one.name, "") if outage is None else f"{digits(outage.rms)} m"
        text = ratio_text(one.ratio, one.interval if outage is None else outage.interval)
        table.add_row(_name(one, found), size, text + OFF * (one in off))
    for name, size in errors.items():
        table.add_row(name.replace("_", " "), size, "")
    return table


def _off(found: Consistency) -> list[Score]:
    """Return the scores that are off: beyond chance and 10 %, or those that decide the verdict against the filter."""
    decisive = [one for one in claims(found) if is_off(one)]
    return [one for one in found.scores if one in decisive or not one.consistent]


def _name(one: Score, found: Consistency) -> str:
    """Return what a row is of; where there is no truth, states are compared with the smoother."""
    if one.name.startswith("outage "):
        return (
            f"{'without fixes' if found.has_truth else 'fixes withheld'}, {one.name.removeprefix('outage ')}"
        )
    words = NAMES.get(one.name, one.name.replace("_", " "))
    return words if found.has_truth or one in found.nis else f"{words}, to the smoother"


def _errors(found: Consistency) -> dict[str, str]:
    """Return rms errors over all axes with their unit; without a truth those of the innovations."""
    sizes: dict[str, str] = {}
    for name, values in found.errors.items():
        what, _, unit = f"{name}_".partition("_rms_")
        unit = unit.removesuffix("_")
        size, shown = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, unit.replace("m_s", "m/s"))
        key = f"nis_{what.removesuffix('_innovation')}" if what.endswith("_innovation") else what
        sizes[key] = f"{digits(size * math.hypot(*values))} {shown}".rstrip()
    return sizes


def _further(found: Consistency) -> list[str]:
    """Return what the table does not show: mark, correlation of the innovations, refused fixes."""
    white = found.whiteness
    marked = (
        [f"{OFF}: too far from 1; position, velocity, attitude and outages decide"] if _off(found) else []
    )
    if white is not None and not white.consistent:
        marked.append(f"innovations correlated, {white.correlation:+.2f} at lag {white.lag}")
    if found.gated:
        marked.append(f"{percent(found.gated)} of fixes refused")
    return ["; ".join(marked)]
