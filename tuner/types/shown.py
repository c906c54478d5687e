"""What a notebook does with any result: a table on display, an answer in print, a figure, a data frame, a dataset.

How each type is shown is declared in `tuner.report.result_views`, above all rooms that make results. It is imported by
its name when a result is first shown, so that no room depends on it and results stay cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

VIEWS = "tuner.report.result_views"
"""Module that declares the views."""


class Shown:
    """A result that shows itself."""

    def plot(self) -> Figure:
        """Return the figure that goes with the result."""
        figure: Figure = _views().view_of(self).figure(self)
        return figure

    def to_pandas(self) -> pd.DataFrame:
        """Return the numbers as a data frame: SI with a column for the unit, or the unit in the name of a column."""
        frame: pd.DataFrame = _views().view_of(self).frame(self)
        return frame

    def to_xarray(self) -> Any:
        """Return the same as an `xarray.Dataset` on its axes; needs the extra ``xarray``."""
        return _views().dataset_of(self)

    def __repr__(self) -> str:
        """Return the answer in the few lines that the command prints."""
        text: str = _views().text_of(self)
        return text

    def _repr_html_(self) -> str:
        """Return tables for a notebook."""
        html: str = _views().html_of(self)
        return html


def _views() -> Any:
    return importlib.import_module(VIEWS)
