"""Empirical curves in tables: the Allan family, the spectrum, correlation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.table import Table

from tuner.formats.customary_units import (
    customary_unit,
    digits,
    in_customary,
    pretty,
)
from tuner.types import (
    AllanCurve,
    Correlogram,
    Spectrum,
)

ANSWER_ROWS = 8
"""Rows of a curve in an answer: one for each half decade of four."""


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


def curve_answer(found: AllanCurve | Spectrum | Correlogram) -> list[Table | str]:
    """Return the table of some rows of a curve, evenly spread, and how many there are."""
    grid = "tau" if isinstance(found, AllanCurve) else "frequency" if isinstance(found, Spectrum) else "lag"
    count = len(getattr(found, grid))
    rows = np.unique(np.linspace(0, count - 1, ANSWER_ROWS).astype(int))
    fields = (grid, "value") if grid == "lag" else (grid, "variance" if grid == "tau" else "density", "dof")
    few = replace(found, **{name: getattr(found, name)[rows] for name in fields})
    return [*statistic_tables(few), f"{len(rows)} of {count} rows. All: --verbose"]


def _deviation_table(curve: AllanCurve) -> Table:
    """Return one Allan-type curve: cluster time, deviation with its 95 % interval, degrees of freedom."""
    unit = pretty(customary_unit("level", curve.unit))
    table = Table(title=f"{curve.estimator}, deviation in {unit} (95 % interval), degrees of freedom")
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
            cells.append(f"{value} ({a} … {b})  {digits(float(curve.dof[i, j]))}")
        table.add_row(digits(float(tau), 5), *cells)
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
