"""The settings of a filter beside the identified terms, and whether they predict the record: one row an axis."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from tuner.report.titled_table import titled_table
from tuner.types.prediction import BlockSource, PredictedBlock

SOURCES = {
    BlockSource.LIKELIHOOD: "identified terms",
    BlockSource.CURVE: "fitted to the Allan curve",
    BlockSource.CURVE_WITH_MOTION: "fitted to the Allan curve, beside motion",
}
"""Where the settings of an axis come from, in words."""


def prediction_tables(predictions: Mapping[str, PredictedBlock]) -> list[Table]:
    """Return the comparison of every axis; nothing where no record was long enough to judge."""
    horizons = sorted({f.horizon for found in predictions.values() for f in found.forecasts})
    rows = []
    for axis, found in predictions.items():
        ratios = {f.horizon: f"{f.ratio:.2f}" for f in found.forecasts}
        ratio, tau = found.curve.ratio, found.curve.tau
        curve = f"{ratio.min():.2f} … {ratio.max():.2f}, τ {tau[0]:.3g} … {tau[-1]:.3g} s"
        forecasts = (ratios.get(horizon, "–") for horizon in horizons)
        rows.append([axis, SOURCES[found.source], "yes" if found.passes else "no", curve, *forecasts])
    heads = ["axis", "settings from", "predicts it", "Allan deviation, predicted ÷ measured"]
    return titled_table(
        "Does the configuration predict its own record? (s ahead: error of the integral, true ÷ predicted)",
        [*heads, *(f"{horizon:g} s ahead" for horizon in horizons)],
        rows,
        words=len(heads),
    )
