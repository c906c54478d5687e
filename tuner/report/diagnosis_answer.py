"""The answer of `diagnose`: verdict, what was found and what it changes, what has no cause, what changes nothing."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.judgement import judge_log
from tuner.limits import SHOWN_FINDINGS
from tuner.report.answer_layout import assumed_text
from tuner.report.document import Document, document
from tuner.report.groups_in_words import findings_in_words
from tuner.report.static_diagnosis_tables import unexplained_lines
from tuner.types import Diagnosis
from tuner.types.records import Record


def diagnosis_answer(found: Diagnosis, records: Sequence[Record] = ()) -> Document:
    """Return what a simulation of the noise of a log gets wrong: what changes most, then what is left."""
    words = findings_in_words(found.findings, max((record.span for record in records), default=None))
    shown = [*words.felt, *words.faults]
    return document(
        [
            assumed_text([text for record in records for text in record.assumptions]),
            f"Verdict: {judge_log(found).text}",
            *shown[:SHOWN_FINDINGS],
            f"Below 5 % of white noise and drift: {'; '.join(words.idle)}" if words.idle else "",
            words.doubted,
        ],
        [
            *shown[SHOWN_FINDINGS:],
            *(f"Not explained: {line}" for line in unexplained_lines(found.unexplained)),
            *(f"Note: {one}" for one in found.notes),
        ],
        beyond="every finding and test",
    )
