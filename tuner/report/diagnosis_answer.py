"""The answer of `diagnose`: verdict, what was found and what it changes, what has no cause, what changes nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from tuner.formats.assumption_words import assumed_text
from tuner.formats.customary_units import digits
from tuner.judgement import is_felt, judge_log
from tuner.limits import SHOWN_FINDINGS
from tuner.report.alike_sentences import alike_sentences
from tuner.report.answer_layout import span_text
from tuner.report.document import Document, document
from tuner.report.groups_in_words import findings_in_words
from tuner.report.static_diagnosis_tables import finding_tables, unexplained_table
from tuner.report.unexplained_words import unexplained_lines
from tuner.types import Diagnosis
from tuner.types.records import Record


def diagnosis_answer(found: Diagnosis, records: Sequence[Record] = ()) -> Document:
    """Return what a simulation of the noise of a log gets wrong: what changes most, then what is left."""
    words = findings_in_words(found.findings, max((record.span for record in records), default=None))
    shown = [*words.felt, *words.faults]
    rest = filter(is_felt, found.unexplained)
    return document(
        [
            _recording(records),
            f"Verdict: {judge_log(found).text}",
            *shown[:SHOWN_FINDINGS],
            f"Found, and changes noise and drift by less than 5 %: {'; '.join(words.idle)}"
            if words.idle
            else "",
            words.doubted,
        ],
        [*shown[SHOWN_FINDINGS:], *(f"Not explained: {line}" for line in unexplained_lines([*rest]))],
        more=[
            *finding_tables(found.findings, "What the simulation gets wrong"),
            *unexplained_table(found.unexplained),
            *note_lines(found),
        ],
        beyond="every finding and test",
    )


def _recording(records: Sequence[Record]) -> str:
    """Return what was diagnosed and what was assumed of it."""
    if not records:
        return ""
    longest = max(records, key=lambda one: one.span)
    log = f"{Path(longest.source).name}, {span_text(longest.span)} at {digits(1.0 / longest.interval)} Hz"
    return "; ".join(filter(None, (log, assumed_text([text for r in records for text in r.assumptions]))))


def note_lines(found: Diagnosis) -> list[str]:
    """Return the notes of a diagnosis, those that say the same of several axes as one."""
    of_axes = [tuple(reversed(one.split(": ", 1))) for one in found.notes if re.match(r"\w+_[xyz]: ", one)]
    others = [one for one in found.notes if not re.match(r"\w+_[xyz]: ", one)]
    return [f"Note: {one}" for one in (*others, *alike_sentences((text, axis) for text, axis in of_axes))]
