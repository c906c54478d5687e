"""Figures of the diagnosis of a drive: innovations, NIS and outages of the filter before and after its findings.

Innovations by channel in the band of ±1 sd, their correlation over time, NIS along the drive, errors after outages,
and for each finding the view of the innovations in which it shows (`tuner.report.drive_cause_panels`).
"""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes

from models.arrays import FloatArray
from models.probability import chi2_quantile
from tuner.diagnosis.drive import ExaminedDrive
from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.navigation.data import ABSENT, WITHHELD
from tuner.navigation.drive.run import navigate, outage_windows
from tuner.report.curve_panels import draw_banded
from tuner.report.drive_cause_panels import (
    AFTER_COLOUR,
    BEFORE_COLOUR,
    INNOVATION_ROWS,
    VIEWS,
    View,
    draw_distribution,
    draw_effect,
    normalised,
    windowed,
)
from tuner.report.figure_files import TIME_LABEL, Sketch
from tuner.types import Parameter

OUTAGE_LENGTHS = (30.0, 60.0)
"""Lengths of the outages, s."""
LONGEST_LAG = 60.0
"""Longest lag of the autocorrelation that is drawn, s: a correlated GNSS error shows within a minute."""
NIS_WINDOW = 30.0
"""Time over which NIS is averaged, s: some 30 fixes at 1 Hz, a band of ± 15 %."""


def drive_figures(examined: ExaminedDrive) -> list[Sketch]:
    """Return the figures of the diagnosis of a drive: of the whole filter, then of each cause that was found."""
    passes, origin = (examined.search.base, examined.search.final), examined.drive.origin
    named = "with all findings" if examined.diagnosis.findings else "nothing found, so the same again"
    whole = [
        Sketch(
            "drive-innovations",
            f"Innovations of the filter as configured (grey) and {named} (blue); bands are ± 1 predicted sd.",
            [partial(_innovations, passes, row) for row in (0, 3, 1, 4, 2, 5)],
            (3, 2),
            7.0,
            origin,
        ),
        Sketch(
            "drive-consistency",
            f"Left: normalised innovations must be uncorrelated. Right: NIS, averaged over {NIS_WINDOW:.0f} s, "
            "must stay about 1; the shaded band holds 95 % of the averages of a consistent filter.",
            [partial(_correlation, passes), partial(_nis, passes)],
            origin=origin,
        ),
    ]
    if outages := _outages(passes):
        caption = (
            "Horizontal error at the end of outages of the whole drive, before and after the findings; below the "
            "diagonal is better. These are the data the findings were estimated from: the gain on held-out data "
            "is in the table."
        )
        panels = [partial(_paired, *one) for one in outages]
        whole.append(Sketch("drive-outages", caption, panels, (1, len(outages))))
    first: dict[str, str] = {}
    for finding in examined.diagnosis.findings:
        first.setdefault(finding.cause, finding.text)
    for number, (cause, text) in enumerate(first.items(), 1):
        views = [
            partial(_view(examined, cause), found=found, title=title)
            for found, title in zip(passes, ("before", "after"), strict=True)
        ]
        whole.append(Sketch(f"drive-finding-{number}-{cause}", text, views, origin=origin))
    return whole


def _view(examined: ExaminedDrive, cause: str) -> View:
    """Return the view of a cause; of one that shifts innovations, with its constants in axes of the unit."""
    one = next((a for a in examined.search.accepted if a.cause == cause), None)
    if one is None or one.candidate.score_test is None:
        return VIEWS.get(DRIVE_CAUSES[cause].view, draw_distribution)
    values = {Parameter(cause, name): c.value for name, c in one.parameters.items() if c.value is not None}
    return partial(draw_effect, values=values)


def _innovations(passes: tuple[FilterRun, FilterRun], row: int, panel: Axes) -> None:
    name, unit = INNOVATION_ROWS[row]
    reach = 0.0
    for found, colour, label in zip(passes, ("0.7", AFTER_COLOUR), ("before", "after"), strict=True):
        for number, solution in enumerate(found.solutions):
            there = (solution.use[:, row // 3] != ABSENT) & np.isfinite(solution.innovation[:, row])
            if not there.any():
                continue
            t, z = solution.t[there], solution.innovation[there, row]
            sd = np.sqrt(solution.innovation_covariance[there, row, row])
            look = {"ms": 2.5, "mew": 0, "color": colour, "label": None if number else label}
            draw_banded(panel, t, z, (-sd, sd), ".", rasterized=True, **look)
            reach = max(reach, float(np.quantile(np.abs(z), 0.99)), 3.0 * float(np.median(sd)))
    if reach:
        panel.set_ylim(-1.3 * reach, 1.3 * reach)
    panel.set(xlabel=TIME_LABEL, ylabel=f"{name}, {unit}")


def _correlation(passes: tuple[FilterRun, FilterRun], panel: Axes) -> None:
    for found, colour, title in zip(passes, (BEFORE_COLOUR, AFTER_COLOUR), ("before", "after"), strict=True):
        for first, kind, style in ((0, "position", "-"), (3, "velocity", ":")):
            z = normalised(found)[:, first : first + 3]
            step = float(np.median(np.diff(found.linearized.t)))
            lags = np.unique(np.geomspace(1, max(2.0, min(LONGEST_LAG / step, len(z) / 4)), 40).astype(int))
            if np.count_nonzero(np.isfinite(z)) < 100:
                continue
            values = [float(np.nanmean(z[lag:] * z[:-lag]) / np.nanmean(z * z)) for lag in lags]
            panel.plot(lags * step, values, style, color=colour, lw=1.3, label=f"{kind}, {title}")
    band = 1.96 / np.sqrt(3.0 * max(1, len(passes[1].linearized)))
    panel.axhspan(-band, band, color="0.85", lw=0, zorder=0)
    panel.set(
        xscale="log", xlabel="lag, s", ylabel="autocorrelation", title="autocorrelation of the innovations"
    )


def _nis(passes: tuple[FilterRun, FilterRun], panel: Axes) -> None:
    for found, colour, title in zip(passes, (BEFORE_COLOUR, AFTER_COLOUR), ("before", "after"), strict=True):
        middle, mean, count = windowed(found.linearized.t, normalised(found) ** 2, NIS_WINDOW)
        panel.plot(middle, mean, "-o", ms=2.5, lw=1.0, color=colour, label=title)
    usual = float(np.median(count))
    low, high = (chi2_quantile(q, usual) / usual for q in (0.025, 0.975))
    panel.axhspan(low, high, color="0.85", lw=0, zorder=0)
    panel.axhline(1.0, color="0.5", lw=0.8)
    panel.set(
        xlabel=TIME_LABEL,
        ylabel="NIS a row",
        title="size of the innovations, squared, by prediction",
    )


def _outages(passes: tuple[FilterRun, FilterRun]) -> list[tuple[float, FloatArray, FloatArray]]:
    """Return length and paired horizontal errors, m, of outages of the whole drive."""
    answer = []
    for horizon in OUTAGE_LENGTHS:
        windows = outage_windows(passes[1].stretches, horizon)
        if not windows:
            continue
        before, after = (_errors_of(found, windows) for found in passes)
        both = [(before[w], after[w]) for w in windows if w in before and w in after]
        if len(both) > 2:
            x, y = np.array(both).T
            answer.append((horizon, x, y))
    return answer


def _errors_of(found: FilterRun, windows: list[tuple[float, float]]) -> dict[tuple[float, float], float]:
    errors = {}
    for solution in navigate(found.stretches, found.settings, np.array(windows)):
        for begin, end in windows:
            inside = (solution.t > begin) & (solution.t <= end) & (solution.use[:, 0] == WITHHELD)
            if inside.any() and end - solution.t[inside][-1] < 0.2 * (end - begin):
                errors[begin, end] = float(np.linalg.norm(solution.innovation[inside][-1, :2]))
    return errors


def _paired(horizon: float, before: FloatArray, after: FloatArray, panel: Axes) -> None:
    high = 1.1 * max(before.max(), after.max())
    panel.plot([0.0, high], [0.0, high], color="0.6", lw=0.9)
    panel.plot(before, after, "o", ms=5, mew=0, alpha=0.75, color=AFTER_COLOUR)
    rms = [float(np.sqrt(np.mean(x**2))) for x in (before, after)]
    panel.set(
        xlim=(0.0, high),
        ylim=(0.0, high),
        xlabel="error before, m",
        ylabel="error after, m",
        title=f"{len(before)} outages of {horizon:.0f} s: rms {rms[0]:.3g} → {rms[1]:.3g} m",
    )
