"""A drawn figure as charts that a page lets its reader zoom and read: one chart a panel, in the colours of the page.

Lines, points, bands between curves, steps, marked spans, names along an axis and points by a colour scale are kept. A
panel with anything else (images, bars) makes the figure one that stays a picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.colors import to_hex, to_rgb, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle, StepPatch
from matplotlib.ticker import FixedFormatter, FuncFormatter

Chart = Mapping[str, Any]

DRAWN_DIGITS = 5
"""Significant digits of a drawn number: finer than a screen, a third of the bytes."""
DRAWN_POINTS = 4000
"""Points of a line on a page: two for each of as many columns as a wide screen has."""
FIGURE_POINTS = 12_000
"""Points of a line in all panels of a figure together: where there are many, each is narrow."""
PAGE_COLOURS = {
    "#1f5fa8": "--measured", "#1d4ed8": "--measured", "#c2410c": "--model", "#111827": "--predicted",
    "#b91c1c": "--event", "#0f766e": "--term0", "#a16207": "--term1", "#be185d": "--term2", "#15803d": "--term3",
    "#7c3aed": "--term4", "#475569": "--quiet", "#d6d3d1": "--rule", "#fecaca": "--span",
}  # fmt: skip
"""Names that the page has for colours of figures: light ones where it is dark."""
GREYS = ((0.3, "--ink"), (0.65, "--quiet"), (1.1, "--rule"))
"""Names of greys up to a lightness."""
COLOUR_SCALE = "<colorbar>"
"""Label that matplotlib gives the panel of a colour scale: its chart has one of its own."""
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
MARKERS = {"o": "circle", ".": "circle", "x": "x", "^": "triangle-up", "v": "triangle-down", "s": "square"}


def charts_of_figure(figure: Figure) -> list[Chart] | None:
    """Return one chart for each panel; None where a panel holds what no chart shows."""
    panels = [panel for panel in figure.axes if panel.get_label() != COLOUR_SCALE]
    points = min(DRAWN_POINTS, FIGURE_POINTS // max(len(panels), 1))
    charts = [_chart(panel, points) for panel in panels]
    known = [chart for chart in charts if chart is not None]
    return known if known and len(known) == len(charts) else None


def _chart(panel: Axes, points: int) -> Chart | None:
    scales = {panel.get_xscale(), panel.get_yscale()}
    spans = [patch for patch in panel.patches if isinstance(patch, Rectangle)]
    steps = [patch for patch in panel.patches if isinstance(patch, StepPatch)]
    known = not panel.images and all(isinstance(c, tuple(COLLECTIONS)) for c in panel.collections)
    if not known or not scales <= {"linear", "log"} or len(spans) + len(steps) != len(panel.patches):
        return None
    if any(_place(panel, patch) is None for patch in spans):
        return None
    names = _names(panel)
    shapes, traces = [_span(panel, patch) for patch in spans], []
    for one in panel.collections:
        traces += next(
            drawn(panel, one, points) for kind, drawn in COLLECTIONS.items() if isinstance(one, kind)
        )
    traces += [_steps(panel, one) for one in steps]
    for line in panel.lines:
        where = _place(panel, line)
        if where is None:
            traces.append(_curve(panel, line, names, points))
        else:
            shapes.append(_straight(line, where))
            if not str(line.get_label()).startswith("_"):
                traces.append(_legend_entry(line))
    traces += [_words(text) for text in panel.texts if text.get_text().strip() and _in_data(text)]
    return {
        "traces": traces,
        "x": panel.get_xlabel(),
        "y": panel.get_ylabel(),
        "title": panel.get_title(),
        "xscale": panel.get_xscale(),
        "yscale": panel.get_yscale(),
        "xrange": _range(panel.get_xlim(), panel.get_xscale()),
        "yrange": _range(panel.get_ylim(), panel.get_yscale()),
        "even": panel.get_aspect() == 1.0,
        "names": {end: {"at": list(at), "text": list(text)} for end, (at, text) in names.items()},
        "shapes": shapes,
        "spans": [],
    }


def _range(limits: tuple[float, float], scale: str) -> list[float | None]:
    return [_short(np.log10(v) if scale == "log" else v) for v in limits]


def _names(panel: Axes) -> dict[str, tuple[Sequence[float], Sequence[str]]]:
    """Return places and names along the axes that have names in place of numbers."""
    found: dict[str, tuple[Sequence[float], Sequence[str]]] = {}
    for end, axis in (("x", panel.xaxis), ("y", panel.yaxis)):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, FixedFormatter | FuncFormatter):
            places = [float(v) for v in axis.get_ticklocs()]
            found[end] = (places, [formatter(v, k) for k, v in enumerate(places)])
    return found


def _place(panel: Axes, artist: Line2D | Rectangle) -> str | None:
    """Return the axis along which a line or span goes from end to end; None for what lies in the data."""
    transform = artist.get_transform() if isinstance(artist, Line2D) else artist.get_data_transform()
    if transform == panel.get_xaxis_transform(which="grid"):
        return "x"
    return "y" if transform == panel.get_yaxis_transform(which="grid") else None


def _span(panel: Axes, patch: Rectangle) -> dict[str, Any]:
    x0, y0 = patch.get_xy()
    x1, y1 = x0 + patch.get_width(), y0 + patch.get_height()
    across = _place(panel, patch) == "x"
    return {
        "type": "rect", "layer": "below", "line": {"width": 0}, "opacity": 0.4,
        "fillcolor": _colour(patch.get_facecolor()),
        "xref": "x" if across else "paper", "yref": "paper" if across else "y",
        "x0": _short(x0), "x1": _short(x1), "y0": _short(y0), "y1": _short(y1),
    }  # fmt: skip


def _straight(line: Line2D, where: str) -> dict[str, Any]:
    x, y = (np.asarray(values, dtype=float) for values in line.get_data())
    ends = (x[0], x[0], 0.0, 1.0) if where == "x" else (0.0, 1.0, y[0], y[0])
    return {
        "type": "line", "line": _line_style(line),
        "xref": "x" if where == "x" else "paper", "yref": "paper" if where == "x" else "y",
        **dict(zip(("x0", "x1", "y0", "y1"), map(_short, ends), strict=True)),
    }  # fmt: skip


def _legend_entry(line: Line2D) -> dict[str, Any]:
    return {
        "type": "scatter", "x": [None], "y": [None], "mode": "lines", "name": str(line.get_label()),
        "showlegend": True, "hoverinfo": "skip", "line": _line_style(line),
    }  # fmt: skip


def _curve(
    panel: Axes, line: Line2D, names: dict[str, tuple[Sequence[float], Sequence[str]]], points: int
) -> dict[str, Any]:
    x, y = (np.atleast_1d(np.asarray(values, dtype=float)) for values in line.get_data())
    x, y = _thinned(x, y, points)
    label = str(line.get_label())
    drawn = line.get_linestyle() in DASHES
    marker = str(line.get_marker())
    style = "+".join(
        [*(["lines"] if drawn else []), *(["markers"] if marker not in ("None", "", " ") else [])]
    )
    trace: dict[str, Any] = {
        "type": "scatter", "x": [_short(v) for v in x], "y": [_short(v) for v in y], "mode": style or "lines",
        "name": "" if label.startswith("_") else label, "showlegend": not label.startswith("_"),
        "hovertemplate": _hover(panel, names), "line": _line_style(line),
    }  # fmt: skip
    if "markers" in style:
        size = max(4.0, 1.3 * float(line.get_markersize()))
        colour = _colour(line.get_markerfacecolor())
        trace["marker"] = {"size": size, "color": colour, "symbol": MARKERS.get(marker, "circle")}
    return trace


def _hover(panel: Axes, names: Mapping[str, object]) -> str:
    """Return what is shown beside a point: its values behind their labels, but those along an axis with names."""
    labels = {"x": panel.get_xlabel() or "x", "y": panel.get_ylabel() or panel.get_title() or "y"}
    return (
        "<br>".join(f"{labels[end]}: %{{{end}:.4~g}}" for end in labels if end not in names)
        + "<extra></extra>"
    )


def _steps(panel: Axes, patch: StepPatch) -> dict[str, Any]:
    """Return a histogram as a line of steps, filled where it is."""
    values, edges, _ = patch.get_data()
    filled = bool(patch.get_fill())
    colour = _colour(patch.get_facecolor() if filled else patch.get_edgecolor())
    dash = DASHES.get(str(patch.get_linestyle()), "solid")
    return {
        "type": "scatter", "x": [_short(v) for v in edges], "y": [_short(v) for v in np.append(values, values[-1])],
        "mode": "lines", "name": str(patch.get_label()), "hovertemplate": _hover(panel, {}),
        "line": {"color": colour, "width": 1.0, "dash": dash, "shape": "hv"},
        "fill": "tozeroy" if filled else "none", "fillcolor": "--band",
        "showlegend": not str(patch.get_label()).startswith("_"),
    }  # fmt: skip


def _points_by_colour(panel: Axes, dots: PathCollection, _: int) -> list[dict[str, Any]]:
    """Return points whose colours are values, with their scale; its title is that of the panel of the scale."""
    (x, y), values = np.asarray(dots.get_offsets(), dtype=float).T, dots.get_array()
    if values is None:
        return []
    bar = dots.colorbar
    marker = {
        "size": 5, "color": [_short(v) for v in np.asarray(values)], "colorscale": "Viridis", "showscale": True,
        "colorbar": {"title": {"text": "" if bar is None else bar.ax.get_ylabel(), "side": "right"}, "thickness": 12},
    }  # fmt: skip
    return [
        {
            "type": "scatter", "x": [_short(v) for v in x], "y": [_short(v) for v in y], "mode": "markers",
            "name": str(dots.get_label()), "showlegend": True, "marker": marker, "hovertemplate": _hover(panel, {}),
        }
    ]  # fmt: skip


def _bars(_: Axes, bars: LineCollection, __: int) -> list[dict[str, Any]]:
    """Return separate pieces of lines, such as intervals of points, as one line with gaps."""
    x: list[float | None] = []
    y: list[float | None] = []
    for piece in bars.get_segments():
        x += [*(_short(v) for v in piece[:, 0]), None]
        y += [*(_short(v) for v in piece[:, 1]), None]
    line = {"color": _colour(bars.get_colors()[0]), "width": 1.0}
    return [
        {"type": "scatter", "x": x, "y": y, "mode": "lines", "name": "", "showlegend": False, "hoverinfo": "skip",
         "line": line}
    ]  # fmt: skip


def _bands(_: Axes, band: PolyCollection, points: int) -> list[dict[str, Any]]:
    fill = to_rgba_array(band.get_facecolor())[0]
    traces: list[dict[str, Any]] = []
    for path in band.get_paths():
        x, y = np.asarray(path.vertices, dtype=float).T
        if len(x) > 2 * points:
            part = np.linspace(0, len(x) - 1, 2 * points).astype(int)
            x, y = x[part], y[part]
        trace = {
            "type": "scatter", "x": [_short(v) for v in x], "y": [_short(v) for v in y], "mode": "lines", "name": "",
            "showlegend": False, "hoverinfo": "skip", "fill": "toself", "fillcolor": _colour(fill),
            "line": {"width": 0, "color": _colour(fill)}, "opacity": float(np.clip(2.0 * fill[3], 0.2, 0.6)),
        }  # fmt: skip
        traces.append(trace)
    return traces


def _in_data(text: Any) -> bool:
    """Tell whether a text stands at a point of the data, and not at one of the panel."""
    return getattr(text, "xycoords", "data") == "data"


def _words(text: Any) -> dict[str, Any]:
    x, y = getattr(text, "xy", text.get_position())
    return {
        "type": "scatter", "x": [_short(x)], "y": [_short(y)], "mode": "text", "text": [text.get_text()],
        "textposition": "middle right", "showlegend": False, "name": "", "hoverinfo": "skip",
    }  # fmt: skip


def _thinned(x: Any, y: Any, points: int) -> tuple[Any, Any]:
    """Return the smallest and the largest value of each piece of a long line."""
    size = -(-2 * len(x) // points)
    if len(x) <= points:
        return x, y
    starts = np.arange(0, len(x), size)
    low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    return np.repeat(x[starts], 2), np.column_stack([low, high]).ravel()


def _line_style(line: Line2D) -> dict[str, Any]:
    dash = DASHES.get(str(line.get_linestyle()), "solid")
    return {"color": _colour(line.get_color()), "width": float(line.get_linewidth()), "dash": dash}


def _colour(colour: Any) -> str:
    """Return the page's name of a colour, or the colour itself."""
    red, green, blue = to_rgb(colour)
    if max(red, green, blue) - min(red, green, blue) < 0.02:
        return next(name for limit, name in GREYS if red < limit)
    return PAGE_COLOURS.get(to_hex((red, green, blue)), to_hex((red, green, blue)))


def _short(value: Any) -> float | None:
    return float(f"{float(value):.{DRAWN_DIGITS}g}") if np.isfinite(value) else None


COLLECTIONS: Mapping[type, Callable[[Axes, Any, int], list[dict[str, Any]]]] = {
    PolyCollection: _bands,
    PathCollection: _points_by_colour,
    LineCollection: _bars,
}
"""What a panel can hold beside lines, spans and steps, and how it is drawn."""
