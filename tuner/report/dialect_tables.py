"""The dialects of the exporters in a table."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from tuner.exporters import Dialect
from tuner.report.titled_table import titled_table


def dialect_tables(dialects: Mapping[str, Dialect]) -> list[Table | str]:
    """Return the dialects `tuner export` writes, with their units."""
    rows = ((name, one.title, one.units) for name, one in dialects.items())
    return [*titled_table("Dialects of tuner export", ("name", "for", "units"), rows, words=3)]
