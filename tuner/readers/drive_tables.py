"""Tables of a drive in CSV: named columns in their units, rows in order of time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from models.units import canonical_unit, unit_value
from tuner.readers.column_names import TIME, TIME_UNITS, parse_name, role_of
from tuner.readers.fixes.gps_time import common_share
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import Dialect, find_dialect
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
OTHER_NAMES: Mapping[str, tuple[str, ...]] = {
    "solution": ("fix", "gnss_fix", "quality"),
    "lat": ("latitude",),
    "lon": ("longitude", "lng"),
    "height": ("altitude", "alt"),
    "speed": ("velocity", "ground_speed"),
    "course": ("heading", "bearing", "direction"),
    "radius": ("hor_acc", "horizontal_accuracy", "accuracy", "h_acc"),
    "sd_d": ("vert_acc", "vertical_accuracy", "v_acc"),
    "sd_speed": ("speed_acc", "speed_accuracy", "s_acc"),
    "sd_course": ("heading_acc", "bearing_accuracy", "course_accuracy"),
}
"""Other names of columns."""
_OURS = {other: name for name, others in OTHER_NAMES.items() for other in others}
OF_A_PHONE = ("speed", "course", "radius", "sd_speed", "sd_course")
"""Columns in which phones give velocities over ground and accuracies."""
RADIUS_OF_68 = math.sqrt(-2.0 * math.log(1.0 - 0.68))
"""Radius that holds 68 % of the positions, as Android states accuracies, in sds of an axis (Rayleigh)."""

UNITS: Mapping[tuple[str, ...], tuple[str, ...]] = {
    ("s", "ms", "us", "ns", "min", "h"): ("t",),
    ("deg", "rad"): ("lat", "lon", "roll", "pitch", "yaw", "course", "sd_course"),
    ("m", "cm", "mm", "km", "ft"): ("height", "sd_n", "sd_e", "sd_d", "radius"),
    ("m/s", "cm/s", "mm/s", "km/h", "kn", "mph", "ft/s"): (
        "vn",
        "ve",
        "vd",
        "sd_vn",
        "sd_ve",
        "sd_vd",
        "speed",
        "sd_speed",
    ),
}
"""Units that may follow a name in brackets; without them the first holds."""
MISSTATED = ("Vertical Accuracy (°)",)
"""Headers that state no unit of the column: phyphox writes so above metres."""


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
        rows[:, 0] = _not_set_back(name, _unwrapped(name, rows[:, 0], repairs), repairs)
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


def _not_set_back(name: str, t: FloatArray, repairs: list[Repair]) -> FloatArray:
    """Return stamps of a clock that goes on where it was set back: rows go on from there at its usual step.

    Stamps of packets in another order, or that are wrong for a while, jump ahead as well, before it or behind it; a
    clock that was reset is another matter.
    """
    steps = np.diff(t)
    usual = float(np.median(steps))
    for k in np.flatnonzero(steps < -usual).tolist():
        back = usual - steps[k]
        again = np.flatnonzero(t[k + 1 :] >= t[k])
        until = k + 1 + (int(again[0]) if len(again) else len(t) - k - 1)
        begin = max(int(np.argmax(t[: k + 1] >= t[k + 1])) - 1, 0)
        ahead = max(steps[begin:k].max(initial=0.0), steps[k + 1 : until].max(initial=0.0))
        if 2 < until - k < MAX_DISORDERED_SHARE * len(t) and ahead < 0.5 * back:
            fault = f"is set back by {back:.3f} s at row {k + 2}"
            done = f"{back:.3f} s added behind it"
            repairs.append(Repair(f"clock of the {name}", fault, done, size=back, unit="s"))
            t = t + np.where(np.arange(len(t)) > k, back, 0.0)
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
    have = [_ours(name) for name in dialect.names]
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


def table_of_fixes(path: Path, begin: float, end: float) -> FloatArray:
    """Return the fixes of a CSV in the columns `GNSS_COLUMNS`, for a drive that lasts from `begin` to `end`, s.

    Phones give speed and course, and accuracies of both. What lies outside of its range stands for unknown; a speed of
    zero needs no course.
    """
    dialect = find_dialect(path)
    have = [_ours(name) for name in dialect.names]
    if not {"lat", "lon", "height"} <= set(have):
        raise DataError(f"{path}: expected columns t, lat, lon, height, found {', '.join(dialect.names)}")
    rows = table(path, (*GNSS_COLUMNS, *OF_A_PHONE), 0)
    rows, (speed, course, radius, along, across) = (
        rows[:, : len(GNSS_COLUMNS)],
        rows[:, len(GNSS_COLUMNS) :].T,
    )
    if "t" not in have:
        rows[:, 0] = _stamps(path, dialect, begin, end)
    for sds in (rows[:, 7:13], radius, along, across):
        sds[sds < 0.0] = math.nan
    course = np.where(speed == 0.0, 0.0, np.where(np.abs(course) <= 360.0, np.radians(course), math.nan))
    towards = np.column_stack([np.cos(course), np.sin(course)])
    across = np.fmax(along, speed * np.radians(across))
    for columns, values in (
        (slice(4, 6), speed[:, None] * towards),
        (slice(7, 9), np.tile(radius / RADIUS_OF_68, (2, 1)).T),
        (slice(10, 12), np.hypot(along[:, None] * towards, across[:, None] * towards[:, ::-1])),
    ):
        rows[:, columns] = np.where(np.isnan(rows[:, columns]), values, rows[:, columns])
    return rows


def _stamps(path: Path, dialect: Dialect, begin: float, end: float) -> FloatArray:
    """Return the stamps of a table, s: of its clocks and their units those that fall into the drive most."""
    found = []
    for place, name in enumerate(map(parse_name, dialect.names)):
        if name.plain.split("_")[0] in TIME or (role_of(name) or ("",))[0] == "t":
            (stamps,) = read_numbers(path, dialect, [[place]])
            stated = TIME_UNITS.get(name.unit or "")
            units = list(TIME_UNITS.values()) if stated is None else [stated]
            found += [unit * stamps[:, 0] for unit in units]
    if not found:
        raise DataError(f"{path}: expected a column of stamps, t, found {', '.join(dialect.names)}")
    return max(found, key=lambda t: common_share(t, begin, end))


def _ours(written: str) -> str:
    """Return our name of a column."""
    plain = parse_name(written).plain
    return _OURS.get(plain, plain)


def _unit(path: Path, name: str, header: str) -> float:
    """Return the size of the unit that a header states, in that which the column has without."""
    stated = parse_name(header).unit
    if stated is None or header.strip() in MISSTATED:
        return 1.0
    usual = next((units for units, columns in UNITS.items() if name in columns), ())
    try:
        unit = canonical_unit(stated)
    except ValueError:
        unit = ""
    if unit not in usual:
        raise DataError(f"{path}: column '{header.strip()}': expected one of the units {', '.join(usual)}")
    return unit_value(unit) / unit_value(usual[0])
