"""Figures of the papers' items: panels of curves, and tables of errors as shaded cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from examples.papers.results import Curve, Item, Panel, Picture, Table
from tuner.formats.files import whole_file

COLOURS = ("#1f5fa8", "#c2410c", "#0f766e", "#7c3aed", "#a16207", "#475569", "#be185d", "#111827")
"""Colours of the groups of curves, in order."""
STYLES: dict[str, dict[str, Any]] = {
    "line": {"lw": 1.3},
    "dashed": {"lw": 1.2, "ls": "--"},
    "dotted": {"lw": 1.4, "ls": ":"},
    "points": {"ls": "none", "marker": "o", "ms": 3.0, "mew": 0},
    "crosses": {"ls": "none", "marker": "x", "ms": 6.0, "mew": 1.4},
    "faint": {"lw": 0.5, "alpha": 0.6},
}
"""Properties of lines and markers, by the style of a curve."""
SCALES = {
    "loglog": ("log", "log"),
    "semilogx": ("log", "linear"),
    "semilogy": ("linear", "log"),
    "linear": ("linear", "linear"),
}
"""Scales of the axes, by the scale of a panel."""
PALETTE_COLOURS = 128
"""Colours of a stored figure: its lines and their shades."""
MIN_CROWDED_MARKS = 2
"""Marks of a panel from which their labels stand at different heights."""
LEGEND_ENTRY_HEIGHT = 0.06
"""Height of an entry of the legend as a share of the axes: room for it above the curves of a linear axis."""
MAX_AXIS_RATIO = 1e8
"""Largest ratio shown on a logarithmic axis."""


def draw_item(item: Item, path: Path, *, dpi: int = 100) -> None:
    """Draw the figure of an item and write it as PNG of few colours, a quarter of the usual size."""
    picture = item.figure
    columns = min(picture.columns, len(picture.panels))
    rows = -(-len(picture.panels) // columns)
    with mpl.rc_context({"font.size": 8.5, "axes.titlesize": 9.5, "svg.fonttype": "none"}):
        figure = Figure(figsize=(_width(picture) * columns, 3.7 * rows + 0.3), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, panel in zip(grid, picture.panels, strict=False):
            if isinstance(panel, Table):
                _draw_table(axes, panel)
            else:
                _draw_panel(axes, panel, alone=len(picture.panels) == 1)
        for axes in grid[len(picture.panels) :]:
            axes.set_visible(False)
        figure.suptitle(f"{item.name}: {item.paper.split(':')[-1].strip()}", fontsize=10)
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=dpi)
            with Image.open(temporary) as image:
                small = image.convert("RGB").quantize(PALETTE_COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=2)
            small.save(temporary, optimize=True)


def _width(picture: Picture) -> float:
    if any(isinstance(panel, Table) for panel in picture.panels):
        return 8.0
    return 6.6 if len(picture.panels) == 1 else 4.8


def _draw_panel(axes: Axes, panel: Panel, *, alone: bool) -> None:
    x_scale, y_scale = SCALES[panel.scale]
    for curve in panel.curves:
        _draw_curve(axes, curve)
    axes.set(xscale=x_scale, yscale=y_scale, xlabel=panel.x_label, ylabel=panel.y_label, title=panel.title)
    if y_scale == "log":
        bottom, top = axes.get_ylim()
        axes.set_ylim(max(bottom, top / MAX_AXIS_RATIO), top)
    for k, (x, label) in enumerate(panel.marks):
        axes.axvline(x, color="0.55", lw=0.8, ls=":")
        axes.annotate(
            label,
            (x, 0.02 + (0.11 * k if len(panel.marks) > MIN_CROWDED_MARKS else 0.0)),
            xycoords=("data", "axes fraction"),
            xytext=(2, 0),
            textcoords="offset points",
            rotation=90,
            fontsize=7,
            color="0.35",
            va="bottom",
        )
    axes.grid(which="major", color="0.88", lw=0.6)
    labels = sum(bool(curve.label) for curve in panel.curves)
    beside: dict[str, Any] = (
        {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)} if alone and labels > 4 else {}
    )
    if labels and not beside and y_scale == "linear":
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom, top + LEGEND_ENTRY_HEIGHT * labels * (top - bottom))
    if labels:
        axes.legend(fontsize=7, framealpha=0.85, handlelength=1.8, **beside)


def _draw_curve(axes: Axes, curve: Curve) -> None:
    colour = COLOURS[curve.group % len(COLOURS)]
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.15, lw=0)
    axes.plot(curve.x, curve.y, color=colour, label=curve.label or None, **STYLES[curve.style])


def _draw_table(axes: Axes, table: Table) -> None:
    errors = np.maximum(np.abs(np.log(table.cells)), 1e-2) if table.ratios else table.cells
    shade = np.clip(-np.log10(np.where(np.isnan(errors), 10.0, errors)), -0.5, 2.5)
    axes.imshow(
        np.where(np.isnan(table.cells), np.nan, shade), cmap="YlGnBu", vmin=-0.5, vmax=3.5, aspect="auto"
    )
    for (i, j), value in np.ndenumerate(table.cells):
        text = f"{value:.2f}" if table.ratios else f"{100.0 * value:.{0 if value > 0.0995 else 1}f} %"
        axes.text(j, i, "–" if np.isnan(value) else text, ha="center", va="center", fontsize=8.5)
    axes.set_xticks(range(len(table.columns)), [name.replace(" ", "\n", 1) for name in table.columns])
    axes.set_yticks(range(len(table.rows)), table.rows)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.set_title(table.title)
