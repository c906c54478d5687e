"""Empirical curves as they are shown: the Allan family, the spectrum, correlation; the answer of `curve`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from models.arrays import FloatArray
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty
from tuner.report.document import Document, document
from tuner.report.titled_table import table_of
from tuner.types import AllanCurve, Correlogram, Spectrum

ANSWER_ROWS = 9
"""Rows of a curve in an answer: one for each half decade of four and a half, of two sensors on one screen."""
NO_BIAS_INSTABILITY = "A minimum is not bias instability B: that is a flat Allan deviation ÷ 0.664"
"""What a minimum is not."""
Curve = AllanCurve | Spectrum | Correlogram


@dataclass(frozen=True)
class ShownCurve:
    """A curve in customary units: names and values of both axes.

    Attributes
    ----------
    across, up : str
        What it is over, and what it is of, with their units.
    x, y : ndarray, shapes (n,), (n, k)
        Places, and values of k axes.
    ends : tuple of ndarray, shapes (n, k)
        Both of the 95 % interval; of a correlation none.
    """

    across: str
    up: str
    x: FloatArray
    y: FloatArray
    ends: tuple[FloatArray, ...] = ()


def shown_curve(found: Curve) -> ShownCurve:
    """Return an empirical curve in customary units."""
    if isinstance(found, Correlogram):
        return ShownCurve("lag, s", found.statistic, found.lag, found.value)
    one, unit = in_customary(1.0, "level", found.unit), pretty(customary_unit("level", found.unit))
    low, high = found.interval()
    if isinstance(found, AllanCurve):
        names = "cluster time τ, s", f"{found.estimator}, deviation in {unit}"
        return ShownCurve(*names, found.tau, one * found.deviation(), (one * low, one * high))
    ends = one**2 * low, one**2 * high
    names = "frequency, Hz", f"two-sided power spectral density, ({unit})²/Hz"
    return ShownCurve(*names, found.frequency, one**2 * found.density, ends)


def curve_table(found: Curve, rows: NDArray[np.intp] | None = None) -> Table:
    """Return a curve with its interval, some of its rows or all."""
    one = shown_curve(found)
    if isinstance(found, Correlogram):
        title = f"{one.up}, white noise stays within ± {digits(found.band)} at 95 %"
        cells = [[f"{value:+.4f}" for value in row] for row in one.y]
    else:
        each = np.stack([one.y, *one.ends], axis=-1)
        title = f"{one.up} (95 % interval)"
        cells = [[f"{digits(y)} ({digits(a)} … {digits(b)})" for y, a, b in row] for row in each.tolist()]
    chosen = range(len(one.x)) if rows is None else rows
    lines = ([f"{one.x[i]:.5g}", *cells[i]] for i in chosen)
    return table_of((one.across, *found.axes), lines, title=title, words=0)


def curve_answer(found: Sequence[Curve], names: Sequence[str]) -> Document:
    """Return some rows of the curves of a log, evenly spread, and of an Allan-type curve its minimum."""
    parts: list[Table | str] = []
    for one in found:
        count = len(shown_curve(one).x)
        parts.append(curve_table(one, np.unique(np.linspace(0, count - 1, ANSWER_ROWS).astype(int))))
        if isinstance(one, AllanCurve):
            parts.append(_minima(one))
    if isinstance(found[0], AllanCurve):
        parts.append(NO_BIAS_INSTABILITY)
    first = shown_curve(found[0])
    ends = f"{digits(float(first.x[0]), 2)} to {digits(float(first.x[-1]), 3)} {first.across.split()[-1]}"
    said = f"{', '.join(names)}: raw, no part of the log left out; {len(first.x)} points, {ends}"
    return document([said, *parts], more=map(curve_table, found), beyond="all points")


def _minima(curve: AllanCurve) -> str:
    """Return the minimum of the curve of each axis; at the end of the record nothing shows that it rises again."""
    deviation = shown_curve(curve).y
    last, unit = len(deviation) - 1, pretty(customary_unit("level", curve.unit))
    parts = [
        f"{axis.rpartition('_')[2]} {digits(float(column[k]))} at {digits(float(curve.tau[k]))} s"
        + ", the end" * (k == last)
        for axis, column, k in zip(curve.axes, deviation.T, deviation.argmin(axis=0).tolist(), strict=True)
    ]
    return f"Minimum, {unit}: {'; '.join(parts)}"
