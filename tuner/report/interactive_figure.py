"""A drawn figure as charts that a page lets its reader zoom and read: one chart a panel, in the colours of the page.

Lines, points, bands between curves, steps, marked spans, names along an axis and points by a colour scale are kept. A
panel with anything else (images, bars) makes the figure one that stays a picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.colors import to_hex, to_rgb, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle, StepPatch
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter

from models.arrays import FloatArray

Chart = Mapping[str, Any]
Drawn = list[dict[str, Any]] | None
"""What an artist is on a chart: traces, and shapes, which have an ``xref``; None where no chart can show it."""

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
NAMED = (FixedFormatter, FuncFormatter)
"""Formatters of axes with names in place of numbers."""
COLOUR_SCALE = "<colorbar>"
"""Label that matplotlib gives the panel of a colour scale: its chart has one of its own."""
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
MARKERS = {"o": "circle", ".": "circle", "x": "x", "^": "triangle-up", "v": "triangle-down", "s": "square"}


def charts_of_figure(figure: Figure) -> list[Chart] | None:
    """Return one chart for each panel; None where a panel holds what no chart shows."""
    panels = [panel for panel in figure.axes if panel.get_visible() and panel.get_label() != COLOUR_SCALE]
    points = min(DRAWN_POINTS, FIGURE_POINTS // max(len(panels), 1))
    charts = [chart for panel in panels if (chart := _chart(panel, points)) is not None]
    return charts if charts and len(charts) == len(panels) else None


def thinned(x: FloatArray, y: FloatArray, points: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest value of each piece of a long line, in the order of `x`; a short one whole.

    Both have shape (n,) and, returned, (`points`,) or less.
    """
    if len(x) <= points:
        return x, y
    starts = np.arange(0, len(x), -(-2 * len(x) // points))
    low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    return np.repeat(x[starts], 2), np.column_stack([low, high]).ravel()


def _chart(panel: Axes, points: int) -> Chart | None:
    artists = [*panel.collections, *panel.patches, *panel.lines, *panel.texts, *panel.images]
    drawn = [
        next((draw(panel, one, points) for kind, draw in ARTISTS.items() if isinstance(one, kind)), None)
        for one in artists
    ]
    if None in drawn or not {panel.get_xscale(), panel.get_yscale()} <= {"linear", "log"}:
        return None
    parts = [part for own in drawn for part in own or ()]
    return {
        "traces": [part for part in parts if "xref" not in part],
        "shapes": [part for part in parts if "xref" in part],
        "x": panel.get_xlabel(),
        "y": panel.get_ylabel(),
        "title": panel.get_title(),
        "xscale": panel.get_xscale(),
        "yscale": panel.get_yscale(),
        "xrange": _range(panel.get_xlim(), panel.get_xscale()),
        "yrange": _range(panel.get_ylim(), panel.get_yscale()),
        "even": panel.get_aspect() == 1.0,
        "names": _names(panel),
    }


def _range(limits: tuple[float, float], scale: str) -> list[float | None]:
    return [_short(np.log10(v) if scale == "log" else v) for v in limits]


def _names(panel: Axes) -> dict[str, dict[str, list[Any]]]:
    """Return places and names along the axes that have names in place of numbers."""
    ends = {"x": panel.xaxis, "y": panel.yaxis}
    named = {end: a for end, a in ends.items() if isinstance(a.get_major_formatter(), NAMED)}
    return {
        end: {
            "at": [float(v) for v in axis.get_ticklocs()],
            "text": axis.get_major_formatter().format_ticks(list(axis.get_ticklocs())),
        }
        for end, axis in named.items()
    }


def _trace(
    panel: Axes, x: Any, y: Any, look: Mapping[str, Any], artist: Artist | None = None, *, hover: bool = True
) -> dict[str, Any]:
    """Return a trace of points, named as an artist is in the legend; beside each stands its value, with that name.

    Along an axis with names the place of a point is no value.
    """
    label = "" if artist is None else str(artist.get_label()).replace("\n", " ")
    name = "" if label.startswith("_") else label
    named = _names(panel) if hover else {}
    labels = {"x": panel.get_xlabel() or "x", "y": panel.get_ylabel() or panel.get_title() or "y"}
    values = [f"{labels[end]}: %{{{end}:.{DRAWN_DIGITS}~g}}" for end in labels if end not in named]
    said = "<br>".join([name, *values] if name else values) + "<extra></extra>"
    return {
        "type": "scatter",
        "x": [_short(v) for v in x],
        "y": [_short(v) for v in y],
        "name": name,
        "showlegend": bool(name),
        **({"hovertemplate": said} if hover else {"hoverinfo": "skip"}),
        **look,
    }


def _across(panel: Axes, artist: Line2D | Rectangle) -> list[dict[str, Any]] | None:
    """Return a line or span that goes from end to end along an axis; None for what lies in the data."""
    transform = artist.get_transform() if isinstance(artist, Line2D) else artist.get_data_transform()
    ways = {"x": panel.get_xaxis_transform(which="grid"), "y": panel.get_yaxis_transform(which="grid")}
    along = next((end for end, way in ways.items() if transform == way), None)  # way == transform may differ
    if along is None:
        return None
    look: dict[str, Any]
    if isinstance(artist, Line2D):
        (x0, x1), (y0, y1) = (np.asarray(values) for values in artist.get_data())
        look = {"type": "line", "line": _line_style(artist)}
    else:
        (x0, y0), (x1, y1) = np.asarray(artist.get_bbox().get_points())
        fill = {"fillcolor": _colour(artist.get_facecolor()), "opacity": 0.4, "line": {"width": 0}}
        look = {"type": "rect", "layer": "below", **fill}
    ends = {name: _short(v) for name, v in (("x0", x0), ("x1", x1), ("y0", y0), ("y1", y1))}
    shape = {**look, **ends, "xref": "paper", "yref": "paper", f"{along}ref": along}
    line = _line_style(artist) if isinstance(artist, Line2D) else {"color": _colour(artist.get_edgecolor())}
    entry = _trace(panel, [np.nan], [np.nan], {"mode": "lines", "line": line}, artist, hover=False)
    return [shape, entry] if entry["name"] else [shape]


def _curve(panel: Axes, line: Line2D, points: int) -> Drawn:
    if (across := _across(panel, line)) is not None:
        return across
    x, y = (np.atleast_1d(np.asarray(values, dtype=float)) for values in line.get_data())
    marker, drawn = str(line.get_marker()), line.get_linestyle() in DASHES
    pointed = marker not in ("None", "", " ")
    look: dict[str, Any] = {"mode": "+".join(["lines"] * drawn + ["markers"] * pointed) or "lines"}
    look |= {"line": _line_style(line), "opacity": line.get_alpha() or 1.0}
    if pointed:
        look["marker"] = {
            "size": max(4.0, 1.3 * float(line.get_markersize())),
            "color": _colour(line.get_markerfacecolor()),
            "symbol": MARKERS.get(marker, "circle"),
        }
    x, y = thinned(x, y, points)
    return [_trace(panel, x, y, look, line)]


def _steps(panel: Axes, patch: StepPatch, _: int) -> Drawn:
    """Return a histogram as a line of steps, filled where it is."""
    values, edges = patch.get_data()[:2]
    filled = bool(patch.get_fill())
    colour = _colour(patch.get_facecolor() if filled else patch.get_edgecolor())
    dash = DASHES.get(str(patch.get_linestyle()), "solid")
    line = {"color": colour, "width": 1.0, "dash": dash, "shape": "hv"}
    look = {"mode": "lines", "line": line, "fill": "tozeroy" if filled else "none", "fillcolor": "--band"}
    return [_trace(panel, edges, np.append(values, values[-1]), look, patch)]


def _points_by_colour(panel: Axes, dots: PathCollection, _: int) -> Drawn:
    """Return points whose colours are values, with their scale; its title is that of the panel of the scale."""
    (x, y), values, bar = np.asarray(dots.get_offsets(), dtype=float).T, dots.get_array(), dots.colorbar
    if values is None:
        return []
    title = {"text": "" if bar is None else bar.ax.get_ylabel(), "side": "right"}
    scale = {"colorscale": "Viridis", "showscale": True, "colorbar": {"title": title, "thickness": 12}}
    marker = {"size": 5, "color": [_short(v) for v in np.asarray(values)], **scale}
    return [_trace(panel, x, y, {"mode": "markers", "marker": marker}, dots)]


def _bars(panel: Axes, bars: LineCollection, _: int) -> Drawn:
    """Return separate pieces of lines, such as intervals of points, as one line with gaps."""
    pieces = [np.append(piece, [[np.nan, np.nan]], axis=0) for piece in bars.get_segments()]
    x, y = np.concatenate([np.empty((0, 2)), *pieces]).T
    look = {"mode": "lines", "line": {"color": _colour(bars.get_colors()[0]), "width": 1.0}}
    return [_trace(panel, x, y, look, hover=False)]


def _bands(panel: Axes, band: PolyCollection, points: int) -> Drawn:
    face = to_rgba_array(band.get_facecolor())[0]
    colour, opacity = _colour(face), float(np.clip(2.0 * face[3], 0.2, 0.6))
    line = {"width": 0, "color": colour}
    look = {"mode": "lines", "line": line, "fill": "toself", "fillcolor": colour, "opacity": opacity}
    corners = [np.asarray(path.vertices, dtype=float) for path in band.get_paths()]
    some = [c[np.linspace(0, len(c) - 1, min(len(c), 2 * points)).astype(int)] for c in corners]
    return [_trace(panel, c[:, 0], c[:, 1], look, band, hover=False) for c in some]


def _words(panel: Axes, text: Any, _: int) -> Drawn:
    """Return a text that stands at a point of the data, and not at one of the panel."""
    if not text.get_text().strip() or getattr(text, "xycoords", "data") != "data":
        return []
    (x, y), font = getattr(text, "xy", text.get_position()), {"color": _colour(text.get_color())}
    look = {"mode": "text", "text": [text.get_text()], "textposition": "middle right", "textfont": font}
    return [_trace(panel, [x], [y], look, hover=False)]


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


ARTISTS: Mapping[type[Artist], Callable[[Axes, Any, int], Drawn]] = {
    PolyCollection: _bands,
    PathCollection: _points_by_colour,
    LineCollection: _bars,
    Rectangle: lambda panel, patch, _: _across(panel, patch),
    StepPatch: _steps,
    Line2D: _curve,
    Text: _words,
}
"""What a panel can hold, and how a chart shows it, with at most so many points of a line."""
