"""Panels of the figures of a drive diagnosis: for each kind of cause, the view of the innovations in which it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from models.arrays import FloatArray
from models.probability import normal_density
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.report.figure_files import TIME_LABEL
from tuner.types import Parameter

View = Callable[..., None]
"""Draws into a panel what a run shows, under a title: of type (panel, found, title)."""

BEFORE_COLOUR, AFTER_COLOUR, CAUSE_COLOUR = "0.55", "#1f5fa8", "#c2410c"
INNOVATION_ROWS = (
    ("position north", "m"),
    ("position east", "m"),
    ("position down", "m"),
    ("velocity north", "m/s"),
    ("velocity east", "m/s"),
    ("velocity down", "m/s"),
)
SLOW_WINDOW = 10.0
"""Time over which the slow part of the innovations is averaged, s."""
INNOVATION_GROUPS = 15
"""Groups of innovations whose means are drawn: enough for a line, each with a narrow interval."""


def normalised(found: FilterRun) -> FloatArray:
    """Return innovations by their predicted sds, shape (k, 6), NaN where the filter used none."""
    z, sd = _innovations(found)
    return np.asarray(np.where(found.linearized.counted, z / sd, np.nan))


def _innovations(found: FilterRun) -> tuple[FloatArray, FloatArray]:
    """Return innovations of the record and their predicted sds, (k, 6)."""
    z = np.concatenate([s.innovation for s in found.solutions])
    variance = np.concatenate(
        [np.diagonal(s.innovation_covariance, axis1=1, axis2=2) for s in found.solutions]
    )
    return z, np.sqrt(np.where(variance > 0.0, variance, np.nan))


def windowed(t: FloatArray, x: FloatArray, length: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middles of windows of a length, s, and mean and number of the known values in each.

    Of times, shape (k,), and values, shape (k, d); windows without a value are left out.
    """
    window = ((t - t[0]) // length).astype(int)
    count = np.asarray(np.bincount(window, weights=np.isfinite(x).sum(axis=1)), dtype=np.float64)
    total, full = np.bincount(window, weights=np.nansum(x, axis=1)), np.flatnonzero(count)
    return t[0] + length * (full + 0.5), np.asarray(total[full] / count[full]), count[full]


def draw_effect(panel: Axes, found: FilterRun, title: str, values: Mapping[Parameter, float]) -> None:
    """Draw innovations over what the constants that were found would do to them.

    Both are whitened: in sds, serially uncorrelated where the filter is right. They lie on the line of what the run
    does not compensate yet: of slope 1 in a filter without the finding, of slope 0 in one with it.
    """
    w = found.whitened
    own = [found.linearized.parameters.index(parameter) for parameter in values]
    size = np.array(list(values.values()))
    effect = w.slope[:, own] @ size
    left = w.slope[:, own] @ (size - found.hypothesis.compensation.vector(values))
    order = np.argsort(effect)
    x, y, predicted = effect[order], w.residual[order], left[order]
    panel.plot(x, y, ".", ms=1.5, mew=0, color=BEFORE_COLOUR, alpha=0.5, rasterized=True)
    if len(x) < 2:
        words = "no fix counts here:\nthe filter has not settled"
        panel.text(0.5, 0.5, words, ha="center", va="center", transform=panel.transAxes)
        panel.set(title=title, xticks=[], yticks=[])
        return
    groups = np.array_split(np.arange(len(x)), min(INNOVATION_GROUPS, len(x) // 2))
    middle, mean, line = (np.array([v[group].mean() for group in groups]) for v in (x, y, predicted))
    error = np.array([y[group].std() / np.sqrt(len(group)) for group in groups])
    panel.errorbar(
        middle,
        mean,
        1.96 * error,
        fmt="o",
        ms=4,
        lw=1.0,
        color=AFTER_COLOUR,
        label="means of equal groups, 95 %",
    )
    panel.axhline(0.0, color="0.5", lw=0.8)
    panel.plot(middle, line, color=CAUSE_COLOUR, lw=1.2, label="predicted by the finding for this filter")
    span = float(np.max(np.abs(middle)))
    reach = 1.5 * float(max(np.max(np.abs(mean)), span) + 0.5)
    panel.set(
        xlim=(-1.1 * span, 1.1 * span),
        ylim=(-reach, reach),
        xlabel="shift of the innovation by the finding, sds",
        ylabel="innovation, sds",
        title=title,
    )


def draw_outliers(panel: Axes, found: FilterRun, title: str, first: int = 0) -> None:
    """Draw the size of every fix's innovation by its prediction over time, with those that are left out."""
    z, sd = _innovations(found)
    part = slice(first, first + 3)
    size = np.sqrt(np.mean((z[:, part] / sd[:, part]) ** 2, axis=1))
    there = found.linearized.available[:, first] & np.isfinite(size)
    used = found.linearized.used[:, first]
    t = found.linearized.t
    for which, ms, colour, label in (
        (there & used, 2.5, AFTER_COLOUR, "used"),
        (there & ~used, 3.5, CAUSE_COLOUR, "refused"),
    ):
        panel.plot(t[which], size[which], ".", ms=ms, mew=0, color=colour, label=label, rasterized=True)
    panel.axhline(1.0, color="0.5", lw=0.8)
    panel.set(yscale="log", xlabel=TIME_LABEL, ylabel="innovation ÷ predicted sd", title=title)


def draw_distribution(panel: Axes, found: FilterRun, title: str) -> None:
    """Draw the distribution of normalised innovations beside the standard normal one that the filter predicts."""
    z = normalised(found)
    edges = np.linspace(-6.0, 6.0, 73)
    for part, name, style in ((slice(0, 3), "position", "-"), (slice(3, 6), "velocity", ":")):
        values = z[:, part][np.isfinite(z[:, part])]
        if not len(values):
            continue
        density, _ = np.histogram(np.clip(values, -6.0, 6.0), edges, density=True)
        panel.stairs(density, edges, color=AFTER_COLOUR, ls=style, lw=1.2, label=name)
    middle = 0.5 * (edges[:-1] + edges[1:])
    panel.plot(middle, normal_density(middle), color=CAUSE_COLOUR, lw=1.0, label="predicted")
    panel.set(xlabel="innovation ÷ predicted sd", ylabel="density", title=title)


def draw_slow_means(panel: Axes, found: FilterRun, title: str) -> None:
    """Draw normalised innovations of the position, smoothed over 10 s: its slow part."""
    z = normalised(found)
    for row, colour in ((0, AFTER_COLOUR), (1, CAUSE_COLOUR), (2, BEFORE_COLOUR)):
        middle, mean, _ = windowed(found.linearized.t, z[:, row : row + 1], SLOW_WINDOW)
        panel.plot(middle, mean, lw=0.9, color=colour, label=INNOVATION_ROWS[row][0])
    panel.set(xlabel=TIME_LABEL, ylabel=f"innovation ÷ sd, means of {SLOW_WINDOW:g} s", title=title)


VIEWS: Mapping[str, View] = {
    "distribution": draw_distribution,
    "positions": draw_outliers,
    "velocities": partial(draw_outliers, first=3),
    "slow means": draw_slow_means,
}
"""Figure of every view that a cause may declare but ``sensitivity``, which needs its estimates (`draw_effect`)."""
