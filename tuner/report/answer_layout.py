"""How the answers of commands are laid out in a terminal: width, lines, and the table of settings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, stamp
from tuner.limits import SCREEN_LINES
from tuner.report.settings_rows import EXTRAPOLATED, SettingsRow, settings_rows, units_of
from tuner.report.terminal import COLUMN_GAP, LINE_WIDTH
from tuner.types import FilterConfig

SHORT_SPAN = 600.0
"""Time up to which a reader counts seconds, s."""
INTERVAL = "± ( ) 95 %"
"""What ± and brackets behind a setting mean."""
MIN_LEFT_OUT = 1.0
"""Time that a log is longer than what is used of it, s, from which its reader is to know."""
BOUNDED = "*: ASSUMED, half a 95 % limit (white noise: all of it)"
"""What a star behind a setting means."""

LONGER = f"{EXTRAPOLATED}: beyond the log"
"""What the mark behind a time constant means."""


def settings_table(rows: Sequence[SettingsRow]) -> Table:
    """Return the numbers of every group of axes, under the units of its sensor."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False, width=LINE_WIDTH)
    table.add_column("axes", no_wrap=True)
    for name in ("N", "bias states", "K"):
        table.add_column(name, overflow="fold")
    for unit in dict.fromkeys(row.unit for row in rows):
        white, level, walk = units_of(unit)
        table.add_row("", f"N, {white}", f"bias states, {level}", f"K, {walk}")
        for row in rows:
            if row.unit == unit:
                table.add_row(axes_text(row.axes), row.white.text, row.bias, row.walk.text)
    return table


def settings_lines(rows: Sequence[SettingsRow]) -> list[str]:
    """Return the numbers of every group of axes in one table with one head, its units as those of ``gyro|accel``."""
    units = [units_of(unit) for unit in dict.fromkeys(row.unit for row in rows)]
    white, level, walk = ("|".join(names) for names in zip(*units, strict=True))
    cells = [[axes_text(row.axes), *_numbers(row)] for row in rows]
    gap = COLUMN_GAP
    known = INTERVAL if any("±" in text or "(" in text for row in cells for text in row) else ""
    head = [
        known,
        f"N, {white}",
        f"bias sd, {level}, at s",
        f"K, {walk}" if len(units) == 1 else "K, same per √h",
    ]
    widths = [max(len(row[i]) for row in (head, *cells)) for i in range(4)]
    widths[2] = LINE_WIDTH - widths[0] - widths[1] - widths[3] - 3 * gap
    if len(f"{head[2]}; {BOUNDED}") <= widths[2] and any("*" in text for row in cells for text in row):
        head[2] += f"; {BOUNDED}"
    lines = []
    for row in (head, *cells):
        states = wrap(row[2], widths[2], break_long_words=False, break_on_hyphens=False) or [""]
        lines.append([row[0], row[1], states[0], row[3]])
        lines += [["", "", more, ""] for more in states[1:]]
    widths[2] = min(widths[2], max(len(line[2]) for line in lines))
    return [
        (" " * gap).join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]


def settings_answer(config: FilterConfig) -> list[str]:
    """Return the settings of a filter in a few lines, with what the signs among them mean."""
    table = settings_lines(settings_rows(config))
    signs = "".join(table)
    legend = [BOUNDED] if "*" in signs and BOUNDED not in table[0] else []
    legend += [LONGER] if EXTRAPOLATED in signs else []
    return [*wrapped("; ".join([f"{config.name}: settings of a filter", *legend]), 2), *table]


def _numbers(row: SettingsRow) -> list[str]:
    """Return white noise, bias states and random walk of a row; the unit of time stands in the head."""
    white = f"{row.white.text} fitted" if row.fitted else row.white.text
    return [white, row.bias.replace(" s;", ";").removesuffix(" s"), row.walk.text]


def span_text(seconds: float) -> str:
    """Return a time in hours, in seconds where it is short."""
    if seconds >= SHORT_SPAN:
        return f"{digits(seconds / 3600.0)} h"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{digits(seconds, 2)} s"


def used_part(source: Mapping[str, Any], axis: str) -> str:
    """Return which part of its log an axis rests on, where some is left out, by the source of an `Identification`."""
    for sensor in source.get("sensors", ()):
        begin, end, log = sensor.get("used_s", (0.0, 0.0, 0.0))
        if axis in sensor["axes"] and log - sensor["span_s"] > MIN_LEFT_OUT:
            parts = f" in {sensor['segments']} parts" if sensor["segments"] > 1 else ""
            return f", {stamp(begin)} to {stamp(end)} s of its clock{parts}"
    return ""


def wrapped(text: str, indent: int = 0) -> list[str]:
    """Return text in lines of a terminal, further ones indented; no word is broken."""
    return wrap(
        text, LINE_WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def filled(lines: Sequence[str], more: Sequence[str] = (), *, also: str = "") -> list[str]:
    """Return lines, of further sentences those that an answer has room for, and what `--verbose` shows beyond.

    Parameters
    ----------
    lines : sequence of str
        What is said in any case, no line wider than `LINE_WIDTH`.
    more : sequence of str, optional
        What is said, whole and in this order, until there is no room for the next; of a first one that is too long
        the beginning.
    also : str, optional
        What else `--verbose` shows.
    """
    answer, left = list(lines), list(more)
    while left and len(answer) + len(text := wrapped(left[0], 2)) < SCREEN_LINES:
        answer += text
        del left[0]
    if left and len(answer) == len(lines) and (room := SCREEN_LINES - 1 - len(lines)) > 0:
        begin = wrapped(left.pop(0), 2)[:room]
        answer += [*begin[:-1], f"{begin[-1][: LINE_WIDTH - 2]} …"]
    rest = f"{len(left)} more remark{'s' * (len(left) > 1)}" if left else ""
    said = " and ".join(part for part in (also, rest) if part) or "all tables"
    return [*answer, *wrapped(f"{said[:1].upper()}{said[1:]}: --verbose", 2)]


def assumed_text(assumptions: Sequence[str]) -> str:
    """Return what nobody stated of a log and was assumed, without what else it might be; empty for nothing."""
    parts = [re.split(r" \(|;", text)[0].replace(" assumed,", ",") for text in dict.fromkeys(assumptions)]
    return f"ASSUMED: {'; '.join(parts)}" if parts else ""
