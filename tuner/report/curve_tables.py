"""Empirical curves in tables: the Allan family, the spectrum, correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rich.table import Table

from tuner.formats.customary_units import (
    customary_unit,
    digits,
    in_customary,
    pretty,
)
from tuner.report.document import Document, document
from tuner.types import (
    AllanCurve,
    Correlogram,
    Spectrum,
)

ANSWER_ROWS = 9
"""Rows of a curve in an answer: one for each half decade of four and a half, of two sensors on one screen."""


def statistic_tables(found: AllanCurve | Spectrum | Correlogram) -> list[Table | str]:
    """Return the table of any empirical curve."""
    if isinstance(found, AllanCurve):
        return [_deviation_table(found)]
    if isinstance(found, Spectrum):
        return [_spectrum_table(found)]
    table = Table(title=f"{found.statistic}, white noise stays within ± {digits(found.band)} at 95 %")
    table.add_column("lag, s", justify="right")
    for axis in found.axes:
        table.add_column(axis, justify="right")
    for lag, row in zip(found.lag, found.value, strict=True):
        table.add_row(digits(float(lag), 5), *(f"{value:+.4f}" for value in row))
    return [table]


def curve_answer(found: Sequence[AllanCurve | Spectrum | Correlogram], names: Sequence[str]) -> Document:
    """Return some rows of the curves of a log, evenly spread, and of an Allan-type curve its least deviation."""
    parts: list[Table | str] = []
    grids = []
    for one in found:
        grid = "tau" if isinstance(one, AllanCurve) else "frequency" if isinstance(one, Spectrum) else "lag"
        grids.append(getattr(one, grid))
        rows = np.unique(np.linspace(0, len(grids[-1]) - 1, ANSWER_ROWS).astype(int))
        fields = (
            (grid, "value") if grid == "lag" else (grid, "variance" if grid == "tau" else "density", "dof")
        )
        parts += statistic_tables(replace(one, **{name: getattr(one, name)[rows] for name in fields}))
        if isinstance(one, AllanCurve):
            parts.append(_least(one))
    unit = "Hz" if isinstance(found[0], Spectrum) else "s"
    ends = f"{digits(float(grids[0][0]), 2)} to {digits(float(grids[0][-1]), 3)} {unit}"
    said = f"{', '.join(names)}: raw, no part of the log left out; {len(grids[0])} points, {ends}"
    return document([said, *parts], beyond="all points")


def _least(curve: AllanCurve) -> str:
    """Return where the deviation of each axis is least; at the end of the record nothing shows that it rises again."""
    deviation = curve.deviation()
    parts = [
        f"{axis.rpartition('_')[2]} {digits(in_customary(float(column.min()), 'level', curve.unit))} at "
        f"{digits(float(curve.tau[int(column.argmin())]))} s"
        + ", the end"
        * (int(column.argmin()) == len(column) - 1)
        for axis, column in zip(curve.axes, deviation.T, strict=True)
    ]
    return f"Least: {'; '.join(parts)}"


def _deviation_table(curve: AllanCurve) -> Table:
    """Return one Allan-type curve: averaging time, and deviation with its 95 % interval."""
    unit = pretty(customary_unit("level", curve.unit))
    table = Table(title=f"{curve.estimator}, deviation in {unit} (95 % interval)")
    table.add_column("τ, s", justify="right")
    for axis in curve.axes:
        table.add_column(axis, justify="right")
    deviation, (low, high) = curve.deviation(), curve.interval()
    for i, tau in enumerate(curve.tau):
        cells = []
        for j in range(len(curve.axes)):
            value, a, b = (
                digits(in_customary(float(x[i, j]), "level", curve.unit)) for x in (deviation, low, high)
            )
            cells.append(f"{value} ({a} … {b})")
        table.add_row(digits(float(tau), 4), *cells)
    return table


def _spectrum_table(found: Spectrum) -> Table:
    unit = "(deg/h)²/Hz" if found.unit == "rad/s" else "µg²/Hz"
    scale = in_customary(1.0, "level", found.unit) ** 2
    table = Table(title=f"two-sided power spectral density, {unit} (95 % interval)")
    table.add_column("frequency, Hz", justify="right")
    for axis in found.axes:
        table.add_column(axis, justify="right")
    low, high = found.interval()
    for i, frequency in enumerate(found.frequency):
        cells = [
            " ".join(
                (
                    digits(scale * float(found.density[i, j])),
                    f"({digits(scale * float(low[i, j]))} … {digits(scale * float(high[i, j]))})",
                )
            )
            for j in range(len(found.axes))
        ]
        table.add_row(digits(float(frequency), 4), *cells)
    return table
