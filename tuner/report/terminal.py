"""Printing of tables and lines on standard output."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from io import StringIO
from textwrap import wrap

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from tuner.limits import SCREEN_LINES
from tuner.report.document import NEXT, Document
from tuner.stages import finished

_CONTROLS = dict.fromkeys(
    {*range(32), *range(127, 160), *range(0xD800, 0xE000)} - {ord("\n")}, "\N{REPLACEMENT CHARACTER}"
)
"""Characters that a terminal would take for commands, and halves of characters, as in names that are no text."""
LINE_WIDTH = 80
"""Columns of a terminal as it opens."""
NO_BREAK = "\N{NO-BREAK SPACE}"
BEFORE_UNIT = re.compile(
    r"(?<=[\d)]) (?=(?:%|×|[cmk]?m|s|h|min|m/s|nats|k?Hz|K|°C|deg\S*|rad\S*|[µm]g\S*)(?:[\s,;:)]|$))"
)
"""The space between a number and its unit, at which no line ends."""
COLUMN_GAP = 2
"""Columns between those of a table."""


class _Console(Console):
    """A console that leaves it to the program what happens where nobody reads on."""

    def on_broken_pipe(self) -> None:
        """Raise what the operating system said."""
        raise BrokenPipeError

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield what is printed: names from outside, as of a folder, have no control characters in it."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=segment.text.translate(_CONTROLS))


def text_of(content: Document | Iterable[Table | str], width: int = LINE_WIDTH) -> str:
    """Return an answer, or tables and lines, as `show` prints them into a file."""
    if isinstance(content, Document):
        return "\n".join(fitted(content, width))
    written = StringIO()
    plain = _Console(
        file=written,
        width=width,
        highlight=False,
        markup=False,
        emoji=False,
        color_system=None,
        force_jupyter=False,
    )
    _print(plain, content, width)
    return "\n".join(line.rstrip() for line in written.getvalue().splitlines())


def fitted(answer: Document, width: int = LINE_WIDTH) -> list[str]:
    """Return the lines of an answer; of its remarks as many as `SCREEN_LINES` have room for, of a first one a part.

    Where there is no room for all parts, spare ones are shorter, or left out.
    """
    end = text_of(answer.end, width).splitlines()
    for count in range(len(answer.spare) + 1):
        begin = text_of(answer.shortened(count).parts, width).splitlines()
        if (room := SCREEN_LINES - len(begin) - len(end) - 1) >= 0:
            break
    shown: list[str] = []
    left = list(answer.remarks)
    while left and len(more := _folded(left[0], width)) <= room - len(shown):
        shown += more
        del left[0]
    if left and not shown and room > 0:
        *whole, cut = _folded(left.pop(0), width)[:room]
        shown = [*whole, f"{cut[: width - 2]} …"]
    last = answer.last_line(len(left))
    return [*begin, *shown, *end, *(_folded(last, width) if last else [])]


def show(content: Document | Iterable[Table | str], *, whole: bool = False) -> None:
    """Print an answer, as much as a screen has room for or the `whole` of it, or tables and lines.

    It is as wide as the terminal or, where it is none, as one as it opens. Lines are parted between words, further ones
    indented; of a table that is wider, columns that have no room follow beneath it, beside its first one again.
    """
    finished()
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else LINE_WIDTH
    if isinstance(content, Document):
        content = [*content.whole, *content.end] if whole else fitted(content, width)
    _print(_Console(width=width, highlight=False, markup=False, emoji=False), content, width)


def _print(console: Console, tables: Iterable[Table | str], width: int) -> None:
    """Print tables and lines on a console of that width."""
    for table in tables:
        if isinstance(table, str):
            for line in table.split("\n"):
                console.print("\n".join(_folded(line, width)), soft_wrap=True)
        else:
            for part in _parts(table, width):
                console.print(part)


def _folded(line: str, width: int) -> list[str]:
    """Return a line in as many as it needs; no word, such as a path, is broken, and a command goes on where it does."""
    if len(line) <= width:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    more = " \\" * line.startswith(NEXT)
    parts = wrap(
        BEFORE_UNIT.sub(NO_BREAK, line),
        width - len(more),
        initial_indent="",
        subsequent_indent=f"{indent}  ",
        drop_whitespace=True,
        break_long_words=False,
        break_on_hyphens=False,
    )
    *first, last = [part.replace(NO_BREAK, " ") for part in parts] or [line]
    return [*(f"{part}{more}" for part in first), last]


def _parts(table: Table, width: int) -> list[Table]:
    """Return a table without lines between its cells, in parts that are no wider than stated.

    A column that states its least width is folded down to it where the table has no room for its longest line.
    """
    cells = [[str(column.header), *map(str, column.cells)] for column in table.columns]
    needed = [max(cell_len(line) for cell in own for line in cell.split("\n")) for own in cells]
    widths = [
        min(longest, column.min_width or longest) + COLUMN_GAP
        for longest, column in zip(needed, table.columns, strict=True)
    ]
    groups = [[0]]
    for i in range(1, len(cells)):
        if len(groups[-1]) > 1 and sum(widths[k] for k in groups[-1]) + widths[i] > width + COLUMN_GAP:
            groups.append([0])
        groups[-1].append(i)
    return [_columns_of(table, cells, group, first=group is groups[0]) for group in groups]


def _columns_of(table: Table, cells: Sequence[Sequence[str]], group: Sequence[int], *, first: bool) -> Table:
    """Return some columns of a table, its title over the first of them."""
    part = Table(
        title=table.title if first else None,
        title_justify="left",
        box=None,
        padding=(0, COLUMN_GAP, 0, 0),
        pad_edge=False,
        show_header=table.show_header,
        width=table.width,
    )
    for i in group:
        column = table.columns[i]
        part.add_column(str(column.header), justify=column.justify, no_wrap=column.no_wrap, overflow="fold")
    for row in zip(*(cells[i][1:] for i in group), strict=True):
        if len(group) == len(cells) or any(row[1:]):  # of some columns only rows with something in them
            part.add_row(*row)
    return part
