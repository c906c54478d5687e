"""One look of all figures of a report, and their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from tuner.formats.files import whole_file

FILE_DPI = 130
"""Dots of a PNG on an inch: a panel of 4.6 inches fills a third of a common screen."""


@contextmanager
def new_figure(size: tuple[float, float], paths: Sequence[Path]) -> Iterator[Figure]:
    """Yield an empty figure of a size in inches; write it afterwards, PNG, SVG, … by the suffix of each path.

    Its panels are laid out once for all files: that takes as long as drawing them.
    """
    with mpl.rc_context({"font.size": 9, "axes.titlesize": 10, "svg.fonttype": "none"}):
        figure = Figure(figsize=size, layout="constrained")
        yield figure
        layout = figure.get_layout_engine()
        assert layout is not None
        layout.execute(figure)
        figure.set_layout_engine(None)
        for path in paths:
            with whole_file(path) as temporary:
                figure.savefig(temporary, dpi=FILE_DPI)
