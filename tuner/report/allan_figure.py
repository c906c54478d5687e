"""The Allan figure: the measured curve with its interval, the fitted sum of noise terms, and each term.

One row a sensor, one column an axis, log–log, in customary units. Beyond a fifth of the record the curve is drawn
faded: each point there rests on fewer than about four independent differences.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.arrays import FloatArray
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, symbol, with_interval
from tuner.formats.files import Put, write_bytes
from tuner.report.figure_files import new_figure
from tuner.types import ChannelIdentification, Identification
from tuner.types.prediction import PredictedBlock

MEASURED_COLOUR = "#1f5fa8"
MODEL_COLOUR = "#c2410c"
PREDICTED_COLOUR = "#111827"
TERM_COLOURS = {
    "quantization": "#7c3aed",
    "white": "#0f766e",
    "bias_instability": "#a16207",
    "gauss_markov": "#be185d",
    "random_walk": "#15803d",
    "ramp": "#475569",
}
SLOPES = {
    "quantization": "slope −1",
    "white": "slope −1/2",
    "bias_instability": "slope 0",
    "random_walk": "slope +1/2",
    "ramp": "slope +1",
    "gauss_markov": "Gauss–Markov peak",
}
WELL_KNOWN_SHARE = 0.2
"""Share of the record up to which the empirical curve is drawn in full: beyond a fifth, few differences remain."""
MARGIN_INCHES = {"left": 0.75, "right": 0.15, "bottom": 0.5, "top": 0.3, "title": 0.3}
"""Room about the panels for labels and their titles, and that of the title of the figure."""
GAP_SHARES = {"wspace": 0.05, "hspace": 0.22}
"""Room between panels as shares of one: for numbers at the left, for label and title above one another."""
LEGEND_WIDTH = 60
"""Characters in a line of the legend beyond which each parameter gets a line: about as many as fit into a panel."""


def allan_figure(
    identification: Identification,
    paths: Sequence[Path] = (),
    *,
    title: str = "",
    predictions: Mapping[str, PredictedBlock] = MappingProxyType({}),
    put: Put = write_bytes,
) -> Figure:
    """Draw every channel of an identification, with what the written settings predict where that is known.

    One file a path is handed to `put`: PNG, SVG, … by its suffix.
    """
    channels = list(identification.channels.values())
    units = list(dict.fromkeys(c.unit for c in channels))
    rows = [[c for c in channels if c.unit == unit] for unit in units]
    columns = max(len(row) for row in rows)
    size = width, height = (4.6 * columns + 0.4, 4.1 * len(rows) + 0.7)
    room = MARGIN_INCHES
    margins = {
        "left": room["left"] / width,
        "right": 1.0 - room["right"] / width,
        "bottom": room["bottom"] / height,
        "top": 1.0 - (room["top"] + (room["title"] if title else 0.0)) / height,
        **GAP_SHARES,
    }
    with new_figure(size, paths, put, margins=margins) as figure:
        grid = figure.subplots(len(rows), columns, squeeze=False, sharey="row")
        for row, panels in zip(rows, grid, strict=True):
            for channel, panel in zip(row, panels, strict=False):
                _draw_channel(panel, channel, predictions.get(channel.axis))
            for panel in panels[len(row) :]:
                panel.set_visible(False)
            panels[0].set_ylabel(f"Allan deviation, {pretty(customary_unit('level', row[0].unit))}")
        if title:
            figure.suptitle(title, parse_math=False)
    return figure


def _draw_channel(panel: Axes, channel: ChannelIdentification, predicted: PredictedBlock | None) -> None:
    def shown(values: FloatArray) -> FloatArray:
        return values * in_customary(1.0, "level", channel.unit)

    curve = channel.allan
    tau, deviation = curve.tau, shown(curve.deviation()[:, 0])
    low, high = (shown(limit[:, 0]) for limit in curve.interval())
    limit = WELL_KNOWN_SHARE * channel.span
    for part, strength in ((tau <= limit, 1.0), (tau >= limit, 0.3)):
        panel.fill_between(
            tau[part], low[part], high[part], color=MEASURED_COLOUR, alpha=0.18 * strength, lw=0
        )
        panel.plot(tau[part], deviation[part], "o", ms=2.4, color=MEASURED_COLOUR, alpha=strength, mew=0)
    fine = np.geomspace(tau[0], tau[-1], 200)
    if predicted is not None:
        _draw_prediction(panel, predicted, shown)
    _draw_model(panel, channel, fine, shown)
    if tau[-1] > limit:
        panel.axvline(limit, color="0.6", lw=0.8, ls=":")
        panel.annotate(
            "beyond T/5: few differences →",
            (limit, 0.02),
            xycoords=("data", "axes fraction"),
            xytext=(-3, 0),
            textcoords="offset points",
            fontsize=7,
            color="0.45",
            ha="right",
        )
    panel.set(xscale="log", yscale="log", xlabel="cluster time τ, s", title=channel.axis)
    panel.set_ylim(0.4 * np.nanmin(deviation), 6.0 * np.nanmax(deviation))
    panel.grid(which="major", color="0.88", lw=0.6)


def _draw_prediction(panel: Axes, found: PredictedBlock, shown: Callable[[FloatArray], FloatArray]) -> None:
    tau = found.measured.tau[found.measured.tau >= found.curve.tau[0]]
    predicted = shown(np.sqrt(found.block.allan_variance(tau, found.measured.interval)))
    panel.plot(tau, predicted, color=PREDICTED_COLOUR, lw=2.6, alpha=0.45, label="what the settings predict")


def _draw_model(
    panel: Axes, channel: ChannelIdentification, tau: FloatArray, shown: Callable[[FloatArray], FloatArray]
) -> None:
    if not channel.model.terms:
        return
    total = channel.model.allan_variance(tau)
    panel.plot(tau, shown(np.sqrt(total)), color=MODEL_COLOUR, lw=1.3, label="identified terms")
    for term in channel.model.terms:
        variance = term.allan_variance(tau)
        colour = TERM_COLOURS.get(term.name, "0.4")
        panel.plot(
            tau, shown(np.sqrt(variance)), color=colour, lw=0.8, ls="--", label=term_label(channel, term.name)
        )
        at = int(np.argmax(np.where((tau > 2 * tau[0]) & (tau < 0.3 * tau[-1]), variance / total, 0.0)))
        mark = panel.annotate(
            term.SYMBOLS[0] if term.SYMBOLS else term.name,
            (tau[at], shown(np.sqrt(variance[at : at + 1]))[0]),
            xytext=(3, 5) if term.SYMBOLS else (-3, -10),
            textcoords="offset points",
            ha="left" if term.SYMBOLS else "right",
            fontweight="bold",
            color=colour,
            annotation_clip=True,
        )
        mark.set_in_layout(False)
    legend = panel.legend(fontsize=7, loc="upper right", framealpha=0.85, handlelength=1.6)
    legend.set_in_layout(False)


def term_label(channel: ChannelIdentification, name: str) -> str:
    """Return a term of an axis with its coefficients and slope, for a legend."""
    estimate = channel.term(name)
    if estimate is None:
        return name
    parts = []
    for field, coefficient in estimate.coefficients.items():
        quantity = f"{name}.{field}"
        if coefficient.value is None:
            continue
        value, *ends = (
            in_customary(number, quantity, channel.unit)
            for number in (coefficient.value, *(coefficient.interval or ()))
        )
        shown = with_interval(value, *ends) if ends else digits(value)
        text = f"{symbol(quantity).removeprefix(f'{name} ')} {shown}"
        parts.append(f"{text} {pretty(customary_unit(quantity, channel.unit))}")
    line = f"{SLOPES.get(name, name)}: " + ", ".join(parts)
    return line if len(line) <= LEGEND_WIDTH else f"{SLOPES.get(name, name)}: " + ",\n".join(parts)
