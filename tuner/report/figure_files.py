"""One look of all figures of a report, and their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from tuner.formats.files import Put, write_bytes

FILE_DPI = 130
"""Dots of a PNG on an inch: a panel of 4.6 inches fills a third of a common screen."""


@contextmanager
def new_figure(size: tuple[float, float], paths: Sequence[Path], put: Put = write_bytes) -> Iterator[Figure]:
    """Yield an empty figure of a size in inches; write it afterwards, PNG, SVG, … by the suffix of each path.

    The same figure gives the same bytes: no date, and names of its parts that follow from their content.

    Its panels are laid out once for all files: that takes as long as drawing them.
    """
    with mpl.rc_context(
        {"font.size": 9, "axes.titlesize": 10, "svg.fonttype": "none", "svg.hashsalt": "tuner"}
    ):
        figure = Figure(figsize=size, layout="constrained")
        yield figure
        layout = figure.get_layout_engine()
        assert layout is not None
        layout.execute(figure)
        figure.set_layout_engine(None)
        for path in paths:
            put(path, figure_bytes(figure, path.suffix))


def figure_bytes(figure: Figure, suffix: str) -> bytes:
    """Return a figure as a file of the format of a suffix, without a date."""
    content = BytesIO()
    kind = suffix.lstrip(".").lower() or "png"
    dateless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    figure.savefig(content, dpi=FILE_DPI, format=kind, metadata=dateless)
    return content.getvalue()
