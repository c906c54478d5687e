"""Solutions of Inertial Explorer, GrafNav and RTKLIB as the output of a filter, or as the truth of one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tuner.readers.estimate_columns import Columns, Frames, assemble
from tuner.readers.fixes.gps_time import SECONDS_A_WEEK, GpsFixes, on_clock_of
from tuner.readers.fixes.rtklib import read_rtklib
from tuner.readers.waypoint import COLUMNS, read_waypoint, waypoint_header
from tuner.types.filter_output import FilterOutput

TEXT_ENDINGS = ("", ".txt", ".pos", ".csv", ".asc", ".post")
"""Endings of files in which such a solution is looked for."""
_ATTITUDE = ("roll", "pitch", "yaw")


def gps_solution(path: Path) -> GpsFixes | None:
    """Return the solution in a file, `tuner.readers.waypoint.COLUMNS`; None for other files.

    Raises
    ------
    DataError
        What is such a file and cannot be used.
    """
    if path.suffix.lower() not in TEXT_ENDINGS:
        return None
    if waypoint_header(path) is not None:
        return read_waypoint(path)
    if path.suffix.lower() != ".pos":
        return None
    fixes = read_rtklib(path)
    rows = np.full((len(fixes.t), len(COLUMNS)), np.nan)
    rows[:, [j for j, name in enumerate(COLUMNS) if not name.endswith(_ATTITUDE)]] = fixes.rows[:, :12]
    return GpsFixes(fixes.t, rows, fixes.notes)


def of_gps_solution(path: Path, solution: GpsFixes, beside: FilterOutput | None) -> FilterOutput:
    """Return a solution as the output of a filter, on the clock of another or in GPS seconds of the week.

    Raises
    ------
    DataError
        Where no clock puts it beside the other.
    """
    if beside is None:
        t = solution.t - SECONDS_A_WEEK * np.floor(np.nanmin(solution.t) / SECONDS_A_WEEK)
        notes = (*solution.notes, f"{path.name}: times are GPS seconds of the week")
    else:
        finite = beside.t[np.isfinite(beside.t)]
        stamped, note = on_clock_of(path, solution, float(finite.min()), float(finite.max()))
        t, notes = stamped[:, 0], (*solution.notes, note.replace("the inertial record", "the estimate"))
    columns: Columns = {
        name: (values, None)
        for name, values in zip(("t", *COLUMNS), (t, *solution.rows.T), strict=True)
        if name == "t" or np.isfinite(values).any()
    }
    for group in (("vn", "ve", "vd"), _ATTITUDE):
        if not set(group) <= columns.keys():
            columns = {
                name: column for name, column in columns.items() if name.removeprefix("sd_") not in group
            }
    return assemble(str(path), columns, Frames(), notes=notes)
