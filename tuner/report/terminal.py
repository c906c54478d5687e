"""Printing of tables and lines on standard output."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable

from rich.console import Console
from rich.table import Table


def show(tables: Iterable[Table | str]) -> None:
    """Print tables and lines on standard output, wide enough when it is not a terminal."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 160
    console = Console(width=width, highlight=False, markup=False, emoji=False)
    for table in tables:
        console.print(table)
