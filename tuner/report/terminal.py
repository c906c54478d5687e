"""Printing of tables and lines on standard output."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable

from rich.console import Console
from rich.table import Table

UNKNOWN_WIDTH = 160
"""Columns where nobody says how many, and no terminal does."""


class _Console(Console):
    """A console that leaves it to the program what happens where nobody reads on."""

    def on_broken_pipe(self) -> None:
        """Raise what the operating system said."""
        raise BrokenPipeError


def show(tables: Iterable[Table | str], width: int = UNKNOWN_WIDTH) -> None:
    """Print tables and lines on standard output, as wide as the terminal or, where it is none, as stated."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else width
    console = _Console(width=width, highlight=False, markup=False, emoji=False)
    for table in tables:
        console.print(table)
