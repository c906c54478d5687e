"""The answer of `tune` in ten lines of 80 columns where axes agree: verdict, numbers, what matters most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from tuner.formats.customary_units import digits
from tuner.identification.comparison import compare_identifications, limit_checks
from tuner.report.answer_layout import settings_table, wrapped
from tuner.report.comparison_tables import limit_text
from tuner.report.drive_answer import choice_lines, finding_lines
from tuner.report.finding_groups import contradicted, drift_text, finding_groups
from tuner.report.settings_rows import SettingsRow, axes_text, settings_rows
from tuner.report.static_diagnosis_tables import hidden_effect_lines
from tuner.report.verdict_text import verdict_text
from tuner.synthesis.findings import judge_hidden

if TYPE_CHECKING:
    from tuner.pipeline import TuneResult
    from tuner.types.consistency import Verdict

WITHOUT_RECEIVER = "name a receiver (--gnss GRADE)"
"""Words of the reason where a check lacks only the receiver."""
SHOWN_FINDINGS = 2
"""Findings in the answer: what a reader acts on first."""
SHORT_SPAN = 600.0
"""Time up to which a reader counts seconds, s."""
HALF_LIMIT = "*: half of a 95 % limit"
NO_INTERVAL = "no ±: fitted to the Allan curve, or set"


def answer_lines(result: TuneResult, directory: Path) -> list[Table | str]:
    """Return the answer, none of its lines wider than `LINE_WIDTH` and nothing left out of any of them.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    directory : Path
        Where its files are.
    """
    rows = settings_rows(result.config)
    numbers: list[Table | str] = [settings_table(rows)] if rows else []
    return [
        *wrapped(verdict_line(result)),
        *wrapped(recording_line(result), 2),
        *numbers,
        *wrapped(legend(rows), 2),
        *(line for text in against_datasheet(result) for line in wrapped(text, 2)),
        *(line for text in what_matters(result) for line in wrapped(text, 2)),
        *([] if result.choice is None else choice_lines(result.choice)),
        *(line for text in hidden_lines(result) for line in wrapped(text, 2)),
        *(line for text in _absent_lines(result) for line in wrapped(text, 2)),
        *wrapped(f"{_page(result)}: {directory / 'report.html'} (tables here: --verbose)", 2),
    ]


def verdict_line(result: TuneResult) -> str:
    """Return whether the filter is as uncertain as it says, and whether its settings predict the log."""
    from tuner.pipeline import CHECK_RUNS  # loaded when used: it imports every room

    parts = []
    if result.check is None:
        parts.append(
            f"Not checked: {WITHOUT_RECEIVER}" if _no_receiver(result) else "The filter is not checked"
        )
    elif result.check.consistency.consistent:
        parts.append(f"Consistent within 10 % ({CHECK_RUNS} simulated hours)")
    else:
        parts.append("NOT consistent" + _why_not(result.check.consistency.verdicts))
    failed = [axis for axis, found in result.predictions.items() if not found.passes]
    if failed:
        parts.append(f"does NOT predict the log in {axes_text(failed)}")
    elif result.predictions:
        parts.append("predicts the log on every axis")
    return "; ".join(parts) + "."


def _why_not(verdicts: Sequence[Verdict]) -> str:
    """Return the first verdict with its likeliest explanation, and how many others the page shows."""
    if not verdicts:
        return ""
    first = verdicts[0]
    text = f": {verdict_text(replace(first, explanations=first.explanations[:1]))}"
    others = len(first.explanations) - 1
    return f"{text} ({others} more on the page explain them as well)" if others > 0 else text


def recording_line(result: TuneResult) -> str:
    """Return length and rate of what the numbers rest on, and what was assumed of it; of a drive alone, its rest."""
    spans: dict[str, list[str]] = {}
    rest = " at rest in the drive" if result.drive is not None and not result.records else ""
    for channel in result.identification.channels.values():
        if channel.span > 0.0:
            text = f"{_span_text(channel.span)}{rest} at {digits(1.0 / channel.interval)} Hz"
            spans.setdefault(text, []).append(channel.axis)
    lengths = [text if len(spans) == 1 else f"{text} ({axes_text(axes)})" for text, axes in spans.items()]
    assumed = assumptions(result)
    units = f"ASSUMED: {'; '.join(assumed)}" if assumed else "units stated, none assumed"
    if result.key is not None:
        units = "simulated in SI units"
    return "; ".join([", ".join([result.name, *lengths]), *([units] if result.records else [])])


def _span_text(seconds: float) -> str:
    """Return a time in hours, in seconds where it is short."""
    return f"{digits(seconds / 3600.0)} h" if seconds >= SHORT_SPAN else f"{seconds:.0f} s"


def assumptions(result: TuneResult) -> tuple[str, ...]:
    """Return what nobody stated of the log and was assumed."""
    return tuple(str(text) for text in result.identification.source.get("assumptions", ()))


def legend(rows: Sequence[SettingsRow]) -> str:
    """Return what the marks of a table of settings mean, those that occur."""
    settings = [one for row in rows for one in (row.white, row.walk, *(sd for sd, _ in row.states))]
    texts = [one.text for one in settings if any(one.used)]
    parts = ["± 95 %"] if any("±" in text for text in texts) else []
    parts += [HALF_LIMIT] if any("*" in text for text in texts) else []
    parts += [NO_INTERVAL] if any("±" not in text and "*" not in text for text in texts) else []
    return "; ".join(parts)


def against_datasheet(result: TuneResult) -> list[str]:
    """Return whether the unit keeps its data sheet, where one was given."""
    if result.datasheet is None:
        return []
    names = (result.name, str(result.datasheet.source.get("name", "its data sheet")))
    found = compare_identifications(names, (result.identification, result.datasheet))
    return [limit_text(one) for one in limit_checks(found)]


def what_matters(result: TuneResult) -> list[str]:
    """Return the findings that change most, in words of what they do; or that there are none."""
    lines: list[str] = []
    if result.diagnosis is not None:
        span = max((record.span for record in result.records), default=None)
        groups = finding_groups([one for one in result.diagnosis.findings if not contradicted(one)], span)
        for group in [group for group in groups if group.matters][:SHOWN_FINDINGS]:
            parts = [drift_text(_most_moved(group.drift)), f"changes {_entry(group.changes)}"]
            title = group.short[:1].upper() + group.short[1:]
            lines.append(f"{title}: " + "; ".join(part for part in parts if part))
        if groups and not lines:
            lines.append(f"No finding moves the position: {len(groups)} on the page")
        if not groups:
            lines.append("Found nothing that the noise terms do not explain")
    if result.drive is not None:
        lines += finding_lines(result.drive.diagnosis.findings, result.choice)
    return lines


def _most_moved(drift: Mapping[str, tuple[float, float]]) -> Mapping[str, tuple[float, float]]:
    """Return the time after which a finding moves the position most; the page has all of them."""
    most = max(drift, key=lambda name: drift[name][0] / max(drift[name][1], 1e-9), default=None)
    return {} if most is None else {most: drift[most]}


def _entry(changes: str) -> str:
    """Return the changed entry without what is said of how it changes."""
    return changes.partition(",")[0].partition(":")[0]


def _page(result: TuneResult) -> str:
    """Return what the page has beyond the answer."""
    found = result.diagnosis
    if found is None:
        return "Page"
    groups = finding_groups([one for one in found.findings if not contradicted(one)])
    shown = min(SHOWN_FINDINGS, sum(group.matters for group in groups))
    more = [f"{len(groups) - shown} more findings"] if len(groups) > shown > 0 else []
    axes = dict.fromkeys(axis for one in found.unexplained for axis in one.channels)
    more += [f"unexplained misfits of {axes_text(list(axes))}"] if axes else []
    return f"Page with {', '.join(more)}" if more else "Page"


def _no_receiver(result: TuneResult) -> bool:
    return WITHOUT_RECEIVER in result.absent.get("consistency", "")


def _absent_lines(result: TuneResult) -> list[str]:
    """Return what could not be done and why, other than what the verdict says already."""
    return [
        f"No {part}: {reason}"
        for part, reason in result.absent.items()
        if not (part == "consistency" and _no_receiver(result))
    ]


def hidden_lines(result: TuneResult) -> list[str]:
    """Return what was hidden in a simulated log and whether it was found."""
    if result.key is None or result.diagnosis is None:
        return []
    return [line.strip() for line in hidden_effect_lines(judge_hidden(result.key, result.diagnosis))]
