"""The picture that shows a finding: model and data before and after, and the view in which the cause is plain.

Left, for causes of the spectrum the density, for all others the Allan deviation: measured, the model of the base
terms, the extended model with the signals that were found. With replicas, each model is a band: the range of
so many simulated records. Right, `tuner.report.static_cause_panels`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from scipy.fft import rfft

from models.arrays import FloatArray
from models.noise import NoiseModel
from tuner.curves.allan import overlapping_allan
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.formats.files import Put
from tuner.report.diagnosed_axis import DiagnosedAxis, diagnosed_axis, parameters
from tuner.report.figure_files import new_figure
from tuner.report.static_cause_panels import (
    CAUSE_COLOUR,
    DATA_COLOUR,
    draw_colour,
    draw_course,
    draw_histogram,
    draw_variance,
    shown,
    unit_of,
    view_of,
)
from tuner.report.unexplained_words import unexplained_parts
from tuner.types import Diagnosis, Finding
from tuner.types.records import Record

MOST_REPLICAS = 39
"""Simulated records of a band: the range of 39 holds 95 % of further ones."""
BEFORE_COLOUR = "0.35"
TITLE_WIDTH = 150
"""Characters of a line of the title."""
LINE_HEIGHT = 0.035
"""Height of a line of the title, as a share of the figure."""
MARGINS = {"left": 0.07, "right": 0.985, "bottom": 0.12, "wspace": 0.24}
"""Places of the two panels, as shares of the figure: room for numbers of seven digits."""


@dataclass(frozen=True)
class _Curve:
    """A curve of samples: its abscissa, how it is computed from samples, and its expectation under a noise model."""

    place: FloatArray
    of: Callable[[FloatArray], FloatArray]
    expected: Callable[[NoiseModel], FloatArray]
    label: str
    unit: str


def finding_figures(
    records: Sequence[Record],
    diagnosis: Diagnosis,
    directory: Path,
    replicas: int = 0,
    seed: int = 0,
    suffixes: Sequence[str] = (".png", ".svg"),
) -> tuple[list[tuple[str, Path]], list[Callable[[Put], None]]]:
    """Return the figures of all findings, one for each cause and its channels, and of what is left, for `draw_all`.

    Returns
    -------
    list of (str, Path)
        Caption and SVG of each picture.
    list of callable
        Draws it to ``finding-NUMBER-CAUSE`` or ``unexplained-NUMBER`` with each of `suffixes`.
    """
    figures: list[Callable[[Put], None]] = []
    subject = cache(lambda axis, moving: diagnosed_axis(records, axis, diagnosis, moving=moving))
    drawn: dict[tuple[str, tuple[str, ...]], tuple[str, Path]] = {}
    for finding in diagnosis.findings:
        if (finding.cause, finding.channels) in drawn:
            continue
        moving = finding.cause == Motion.cause
        ready = (subject(axis, moving) for axis in finding.channels)
        chosen = next((one for one in ready if one is not None), None)
        if chosen is None:
            continue
        path = directory / f"finding-{len(drawn) + 1}-{finding.cause}.svg"
        paths = [path.with_suffix(suffix) for suffix in suffixes]
        figures.append(partial(_draw, chosen, finding, paths, replicas, seed))
        drawn[finding.cause, finding.channels] = (finding.text, path)
    left: list[tuple[str, Path]] = []
    for line, largest in unexplained_parts(diagnosis.unexplained):
        one = subject(largest.channels[0], False)
        if one is not None:
            path = directory / f"unexplained-{len(left) + 1}.svg"
            paths = [path.with_suffix(suffix) for suffix in suffixes]
            figures.append(partial(_draw_unexplained, one, largest.about, line, paths))
            left.append((line, path))
    return [*drawn.values(), *left], figures


def _is_spectral(code: str) -> bool:
    """Return whether the density shows a cause better than the Allan deviation does."""
    declared = CAUSES.get(code)
    return declared is not None and declared.group == "fast spectrum"


def _draw(
    one: DiagnosedAxis, finding: Finding, paths: Sequence[Path], replicas: int, seed: int, put: Put
) -> None:
    one = replace(one, findings=(finding, *(f for f in one.findings if f is not finding)))

    def draw(left: Axes, right: Axes) -> None:
        _draw_curve(left, one, _spectrum(one) if _is_spectral(finding.cause) else _allan(one), replicas, seed)
        view_of(finding.cause)(right, one, parameters(finding, one.axis))

    _draw_pair(finding.text, paths, put, draw)


def _draw_unexplained(one: DiagnosedAxis, about: str, line: str, paths: Sequence[Path], put: Put) -> None:
    """Draw what is unexplained: law and variance of the residuals; the spectrum; or Allan deviation and time course."""

    def draw(left: Axes, right: Axes) -> None:
        if about == "distribution":
            draw_histogram(left, one, {})
            draw_variance(right, one, {})
        elif about == "fast spectrum":
            _draw_curve(left, one, _spectrum(one), 0, 0)
            draw_colour(right, one, {})
        else:
            _draw_curve(left, one, _allan(one), 0, 0)
            draw_course(right, replace(one, findings=()), {})

    _draw_pair(line, paths, put, draw)


def _draw_pair(text: str, paths: Sequence[Path], put: Put, draw: Callable[[Axes, Axes], None]) -> None:
    """Draw two panels under a title."""
    title = fill(text, TITLE_WIDTH)
    top = 0.93 - LINE_HEIGHT * (title.count("\n") + 1)
    with new_figure((11.0, 4.4), paths, put, margins={**MARGINS, "top": top}, coarse=True) as figure:
        left, right = figure.subplots(1, 2)
        draw(left, right)
        for panel in (left, right):
            panel.grid(which="major", color="0.9", lw=0.6)
            if panel.get_legend_handles_labels()[0]:
                panel.legend(fontsize=7, framealpha=0.85)
        figure.suptitle(title, fontsize=9, parse_math=False)


def _draw_curve(panel: Axes, one: DiagnosedAxis, curve: _Curve, replicas: int, seed: int) -> None:
    panel.plot(
        curve.place, curve.of(one.y), "o", ms=2.6, mew=0, color=DATA_COLOUR, label="measured", zorder=3
    )
    signal = one.signal
    more = curve.of(signal) ** 2 if one.signals else 0.0
    for label, colour, model, added, path in (
        ("identified terms", BEFORE_COLOUR, one.before, 0.0, np.zeros_like(signal)),
        ("with what was found", CAUSE_COLOUR, one.after, more, signal),
    ):
        if not model.terms:
            continue
        panel.plot(
            curve.place, np.sqrt(curve.expected(model) ** 2 + added), color=colour, lw=1.2, label=label
        )
        if replicas > 1:
            rng = np.random.default_rng((seed, 39))
            many = [
                curve.of(model.sample(len(one.y), one.interval, rng) + path)
                for _ in range(min(replicas, MOST_REPLICAS))
            ]
            low, high = np.min(many, axis=0), np.max(many, axis=0)
            panel.fill_between(curve.place, low, high, color=colour, alpha=0.2, lw=0)
    panel.set(xscale="log", yscale="log", xlabel=curve.label, ylabel=curve.unit, title=one.axis)


def _allan(one: DiagnosedAxis) -> _Curve:
    m = np.unique(np.geomspace(1, max(2, len(one.y) // 5), 32).astype(np.int64))
    tau = np.asarray(m * one.interval, dtype=np.float64)
    return _Curve(
        tau,
        lambda y: shown(one, np.sqrt(overlapping_allan(y, m))),
        lambda model: shown(one, np.sqrt(model.allan_variance(tau, interval=one.interval))),
        "cluster time τ, s",
        f"Allan deviation, {unit_of(one)}",
    )


def _spectrum(one: DiagnosedAxis) -> _Curve:
    n, dt = len(one.y), one.interval
    edges = 4 * np.unique(np.geomspace(1, n // 8, 200).astype(np.int64))
    f = np.asarray(0.5 * (edges[:-1] + edges[1:]) / (n * dt), dtype=np.float64)

    def of(y: FloatArray) -> FloatArray:
        power = np.abs(rfft(y - y.mean())[: edges[-1]]) ** 2 * dt / n
        return shown(one, np.sqrt(np.add.reduceat(power, edges[:-1]) / np.diff(edges)))

    def expected(model: NoiseModel) -> FloatArray:
        return shown(one, np.sqrt(model.psd(f, interval=dt)))

    return _Curve(f, of, expected, "frequency, Hz", f"root of the density, {unit_of(one)}/√Hz")
