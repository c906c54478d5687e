"""Figures of a filtered drive: the track seen from above, errors and innovations over time with their bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from models.arrays import FloatArray, IntArray
from tuner.consistency.drive_scores import differences, stated
from tuner.consistency.score_drive import DriveResult
from tuner.formats.customary_units import since
from tuner.navigation.data import ABSENT, GATED, USED
from tuner.report.curve_panels import draw_banded
from tuner.report.figure_files import new_figure, rendered
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


@dataclass(frozen=True)
class _Part:
    """Errors or innovations of a stretch: times, shape (n,); values, predicted sds, whether used, shape (n, k)."""

    t: FloatArray
    value: FloatArray
    sd: FloatArray
    use: IntArray
    settled: float


def solution_pictures(
    found: DriveResult, drive: Drive, suffixes: Sequence[str] = (".png", ".svg")
) -> dict[str, bytes]:
    """Return ``track``, ``innovations`` and, where the drive has a reference, ``errors``, each with these suffixes."""
    figures = {
        "track": _track(found, drive),
        "innovations": _banded(
            _innovations(found), (2, 3), 5.2, drive.origin, "fix − prediction; × refused by the gate"
        ),
    }
    if drive.reference is not None:
        errors = _errors(found, drive.reference)
        figures["errors"] = _banded(errors, (3, 3), 7.5, drive.origin, "reference − filter")
    return {
        name: content
        for stem, figure in figures.items()
        for name, content in rendered(figure, stem, suffixes).items()
    }


def _track(found: DriveResult, drive: Drive) -> Figure:
    lines = local_track(tracks(found, drive.reference))
    with new_figure((8.0, 8.0)) as figure:
        panel = figure.subplots()
        for kind, (colour, width) in LINES.items():
            for number, plane in enumerate(lines.get(kind, [])):
                style = {"marker": ".", "ms": 3.0, "ls": "none"} if kind == "fixes" else {"lw": width}
                panel.plot(*plane.T, color=colour, label=kind if number == 0 else None, **style)
        panel.plot(*lines["filter"][0][0], "k^", ms=8, label="start")
        panel.set_aspect("equal", adjustable="datalim")
        panel.set(xlabel="east, m", ylabel="north, m", title=f"{drive.name}: track from above")
    return figure


def _errors(found: DriveResult, reference: Reference) -> list[_Part]:
    parts = []
    for stretch, solution in zip(found.stretches, found.solutions, strict=True):
        error = differences(reference, solution, np.arange(len(solution.t)))
        own = np.diagonal(solution.covariance, axis1=1, axis2=2)[:, :9]
        sd = np.sqrt(own + stated(reference, solution.t))
        parts.append(_Part(solution.t, error, sd, np.full(error.shape, USED), stretch.settled))
    return parts


def _innovations(found: DriveResult) -> list[_Part]:
    parts = []
    for stretch, solution in zip(found.stretches, found.solutions, strict=True):
        sd = np.sqrt(np.diagonal(solution.innovation_covariance, axis1=1, axis2=2))
        use = np.where(np.isfinite(solution.innovation), np.repeat(solution.use, 3, axis=1), ABSENT)
        parts.append(_Part(solution.t, solution.innovation, sd, use, stretch.settled))
    return parts


def _banded(
    parts: Sequence[_Part], shape: tuple[int, int], height: float, origin: float, what: str
) -> Figure:
    """Return values over time with their bands; one outlier in 200 does not flatten the rest of a panel."""
    with new_figure((11.0, height)) as figure:
        panels = figure.subplots(*shape, sharex=True)
        for panel, (name, unit, at) in zip(panels.ravel(), ROWS, strict=False):
            scale, sizes = (180.0 / np.pi if unit == "deg" else 1.0), [np.zeros(1)]
            for part in parts:
                used, refused = part.use[:, at] == USED, part.use[:, at] == GATED
                value, reach = scale * part.value[:, at], BAND_SDS * scale * part.sd[used, at]
                look = {"ms": 2.0, "mew": 0, "color": "#1f5fa8", "rasterized": True}
                draw_banded(panel, part.t[used], value[used], (-reach, reach), ".", **look)
                panel.plot(part.t[refused], value[refused], "x", color="#c2410c", ms=3)
                sizes.append(np.abs(value[(used | refused) & (part.t >= part.settled)]))
            if (most := float(np.nanquantile(np.concatenate(sizes), 0.995))) > 0.0:
                panel.set_ylim(-1.2 * most, 1.2 * most)
            panel.set(title=name, ylabel=unit, xlabel=since(origin))
        for panel in panels[:-1].ravel():
            panel.xaxis.label.set_visible(False)
        figure.suptitle(f"{what}; bands are ± {BAND_SDS:g} predicted sds; axes fit the time after settling")
    return figure
