"""One look of all figures of a report, and their files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, LogFormatterSciNotation, NullLocator

from tuner.formats.customary_units import since
from tuner.formats.files import write_bytes
from tuner.jobs import each
from tuner.report.interactive_figure import COLOUR_SCALE, charts_of_figure

LABELLED_DECADES = 2.0
"""Decades of an axis beyond which ticks between them are without labels: two of their own are then on it."""
CHARTS = ".json"
"""Suffix of a figure as charts for a page."""
TIME_LABEL = since(0.0)
"""Label of an axis of time from the begin of a recording on."""
PAGE_SUFFIXES = (".svg", CHARTS)
"""Suffixes of what a page takes of a figure."""
LOOK: dict[Any, Any] = {"font.size": 9, "axes.titlesize": 10, "axes.titley": 1.0}
"""Sizes of text, points; the height of titles is given, so that no ticks are measured to find it."""
TITLE_WIDTH = 150
"""Characters of a line of the title of a sketch."""
FILE_DPI = 130
"""Dots of a PNG on an inch: a panel of 4.6 inches fills a third of a common screen."""


POWER = re.compile(r"\^\{([-\u2212]?\d+)\}")
"""The exponent of a number that is set as mathematics."""
RAISED = str.maketrans(
    "-\u22120123456789", "\u207b\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)
"""Raised forms of minus and digits."""


SET_AS_MATHEMATICS = str.maketrans("", "", "${} ")
"""Signs that say so."""


class PlainPowers(LogFormatterSciNotation):
    """Labels of a logarithmic axis with raised digits: set as mathematics they take as long as the rest of a figure."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a number."""
        label = POWER.sub(lambda power: power[1].translate(RAISED), super().__call__(x, pos))
        return label.replace(r"\times", "\u00d7").replace(r"\mathdefault", "").translate(SET_AS_MATHEMATICS)


class ShownFigure(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_png_(self) -> bytes:
        """Return the figure for a notebook."""
        return figure_bytes(self, ".png")


@dataclass(frozen=True)
class Sketch:
    """A figure that is yet to be drawn, of panels that draw themselves.

    Attributes
    ----------
    name : str
        Of its files, without a suffix.
    caption : str
        What it shows: its title.
    panels : sequence of callable
        Each draws one panel, row by row.
    shape : (int, int)
        Rows and columns of panels.
    height : float
        Inches.
    origin : float
        Time 0 of panels labelled `TIME_LABEL` on the clock of the recording, s.
    """

    name: str
    caption: str
    panels: Sequence[Callable[[Axes], None]]
    shape: tuple[int, int] = (1, 2)
    height: float = 4.4
    origin: float = 0.0

    def files(self, suffixes: Sequence[str] = PAGE_SUFFIXES) -> dict[str, bytes]:
        """Return it drawn, as files by their names."""
        with new_figure((11.0, self.height), coarse=True) as figure:
            for panel, draw in zip(
                figure.subplots(*self.shape, squeeze=False).flat, self.panels, strict=True
            ):
                draw(panel)
                if panel.get_xlabel() == TIME_LABEL:
                    panel.set_xlabel(since(self.origin))
            figure.suptitle(fill(self.caption, TITLE_WIDTH), fontsize=9, parse_math=False)
        return rendered(figure, self.name, suffixes)


@contextmanager
def new_figure(size: tuple[float, float], *, coarse: bool = False) -> Iterator[Figure]:
    """Yield an empty figure of a size in inches; give its panels afterwards their grid, legend and labels.

    They are laid out when they are first drawn. Log axes of a `coarse` figure have no ticks between decades.
    """
    with mpl.rc_context(LOOK):
        figure = ShownFigure(figsize=size, layout="constrained")
        yield figure
        for panel in figure.axes:
            if panel.get_label() != COLOUR_SCALE:
                panel.grid(which="major", color="0.9", lw=0.6)
            if panel.get_legend_handles_labels()[0] and panel.get_legend() is None:
                panel.legend(fontsize=7, framealpha=0.85)
        label_plainly(figure)
        for axis in _wide_axes(figure) if coarse else ():
            axis.set_minor_locator(NullLocator())


def label_plainly(figure: Figure) -> None:
    """Give logarithmic axes the labels of `PlainPowers`."""
    for axis in (axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatter):
            axis.set_major_formatter(PlainPowers())
            axis.set_minor_formatter(PlainPowers())


def lay_out(figure: Figure) -> None:
    """Place the panels once for all files, which takes as long as drawing them.

    Ticks between decades have no labels there and would take two thirds of the time.
    """
    layout = figure.get_layout_engine()
    if layout is None:
        return
    unlabelled = [(axis, axis.get_minor_locator()) for axis in _wide_axes(figure)]
    for axis, _ in unlabelled:
        axis.set_minor_locator(NullLocator())
    layout.execute(figure)
    for axis, locator in unlabelled:
        axis.set_minor_locator(locator)
    figure.set_layout_engine(None)


def _wide_axes(figure: Figure) -> list[Axis]:
    """Return the logarithmic axes on which ticks between decades have no labels."""
    every = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    ends = [(axis, axis.get_view_interval()) for axis in every if axis.get_scale() == "log"]
    return [axis for axis, (low, high) in ends if 0.0 < low * 10.0**LABELLED_DECADES < high]


def rendered(figure: Figure, name: str, suffixes: Sequence[str] = PAGE_SUFFIXES) -> dict[str, bytes]:
    """Return the files of a figure by their names, one a suffix."""
    return {f"{name}{suffix}": figure_bytes(figure, suffix) for suffix in suffixes}


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure: PNG, SVG, … by the suffix of the path."""
    write_bytes(path, figure_bytes(figure, path.suffix))


def draw_all(figures: Sequence[Callable[[], Mapping[str, bytes]]]) -> dict[str, bytes]:
    """Return the files of figures by their names; each of `figures` draws one, all processors share them."""
    return {name: content for made in each(lambda draw: draw(), figures) for name, content in made.items()}


def figure_bytes(figure: Figure, suffix: str) -> bytes:
    """Return a figure as a file, its format by a suffix: no date, and names of parts that follow from their content.

    With the suffix ``.json``, the charts of its panels: ``null`` where it has none.
    """
    if suffix.lstrip(".") == CHARTS.lstrip("."):
        return json.dumps(charts_of_figure(figure), separators=(",", ":")).encode()
    content = BytesIO()
    kind = suffix.lstrip(".").lower() or "png"
    dateless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({**LOOK, "svg.fonttype": "none", "svg.hashsalt": "tuner"}):
        lay_out(figure)
        figure.savefig(content, dpi=FILE_DPI, format=kind, metadata=dateless)
    return content.getvalue()
