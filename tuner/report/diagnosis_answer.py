"""The answer of `diagnose`: verdict, what has no cause, what was found and what it changes."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.judgement import judge_log
from tuner.limits import SHOWN_FINDINGS
from tuner.report.answer_layout import assumed_text
from tuner.report.document import Document, document
from tuner.report.finding_groups import headlines
from tuner.report.static_diagnosis_tables import unexplained_lines
from tuner.types import Diagnosis
from tuner.types.records import Record


def diagnosis_answer(found: Diagnosis, records: Sequence[Record] = ()) -> Document:
    """Return what a simulation of the noise of a log gets wrong: what moves the position most, then what is left."""
    span = max((record.span for record in records), default=None)
    findings = headlines(found.findings, span)
    left = [f"Not explained: {line}" for line in unexplained_lines(found.unexplained)]
    assumed = assumed_text([text for record in records for text in record.assumptions])
    texts = [assumed, f"Verdict: {judge_log(found).text}", *left, *findings[:SHOWN_FINDINGS]]
    more = [*findings[SHOWN_FINDINGS:], *(f"Note: {one}" for one in found.notes)]
    return document(texts, more, beyond="every finding and test")
