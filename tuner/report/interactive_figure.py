"""A drawn figure as charts that a page lets its reader zoom and read: one chart a panel, in the colours of the page.

Lines, points, bands between curves, marked spans and names along an axis are kept. A panel with anything else (images,
bars, a colour scale) makes the figure one that stays a picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex, to_rgb, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedFormatter, FuncFormatter

from tuner.report.page_charts import DRAWN_DIGITS, Chart

DRAWN_POINTS = 4000
"""Points of a line on a page: two for each of as many columns as a wide screen has."""
PAGE_COLOURS = {
    "#1f5fa8": "--measured", "#1d4ed8": "--measured", "#c2410c": "--model", "#111827": "--predicted",
    "#b91c1c": "--event", "#0f766e": "--term0", "#a16207": "--term1", "#be185d": "--term2", "#15803d": "--term3",
    "#7c3aed": "--term4", "#475569": "--quiet", "#d6d3d1": "--rule", "#fecaca": "--span",
}  # fmt: skip
"""Names that the page has for colours of figures: light ones where it is dark."""
GREYS = ((0.3, "--ink"), (0.65, "--quiet"), (1.1, "--rule"))
"""Names of greys up to a lightness."""
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
MARKERS = {"o": "circle", ".": "circle", "x": "x", "^": "triangle-up", "v": "triangle-down", "s": "square"}


def charts_of_figure(figure: Figure) -> list[Chart] | None:
    """Return one chart for each panel; None where a panel holds what no chart shows."""
    charts = [_chart(panel) for panel in figure.axes]
    known = [chart for chart in charts if chart is not None]
    return known if known and len(known) == len(charts) else None


def _chart(panel: Axes) -> Chart | None:
    bands = [c for c in panel.collections if isinstance(c, PolyCollection)]
    known = len(bands) == len(panel.collections) and not panel.images
    scales = {panel.get_xscale(), panel.get_yscale()}
    spans = [patch for patch in panel.patches if isinstance(patch, Rectangle)]
    if not known or not scales <= {"linear", "log"} or len(spans) != len(panel.patches):
        return None
    if any(_place(panel, patch) is None for patch in spans):
        return None
    names = _names(panel)
    shapes, traces = [_span(panel, patch) for patch in spans], []
    for band in bands:
        traces += _bands(band)
    for line in panel.lines:
        where = _place(panel, line)
        if where is None:
            traces.append(_curve(panel, line, names))
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
    panel: Axes, line: Line2D, names: dict[str, tuple[Sequence[float], Sequence[str]]]
) -> dict[str, Any]:
    x, y = (np.atleast_1d(np.asarray(values, dtype=float)) for values in line.get_data())
    x, y = _thinned(x, y)
    label = str(line.get_label())
    drawn = line.get_linestyle() in DASHES
    marker = str(line.get_marker())
    style = "+".join(
        [*(["lines"] if drawn else []), *(["markers"] if marker not in ("None", "", " ") else [])]
    )
    unit = {end: "" if end in names else f"{panel_label}: " for end, panel_label in _labels(panel).items()}
    words = "<br>".join(f"{unit[end]}%{{{end}:.4~g}}" for end in ("x", "y") if end not in names)
    trace: dict[str, Any] = {
        "type": "scatter", "x": [_short(v) for v in x], "y": [_short(v) for v in y], "mode": style or "lines",
        "name": "" if label.startswith("_") else label, "showlegend": not label.startswith("_"),
        "hovertemplate": f"{words}<extra></extra>", "line": _line_style(line),
    }  # fmt: skip
    if "markers" in style:
        size = max(4.0, 1.3 * float(line.get_markersize()))
        colour = _colour(line.get_markerfacecolor())
        trace["marker"] = {"size": size, "color": colour, "symbol": MARKERS.get(marker, "circle")}
    return trace


def _labels(panel: Axes) -> dict[str, str]:
    return {"x": panel.get_xlabel() or "x", "y": panel.get_ylabel() or panel.get_title() or "y"}


def _bands(band: PolyCollection) -> list[dict[str, Any]]:
    fill = to_rgba_array(band.get_facecolor())[0]
    traces: list[dict[str, Any]] = []
    for path in band.get_paths():
        x, y = np.asarray(path.vertices, dtype=float).T
        if len(x) > 2 * DRAWN_POINTS:
            part = np.linspace(0, len(x) - 1, 2 * DRAWN_POINTS).astype(int)
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


def _thinned(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the smallest and the largest value of each piece of a long line."""
    size = -(-2 * len(x) // DRAWN_POINTS)
    if len(x) <= DRAWN_POINTS:
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
