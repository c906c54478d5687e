"""One look of all figures of a report, and their files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, LogFormatterSciNotation, NullLocator

from tuner.formats.files import Put, write_bytes
from tuner.jobs import each
from tuner.report.interactive_figure import charts_of_figure

LABELLED_DECADES = 2.0
"""Decades of an axis beyond which ticks between them are without labels: two of their own are then on it."""
CHARTS = ".json"
"""Suffix of a figure as charts for a page."""
TITLE_PLACE = 1.0
"""Height of the title of a panel, as a share of it: given, so that no ticks are measured to find it."""
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


@contextmanager
def new_figure(
    size: tuple[float, float],
    paths: Sequence[Path] = (),
    put: Put = write_bytes,
    *,
    margins: Mapping[str, float] | None = None,
    coarse: bool = False,
) -> Iterator[Figure]:
    """Yield an empty figure of a size in inches; write it afterwards, PNG, SVG, … by the suffix of each path.

    The same figure gives the same bytes: no date, and names of its parts that follow from their content.

    Its panels are laid out once for all files: that takes as long as drawing them. With `margins`, those of
    `Figure.subplots_adjust`, nothing is measured; of a `coarse` figure, log axes have no ticks between decades.
    """
    with mpl.rc_context({"font.size": 9, "axes.titlesize": 10, "axes.titley": TITLE_PLACE}):
        figure = ShownFigure(figsize=size, layout="constrained" if margins is None else None)
        if margins is not None:
            figure.subplots_adjust(**margins)
        yield figure
        label_plainly(figure)
        if margins is None:
            lay_out(figure)
        for axis in _wide_axes(figure) if coarse else ():
            axis.set_minor_locator(NullLocator())
        for path in paths:
            put(path, figure_bytes(figure, path.suffix))


def label_plainly(figure: Figure) -> None:
    """Give logarithmic axes the labels of `PlainPowers`."""
    for axis in (axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatter):
            axis.set_major_formatter(PlainPowers())
            axis.set_minor_formatter(PlainPowers())


def lay_out(figure: Figure) -> None:
    """Place the panels; ticks between decades have no labels there and would take two thirds of the time."""
    layout = figure.get_layout_engine()
    assert layout is not None
    unlabelled = [(axis, axis.get_minor_locator()) for axis in _wide_axes(figure)]
    for axis, _ in unlabelled:
        axis.set_minor_locator(NullLocator())
    layout.execute(figure)
    for axis, locator in unlabelled:
        axis.set_minor_locator(locator)
    figure.set_layout_engine(None)


def _wide_axes(figure: Figure) -> list[Axis]:
    """Return the axes on which ticks between decades have no labels."""
    every = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    return [axis for axis in every if _decades(axis) > LABELLED_DECADES]


def _decades(axis: Axis) -> float:
    """Return over how many decades a logarithmic axis goes; 0 for an even one."""
    low, high = axis.get_view_interval()
    return float(np.log10(high / low)) if axis.get_scale() == "log" and 0.0 < low < high else 0.0


def draw_all(figures: Sequence[Callable[[Put], object]], put: Put) -> None:
    """Draw figures on all processors, and hand their files to `put` in their order.

    Each of `figures` draws one and hands its files to its argument.
    """

    def files(draw: Callable[[Put], object]) -> dict[Path, bytes]:
        made: dict[Path, bytes] = {}
        draw(made.__setitem__)
        return made

    for made in each(files, figures):
        for path, content in made.items():
            put(path, content)


def figure_bytes(figure: Figure, suffix: str) -> bytes:
    """Return a figure as a file, its format by a suffix: no date, and names of parts that follow from their content.

    With the suffix ``.json``, the charts of its panels: ``null`` where it has none.
    """
    if suffix.lstrip(".") == CHARTS.lstrip("."):
        return json.dumps(charts_of_figure(figure), separators=(",", ":")).encode()
    content = BytesIO()
    kind = suffix.lstrip(".").lower() or "png"
    dateless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "tuner"}):
        figure.savefig(content, dpi=FILE_DPI, format=kind, metadata=dateless)
    return content.getvalue()
