"""The findings of a log and of a drive for the page: groups with what they change, and their pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tuner.formats.grouping import grouped
from tuner.report.diagnosis_answer import diagnosis_answer
from tuner.report.document import sentence
from tuner.report.drive_answer import found_text
from tuner.report.finding_groups import contradicted, finding_groups
from tuner.report.groups_in_words import effect_in_words, findings_in_words
from tuner.report.page_parts import Picture, blocks, with_room
from tuner.report.unexplained_words import unexplained_lines
from tuner.tune_result import TuneResult
from tuner.types import Diagnosis

GROUP_PICTURES = 2
"""Pictures of a group that stand on the page: further ones show the same in other samples."""


def findings_content(result: TuneResult, pictures: Sequence[Picture]) -> dict[str, Any]:
    """Return the findings in groups, each with its pictures as long as there is room, and what else there is."""
    found, nothing = result.diagnosis, "Nothing: the log agrees with a simulation of its noise terms."
    if found is None:
        why = result.absent.get("static diagnosis") or result.absent.get("diagnosis")
        nothing = f"No static diagnosis: {why}." if why else "No diagnosis was made."
    known = Diagnosis(()) if found is None else found
    span = max((record.span for record in result.records), default=None)
    left = unexplained_lines(known.unexplained)
    groups = [
        (sentence(group.title), [effect_in_words(group)], {one.text for one in group.findings})
        for group in finding_groups([one for one in known.findings if not contradicted(one)], span)
    ]
    if result.drive is not None:
        for alike in grouped(result.drive.diagnosis.findings, lambda group, one: group[0].cause == one.cause):
            lines = [f"{found_text(one)} → {one.consequence}" for one in alike]
            title = f"On the drive: {alike[0].cause.replace('_', ' ')}"
            groups.append((title, lines, {one.text for one in alike}))
        left += [one.statistic for one in result.drive.diagnosis.unexplained]
    if left:
        groups.append(("What no finding explains", left, set(left)))
    own = [[picture for picture in pictures if picture.caption in captions] for _, _, captions in groups]
    drawn = with_room(picture for each in own for picture in each[:GROUP_PICTURES])
    shown = [
        {
            "title": title,
            "lines": lines,
            "pictures": [one for one in each if one in drawn],
            "left_out": [one.name for one in each if one not in drawn],
        }
        for (title, lines, _), each in zip(groups, own, strict=True)
    ]
    doubted = findings_in_words(known.findings, span).doubted
    return {
        "groups": shown,
        "remarks": [text for text in (nothing if shown and found is None else "", doubted) if text],
        "all_findings": blocks(diagnosis_answer(known).more),
        "nothing_found": nothing,
    }
