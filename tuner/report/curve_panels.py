"""Panels of Allan deviations and of other measured curves: one a sensor, in its customary unit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.arrays import FloatArray
from tuner.formats.customary_units import customary_unit, pretty
from tuner.report.figure_files import new_figure

SOURCE_COLOURS = ("#1f5fa8", "#c2410c", "#15803d", "#7c3aed", "#a16207", "#be185d", "#0f766e", "#475569")
"""One a source, in order; they begin again where there are more."""
SENSORS = {"rad/s": "gyros", "m/s^2": "accelerometers"}
STATED_TAU = (0.01, 1e4)
"""Cluster times over which a data sheet is drawn, s."""


@contextmanager
def sensor_panels(units: Iterable[str]) -> Iterator[tuple[Figure, dict[str, Axes]]]:
    """Yield a figure with a panel of Allan deviations for each unit of samples."""
    kinds = list(dict.fromkeys(units))
    with new_figure((5.4 * len(kinds) + 0.4, 4.4)) as figure:
        panels = dict(zip(kinds, figure.subplots(1, len(kinds), squeeze=False)[0], strict=True))
        for unit, panel in panels.items():
            name_allan_axes(panel, unit)
            panel.set_title(SENSORS.get(unit, unit))
        yield figure, panels


def name_allan_axes(panel: Axes, unit: str) -> None:
    """Make a panel one of Allan deviations of samples in a unit."""
    panel.set(xscale="log", yscale="log", xlabel="cluster time τ, s")
    panel.set_ylabel(f"Allan deviation, {pretty(customary_unit('level', unit))}")


def draw_banded(
    panel: Axes, x: FloatArray, y: FloatArray, ends: Iterable[FloatArray], style: str = "-", **look: Any
) -> None:
    """Draw values within the ends of their intervals, low and high, each of shape (n,)."""
    low, high = ends
    (line,) = panel.plot(x, y, style, **look)
    panel.fill_between(
        x,
        low,
        high,
        color=line.get_color(),
        alpha=0.18 * (line.get_alpha() or 1.0),
        lw=0,
        rasterized=line.get_rasterized(),
    )
