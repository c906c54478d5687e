"""Printing of tables and lines on standard output."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Iterator

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from tuner.stages import finished

_CONTROLS = dict.fromkeys(
    {*range(32), *range(127, 160), *range(0xD800, 0xE000)} - {ord("\n")}, "\N{REPLACEMENT CHARACTER}"
)
"""Characters that a terminal would take for commands, and halves of characters, as in names that are no text."""
UNKNOWN_WIDTH = 160
"""Columns where nobody says how many, and no terminal does."""


class _Console(Console):
    """A console that leaves it to the program what happens where nobody reads on."""

    def on_broken_pipe(self) -> None:
        """Raise what the operating system said."""
        raise BrokenPipeError

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield what is printed: names from outside, as of a folder, have no control characters in it."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=segment.text.translate(_CONTROLS))


def show(tables: Iterable[Table | str], width: int = UNKNOWN_WIDTH) -> None:
    """Print tables and lines on standard output, as wide as the terminal or, where it is none, as stated."""
    finished()
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else width
    console = _Console(width=width, highlight=False, markup=False, emoji=False)
    for table in tables:
        console.print(table)
