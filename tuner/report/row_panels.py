"""Named rows of marks: values with their intervals along one axis, a limit across all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.arrays import FloatArray
from tuner.report.figure_files import new_figure

ROUND_DIGITS = (
    (3.0, (1.0, 1.1, 1.2, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)),
    (300.0, (1.0, 1.4, 2.0, 3.0, 5.0, 7.0)),
    (math.inf, (1.0,)),
)
"""First digits that are named along an axis, by the ratio of its ends up to which they are."""


@dataclass(frozen=True)
class Mark:
    """A value on a row of a figure, its interval, or both.

    Attributes
    ----------
    value : float or ndarray, shape (n,), optional
        Drawn with `sign`; several are of one look.
    colour : str
        Of value and interval.
    interval : (float, float), optional
        Drawn as a line, `width` points wide.
    label : str, optional
        In the legend, once for all marks that share it.
    up : float
        Rows above the middle of its own.
    text : str
        Beside the value.
    """

    value: float | FloatArray | None
    colour: str
    interval: tuple[float, float] | None = None
    label: str | None = None
    sign: str = "o"
    width: float = 2.0
    up: float = 0.0
    text: str = ""


def draw_rows(panel: Axes, rows: Sequence[tuple[str, Sequence[Mark]]]) -> None:
    """Draw named rows of marks from top to bottom."""
    for k, (_, marks) in enumerate(rows):
        for mark in marks:
            at, said = k - mark.up, panel.get_legend_handles_labels()[1]
            if mark.interval is not None:
                panel.plot(mark.interval, [at, at], color=mark.colour, lw=mark.width, solid_capstyle="butt")
            if mark.value is not None:
                values, label = np.atleast_1d(mark.value), None if mark.label in said else mark.label
                panel.plot(values, np.full(len(values), at), mark.sign, color=mark.colour, label=label)
            if mark.text:
                panel.annotate(mark.text, (mark.value, at), va="center", fontsize=8)
    panel.set_yticks(range(len(rows)), [name for name, _ in rows])
    panel.invert_yaxis()


def _ticks(low: float, high: float) -> list[float]:
    """Return round numbers of a logarithmic axis from end to end: few rows span decades, most a factor of 2."""
    digits = next(digits for reach, digits in ROUND_DIGITS if high <= reach * low)
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)))
    every = [float(f"{digit}e{power}") for power in powers for digit in digits]
    return [one for one in every if low <= one <= high]


def row_figure(
    rows: Sequence[tuple[str, Sequence[Mark]]],
    what: str,
    limit: float | None = None,
    limit_label: str | None = None,
    nothing: str = "",
) -> Figure:
    """Return named rows of marks along a logarithmic axis, with a limit on it; without a row, words that say so."""
    with new_figure((9.4, 1.4 + 0.3 * max(len(rows), 1))) as figure:
        panel = figure.subplots()
        draw_rows(panel, rows)
        if limit is not None:
            panel.axvline(limit, color="0.3", lw=1.0, ls="--" if limit_label else "-", label=limit_label)
        panel.set(xlabel=what, title="" if rows else nothing)
        if rows:
            panel.set_xscale("log")
            ticks = _ticks(*panel.get_xlim())
            panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            panel.minorticks_off()
    return figure
