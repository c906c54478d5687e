"""The dialects of the exporters in a table."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from tuner.exporters import Dialect


def dialect_tables(dialects: Mapping[str, Dialect]) -> list[Table | str]:
    """Return the dialects `tuner export` writes, with their units."""
    table = Table(title="Dialects of tuner export")
    for head in ("name", "for", "units"):
        table.add_column(head)
    for name, dialect in dialects.items():
        table.add_row(name, dialect.title, dialect.units)
    return [table]
