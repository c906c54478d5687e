"""The answer of `identify` in ten to twenty lines of 80 columns: the noise of axes that agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table

from tuner.formats.customary_units import customary_unit, digits, pretty, symbol
from tuner.identification.identify import BY_DIAGNOSIS
from tuner.report.agreeing_rows import joined_rows
from tuner.report.alike_sentences import alike_sentences
from tuner.report.answer_layout import INTERVAL, LINE_WIDTH, settings_table, span_text, used_part, wrapped
from tuner.report.settings_rows import axes_text, settings_rows
from tuner.report.terms_rows import MAIN_TERMS, TermsRow, channel_row, single_row
from tuner.types import FilterConfig, Identification, PooledChannel

UNEQUAL_BELOW = 0.05
"""Probability below which logs are said to differ."""
MAX_WARNINGS = 2
"""Warnings in the answer: what changes what a reader does next."""


def identification_answer(
    name: str, found: Identification, settings: FilterConfig | None = None
) -> list[Table | str]:
    """Return what was found in a log, none of its lines wider than a terminal.

    Parameters
    ----------
    name : str
        Of the log.
    found : Identification
        Its noise terms.
    settings : FilterConfig, optional
        What `tune` makes of it: shown where it is not the identified terms.
    """
    channels = list(found.channels.values())
    rows = joined_rows(channel_row(channel) for channel in channels)
    answer: list[Table | str] = [
        *wrapped(f"{name}: {_recording(found)}", 2),
        terms_table([("", row) for row in rows]),
    ]
    answer += wrapped(f"{INTERVAL}; < 95 % limit; – not stated", 2)
    answer += [
        line for row in rows if row.further for line in wrapped(f"{axes_text(row.axes)}: {row.further}", 2)
    ]
    answer += _too_short(found)
    fitted = [] if settings is None else [row for row in settings_rows(settings) if row.fitted]
    if fitted:
        answer.append("The Allan curve is not the sum of these terms. `tuner tune` writes instead:")
        answer.append(settings_table(fitted))
    answer += [line for text in warning_lines(found) for line in wrapped(text, 2)]
    more = len(_warnings(found)) - MAX_WARNINGS
    rest = f"{more} more warnings, all" if more > 0 else "All"
    return [*answer, *wrapped(f"{rest} terms, bounds with reasons, means, ARMA: --verbose", 2)]


def warning_lines(found: Identification, *, short: bool = False) -> list[str]:
    """Return what limits the terms of a log, at most `MAX_WARNINGS`; `short` leaves figures and consequences out.

    What the diagnosis found stands among the findings.
    """
    texts = [text.partition(" (")[0] if short else text for text in _warnings(found)]
    return [f"Warning: {text}" for text in texts[:MAX_WARNINGS]]


def _warnings(found: Identification) -> list[str]:
    """Return the warnings of all axes, those that differ only in numbers once."""
    return alike_sentences(
        (text, one.axis)
        for one in found.channels.values()
        for text in one.warnings
        if BY_DIAGNOSIS not in text
    )


def pooled_answer(pooled: Mapping[str, PooledChannel], names: Sequence[str]) -> list[Table | str]:
    """Return what several logs of one sensor have in common, and in what they differ."""
    rows = joined_rows(
        single_row(one.axis, one.unit, [(c.name, c.value) for c in one.coefficients])
        for one in pooled.values()
        if one.mean is not None
    )
    lines: list[Table | str] = [f"{len(names)} logs pooled", terms_table([("", row) for row in rows])]
    lines += wrapped(f"{INTERVAL} of the mean over the logs; < 95 % limit", 2)
    differing: dict[str, list[str]] = {}
    for channel in pooled.values():
        for one in (*channel.coefficients, *([channel.mean] if channel.mean else [])):
            if channel.mean is not None and one.p_value < UNEQUAL_BELOW:
                differing.setdefault(symbol(one.name), []).append(channel.axis)
    text = "; ".join(f"{sign} of {axes_text(axes)}" for sign, axes in differing.items())
    verdict = (
        f"Logs differ (p < {UNEQUAL_BELOW:g}) in {text}" if text else "No coefficient differs from log to log"
    )
    return [*lines, *wrapped(f"{verdict}. Each log and the spread: --verbose", 2)]


def terms_table(rows: Sequence[tuple[str, TermsRow]]) -> Table:
    """Return N, B and K of every row, behind the name of its source, under the units of its sensor."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False, width=LINE_WIDTH)
    table.add_column("noise of", no_wrap=True)
    for name in MAIN_TERMS:
        table.add_column(symbol(name), overflow="fold")
    for unit in dict.fromkeys(row.unit for _, row in rows):
        table.add_row("", *(f"{symbol(n)}, {pretty(customary_unit(n, unit))}" for n in MAIN_TERMS))
        for name, row in rows:
            if row.unit == unit:
                label = f"{name} {axes_text(row.axes)}".strip()
                table.add_row(label, *(row.cell(one) for one in MAIN_TERMS))
    return table


def _recording(found: Identification) -> str:
    spans: dict[str, list[str]] = {}
    for c in found.channels.values():
        part = used_part(found.source, c.axis)
        text = f"{span_text(c.span)} at {digits(1.0 / c.interval)} Hz{part}, by {c.method}"
        spans.setdefault(text if c.span > 0.0 else "stated, not measured", []).append(c.axis)
    parts = [text if len(spans) == 1 else f"{text} ({axes_text(axes)})" for text, axes in spans.items()]
    assumed = found.source.get("assumptions", ())
    return "; ".join([*parts, *(["ASSUMED: " + "; ".join(map(str, assumed))] if assumed else [])])


def terms_too_short(found: Identification) -> dict[str, list[str]]:
    """Return the axes of each term, by its symbol, that a longer record would show."""
    short: dict[str, list[str]] = {}
    for channel in found.channels.values():
        for term in channel.terms:
            for field, c in term.coefficients.items():
                if c.value is None and c.reason and c.reason.startswith("record too short"):
                    short.setdefault(symbol(f"{term.name}.{field}"), []).append(channel.axis)
    return short


def _too_short(found: Identification) -> list[str]:
    """Return which terms of which axes a longer record would show; empty where none is bounded for that reason."""
    text = "; ".join(f"{sign} of {axes_text(axes)}" for sign, axes in terms_too_short(found).items())
    return wrapped(f"Too short to show {text}: `tuner plan` says how long it takes", 2) if text else []
