"""Figures of a filtered drive: the track seen from above, errors and innovations over time with their bands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.consistency.drive_scores import differences, stated
from tuner.consistency.score_drive import DriveResult
from tuner.navigation.data import GATED, USED
from tuner.report.figure_files import figure_bytes, lay_out
from tuner.report.solution_files import local_track, tracks
from tuner.types.records import Drive, Reference

LINES = {"fixes": ("#c2410c", 0.9), "reference": ("#15803d", 1.6), "filter": ("#1f5fa8", 1.1)}
"""Colour and width of each track, from the lowest to the topmost."""
BAND_SDS = 3.0
"""Half width of the bands, predicted sds: three hold 99.7 % of a consistent filter's errors."""
ROWS = (
    ("north", "m", 0),
    ("east", "m", 1),
    ("down", "m", 2),
    ("velocity north", "m/s", 3),
    ("velocity east", "m/s", 4),
    ("velocity down", "m/s", 5),
    ("roll axis (north)", "deg", 6),
    ("pitch axis (east)", "deg", 7),
    ("heading (down)", "deg", 8),
)
"""Name, unit and place in the error vector of each panel."""


def solution_pictures(
    found: DriveResult, drive: Drive, suffixes: Sequence[str] = ("png", "svg")
) -> dict[str, bytes]:
    """Return ``track``, ``innovations`` and, where the drive has a reference, ``errors``, each with these suffixes."""
    pictures = {"track": _track(found, drive), "innovations": _innovations(found)}
    if drive.reference is not None:
        pictures["errors"] = _errors(found, drive.reference)
    for figure in pictures.values():
        lay_out(figure)
    return {
        f"{name}.{suffix}": figure_bytes(figure, suffix)
        for name, figure in pictures.items()
        for suffix in suffixes
    }


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def _track(found: DriveResult, drive: Drive) -> Figure:
    lines = local_track(tracks(found, drive.reference))
    figure = _figure(8.0, 8.0)
    panel = figure.subplots()
    for kind, (colour, width) in LINES.items():
        for number, plane in enumerate(lines.get(kind, [])):
            style = {"marker": ".", "ms": 3.0, "ls": "none"} if kind == "fixes" else {"lw": width}
            panel.plot(*plane.T, color=colour, label=kind if number == 0 else None, **style)
    start = lines["filter"][0][0]
    panel.plot(*start, "k^", ms=8, label="start")
    panel.set_aspect("equal", adjustable="datalim")
    panel.set(xlabel="east, m", ylabel="north, m", title=f"{drive.name}: track from above")
    panel.grid(color="0.92")
    panel.legend()
    return figure


def _errors(found: DriveResult, reference: Reference) -> Figure:
    figure = _figure(11.0, 7.5)
    panels = figure.subplots(3, 3, sharex=True).T.ravel()
    reach = np.zeros(len(ROWS))
    for stretch, solution in zip(found.stretches, found.solutions, strict=True):
        rows = np.arange(len(solution.t))
        error = differences(reference, solution, rows)
        own = np.diagonal(solution.covariance, axis1=1, axis2=2)[:, :9]
        sd = np.sqrt(own + stated(reference, solution.t))
        for panel, (_, unit, at) in zip(panels, ROWS, strict=True):
            scale = 180.0 / np.pi if unit == "deg" else 1.0
            _banded(panel, solution.t, scale * error[:, at], scale * sd[:, at])
            reach[at] = max(reach[at], _reach(scale * error[solution.t >= stretch.settled, at]))
    _finish(panels, reach, "reference − filter", figure)
    return figure


def _innovations(found: DriveResult) -> Figure:
    figure = _figure(11.0, 5.2)
    panels = figure.subplots(2, 3, sharex=True).ravel()
    reach = np.zeros(6)
    for stretch, solution in zip(found.stretches, found.solutions, strict=True):
        sd = np.sqrt(np.diagonal(solution.innovation_covariance, axis1=1, axis2=2))
        for panel, (_, _, at) in zip(panels, ROWS, strict=False):
            use = solution.use[:, at // 3]
            used = use == USED
            _banded(panel, solution.t[used], solution.innovation[used, at], sd[used, at])
            gated = use == GATED
            panel.plot(solution.t[gated], solution.innovation[gated, at], "x", color="#c2410c", ms=3)
            seen = (used | gated) & (solution.t >= stretch.settled)
            reach[at] = max(reach[at], _reach(solution.innovation[seen, at]))
    _finish(panels, reach, "fix − prediction; × refused by the gate", figure)
    return figure


def _banded(panel: Axes, t: FloatArray, value: FloatArray, sd: FloatArray) -> None:
    panel.fill_between(t, -BAND_SDS * sd, BAND_SDS * sd, color="#1f5fa8", alpha=0.18, lw=0, rasterized=True)
    panel.plot(t, value, ".", ms=2.0, mew=0, color="#1f5fa8", rasterized=True)


def _reach(values: FloatArray) -> float:
    """Return the size that all but 0.5 % of the values keep within: one outlier does not flatten the rest."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.quantile(known, 0.995)) if len(known) else 0.0


def _finish(panels: NDArray[np.object_], reach: FloatArray, what: str, figure: Figure) -> None:
    for panel, (name, unit, at) in zip(panels, ROWS, strict=False):
        panel.set_title(name, fontsize=10)
        panel.set_ylabel(unit)
        panel.grid(color="0.92")
        if reach[at] > 0.0:
            panel.set_ylim(-1.2 * reach[at], 1.2 * reach[at])
        if panel.get_subplotspec().is_last_row():
            panel.set_xlabel("time, s")
    figure.suptitle(f"{what}; bands are ± {BAND_SDS:g} predicted sds; axes fit the time after settling")
