"""What a drive changed, for the answer of `tune`: verdict on the drive, its first findings, errors before and after."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tuner.formats.customary_units import amount, digits
from tuner.formats.outage_words import interval_words
from tuner.formats.parameter_words import parameter_words
from tuner.report.terminal import LINE_WIDTH
from tuner.report.verdict_text import verdict_text
from tuner.types.consistency import Consistency

if TYPE_CHECKING:
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.types import Finding

SHOWN_FINDINGS = 2
"""Findings of a drive in the answer: what a reader acts on first."""


def drive_verdict(found: Consistency, *, short: bool = False, shortest: bool = False) -> str:
    """Return the verdict on the filter on the measured drive, the first reason and how many others there are."""
    if found.consistent:
        return "On the measured drive: consistent, no score is shown to be 10 % off"
    reasons = [verdict_text(one) for one in found.shown.verdicts]
    more = f" ({len(reasons) - 1} more on the page)" if len(reasons) > 1 else ""
    if short:
        reason = reasons[0].replace("what the filter predicts: ", "predicted, ")
        if shortest:  # whether more or less than 1, the number says
            reason = reason.removesuffix(", optimistic").removesuffix(", pessimistic")
            more = more.replace(" on the page", "")
        return f"Measured drive: NOT consistent: {reason}{more}"
    return f"On the measured drive: NOT consistent: {reasons[0]}{more}"


def finding_lines(
    findings: Sequence[Finding], choice: HeldOutChoice | None, *, shortest: bool = False
) -> list[str]:
    """Return the clearest findings of a drive, with as many of their figures as a line has room for.

    Parameters
    ----------
    findings : sequence of Finding
        Of the drive, the clearest first.
    choice : HeldOutChoice or None
        What of them entered the settings.
    shortest : bool, optional
        Whether each has one line.
    """
    if not findings:
        return ["On the drive: nothing found that the filter does not expect"]
    lines = [(shortest_text if shortest else found_text)(one) for one in findings[:SHOWN_FINDINGS]]
    stays = shortest and choice is not None and choice.kept == "as it began"  # said with the choice
    if choice is not None and not stays and not choice.kept.startswith("with the findings"):
        lines.append("Findings are not in the settings: the last 40 % is predicted no better with them")
    return lines


def found_text(finding: Finding) -> str:
    """Return what a finding is with its first figure, and further ones that a line has room for."""
    words = finding.text.partition(": ")[2].partition(" (")[0] or finding.text
    figures = dict(finding.parameters)
    for name in finding.parameters:
        if (phrase := f" by the {name.replace('_', ' ')}") in words:  # the figure in its place
            words = words.replace(phrase, f" by {amount(figures.pop(name))}", 1)
            break
    text = words = f"Found: {words}"
    for name, said in parameter_words(finding.parameters).items():
        if name not in figures:
            continue
        longer = f"{text}{', ' if '(' in text else ' ('}{said} {amount(figures[name])}"
        if len(longer) >= LINE_WIDTH and text != words:
            break
        text = longer
    return f"{text})" if "(" in text else text


def shortest_text(finding: Finding) -> str:
    """Return what a finding is with its first figure in one line: the words give way, the figure stays."""
    text = found_text(finding)
    if len(text) <= LINE_WIDTH:
        return text
    what, _, figures = text.partition(" (")
    first = f" ({figures.removesuffix(')').partition(', ')[0]})" if figures else ""
    if not first and len(what) > LINE_WIDTH:
        return what.partition(", ")[0]
    clauses = [what, what.rpartition(": ")[0], f"Found: {finding.cause.replace('_', ' ')}"]
    return next(
        (f"{one}{first}" for one in clauses if one and len(one + first) <= LINE_WIDTH), what[:LINE_WIDTH]
    )


def choice_lines(
    choice: HeldOutChoice, *, shorter: bool, shortest: bool, intervals_alone: bool = False
) -> list[str]:
    """Return what was kept, and position errors with fixes and without them before and after.

    Parameters
    ----------
    choice : HeldOutChoice
        What the drive keeps.
    shorter, shortest : bool
        Whether to leave the intervals of the changes to the page, and what the fixes alone give and what was kept.
    intervals_alone : bool, optional
        Whether to say the intervals of the ratios alone.
    """
    before, after = choice.before, choice.after
    ranges = [f"{one.seconds:g} s {interval_words(one.interval)}".replace(" … ", "–") for one in choice.late]
    ratios = ", ".join(ranges)
    least = [f"True ÷ predicted, last 40 %: {ratios} (95 %)"] if ratios else []
    if choice.kept == "as it began" or before is None or after is None:
        if not intervals_alone:
            return [f"After the drive: {choice.note}"]
        return [f"After the drive: {choice.note.partition(';')[0] if least else choice.note}", *least]
    from tuner.diagnosis.drive.held_out_gain import change_interval  # loads the diagnosis of drives

    arrow = "→" if shortest else " → "
    changes = []
    for seconds, pairs in choice.outages.items():
        old, new = np.sqrt(pairs.mean(axis=0)).tolist()
        low, high = (_signed(end) for end in change_interval(pairs))
        change = "" if shorter else f" ({low} to {high})"
        changes.append(f"{seconds:.0f} s {digits(old)}{arrow}{digits(new)}{change}")
    tracking = f"{digits(before.tracking_rms)}{arrow}{digits(after.tracking_rms)} m"
    blind = f"{', '.join(changes)} m"
    despite = [f"{choice.despite[:1].upper()}{choice.despite[1:]}"] if choice.despite else []
    if intervals_alone:
        text = f"Error, last 40 %: {tracking}; whole drive, unaided {blind}"
        if len(text) > LINE_WIDTH:
            times = ",".join(f"{seconds:.0f}" for seconds in choice.outages)
            moved = ", ".join(one.partition(" s ")[2] for one in changes)
            text = _in_two_digits(f"Error [m], last 40 % {tracking}; all, unaided {times} s {moved}")
            text = text.replace(" m;", ";")
        return [*despite, text, *least]
    if shortest:
        ratios = ", ".join(
            f"{one.seconds:g} s {digits(one.ratio, 2)} ({interval_words(one.interval)} by {len(one.square)})"
            for one in choice.late
        )
        return [
            *despite,
            f"Error, last 40 %: {tracking}; whole drive, unaided {blind}",
            f"True ÷ predicted, unaided, last 40 % (95 %, windows): {ratios}",
        ]
    alone = "" if after.fixes_rms is None else f" (fixes alone {digits(after.fixes_rms)})"
    of_change = "" if shorter else " (95 % of the change)"
    return [
        *despite,
        f"Kept {choice.kept}; position error, rms: with fixes, last 40 % of the drive, {tracking}{alone}; "
        f"without them, whole drive, {blind}{of_change}",
        f"Without fixes, last 40 % (ratios at 95 %): {'; '.join(one.text for one in choice.late)}",
    ]


def _in_two_digits(text: str) -> str:
    """Return text whose changes, such as ``8.67→4.23``, have two digits."""
    return re.sub(r"([\d.]+)→([\d.]+)", lambda x: "→".join(digits(float(y), 2) for y in x.groups()), text)


def _signed(change: float) -> str:
    """Return a change with its sign, to two digits."""
    return ("+" if change > 0.0 else "") + digits(change, 2)
