"""Text with one reading a row, whose first cell names the sensor: loggers of phones.

``# accelerometer,timestamp,x,y,z`` above, or nothing; then ``accelerometer,61423000000000,0.1,0.2,9.8``. The cells of
a row are those that a line above with the same first cell names, else a stamp and three axes. Other rows are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.readers.column_names import parse_name, role_of, sensor_of
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.text_dialect import Dialect, is_number, open_bytes

MAX_CELLS = 32
"""Cells of a row that are looked at."""


def list_rows(path: Path, dialect: Dialect) -> Listing | None:
    """Return the columns of a text whose rows name a sensor first; None for others."""
    if dialect.separator is None or len(dialect.names) < 5:
        return None
    with open_bytes(path) as file:
        above = [file.readline().decode("utf-8", errors="replace") for _ in range(dialect.skip)]
        first = file.readline().decode("utf-8", errors="replace").split(dialect.separator)[0].strip()
        if is_number(first) or sensor_of(parse_name(first).plain) is None:
            return None
        import pandas as pd  # most texts are none of these

        file.seek(0)
        rows = pd.read_csv(
            file,
            sep=dialect.separator,
            header=None,
            names=list(range(MAX_CELLS)),
            comment="#",
            dtype=str,
            skiprows=dialect.skip,
            on_bad_lines="skip",
        )
    cells_above = (line.strip().lstrip("#%").split(dialect.separator) for line in above)
    named = {cells[0].strip(): [cell.strip() for cell in cells] for cells in cells_above}
    columns: dict[str, FloatArray] = {"t": np.full(len(rows), np.nan)}
    units: dict[str, str] = {}
    for word in rows[0].dropna().unique():
        sensor = sensor_of(parse_name(str(word).strip()).plain)
        if sensor is None or f"{sensor}_x" in columns:
            continue
        own = (rows[0] == word).to_numpy()
        for name, cell in _of_row(named.get(str(word).strip(), []), sensor).items():
            unit = parse_name(cell[1]).unit
            units |= {} if unit is None else {name: unit}
            values = columns.setdefault(name, np.full(len(rows), np.nan))
            values[own] = pd.to_numeric(rows[cell[0]][own], errors="coerce").to_numpy(float)
    kept = np.isfinite(columns["t"])
    note = "rows name their sensor: those of gyroscopes and accelerometers are read"
    return listing_of_arrays(
        path, {name: x[kept] for name, x in columns.items()}, units=units, meta={}, notes=(note,)
    )


def _of_row(names: list[str], sensor: str) -> Mapping[str, tuple[int, str]]:
    """Return the cells of time and axes of a row, and how they are named, from the names above; else those in order."""
    found = {"t": (1, ""), **{f"{sensor}_{axis}": (2 + i, "") for i, axis in enumerate("xyz")}}
    for number, name in reversed(list(enumerate(names[1:], start=1))):
        parsed = parse_name(name)
        role = role_of(parsed)
        key = f"{sensor}_{parsed.plain[-1:]}" if role is None or role[0].startswith(sensor) else role[0]
        if key in found and (key == "t" or parsed.plain[-1:] in "xyz"):
            found[key] = number, name
    return found
