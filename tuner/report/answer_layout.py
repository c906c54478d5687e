"""How the answers of commands are laid out in a terminal: width, lines, and the table of settings."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from rich.table import Table

from tuner.report.settings_rows import SettingsRow, axes_text, units_of

LINE_WIDTH = 80
"""Columns of a terminal as it opens."""


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


def wrapped(text: str, indent: int = 0) -> list[str]:
    """Return text in lines of a terminal, further ones indented; no word is broken."""
    return wrap(
        text, LINE_WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
