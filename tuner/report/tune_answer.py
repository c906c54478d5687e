"""The answer of `tune` in ten to fifteen lines of 80 columns: verdict, numbers, what matters most."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from tuner.formats.customary_units import digits
from tuner.report.answer_layout import settings_table, wrapped
from tuner.report.finding_groups import contradicted, drift_text, finding_groups
from tuner.report.settings_rows import SettingsRow, axes_text, settings_rows
from tuner.report.static_diagnosis_tables import hidden_effect_lines
from tuner.report.verdict_text import verdict_text
from tuner.synthesis.findings import judge_hidden

if TYPE_CHECKING:
    from tuner.pipeline import TuneResult

SHOWN_FINDINGS = 2
"""Findings in the answer: what a reader acts on first."""
HALF_LIMIT = "* only bounded: half of the 95 % limit"
NO_INTERVAL = "without ±: fitted to the Allan curve, or set"


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
        *wrapped(f"Log: {recording_line(result)}"),
        *numbers,
        *wrapped(legend(rows), 2),
        *(line for text in what_matters(result) for line in wrapped(text, 2)),
        *(line for text in hidden_lines(result) for line in wrapped(text, 2)),
        *(line for part, reason in result.absent.items() for line in wrapped(f"No {part}: {reason}", 2)),
        *wrapped(f"Page: {directory / 'report.html'}; noise.yaml beside it; all tables: --verbose", 2),
    ]


def verdict_line(result: TuneResult) -> str:
    """Return whether the filter is as uncertain as it says, and whether its settings predict the log."""
    from tuner.pipeline import CHECK_RUNS  # loaded when used: it imports every room

    parts = []
    if result.check is None:
        parts.append("The filter is not checked")
    elif result.check.consistency.consistent:
        parts.append(f"Consistent within 10 % ({CHECK_RUNS} simulated hours)")
    else:
        first = next(iter(result.check.consistency.verdicts), None)
        parts.append("NOT consistent" + ("" if first is None else f": {verdict_text(first)}"))
    failed = [axis for axis, found in result.predictions.items() if not found.passes]
    if failed:
        parts.append(f"does NOT predict the log in {axes_text(failed)}")
    elif result.predictions:
        parts.append("predicts the log on every axis")
    return "; ".join(parts) + "."


def recording_line(result: TuneResult) -> str:
    """Return length and rate of what the numbers rest on, and what was assumed of it."""
    spans: dict[str, list[str]] = {}
    for channel in result.identification.channels.values():
        if channel.span > 0.0:
            text = f"{digits(channel.span / 3600.0)} h at {digits(1.0 / channel.interval)} Hz"
            spans.setdefault(text, []).append(channel.axis)
    lengths = [text if len(spans) == 1 else f"{text} ({axes_text(axes)})" for text, axes in spans.items()]
    assumed = assumptions(result)
    units = f"ASSUMED: {'; '.join(assumed)}" if assumed else "units stated, none assumed"
    if result.key is not None:
        units = "simulated in SI units"
    return "; ".join([", ".join([result.name, *lengths]), *([units] if result.records else [])])


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


def what_matters(result: TuneResult) -> list[str]:
    """Return the findings that change most, in words of what they do; or that there are none."""
    lines: list[str] = []
    if result.diagnosis is not None:
        span = max((record.span for record in result.records), default=None)
        groups = finding_groups([one for one in result.diagnosis.findings if not contradicted(one)], span)
        for group in groups[:SHOWN_FINDINGS]:
            parts = [drift_text(group.drift), f"changes {group.changes}"]
            title = group.short[:1].upper() + group.short[1:]
            lines.append(f"{title}: " + "; ".join(part for part in parts if part))
        if more := len(groups) - SHOWN_FINDINGS:
            lines += [f"and {more} more on the page"] if more > 0 else []
        if not groups:
            lines.append("Found nothing that the noise terms do not explain")
        if result.diagnosis.unexplained:
            axes = dict.fromkeys(a for one in result.diagnosis.unexplained for a in one.channels)
            lines.append(f"Unexplained misfit in {axes_text(list(axes))}: see the page")
    if result.drive is not None:
        found = result.drive.diagnosis
        lines += [
            f"On the drive: {one.text} → {one.consequence}" for one in found.findings[:SHOWN_FINDINGS]
        ] or ["On the drive: nothing found that the filter does not expect"]
    if result.choice is not None:
        lines.append(f"After the drive: {result.choice.note}")
    return lines


def hidden_lines(result: TuneResult) -> list[str]:
    """Return what was hidden in a simulated log and whether it was found."""
    if result.key is None or result.diagnosis is None:
        return []
    return [line.strip() for line in hidden_effect_lines(judge_hidden(result.key, result.diagnosis))]
