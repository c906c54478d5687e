"""The answer of `tune`: what was analysed, verdict, settings, what was found, where the files are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from tuner.formats.grouping import gathered
from tuner.formats.reference_words import reference_line
from tuner.identification.comparison import compare_identifications, limit_checks
from tuner.judgement import is_felt
from tuner.limits import SHOWN_FINDINGS
from tuner.report.answer_layout import recording_text
from tuner.report.diagnosis_answer import diagnosis_answer
from tuner.report.document import Document, document
from tuner.report.drive_answer import choice_parts, fixes_parts, found_text
from tuner.report.examination_answer import MENDED, vibration_lines
from tuner.report.finding_groups import FindingGroup, finding_groups
from tuner.report.groups_in_words import changes_much, findings_in_words
from tuner.report.identification_answer import warning_lines
from tuner.report.identification_tables import identification_tables
from tuner.report.noise_table import (
    FADING,
    PAIR,
    entries_tables,
    legend,
    measured_table,
    states_tables,
    why_larger,
)
from tuner.report.pose_run_answer import pose_run_lines
from tuner.report.sensor_answers import limit_text
from tuner.report.static_diagnosis_tables import hidden_effect_lines
from tuner.report.terminal import LINE_WIDTH
from tuner.report.tune_sections import setting_reasons, tune_sections
from tuner.report.unexplained_words import unexplained_lines
from tuner.synthesis.findings import judge_hidden, left_out
from tuner.types import Diagnosis
from tuner.types.judgement import Judgement, Use
from tuner.types.named_cause import separated

if TYPE_CHECKING:
    from tuner.tune_result import TuneResult

MAX_KEYS = 7
"""Lines of another filter's settings that an answer shows; of more, only the file is named."""
MAX_LEFT_OUT = 2
"""Kinds of events and wrong readings that an answer names, those of most effect."""
COMMENTS = ("#", "//", "%", "<!--", "/*", "*")
"""How lines of comments begin in the dialects."""
OF_DRIVE_ALONE = "static diagnosis"
"""What lacks where a drive stands in for the log, which the line of the recording says."""
SAID_ABOVE = ("the same on all axes", "for all axes", "rests on a 95 % limit")
"""How remarks on a setting of a file begin that the table of an answer says."""


def tune_answer(result: TuneResult, directory: Path | None, dialect: str | None = None) -> Document:
    """Return the answer: what was analysed, the verdict, the noise and what to enter, what was found, the files.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    directory : Path or None
        Where its files are; None where none were written.
    dialect : str, optional
        The one whose keys and numbers are shown first, where they are few.
    """
    keys = [] if dialect is None or directory is None else settings_in_dialect(result, dialect, directory)
    files = () if len(keys) > 1 else result.exports
    noise = noise_tables(result, files) if result.exports else []
    signs = legend(*noise[:1])
    found, idle, doubted = found_lines(result)
    without = left_out_text(left_out_groups(result.diagnosis))
    examined = result.diagnosis is not None or result.drive is not None
    vibration = [] if result.examination is None else vibration_lines(result.examination)
    none = (
        "Nothing was found that the noise terms do not explain"
        if result.verdict.use in (Use.USABLE, Use.HONEST)
        else "The search for causes found none"
    )
    faulty = result.examination is not None and result.examination.before_filter
    nothing = [] if faulty or vibration or without or result.run else [none]
    further = len(found) - SHOWN_FINDINGS
    own = Path(keys[0].removesuffix(":")).name if len(keys) > 1 else ""
    shown = (own,) if own else (PAIR, FADING)
    reason = why_larger(result.exports[name] for name in shown if name in result.exports)
    scored = () if result.measured is None else result.measured.consistency.outages
    run = result.measured or (result.drive and result.drive.diagnosis)
    notes = run.notes if run else ()  # on the reference and on repairs of the drive
    said: list[Table | str] = [
        recording_line(result),
        f"Verdict: {result.verdict.text}",
        f"Not in the settings, as it is no noise, but your filter meets it: {without}" if without else "",
        *reference_line(notes),
        *separated(notes)[0],
        *(vibration if "vibration" not in result.verdict.text else []),
        *noise[:1],
        signs,
        reason,
        *keys,
        *noise[1:],
        *fixes_content(result),
        *([] if result.choice is None else choice_parts(result.choice, scored)),
        *([] if result.run is None else pose_run_lines(result.run)),
        *found[:1],
    ]
    remarks = [
        *(found[1:SHOWN_FINDINGS] or nothing * (not found and examined and not idle and not doubted)),
        doubted,
        f"{further} more finding{'s' * (further > 1)} in report.html" if further > 0 else "",
        f"{idle} finding{'s' * (idle > 1)} in report.html change{'s' * (idle == 1)} no setting by 5 % or more"
        if idle
        else "",
        *against_datasheet(result),
        *warning_lines(result.identification, predicted=result.predictions),
        *(f"No {part}: {why}" for part, why in result.absent.items() if part != OF_DRIVE_ALONE),
    ]
    known = result.identification.notes
    more = [
        *identification_tables(result.identification),
        *states_tables(result.config),
        *setting_reasons(result),
        *(() if result.diagnosis is None else diagnosis_answer(result.diagnosis).more),
        *(part for _, heading, content in tune_sections(result) for part in (heading, *content)),
        *(note for note in result.config.notes if note not in known),
    ]
    path = "FOLDER by write_tune_result(result, FOLDER)" if directory is None else directory
    mended = [MENDED] * bool(result.examination and result.examination.mends)
    files_line = f"In {path}: {', '.join([*result.exports, *mended, 'report.html'])}"
    end = [*withheld_lines(result), files_line]
    main = measured_table(result.identification, result.config, result.predictions, further=False)
    groups: list[list[Table | str]] = [[*noise[2:]], [main, signs], [*noise[1:2], reason]]
    spare: list[list[tuple[Table | str, Table | str]]] = [[(part, "") for part in group] for group in groups]
    spare.insert(1, [(one, main) for one in noise[:1]])
    return document(said, remarks, end, more, spare=spare)


def noise_tables(result: TuneResult, files: Iterable[str]) -> list[Table]:
    """Return the measured noise, and what to enter where these files are written."""
    entered = entries_tables(result.config, files)
    return [
        measured_table(result.identification, result.config, result.predictions, further=not entered),
        *entered,
    ]


def fixes_content(result: TuneResult) -> list[Table | str]:
    """Return the sds of the fixes of a drive and what is taken out as delay; nothing of a log."""
    if result.drive is None:
        return []
    mended = bool(result.examination and result.examination.mends)
    return fixes_parts(result.drive, result.config, written=bool(result.exports), mended=mended)


def withheld_lines(result: TuneResult) -> list[str]:
    """Return which files of settings are not written, with what the verdict does not say of the reason."""
    names = gathered((why, name) for name, why in result.withheld.items())
    return [
        f"Not written: {', '.join(files)}{f': {rest}' if (rest := _beyond(why, result.verdict)) else ''}"
        for why, files in names.items()
    ]


def _beyond(why: str, verdict: Judgement) -> str:
    """Return what a reason says beyond the verdict: what would do."""
    rest = "" if why == verdict.text else why
    for one in verdict.reasons:
        rest = rest.replace(one, "")
    return rest.strip(" ;.")


def settings_in_dialect(result: TuneResult, dialect: str, directory: Path) -> list[str]:
    """Return where the file of a dialect is, and its settings where they are few.

    Lines of comments are left out; what they say of a setting, "# NAME: unit; formula; …", stands behind it, as far as
    it fits.
    """
    from tuner.pipeline import file_of_dialect  # loaded when used: it imports every room

    name = file_of_dialect(dialect)
    if name not in result.exports:
        return []
    written = [line.rstrip() for line in result.exports[name].splitlines() if line.strip()]
    remarks = (line[2:].split(": ", 1) for line in written if line.startswith("# ") and ": " in line)
    notes = {
        name: "; ".join(part for part in remark.split("; ") if not part.startswith(SAID_ABOVE))
        for name, remark in remarks
    }
    lines = []
    for line in written:
        if line.lstrip().startswith(COMMENTS):
            continue
        shown = line.replace("\t", " ")
        for note in (notes[word] for word in re.split(r"[ ,]+", shown) if word in notes):
            shown = f"{shown}  # {note}"
        while len(shown) > LINE_WIDTH and "; " in shown:
            shown = shown.rpartition("; ")[0]
        lines.append(shown)
    kept = [_kept_text(line) for line in written if "keep stock" in line]
    lines = [*lines, *kept] if len(lines) + len(kept) <= MAX_KEYS else lines or kept
    if len(lines) <= MAX_KEYS and max(map(len, lines), default=0) <= LINE_WIDTH:
        return [f"{directory / name}:", *lines]
    return [f"For {dialect}: {directory / name}"]


def _kept_text(line: str) -> str:
    """Return of a comment which stock value is kept, and what the log shows beside it."""
    head, *rest = line.lstrip("# ").split("; ")
    return "; ".join([": ".join(head.split(": ")[:2]), *(one for one in rest if one.startswith("here"))])


def recording_line(result: TuneResult) -> str:
    """Return name, length and rate of what the numbers rest on, and what was assumed of it; of a drive, its rest."""
    rest = " at rest in the drive" if result.drive is not None and not result.records else ""
    said = [f"{result.name}, {recording_text(result.identification, rest)}"]
    if result.key is not None:
        judged = [] if result.diagnosis is None else judge_hidden(result.key, result.diagnosis)
        said += hidden_effect_lines(judged) or ["simulated"]
    elif result.records and not result.identification.source.get("assumptions"):
        said.append("units stated, none assumed")
    return "; ".join(said)


def left_out_groups(diagnosis: Diagnosis | None) -> list[FindingGroup]:
    """Return the events and wrong readings without which the numbers are, those that change much."""
    found = [] if diagnosis is None else left_out(diagnosis.findings)
    return [group for group in finding_groups(found) if changes_much(group)]


def left_out_text(groups: Sequence[FindingGroup]) -> str:
    """Return which events and wrong readings the settings leave out; empty for none."""
    said = [f"{one.title}{one.figures}" for one in groups[:MAX_LEFT_OUT]]
    said += [f"{len(groups) - MAX_LEFT_OUT} more"] * (len(groups) > MAX_LEFT_OUT)
    return "; ".join(said)


def against_datasheet(result: TuneResult) -> list[str]:
    """Return whether the unit keeps its data sheet, where one was given."""
    if result.datasheet is None:
        return []
    names = (result.name, str(result.datasheet.source.get("name", "its data sheet")))
    found = compare_identifications(names, (result.identification, result.datasheet))
    return [limit_text(one) for one in limit_checks(found)]


def found_lines(result: TuneResult) -> tuple[list[str], int, str]:
    """Return what has no cause, then the findings by the effect they state; how many have none; what is doubted.

    A finding whose effect is below `SHOWN_CHANGE` stands on the page alone; one whose effect is not known comes last.
    """
    known = result.diagnosis or Diagnosis(())
    span = max((record.span for record in result.records), default=None)
    without = [one for group in left_out_groups(known) for one in group.findings]
    found = findings_in_words([one for one in known.findings if one not in without], span, figures=False)
    rest = [one for one in known.unexplained if is_felt(one)]
    idle = len(found.idle) + (len(rest) < len(known.unexplained))
    of_drive = () if result.drive is None else result.drive.diagnosis.findings
    delays = result.config.compensation  # which the line on the stamps of the fixes says
    new = (
        one
        for one in of_drive
        if not delays.value(one.cause, "delay") and not (result.choice and result.choice.settles(one.cause))
    )
    unexplained = (f"Not explained: {text}" for text in unexplained_lines(rest)[:1])
    said = [*unexplained, *found.felt, *(found_text(one, ranges=True) for one in new), *found.faults]
    return said, idle, found.doubted
