"""The answer of `tune` in ten lines of 80 columns: verdict, numbers, what matters most, where the page is."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tuner.formats.customary_units import digits
from tuner.formats.reference_words import reference_line
from tuner.identification.comparison import compare_identifications, limit_checks
from tuner.report.answer_layout import (
    BOUNDED,
    INTERVAL,
    LONGER,
    MAX_LINES,
    assumed_text,
    settings_lines,
    span_text,
    used_part,
    wrapped,
)
from tuner.report.comparison_tables import limit_text
from tuner.report.drive_answer import choice_lines, drive_verdict, finding_lines
from tuner.report.fast_state_note import fast_state_note
from tuner.report.finding_groups import (
    SAMPLES_AT_FAULT,
    contradicted,
    finding_groups,
)
from tuner.report.groups_in_words import group_in_words, groups_in_short
from tuner.report.identification_answer import terms_too_short, warning_lines
from tuner.report.settings_rows import EXTRAPOLATED, SettingsRow, axes_text, settings_rows
from tuner.report.static_diagnosis_tables import hidden_effect_lines
from tuner.report.terminal import LINE_WIDTH
from tuner.report.verdict_text import shortened, verdict_text
from tuner.synthesis.findings import judge_hidden

if TYPE_CHECKING:
    from tuner.tune_result import TuneResult
    from tuner.types.verdict import Verdict

WITHOUT_RECEIVER = "name a receiver (--gnss GRADE)"
"""Words of the reason where a check lacks only the receiver."""
SHORTER = ("head", "numbers", "findings", "warnings", "drive", "without effect", "least of the drive")
"""Parts that are said in fewer words where the answer has more lines, in this order."""
MAX_KEYS = 7
"""Lines of another filter's settings that an answer shows; of more, only the file is named."""
COMMENTS = ("#", "//", "%", "<!--", "/*", "*")
"""How lines of comments begin in the dialects."""
COMPARED_UP_TO = 10.0
"""Cluster time up to which the log is compared, s, below which the verdict says so: the slower bias states of a filter
are not tested there."""
WHAT_SIMULATES = "--gnss GRADE does"
"""What to add to the command, for the filter to be simulated."""
ON_LIMIT, SHORT_ON_LIMIT = "rests on a 95 % limit", "95 % limit"
"""How a remark on a setting begins that is half of a limit, and in a line without room for its axes."""
SHOWN_FINDINGS = 2
"""Findings in the answer: what a reader acts on first."""
OF_DRIVE_ALONE = "static diagnosis"
"""What lacks where a drive stands in for the log, which the line of the recording says."""
SAME = "the same on all axes"
"""Remark on a setting of a file that the line of an answer has no room for."""
NO_INTERVAL = "no ±: fitted to the Allan curve, or set"


def answer_lines(result: TuneResult, directory: Path | None, dialect: str | None = None) -> list[str]:
    """Return the answer, at most `MAX_LINES` lines of `LINE_WIDTH` for a log whose rows of settings take a line each.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    directory : Path or None
        Where its files are; None where none were written.
    dialect : str, optional
        The one whose keys and numbers are shown instead of the table, where they are few.
    """
    keys = [] if dialect is None or directory is None else settings_in_dialect(result, dialect, directory)
    for steps in range(len(SHORTER) + 1):
        lines = _answer(result, directory, frozenset(SHORTER[:steps]), keys)
        if len(lines) <= MAX_LINES:
            break
    return lines


def settings_in_dialect(result: TuneResult, dialect: str, directory: Path) -> list[str]:
    """Return where the file of a dialect is, and its settings where they are few.

    Lines of comments are left out; what they say of a setting, "# NAME: unit; formula; …", stands behind it, as far as
    it fits: the formula goes first.
    """
    from tuner.pipeline import file_of_dialect  # loaded when used: it imports every room

    name = file_of_dialect(dialect)
    if why := result.withheld.get(name):
        return [f"Nothing is written for {dialect}: {why}"]
    written = [line.rstrip() for line in result.exports[name].splitlines() if line.strip()]
    remarks = (line[2:].split(": ", 1) for line in written if line.startswith("# ") and ": " in line)
    notes = {name: [part for part in remark.split("; ") if part != SAME] for name, remark in remarks}
    lines = []
    for line in written:
        if line.lstrip().startswith(COMMENTS):
            continue
        shown = line.replace("\t", " ")
        for note in (notes[word] for word in re.split(r"[ ,]+", shown) if word in notes):
            unit, *rest = note
            whole, without_formula = (f"{shown}  # {'; '.join(parts)}" for parts in (note, [unit, *rest[1:]]))
            shown = whole if len(whole) <= LINE_WIDTH else without_formula
        lines.append(_shortened_remarks(shown))
    if len(lines) <= MAX_KEYS and max(map(len, lines), default=0) <= LINE_WIDTH:
        return [f"{directory / name}:", *lines]
    return [f"For {dialect}: {directory / name}"]


def _shortened_remarks(line: str) -> str:
    """Return a line of settings without the last remarks that it has no room for; that on a limit stays longest."""
    setting, *remarks = line.split("; ")
    on_limit = [one for one in remarks if one.startswith(ON_LIMIT)]
    limits = [*on_limit[:1], *(ON_LIMIT, SHORT_ON_LIMIT)] if on_limit else []
    fitting = (
        "; ".join([setting, *(limit if one in on_limit else one for one in remarks[:count])])
        for limit in limits or [""]
        for count in range(len(remarks), -1, -1)
        if not on_limit or remarks[:count].count(on_limit[0])
    )
    whole = (one for one in (*fitting, setting) if len(one) <= LINE_WIDTH)
    return next(whole, setting)


def _answer(result: TuneResult, directory: Path | None, short: Set[str], keys: Sequence[str]) -> list[str]:
    """Return the answer with some of its parts in fewer words, those of `SHORTER`."""
    rows = settings_rows(result.config)
    table = settings_lines(rows, tight="numbers" in short) if rows and len(keys) < 2 else []
    brief, least = "drive" in short, "least of the drive" in short
    findings, shown = _findings_of_log(result, short="findings" in short, idle="without effect" not in short)
    warnings = warning_lines(result.identification, short="findings" in short)
    unsaid = len(warnings) if "warnings" in short else 0
    warnings = warnings[unsaid:]
    texts = [*against_datasheet(result), *findings, *warnings, *hidden_lines(result), *_absent_lines(result)]
    if result.drive is not None:
        found = result.drive.diagnosis.findings
        most = 1 if least or (findings and brief) else SHOWN_FINDINGS
        texts += finding_lines(found[:most], result.choice, shortest=least)
        shown += min(len(found), most)
    if result.choice is not None:
        texts += choice_lines(
            result.choice, shorter="numbers" in short, shortest=brief, intervals_alone=least
        )
    head, note = _head(result, short, table), fast_state_note(result.config) if table else ""
    beneath = [f"{note}; for N and K alone: --to DIALECT"] if note else []
    joined = [*head[:-1], f"{head[-1].removesuffix('.')}; {note}"]
    if note and "numbers" in short and len(wrapped(joined[-1], 2)) == len(wrapped(head[-1], 2)):
        head, beneath = joined, []
    if "least of the drive" in short:
        beneath = []
    return [
        *(line for text in head for line in wrapped(text, 2)),
        *table,
        *beneath,
        *keys,
        *(line for text in texts for line in wrapped(text, 2)),
        *_page_lines(result, directory, shown, unsaid),
    ]


def _head(result: TuneResult, short: Set[str], table: Sequence[str]) -> list[str]:
    """Return the verdicts and the line on the recording, with what signs in the table of settings mean."""
    brief, least = "drive" in short, "least of the drive" in short
    head = (
        [short_verdict(result, brief=brief)]
        if "head" in short
        else [verdict_line(result), recording_line(result)]
    )
    if result.measured is not None:
        measured = drive_verdict(result.measured.consistency, short=brief, shortest=least)
        wrong = reference_lines(result)
        if wrong:
            measured = shortened(measured)
        together = "head" in short and not wrong
        head = [f"{measured}. {head[0]}"] if together else [measured, *wrong, *head]
    elif result.drive is not None:
        head = [head[0], *reference_lines(result), *head[1:]]
    if any("*" in line for line in table) and BOUNDED not in table[0]:
        legend_here = f"; {BOUNDED}"
        fits = len(head[-1]) + len(legend_here) <= LINE_WIDTH
        head[-1] += legend_here if fits else legend_here.replace(" 95 %", "")
    if any(EXTRAPOLATED in line for line in table):
        head[-1] += f"; {LONGER}"
    if "head" in short and len(head[-1]) > LINE_WIDTH:
        head[-1] = head[-1].replace(f" ({WHAT_SIMULATES})", "")
    if least:
        return [one.replace(" with its noise:", ":").replace(" in the drive at", " at") for one in head]
    return head


def reference_lines(result: TuneResult) -> list[str]:
    """Return what is wrong with the reference of the drive, in one line or none."""
    if result.measured is not None:
        return reference_line(result.measured.notes)
    return [] if result.drive is None else reference_line(result.drive.diagnosis.notes)


def whole_verdict(result: TuneResult) -> str:
    """Return the verdict of the measured drive, where there is one, before those of simulation and log."""
    measured = [] if result.measured is None else [drive_verdict(result.measured.consistency)]
    return ". ".join([*measured, *reference_lines(result), verdict_line(result)])


def verdict_line(result: TuneResult, *, brief: bool = False) -> str:
    """Return whether the filter is as uncertain as it says, and whether its settings predict the log."""
    from tuner.pipeline import CHECK_RUNS  # loaded when used: it imports every room

    parts = []
    simulated = "" if result.measured is None else "simulated with its noise: "
    if result.check is not None and result.check.consistency.consistent:
        parts.append(f"{simulated}consistent" + f" within 10 % ({CHECK_RUNS} simulated hours)" * (not brief))
    elif result.check is not None:
        parts.append(f"{simulated}NOT consistent" + _why_not(result.check.consistency.verdicts))
    failed = [axis for axis, found in result.predictions.items() if not found.passes]
    if failed:
        parts.append(f"does NOT predict the log in {axes_text(failed)}")
    elif result.predictions:
        parts.append(f"predicts {_compared(result) or _on_axes(result)}")
    if result.check is None:
        parts.append("filter not simulated" + (f" ({WHAT_SIMULATES})" if _no_receiver(result) else ""))
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def short_verdict(result: TuneResult, *, brief: bool) -> str:
    """Return verdict and recording in one sentence, which is of one line where nothing is wrong."""
    checked = None if result.check is None else result.check.consistency.consistent
    every = bool(result.predictions) and all(found.passes for found in result.predictions.values())
    recording = recording_line(result, named=False)
    if checked is False or not every or result.measured is not None:
        return f"{verdict_line(result, brief=brief).removesuffix('.')}; {recording}"
    part = _compared(result)
    verdict = (
        f"Consistent within 10 %, predicts {part or 'each axis'}"
        if checked
        else f"Predicts {part or _on_axes(result)}"
    )
    with_cure = f"{verdict}; {recording}; filter not simulated ({WHAT_SIMULATES})"
    return with_cure if _no_receiver(result) and len(with_cure) <= LINE_WIDTH else f"{verdict}; {recording}"


def _on_axes(result: TuneResult) -> str:
    """Return what is predicted of a log: of a sensor that lacks an axis, or has a constant one, the others by name."""
    triads = {axis.rpartition("_")[0] for axis in result.predictions}
    whole = len(result.predictions) == 3 * len(triads)
    return "the log on every axis" if whole else f"the log on {axes_text(list(result.predictions))}"


def _compared(result: TuneResult) -> str:
    """Return up to which cluster time a short log was compared, and what it cannot show; empty for a longer one."""
    longest = min(float(found.curve.tau[-1]) for found in result.predictions.values())
    if longest >= COMPARED_UP_TO:
        return ""
    channels = [result.identification.channels[axis] for axis in result.predictions]
    span = min((channel.span for channel in channels if channel.span > 0.0), default=0.0)
    rest = any(used_part(result.identification.source, channel.axis) for channel in channels)
    text = f"the {span_text(span)}{' at rest' * rest} up to τ = {digits(longest, 2)} s"
    signs = terms_too_short(result.identification)
    return f"{text}, too short to show {signs}" if signs else text


def _why_not(verdicts: Sequence[Verdict]) -> str:
    """Return the first verdict with its likeliest explanation, and how many others the page shows."""
    if not verdicts:
        return ""
    first = verdicts[0]
    text = f": {verdict_text(replace(first, explanations=first.explanations[:1]))}"
    others = len(first.explanations) - 1
    return f"{text} ({others} more on the page explain them as well)" if others > 0 else text


def recording_line(result: TuneResult, *, named: bool = True) -> str:
    """Return length and rate of what the numbers rest on, and what was assumed of it; of a drive alone, its rest.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    named : bool, optional
        Whether to say its name, and that units are stated where they are.
    """
    spans: dict[str, list[str]] = {}
    rest = " at rest in the drive" if result.drive is not None and not result.records else ""
    for channel in result.identification.channels.values():
        if channel.span > 0.0:
            part = used_part(result.identification.source, channel.axis)
            text = f"{span_text(channel.span)}{rest} at {digits(1.0 / channel.interval)} Hz{part}"
            spans.setdefault(text, []).append(channel.axis)
    lengths = [text if len(spans) == 1 else f"{text} ({axes_text(axes)})" for text, axes in spans.items()]
    assumed = assumptions(result)
    units = assumed_text(assumed) or "units stated, none assumed"
    if result.key is not None:
        units = "simulated in SI units"
    if not named:
        return "; ".join([", ".join(lengths), *([units] if assumed else [])])
    return "; ".join([", ".join([result.name, *lengths]), *([units] if result.records else [])])


def assumptions(result: TuneResult) -> tuple[str, ...]:
    """Return what nobody stated of the log and was assumed."""
    return tuple(str(text) for text in result.identification.source.get("assumptions", ()))


def legend(rows: Sequence[SettingsRow]) -> str:
    """Return what the marks of a table of settings mean, those that occur."""
    settings = [one for row in rows for one in (row.white, row.walk, *(sd for sd, _ in row.states))]
    texts = [one.text for one in settings if any(one.used)]
    parts = [INTERVAL] if any("±" in text or "(" in text for text in texts) else []
    parts += [BOUNDED] if any("*" in text for text in texts) else []
    parts += [LONGER] if any(EXTRAPOLATED in row.bias for row in rows) else []
    parts += [NO_INTERVAL] if any(not set("±*(") & set(text) for text in texts) else []
    return "; ".join(parts)


def against_datasheet(result: TuneResult) -> list[str]:
    """Return whether the unit keeps its data sheet, where one was given."""
    if result.datasheet is None:
        return []
    names = (result.name, str(result.datasheet.source.get("name", "its data sheet")))
    found = compare_identifications(names, (result.identification, result.datasheet))
    return [limit_text(one) for one in limit_checks(found)]


def _findings_of_log(result: TuneResult, *, short: bool, idle: bool) -> tuple[list[str], int]:
    """Return the findings of the log that change most, in words of what they do, or that there are none; how many.

    Without `idle`, findings that change no entry of the configuration are left to the page.
    """
    if result.diagnosis is None:
        return [], 0
    span = max((record.span for record in result.records), default=None)
    groups = finding_groups([one for one in result.diagnosis.findings if not contradicted(one)], span)
    if not groups and result.diagnosis.quiet:
        return ["Found nothing that the noise terms do not explain"], 0
    if not groups:
        return ["No cause is named, but the noise terms do not explain all of the log"], 0
    matter = [group for group in groups if group.matters][:SHOWN_FINDINGS]
    if not idle and matter and all(group.changes == SAMPLES_AT_FAULT for group in matter):
        return [], 0
    if not matter:
        return [f"No finding moves the position at rest: {len(groups)} on the page"], len(groups)
    if not short:
        return [group_in_words(group) for group in matter], len(matter)
    while len(text := groups_in_short(matter)) > LINE_WIDTH and len(matter) > 1:
        matter.pop()
    return [text], len(matter)


def _page_lines(result: TuneResult, directory: Path | None, shown: int, warnings: int) -> list[str]:
    """Return where the page is and what it has beyond the answer, in one line where that has room."""
    path = "write_tune_result(result, FOLDER)" if directory is None else directory / "report.html"
    found = result.diagnosis
    of_log = () if found is None else [one for one in found.findings if not contradicted(one)]
    of_drive = () if result.drive is None else result.drive.diagnosis.findings
    count = len(finding_groups(of_log)) + len(of_drive) - shown
    more = [f"{count} more findings"] if count > 0 else []
    more += [f"{warnings} warning{'s' * (warnings > 1)}"] if warnings else []
    axes = [] if found is None else [axis for one in found.unexplained for axis in one.channels]
    more += [f"unexplained rest of {axes_text(list(dict.fromkeys(axes)))}"] if axes else []
    more += ["unexplained rest of the drive"] if result.drive and result.drive.diagnosis.unexplained else []
    text = f"Page ({', '.join(more)}): {path}" if more else f"Page: {path}"
    short = f"Page ({', '.join(one.partition(' of ')[0] for one in more)}): {path}" if more else text
    shortest = short.replace(" more findings", " more")
    for line in (f"{text} (tables: --verbose)", text, short, shortest, f"Page: {path}"):
        if len(line) <= LINE_WIDTH:
            return [line]
    return wrapped(text, 2)


def _no_receiver(result: TuneResult) -> bool:
    return WITHOUT_RECEIVER in result.absent.get("consistency", "")


def _absent_lines(result: TuneResult) -> list[str]:
    """Return what could not be done and why, where neither the verdict nor the lines on the recording say so."""
    return [
        f"No {part}: {reason}"
        for part, reason in result.absent.items()
        if not (part == "consistency" and _no_receiver(result)) and part != OF_DRIVE_ALONE
    ]


def hidden_lines(result: TuneResult) -> list[str]:
    """Return what was hidden in a simulated log and whether it was found."""
    if result.key is None or result.diagnosis is None:
        return []
    return [line.strip() for line in hidden_effect_lines(judge_hidden(result.key, result.diagnosis))]
