"""Text that Waypoint's GrafNav and Inertial Explorer export: a solution with the columns that its profile chose.

A block of settings (``Project:``, ``Program:``, ``Source:``; absent where the profile says so), a line of names, one
of units, rows. Names and units stand one under the other with their right ends alike; a column such as Q has no unit.
Latitudes in ``(+/-D M S)`` take three cells. Attitudes are those of a vehicle: roll to the right, pitch up, heading
clockwise from north; velocities of the body (``VelBdyX`` …) are along right, forward, up.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import llh_from_ecef, mat_en
from models.units import canonical_unit, unit_value
from tuner.readers.fixes.gps_time import (
    GPS_EPOCH,
    SECONDS_A_DAY,
    SECONDS_A_WEEK,
    UNIX_OF_GPS_EPOCH,
    GpsFixes,
    leap_seconds,
)
from tuner.types.records import DataError

HEAD_LINES = 80
"""Lines in which the names must stand: settings with many masters take some forty."""
MAX_LEFT_OUT_SHARE = 0.01
"""Share of rows with too many cells above which a file is refused."""
TIME_NAMES = ("gpstime", "corrtime", "gpscorrtime", "utctime", "time")
"""Names of the column of time, the preferred first."""
_NAMES = {
    "latitude": "lat", "longitude": "lon", "hell": "height", "hmsl": "height_msl",
    "xecef": "x", "yecef": "y", "zecef": "z",
    "vnorth": "vn", "veast": "ve", "vup": "vu",
    "vxecef": "vx", "vyecef": "vy", "vzecef": "vz",
    "velbdyx": "v_right", "velbdyy": "v_forward", "velbdyz": "v_up",
    "roll": "roll", "pitch": "pitch", "heading": "yaw", "azimuth": "azimuth",
    "sdnorth": "sd_n", "sdeast": "sd_e", "sdheight": "sd_d", "sdheigh": "sd_d", "sdhoriz": "sd_horizontal",
    "sdvn": "sd_vn", "sdve": "sd_ve", "sdvh": "sd_vd", "sdvu": "sd_vd",
    "rollsd": "sd_roll", "pitchsd": "sd_pitch", "hdngsd": "sd_yaw", "headingsd": "sd_yaw", "azstdev": "sd_yaw",
}  # fmt: skip
"""Names of Waypoint without signs, and ours."""
_SCALED = {"position": ("sd_n", "sd_e", "sd_d"), "velocity": ("sd_vn", "sd_ve", "sd_vd"),
           "attitude": ("sd_roll", "sd_pitch", "sd_yaw")}  # fmt: skip
COLUMNS = ("lat", "lon", "height", "vn", "ve", "vd", "roll", "pitch", "yaw",
           "sd_n", "sd_e", "sd_d", "sd_vn", "sd_ve", "sd_vd", "sd_roll", "sd_pitch", "sd_yaw")  # fmt: skip
"""Columns of a solution; angles in deg, m, m/s; NaN where the export has none."""


@dataclass(frozen=True)
class WaypointHeader:
    """What stands above the rows.

    Attributes
    ----------
    first : int
        Number of lines above the rows.
    names, units : tuple of str
        Names as written, and the unit under each without brackets, empty where there is none.
    separator : str or None
        ``,`` or ``;`` or a tab; None for blanks.
    scales : tuple of (str, float)
        Factors by which sds of position, velocity, attitude were enlarged on export, other than 1.
    """

    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    separator: str | None
    scales: tuple[tuple[str, float], ...]

    @property
    def integrated(self) -> bool:
        """Whether it is a solution with attitude, which an inertial unit took part in."""
        return {"roll", "pitch"} <= {_key(name) for name in self.names}


def waypoint_header(path: Path) -> WaypointHeader | None:
    """Return the header of a text file of Waypoint; None for other files."""
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line.rstrip("\r\n") for _, line in zip(range(HEAD_LINES), file, strict=False)]
    for number, (line, under) in enumerate(itertools.pairwise(lines)):
        separator = next((s for s in (",", ";", "\t") if s in line), None)
        names = [
            m
            for m in re.finditer(r"\S+" if separator is None else rf"[^{separator}]+", line)
            if m.group().strip()
        ]
        keys = {_key(m.group()) for m in names}
        if "(" in under and keys & set(TIME_NAMES) and keys & {"latitude", "xecef", "northing"}:
            units = _units(names, under, separator)
            plain = tuple(m.group().strip() for m in names)
            return WaypointHeader(number + 2, plain, units, separator, _scales(lines[:number]))
    return None


def _units(names: list[re.Match[str]], under: str, separator: str | None) -> tuple[str, ...]:
    """Return the unit below each name: by order where each has one, else by the nearest right end."""
    if separator is not None:
        cells = [cell.strip().strip("()") for cell in under.split(separator)]
        return tuple(cells[j] if j < len(cells) else "" for j in range(len(names)))
    found = list(re.finditer(r"\([^)]*\)|\S+", under))
    if len(found) == len(names):
        return tuple(m.group().strip("()") for m in found)
    units = [""] * len(names)
    for m in found:
        units[min(range(len(names)), key=lambda j: abs(names[j].end() - m.end()))] = m.group().strip("()")
    return tuple(units)


def _scales(lines: list[str]) -> tuple[tuple[str, float], ...]:
    """Return the factors of the sds other than 1, as the settings state them."""
    begin = next((i for i, line in enumerate(lines) if "scaling settings" in line.lower()), len(lines))
    stated = re.compile(r"\s*(Position|Velocity|Attitude):\s*([\d.]+)\s*(?:$|\()")
    found = (stated.match(line) for line in lines[begin:])
    factors = ((one.group(1).lower(), float(one.group(2))) for one in found if one)
    return tuple((what, factor) for what, factor in factors if factor not in (0.0, 1.0))


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def read_waypoint(path: Path) -> GpsFixes:
    """Return the solution in a text file of Waypoint, its rows in `COLUMNS`.

    Raises
    ------
    DataError
        What is no such file, lacks positions or time, or has rows that do not fit its names.
    """
    header = waypoint_header(path)
    if header is None:
        raise DataError(
            f"{path}: expected an export of Inertial Explorer or GrafNav with a line of names (GPSTime, Latitude, …) "
            f"and one of units below it, found none in the first {HEAD_LINES} lines; let its profile write both"
        )
    cells = _Cells(path, header)
    notes: list[str] = []
    if cells.left_out:
        notes.append(f"{path.name}: {cells.left_out} rows with more numbers than names left out")
    t, dated = _time(path, cells)
    rows = _rows(path, cells, notes)
    return GpsFixes(t, rows, tuple(notes), dated)


class _Cells:
    """The rows of a file as columns, by the key of their name."""

    def __init__(self, path: Path, header: WaypointHeader) -> None:
        import pandas as pd

        widths = [
            len(unit.split()) if re.fullmatch(r"[+/-]*[DH] M( S)?", unit) else 1 for unit in header.units
        ]
        if header.separator is not None:
            widths = [1] * len(widths)
        with path.open(encoding="utf-8", errors="replace") as file:
            rows = (line for number, line in enumerate(file) if number >= header.first and line.strip())
            first = next(rows, "")
            count = 1 + sum(1 for _ in rows)
        found = len(first.split(header.separator)) if header.separator else len(first.split())
        if found != sum(widths):
            raise DataError(
                f"{path}:{header.first + 1}: expected {sum(widths)} numbers a row below {len(widths)} names, found "
                f"{found}: leave columns that can be empty out of the export profile"
            )
        begins = np.concatenate([[0], np.cumsum(widths)])
        self.at: dict[str, slice] = {}
        self.unit: dict[str, str] = {}
        for name, unit, begin, width in zip(header.names, header.units, begins, widths, strict=False):
            self.at.setdefault(_key(name), slice(int(begin), int(begin) + width))
            self.unit.setdefault(_key(name), unit)
        self.header = header
        self.table = pd.read_csv(
            path, sep=header.separator or r"\s+", header=None, names=list(range(sum(widths))), dtype=str,
            skiprows=header.first, encoding="utf-8", encoding_errors="replace", on_bad_lines="skip", index_col=False,
        )  # fmt: skip
        # Rows with more cells than names are left out by the library, footers such as these have few.
        self.left_out = count - len(self.table)
        if self.left_out > MAX_LEFT_OUT_SHARE * count:
            raise DataError(
                f"{path}: expected {sum(widths)} numbers a row, found {self.left_out} of {count} with more; mend them"
            )

    def text(self, key: str) -> list[NDArray[np.str_]]:
        """Return the cells of a column as text."""
        part = self.at[key]
        return [
            self.table[j].fillna("").str.strip().to_numpy(dtype=str) for j in range(part.start, part.stop)
        ]

    def numbers(self, key: str) -> FloatArray:
        """Return a column as numbers, angles in parts as deg; NaN where a cell is none."""
        import pandas as pd

        parts = self.text(key)
        if len(parts) == 1 and re.search("[DH] ?-?M", self.unit[key]):
            split = (
                pd.Series(parts[0]).str.split(r"[\s:]+", expand=True).reindex(columns=range(3)).fillna("0")
            )
            parts = [split[j].to_numpy(dtype=str) for j in range(3)]
        values = [np.asarray(pd.to_numeric(pd.Series(p), errors="coerce"), dtype=float) for p in parts]
        if len(values) == 1:
            return values[0]
        sign = np.where(np.char.startswith(parts[0], "-"), -1.0, 1.0)
        size = sum(np.abs(v) / 60.0**k for k, v in enumerate(values))
        return np.asarray(sign * size)


def _time(path: Path, cells: _Cells) -> tuple[FloatArray, bool]:
    """Return GPS time, s, and whether it counts from 1980."""

    def usable(key: str) -> bool:
        # UTCTime is a clock time or counts from 1970: else its beginning is unknown
        stated = key != "utctime" or "H" in cells.unit[key].upper()
        return stated or float(np.nanmin(cells.numbers(key))) > 1e9

    key = next((k for k in TIME_NAMES if k in cells.at and usable(k)), None)
    if key is None:
        raise DataError(
            f"{path}: expected a column GPSTime, s of the week, found {' '.join(cells.header.names)[:80]}"
        )
    clock = "H" in cells.unit[key].upper() and "M" in cells.unit[key].upper()
    seconds = 3600.0 * cells.numbers(key) if clock else cells.numbers(key)
    day = next((k for k in ("date", "gpsdate", "utcdate") if k in cells.at), None)
    dates = None if day is None else _days(path, cells, day)
    if clock and dates is None:
        raise DataError(
            f"{path}: expected a column Date beside {key} in hours, minutes, seconds; add it to the profile"
        )
    if clock and dates is not None:
        t = dates * SECONDS_A_DAY + seconds
    elif key == "utctime":
        t = seconds - UNIX_OF_GPS_EPOCH
    elif "week" in cells.at:
        return np.round(cells.numbers("week")) * SECONDS_A_WEEK + seconds, True
    else:  # within one export the count begins anew at the end of the week
        begun = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -0.5 * SECONDS_A_WEEK)
        week = 0.0 if dates is None else float(np.floor(np.nanmin(dates) / 7.0))
        return seconds + SECONDS_A_WEEK * begun + SECONDS_A_WEEK * week, dates is not None
    if key == "utctime":
        t = t + leap_seconds(datetime.fromtimestamp(float(np.nanmin(t)) + UNIX_OF_GPS_EPOCH, tz=UTC))
    return t, True


def _days(path: Path, cells: _Cells, key: str) -> FloatArray:
    """Return days since the beginning of GPS time, of dates whose unit says in which order their parts stand."""
    order = re.sub("[^DMY]", "", cells.unit[key].upper())
    (written,) = cells.text(key)
    days: dict[str, float] = {}
    for one in np.unique(written):
        try:
            parts = dict(zip(order, (int(x) for x in re.split(r"[/.\-]", one)), strict=True))
            when = datetime(
                parts["Y"] + (2000 if parts["Y"] < 100 else 0), parts["M"], parts["D"], tzinfo=UTC
            )
        except (ValueError, KeyError):
            days[one] = np.nan
        else:
            days[one] = (when - GPS_EPOCH).days
    if np.isnan(list(days.values())).all():
        raise DataError(f"{path}: expected dates as ({order or 'MDY'}) in column {key}, found '{written[0]}'")
    return np.array([days[one] for one in written])


def _rows(path: Path, cells: _Cells, notes: list[str]) -> FloatArray:
    found: dict[str, FloatArray] = {}
    for key in cells.at:
        name = _NAMES.get(key)
        if name is not None and name not in found:
            found[name] = cells.numbers(key) * _factor(path, name, cells.unit[key])
    if "height" not in found and "height_msl" in found:
        found["height"] = found["height_msl"]
        notes.append(f"{path.name}: heights are above the geoid (H-MSL): off by its undulation")
    if not {"lat", "lon", "height"} <= found.keys() and {"x", "y", "z"} <= found.keys():
        llh = llh_from_ecef(np.column_stack([found["x"], found["y"], found["z"]]))
        found |= {"lat": np.degrees(llh[:, 0]), "lon": np.degrees(llh[:, 1]), "height": llh[:, 2]}
    if not {"lat", "lon", "height"} <= found.keys():
        names = " ".join(cells.header.names)[:80]
        raise DataError(
            f"{path}: expected Latitude, Longitude, H-Ell, found {names}; add them to the profile"
        )
    found.setdefault("yaw", found.get("azimuth", np.full(len(cells.table), np.nan)))
    _velocity(found)
    if "sd_horizontal" in found and "sd_n" not in found:
        found["sd_n"] = found["sd_e"] = found["sd_horizontal"] / np.sqrt(2.0)
    for what, factor in cells.header.scales:
        for name in _SCALED[what]:
            if name in found:
                found[name] = found[name] / factor
        notes.append(f"{path.name}: sds of {what} divided by {factor:g}, by which the export enlarged them")
    short = int(np.count_nonzero(~np.isfinite(found["lat"])))
    if short:
        notes.append(f"{path.name}: {short} rows without a position")
    empty = np.full(len(cells.table), np.nan)
    return np.column_stack([found.get(name, empty) for name in COLUMNS])


def _velocity(found: dict[str, FloatArray]) -> None:
    """Add velocities along north, east, down, of those along up, of the Earth's axes or of the body."""
    if {"vn", "ve", "vu"} <= found.keys():
        found["vd"] = -found["vu"]
    elif {"vx", "vy", "vz"} <= found.keys():
        mat = mat_en(np.radians(found["lat"]), np.radians(found["lon"]))
        of_earth = np.column_stack([found["vx"], found["vy"], found["vz"]])
        found["vn"], found["ve"], found["vd"] = np.einsum("nij,ni->jn", mat, of_earth)
    elif {"v_right", "v_forward", "v_up", "roll", "pitch"} <= found.keys():
        rpy = np.radians(np.column_stack([found["roll"], found["pitch"], found["yaw"]]))
        body = np.column_stack([found["v_forward"], found["v_right"], -found["v_up"]])
        found["vn"], found["ve"], found["vd"] = np.einsum("nij,nj->in", rotation.mat_from_rpy(rpy), body)


def _factor(path: Path, name: str, unit: str) -> float:
    """Return the size of the unit of a column in ours."""
    plain = unit.strip().lower().replace("metres", "m").replace("knots", "kn").replace("feet", "ft")
    angle = name in ("lat", "lon", "roll", "pitch", "yaw", "azimuth", "sd_roll", "sd_pitch", "sd_yaw")
    if not plain or (angle and (plain.startswith(("deg", "+/-d", "d ", "d-")))):
        return 1.0
    try:
        size = unit_value(canonical_unit(plain))
    except ValueError:
        raise DataError(
            f"{path}: column {name}: unknown unit '({unit})'; export it in deg, m or m/s"
        ) from None
    return float(np.degrees(size)) if angle else size
