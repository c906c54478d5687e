"""Words that several answers share, and the table of settings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, stamp
from tuner.report.document import Document, document
from tuner.report.settings_rows import EXTRAPOLATED, SettingsRow, settings_rows, units_of
from tuner.report.terminal import LINE_WIDTH
from tuner.types import FilterConfig

SHORT_SPAN = 600.0
"""Time up to which a reader counts seconds, s."""
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


def settings_answer(config: FilterConfig) -> Document:
    """Return the settings of a filter, with what the signs among them mean."""
    rows = settings_rows(config)
    table = [settings_table(rows)] if rows else []
    return document([f"{config.name}: settings of a filter", *table, "; ".join(marks_of(config))])


def marks_of(config: FilterConfig) -> list[str]:
    """Return what the marks among the settings of a configuration mean, those that occur."""
    cells = "".join(f"{row.white.text}{row.bias}{row.walk.text}" for row in settings_rows(config))
    return [text for sign, text in ((BOUNDED[0], BOUNDED), (EXTRAPOLATED, LONGER)) if sign in cells]


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


def assumed_text(assumptions: Sequence[str]) -> str:
    """Return what nobody stated of a log and was assumed, without what else it might be; empty for nothing."""
    parts = [re.split(r" \(|;", text)[0].replace(" assumed,", ",") for text in dict.fromkeys(assumptions)]
    return f"ASSUMED: {'; '.join(parts)}" if parts else ""
