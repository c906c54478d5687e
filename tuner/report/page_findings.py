"""The findings of a log and of a drive for the page: groups with what they change, their pictures and before/after."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

from tuner.formats.axis_words import axes_text
from tuner.report.finding_groups import (
    MIN_DRIFT_CHANGE,
    FindingGroup,
    contradicted,
    finding_groups,
    way_text,
)
from tuner.report.page_parts import Picture, blocks
from tuner.report.static_diagnosis_tables import diagnosis_tables, gain_text
from tuner.report.unexplained_words import unexplained_lines
from tuner.tune_result import TuneResult
from tuner.types import Diagnosis, Finding

PICTURE_BYTES = 2_500_000
"""Bytes that all pictures of findings take in the page; further ones stand beside the page, which stays below 6 MB."""
WORDED_FINDINGS = 2
"""Findings of a group that stand in words with their pictures: further ones differ in their figures only."""


def findings_content(result: TuneResult, pictures: Sequence[Picture]) -> dict[str, Any]:
    """Return the findings in groups, each with its pictures as long as there is room, and what else there is."""
    groups = _with_pictures(_groups_in_words(result), pictures)
    found, nothing = result.diagnosis, "Nothing: the log agrees with a simulation of its noise terms."
    remarks = []
    if found is None:
        why = result.absent.get("static diagnosis") or result.absent.get("diagnosis")
        nothing = f"No static diagnosis: {why}." if why else "No diagnosis was made."
        remarks = [nothing] if groups else []
    known = Diagnosis(()) if found is None else found
    remarks += [
        f"{one.cause} in {axes_text(one.channels)}: held-out data are less likely with it, so it is no finding"
        for one in known.findings
        if contradicted(one)
    ]
    return {
        "groups": groups,
        "remarks": remarks,
        "notes": known.notes,
        "all_findings": [block for block in blocks(diagnosis_tables(known)) if "rows" in block],
        "nothing_found": nothing,
    }


@dataclass(frozen=True)
class _Group:
    """Findings of the page that belong together: heading, table of their drift, words, captions of their pictures.

    Their first pictures are shown, names of others left out.
    """

    title: str
    drift: dict[str, Any] | None
    lines: Sequence[str]
    captions: Set[str]
    pictures: Sequence[Picture] = ()
    left_out: Sequence[str] = ()


def _groups_in_words(result: TuneResult) -> list[_Group]:
    """Return the findings of the log and of the drive in groups, and what no finding explains."""
    found, span = result.diagnosis, max((record.span for record in result.records), default=None)
    groups: list[_Group] = []
    left: list[str] = []
    if found is not None:
        for group in finding_groups([one for one in found.findings if not contradicted(one)], span):
            title = group.short[:1].upper() + group.short[1:]
            captions = {one.text for one in group.findings}
            groups.append(_Group(title, _drift(group), _words(group), captions))
        left += unexplained_lines(found.unexplained)
    if result.drive is not None:
        groups += _found_on_drive(result.drive.diagnosis.findings)
        left += [one.statistic for one in result.drive.diagnosis.unexplained]
    return [*groups, _Group("What no finding explains", None, left, set(left))] if left else groups


def _with_pictures(groups: Sequence[_Group], pictures: Sequence[Picture]) -> list[_Group]:
    """Return the groups, each with its first pictures as long as there is room for them."""
    room, filled = PICTURE_BYTES, []
    for group in groups:
        own = [picture for picture in pictures if picture.caption in group.captions]
        taken = []
        for picture in own[:WORDED_FINDINGS]:
            if picture.size <= room:
                taken.append(picture)
                room -= picture.size
        left_out = [picture.name for picture in own if picture not in taken]
        filled.append(replace(group, pictures=taken, left_out=left_out))
    return filled


def _found_on_drive(findings: Sequence[Finding]) -> list[_Group]:
    """Return a group for each cause that was found on the drive, the clearest first."""
    by_cause: dict[str, list[Finding]] = {}
    for one in findings:
        by_cause.setdefault(one.cause, []).append(one)
    return [
        _Group(
            f"On the drive: {cause.replace('_', ' ')}",
            None,
            [f"{one.text} → {one.consequence}" for one in alike],
            {one.text for one in alike},
        )
        for cause, alike in by_cause.items()
    ]


def _drift(group: FindingGroup) -> dict[str, Any] | None:
    """Return the position error with and without what was found; None where it is the same."""
    if not group.drift or all(a < MIN_DRIFT_CHANGE * b for a, b in group.drift.values()):
        return None
    head = ["position error of one sensor axis, no fixes", *(f"after {name}" for name in group.drift)]
    texts = [(way_text(a, a), way_text(b, a)) for a, b in group.drift.values()]
    before, after = zip(*texts, strict=True)
    rows = [["with it in the samples", *before], ["without it", *after]]
    return {"title": "", "head": head, "rows": rows, "words": False}


def _words(group: FindingGroup) -> list[str]:
    still = ["Does not move the position at rest."] if group.drift and _drift(group) is None else []
    moving = [f"{group.in_motion[:1].upper()}{group.in_motion[1:]}."] if group.in_motion else []
    lines = [*moving, *still, f"Changes {group.changes}."]
    for one in group.findings[:WORDED_FINDINGS]:
        lines.append(one.text + (f" → {one.consequence}" if one.consequence else ""))
        if one.gain is not None and (gain := gain_text(one.gain)):
            lines.append(f"before → after: {gain}")
    if (more := len(group.findings) - WORDED_FINDINGS) > 0:
        lines.append(f"{more} more of the kind: in the table of all findings below")
    return list(dict.fromkeys(lines))
