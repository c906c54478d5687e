"""Tables of a drive in CSV: named columns in their units, rows in order of time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from models.units import canonical_unit, unit_value
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types.records import DataError
from tuner.types.repair import Repair

MAX_UNREADABLE_SHARE = 0.01
"""Share of unreadable rows above which a stream is refused."""

MAX_DISORDERED_SHARE = 0.10
"""Share of rows behind an earlier stamp above which a clock was reset; fewer are sorted."""

PERIODS: Mapping[float, str] = {604800.0: "a GPS week", 86400.0: "a day", 2.0**32 * 1e-6: "2³² µs"}
"""Times after which clocks begin anew, s."""
MAX_PAUSE = 60.0
"""Pause while a clock begins anew, beside the usual step, s."""

GNSS_COLUMNS = (
    "t",
    "lat",
    "lon",
    "height",
    "vn",
    "ve",
    "vd",
    "sd_n",
    "sd_e",
    "sd_d",
    "sd_vn",
    "sd_ve",
    "sd_vd",
    "solution",
)
OTHER_NAMES: Mapping[str, str] = {"fix": "solution", "gnss_fix": "solution", "quality": "solution"}
"""Other names of columns."""

UNITS: Mapping[tuple[str, ...], tuple[str, ...]] = {
    ("s", "ms", "us", "ns", "min", "h"): ("t",),
    ("deg", "rad"): ("lat", "lon", "roll", "pitch", "yaw"),
    ("m", "cm", "mm", "km", "ft"): ("height", "sd_n", "sd_e", "sd_d"),
    ("m/s", "cm/s", "mm/s", "km/h", "kn", "mph", "ft/s"): ("vn", "ve", "vd", "sd_vn", "sd_ve", "sd_vd"),
}
"""Units that may follow a name in brackets; without them the first holds."""


def ordered(
    path: Path,
    name: str,
    rows: FloatArray,
    needed: FloatArray,
    notes: list[str],
    repairs: list[Repair] | None = None,
) -> FloatArray:
    """Return rows in order of time, without doubled stamps and without those that lack a needed number.

    Where `repairs` are kept, a clock that began anew at the end of its period goes on, and stamps without the fractions
    of their unit are spread over it.
    """
    if not len(rows):
        raise DataError(f"{path}: {name}: no rows")
    good = np.isfinite(needed).all(axis=1)
    bad = int(np.count_nonzero(~good))
    if bad > MAX_UNREADABLE_SHARE * len(rows) or bad == len(rows):
        raise DataError(f"{path}: {name}: {bad} of {len(rows)} rows are not numbers; at most 1 % may be")
    if bad:
        notes.append(f"{bad} unreadable {name} rows removed")
    rows = rows[good]
    if repairs is not None:
        rows[:, 0] = _unwrapped(name, rows[:, 0], repairs)
    behind = np.flatnonzero(rows[:, 0] < np.maximum.accumulate(rows[:, 0]))
    if len(behind) > MAX_DISORDERED_SHARE * len(rows):
        raise DataError(
            f"{path}: {name}: time runs backwards at row {behind[0] + 1} and stays behind for {len(behind)} of "
            f"{len(rows)} rows (a clock that was reset?): split the drive there"
        )
    if len(behind):
        notes.append(f"{len(behind)} {name} rows out of order sorted")
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
    if repairs is not None:
        rows[:, 0] = _spread(name, rows, repairs)
    fresh = np.concatenate([[True], np.diff(rows[:, 0]) > 0.0])
    if not fresh.all():
        notes.append(f"{np.count_nonzero(~fresh)} {name} rows with a doubled stamp removed")
    return np.asarray(rows[fresh])


def _unwrapped(name: str, t: FloatArray, repairs: list[Repair]) -> FloatArray:
    """Return stamps of a clock that goes on where it began anew, by one of the periods that clocks have."""
    steps = np.diff(t)
    pause = MAX_PAUSE + float(np.median(steps))
    for period, what in PERIODS.items():
        anew = (steps < 0.0) & (np.abs(steps + period) < pause)
        if anew.any():
            row = int(np.argmax(anew)) + 2
            fault = f"begins anew after {what}, {period:.10g} s, at row {row}"
            done = f"{period:.10g} s added behind it"
            repairs.append(Repair(f"clock of the {name}", fault, done, size=period, unit="s"))
            return np.asarray(t + period * np.append(0.0, np.cumsum(anew)))
    return t


def _spread(name: str, rows: FloatArray, repairs: list[Repair]) -> FloatArray:
    """Return stamps, those that several different rows share spread evenly up to the next where most are shared."""
    stamps, first, count = np.unique(rows[:, 0], return_index=True, return_counts=True)
    many = int(np.median(count))
    alike = np.all(np.diff(rows[:, 1:4], axis=0) == 0.0, axis=1) & (np.diff(rows[:, 0]) == 0.0)
    if many < 2 or np.count_nonzero(alike) > 0.5 * np.count_nonzero(np.diff(rows[:, 0]) == 0.0):
        return rows[:, 0]
    unit = float(np.median(np.diff(stamps)))
    number = np.arange(len(rows)) - np.repeat(first, count)
    repairs.append(
        Repair(
            f"stamps of the {name}",
            f"are cut to {'whole seconds' if abs(unit - 1.0) < 1e-3 else f'{unit:.3g} s'}: {many} rows share each",
            f"rows spread {unit / many:.3g} s apart",
            size=unit,
            unit="s",
        )
    )
    return rows[:, 0] + number * (unit / np.repeat(np.maximum(count, many), count))


def table(path: Path, names: tuple[str, ...], needed: int) -> FloatArray:
    """Return the named columns of a CSV, NaN for absent ones; the first `needed` must be there."""
    dialect = find_dialect(path)
    have = [name.split("[")[0].strip().lower() for name in dialect.names]
    have = [OTHER_NAMES.get(name, name) for name in have]
    missing = [name for name in names[:needed] if name not in have]
    if missing:
        raise DataError(f"{path}: expected columns {', '.join(names)}, {', '.join(missing)} missing")
    present = [name for name in names if name in have]
    factors = {name: _unit(path, name, dialect.names[have.index(name)]) for name in present}
    (numbers,) = read_numbers(path, dialect, [[have.index(name) for name in present]])
    rows = np.full((len(numbers), len(names)), math.nan)
    for j, name in enumerate(present):
        rows[:, names.index(name)] = factors[name] * numbers[:, j]
    return rows


def _unit(path: Path, name: str, header: str) -> float:
    """Return the size of the unit in brackets behind a name, in that which the column has without."""
    _, bracket, stated = header.partition("[")
    if not bracket:
        return 1.0
    usual = next(units for units, columns in UNITS.items() if name in columns)
    try:
        unit = canonical_unit(stated.strip(" ]"))
    except ValueError:
        unit = ""
    if unit not in usual:
        raise DataError(f"{path}: column '{header.strip()}': expected one of the units {', '.join(usual)}")
    return unit_value(unit) / unit_value(usual[0])
