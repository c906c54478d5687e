"""The settings of a filter beside the identified terms, and whether they predict the record: one row an axis."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty
from tuner.synthesis.prediction import FITTED
from tuner.types import ChannelIdentification, ChannelNoise, FilterConfig, Identification
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


def settings_tables(config: FilterConfig, identification: Identification) -> list[Table | str]:
    """Return what a filter is given of each axis, and how far that is from the identified white noise.

    Settings that are fitted to the Allan curve have no interval: their terms are only determined together.
    """
    answer: list[Table | str] = []
    axes = [axis for axis in config.channels if axis in identification.channels]
    for unit in dict.fromkeys(config.channels[axis].unit for axis in axes):
        density, walk, level = (
            pretty(customary_unit(name, unit)) for name in ("white.density", "random_walk.density", "level")
        )
        table = Table(title="Settings of a filter, as `tuner tune` writes them")
        table.add_column("axis")
        table.add_column(f"N, {density}", justify="right")
        table.add_column("÷ identified N", justify="right")
        table.add_column(f"bias states, {level} (time constant)")
        table.add_column(f"K, {walk}", justify="right")
        table.add_column("from")
        for axis in [axis for axis in axes if config.channels[axis].unit == unit]:
            noise = config.channels[axis]
            states = ", ".join(
                f"{digits(in_customary(s.sd, 'level', unit))} ({digits(s.time_constant)} s)"
                for s in noise.markov
            )
            table.add_row(
                axis,
                digits(in_customary(noise.white_density, "white.density", unit)),
                _share(noise, identification.channels[axis]),
                states or "–",
                digits(in_customary(noise.random_walk_density, "random_walk.density", unit)),
                "the Allan curve" if FITTED in noise.handling.values() else "the identified terms",
            )
        answer.append(table)
    return answer


def _share(noise: ChannelNoise, channel: ChannelIdentification) -> str:
    density = channel.model.white_density()
    return digits(noise.white_density / density) if density > 0.0 else "–"


def _curve(found: PredictedBlock) -> str:
    ratio, tau = found.curve.ratio, found.curve.tau
    return f"{ratio.min():.2f} … {ratio.max():.2f}, τ {tau[0]:.3g} … {tau[-1]:.3g} s"
