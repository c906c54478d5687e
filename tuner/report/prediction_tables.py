"""The settings of a filter beside the identified terms, and whether they predict the record: one row an axis."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from tuner.types.prediction import BlockSource, PredictedBlock

SOURCES = {
    BlockSource.LIKELIHOOD: "identified terms",
    BlockSource.CURVE: "fitted to the Allan curve",
    BlockSource.CURVE_WITH_MOTION: "fitted to the Allan curve, beside motion",
}
"""Where the settings of an axis come from, in words."""


def prediction_tables(predictions: Mapping[str, PredictedBlock]) -> list[Table | str]:
    """Return the comparison of every axis; nothing where no record was long enough to judge."""
    if not predictions:
        return []
    horizons = sorted({f.horizon for found in predictions.values() for f in found.forecasts})
    table = Table(
        title="Does the configuration predict its own record? (s ahead: error of the integral, true ÷ predicted)"
    )
    table.add_column("axis")
    table.add_column("Allan deviation, predicted ÷ measured")
    for horizon in horizons:
        table.add_column(f"{horizon:g} s ahead", justify="right")
    table.add_column("settings from")
    table.add_column("predicts it")
    for axis, found in predictions.items():
        ratios = {f.horizon: f for f in found.forecasts}
        cells = [f"{ratios[h].ratio:.2f}" if h in ratios else "–" for h in horizons]
        table.add_row(axis, _curve(found), *cells, SOURCES[found.source], "yes" if found.passes else "no")
    return [table]


def _curve(found: PredictedBlock) -> str:
    ratio, tau = found.curve.ratio, found.curve.tau
    return f"{ratio.min():.2f} … {ratio.max():.2f}, τ {tau[0]:.3g} … {tau[-1]:.3g} s"
