"""The answer of `diagnose` in ten lines of 80 columns: what was found, what it changes, what is left unexplained."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.report.answer_layout import assumed_text, filled, wrapped
from tuner.report.finding_groups import NOTE, headlines
from tuner.report.static_diagnosis_tables import unexplained_lines
from tuner.types import Diagnosis
from tuner.types.records import Record

CLEAREST_FINDINGS = 3
"""Findings that come before what is unexplained."""


def diagnosis_answer(found: Diagnosis, records: Sequence[Record] = ()) -> list[str]:
    """Return what a simulation of the noise of a log gets wrong: what moves the position most, then what is left."""
    span = max((record.span for record in records), default=None)
    lines = headlines(found.findings, span)
    left = [f"Unexplained: {line}" for line in unexplained_lines(found.unexplained)]
    if found.quiet:
        head = "Nothing found: the log agrees with a simulation of its noise terms"
    elif lines and all(line.startswith(NOTE) for line in lines):
        head = "Nothing found that moves the position at rest; beside that:"
    elif lines:
        head = "Found, what moves the position most first (one axis, no fixes):"
    else:
        head = "Nothing is named, but the log does not agree with a simulation of its noise:"
    assumed = assumed_text([text for record in records for text in record.assumptions])
    more = [
        *lines[:CLEAREST_FINDINGS],
        *left[:1],
        *lines[CLEAREST_FINDINGS:],
        *left[1:],
        *(f"Note: {one}" for one in found.notes),
    ]
    return filled([*wrapped(assumed, 2), head], more, also="every finding and test")
