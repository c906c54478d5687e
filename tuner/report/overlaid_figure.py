"""Allan curves of several sensors over one another: one panel a kind of sensor, one colour a source."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tuner.formats.customary_units import in_customary
from tuner.identification.comparison import Comparison
from tuner.report.curve_panels import SOURCE_COLOURS, STATED_TAU, draw_banded, sensor_panels
from tuner.types import ChannelIdentification


def overlaid_figure(comparison: Comparison) -> Figure:
    """Draw every axis of every source: measured as points with their fit, stated as a dashed line."""
    units = [c.unit for one in comparison.sources for c in one.channels.values()]
    with sensor_panels(units) as (figure, panels):
        for k, (name, source) in enumerate(zip(comparison.names, comparison.sources, strict=True)):
            for channel in source.channels.values():
                first = next(c for c in source.channels.values() if c.unit == channel.unit)
                label = name if channel is first else None
                _draw(panels[channel.unit], channel, SOURCE_COLOURS[k % len(SOURCE_COLOURS)], label)
    return figure


def _draw(panel: Axes, channel: ChannelIdentification, colour: str, label: str | None) -> None:
    scale, tau = in_customary(1.0, "level", channel.unit), np.geomspace(*STATED_TAU, 200)
    if measured := channel.span > 0.0:
        tau = channel.allan.tau
        ends = (scale * limit[:, 0] for limit in channel.allan.interval())
        draw_banded(
            panel, tau, scale * channel.allan.deviation()[:, 0], ends, ".", ms=3, color=colour, label=label
        )
    if channel.model.terms:
        deviation, style = scale * np.sqrt(channel.model.allan_variance(tau)), "-" if measured else "--"
        panel.plot(tau, deviation, style, lw=1.0, color=colour, label=None if measured else label)
