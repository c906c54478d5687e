"""The answer of `diagnose` in ten lines of 80 columns: what was found, what it changes, what is left unexplained."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.diagnosis.drive.noise_scale_estimates import factor_text, may_be_one
from tuner.report.answer_layout import assumed_text, filled, wrapped
from tuner.report.drive_answer import found_text
from tuner.report.drive_diagnosis_tables import SHORT_NAMES, harm_text, missing, whole_gain_text
from tuner.report.finding_groups import headlines
from tuner.report.static_diagnosis_tables import unexplained_lines
from tuner.types import Diagnosis, DriveDiagnosis
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


def drive_diagnosis_answer(found: DriveDiagnosis) -> list[str]:
    """Return what the filter gets wrong on a drive, the factors that its noise needs, and what is left."""
    lines = [f"{found_text(one)} → {one.consequence}" for one in found.findings]
    if found.quiet:
        lines = ["Nothing found: the drive agrees with a simulation of this filter"]
    left = [f"Unexplained: {one.statistic}" for one in found.unexplained]
    factors = [
        f"{SHORT_NAMES[one.setting]} × {factor_text(one.plain)}"
        for one in found.noise_scales
        if one.stated is not None and one.identifiable and not may_be_one(one.plain)
    ]
    noise = [f"Factors on the noise that the drive shows: {'; '.join(factors)}"] if factors else []
    gain = [] if found.gain is None else [whole_gain_text(found.gain)]
    harm = [] if found.credited else [harm_text(found.gain)]
    rest = [f"Missing: {one}" for one in missing(found)] + [f"Note: {one}" for one in found.notes]
    clear, others = lines[:CLEAREST_FINDINGS], lines[CLEAREST_FINDINGS:]
    texts = [*harm, *clear, *left[:1], *noise, *gain, *others, *left[1:], *rest]
    return filled([], [f"{text[:1].upper()}{text[1:]}" for text in texts], also="every finding and test")
