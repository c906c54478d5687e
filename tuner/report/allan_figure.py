"""The Allan figure: the measured curve with its interval, the fitted sum of noise terms, and each term.

One row a sensor, one column an axis, log–log, in customary units. Beyond a fifth of the record the curve is drawn
faded: each point there rests on fewer than about four independent differences.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tuner.formats.customary_units import in_customary, phrase, symbol
from tuner.report.curve_panels import draw_banded, name_allan_axes
from tuner.report.figure_files import new_figure
from tuner.types import ChannelIdentification, Identification
from tuner.types.prediction import BlockSource, PredictedBlock

MEASURED_COLOUR = "#1f5fa8"
MODEL_COLOUR = "#c2410c"
PREDICTED_COLOUR = "#111827"
STATED_COLOUR = "#b91c1c"
TERM_COLOURS = {
    "quantization": "#7c3aed",
    "white": "#0f766e",
    "bias_instability": "#a16207",
    "gauss_markov": "#be185d",
    "random_walk": "#15803d",
    "ramp": "#475569",
}
TERM_STYLES = ("--", ":", "-.")
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
LEGEND_WIDTH = 60
"""Characters in a line of the legend beyond which each parameter gets a line: about as many as fit into a panel."""


def allan_figure(
    identification: Identification,
    *,
    title: str = "",
    predictions: Mapping[str, PredictedBlock] = MappingProxyType({}),
    stated: Mapping[str, ChannelIdentification] = MappingProxyType({}),
) -> Figure:
    """Draw every channel of an identification, with what settings predict and a data sheet states where it is known.

    Terms of an axis that do not predict its curve, so that its settings are fitted to the curve, are not drawn.
    """
    channels = list(identification.channels.values())
    units = list(dict.fromkeys(c.unit for c in channels))
    rows = [[c for c in channels if c.unit == unit] for unit in units]
    columns = max(len(row) for row in rows)
    with new_figure((4.6 * columns + 0.4, 4.1 * len(rows) + 0.7)) as figure:
        grid = figure.subplots(len(rows), columns, squeeze=False, sharey="row")
        for row, panels in zip(rows, grid, strict=True):
            for channel, panel in zip(row, panels, strict=False):
                _draw_channel(panel, channel, predictions.get(channel.axis), stated.get(channel.axis))
                panel.yaxis.label.set_visible(panel is panels[0])
            for panel in panels[len(row) :]:
                panel.set_visible(False)
            ends = [f(c.allan.deviation()) for c in row for f in (np.nanmin, np.nanmax)]
            one = in_customary(1.0, "level", row[0].unit)
            panels[0].set_ylim(0.4 * one * min(ends), 6.0 * one * max(ends))
        if title:
            figure.suptitle(title, parse_math=False)
    return figure


def _draw_channel(
    panel: Axes,
    channel: ChannelIdentification,
    predicted: PredictedBlock | None,
    stated: ChannelIdentification | None,
) -> None:
    one, curve, limit = (
        in_customary(1.0, "level", channel.unit),
        channel.allan,
        WELL_KNOWN_SHARE * channel.span,
    )
    name_allan_axes(panel, channel.unit)
    panel.set_title(channel.axis)
    for part, strength, label in (
        (curve.tau <= limit, 1.0, "measured, with 95 % band"),
        (curve.tau >= limit, 0.3, None),
    ):
        ends = (one * end[part, 0] for end in curve.interval())
        y = one * curve.deviation()[part, 0]
        look = {"ms": 2.4, "mew": 0, "alpha": strength, "color": MEASURED_COLOUR, "label": label}
        draw_banded(panel, curve.tau[part], y, ends, "o", **look)
    if predicted is not None:
        tau = predicted.measured.tau[predicted.measured.tau >= predicted.curve.tau[0]]
        y = one * np.sqrt(predicted.block.allan_variance(tau, predicted.measured.interval))
        panel.plot(tau, y, color=PREDICTED_COLOUR, lw=2.6, alpha=0.45, label="what the settings predict")
    fine = np.geomspace(curve.tau[0], curve.tau[-1], 200)
    refuted = predicted is not None and predicted.source is not BlockSource.LIKELIHOOD
    for known, colour, style, label in (
        (channel, MODEL_COLOUR, "-", "identified terms"),
        (stated, STATED_COLOUR, "-.", "data sheet"),
    ):
        if known is not None and known.model.terms and not (known is channel and refuted):
            y = one * np.sqrt(known.model.allan_variance(fine))
            panel.plot(fine, y, style, color=colour, lw=1.3, label=label)
    for k, term in enumerate(() if refuted else channel.model.terms):
        variance = term.allan_variance(fine)
        colour, y = TERM_COLOURS.get(term.name, "0.4"), one * np.sqrt(variance)
        style = TERM_STYLES[k % len(TERM_STYLES)]
        panel.plot(fine, y, style, color=colour, lw=1.0, label=term_label(channel, term.name))
        share = variance / channel.model.allan_variance(fine)
        at = int(np.argmax(np.where((fine > 2 * fine[0]) & (fine < 0.3 * fine[-1]), share, 0.0)))
        mark = panel.annotate(
            term.SYMBOLS[0] if term.SYMBOLS else term.name,
            (fine[at], y[at]),
            xytext=(3, 5) if term.SYMBOLS else (-3, -10),
            textcoords="offset points",
            ha="left" if term.SYMBOLS else "right",
            fontweight="bold",
            color=colour,
            annotation_clip=True,
        )
        mark.set_in_layout(False)
    if curve.tau[-1] > limit:
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
    legend = panel.legend(fontsize=7, loc="upper right", framealpha=0.85, handlelength=1.6)
    legend.set_in_layout(False)


def term_label(channel: ChannelIdentification, name: str) -> str:
    """Return a term of an axis with its coefficients and slope, for a legend."""
    estimate = channel.term(name)
    if estimate is None:
        return name
    parts = [
        f"{symbol(f'{name}.{field}').removeprefix(f'{name} ')} {phrase(one, f'{name}.{field}', channel.unit)}"
        for field, one in estimate.coefficients.items()
        if one.value is not None
    ]
    line = f"{SLOPES.get(name, name)}: " + ", ".join(parts)
    return line if len(line) <= LEGEND_WIDTH else f"{SLOPES.get(name, name)}: " + ",\n".join(parts)
