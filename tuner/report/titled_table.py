"""A table from its heads and its rows: how every part of a result with one row for each thing is shown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.table import Table


def table_of(
    heads: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", words: int = 1
) -> Table:
    """Return the table of some rows.

    The first columns, as many as `words`, stand at the left, those of numbers at the right.
    """
    table = Table(title=title or None)
    for place, head in enumerate(heads):
        table.add_column(head, justify="left" if place < words else "right")
    for row in rows:
        table.add_row(*row)
    return table


def titled_table(
    title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 1
) -> list[Table]:
    """Return the table of some rows in a list; without rows there is none."""
    table = table_of(heads, rows, title=title, words=words)
    return [table] if table.rows else []
