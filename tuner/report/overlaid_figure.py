"""Allan curves of several sensors over one another: one panel a kind of sensor, one colour a source."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tuner.formats.customary_units import customary_unit, in_customary, pretty
from tuner.formats.files import write_bytes
from tuner.identification.comparison import Comparison
from tuner.report.figure_files import new_figure
from tuner.types import ChannelIdentification

SOURCE_COLOURS = ("#1f5fa8", "#c2410c", "#15803d", "#7c3aed", "#a16207", "#be185d", "#0f766e", "#475569")
"""One a source, in order; they begin again where there are more."""
SENSORS = {"rad/s": "gyros", "m/s^2": "accelerometers"}
STATED_TAU = (0.01, 1e4)
"""Cluster times over which a data sheet is drawn, s."""


def overlaid_figure(comparison: Comparison, paths: Sequence[Path] = ()) -> Figure:
    """Draw every axis of every source: measured as points with their fit, stated as a dashed line."""
    units = list(dict.fromkeys(c.unit for one in comparison.sources for c in one.channels.values()))
    with new_figure((5.4 * len(units) + 0.4, 4.4), paths, write_bytes) as figure:
        panels = figure.subplots(1, len(units), squeeze=False)[0]
        for unit, panel in zip(units, panels, strict=True):
            for k, (name, source) in enumerate(zip(comparison.names, comparison.sources, strict=True)):
                own = [c for c in source.channels.values() if c.unit == unit]
                for index, channel in enumerate(own):
                    _draw(
                        panel, channel, SOURCE_COLOURS[k % len(SOURCE_COLOURS)], name if index == 0 else None
                    )
            panel.set(xscale="log", yscale="log", xlabel="cluster time τ, s")
            panel.set_ylabel(f"Allan deviation, {pretty(customary_unit('level', unit))}")
            panel.set_title(SENSORS.get(unit, unit))
            panel.grid(which="major", color="0.88", lw=0.6)
            panel.legend(fontsize=8)
    return figure


def _draw(panel: Axes, channel: ChannelIdentification, colour: str, label: str | None) -> None:
    scale = in_customary(1.0, "level", channel.unit)
    measured = channel.span > 0.0
    if measured:
        tau = channel.allan.tau
        panel.plot(tau, scale * channel.allan.deviation()[:, 0], ".", ms=3, color=colour, label=label)
        low, high = (scale * limit[:, 0] for limit in channel.allan.interval())
        panel.fill_between(tau, low, high, color=colour, alpha=0.12, lw=0)
    else:
        tau = np.geomspace(*STATED_TAU, 200)
    if channel.model.terms:
        deviation = scale * np.sqrt(channel.model.allan_variance(tau))
        style = "-" if measured else "--"
        panel.plot(tau, deviation, style, lw=1.0, color=colour, label=None if measured else label)
