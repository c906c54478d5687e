"""The picture that shows a finding: model and data before and after, and the view in which the cause is plain.

Left, for causes of the spectrum the density, for all others the Allan deviation: measured, the model of the base
terms, the extended model with the signals that were found. With replicas, each model is a band: the range of
so many simulated records. Right, `tuner.report.static_cause_panels`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from scipy.fft import rfft

from models.arrays import FloatArray
from models.noise import NoiseModel
from tuner.curves.allan import overlapping_allan
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.report.diagnosed_axis import DiagnosedAxis, diagnosed_axis
from tuner.report.figure_files import Sketch
from tuner.report.static_cause_panels import (
    CAUSE_COLOUR,
    DATA_COLOUR,
    NOTHING,
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
Draw = Callable[[Axes], None]


@dataclass(frozen=True)
class _Curve:
    """A curve of samples: its abscissa, how it is computed from samples, and its expectation under a noise model."""

    place: FloatArray
    of: Callable[[FloatArray], FloatArray]
    expected: Callable[[NoiseModel], FloatArray]
    label: str
    unit: str


def finding_figures(
    records: Sequence[Record], diagnosis: Diagnosis, replicas: int = 0, seed: int = 0
) -> list[Sketch]:
    """Return the figures of all findings, one for each cause and its channels, and of what is left.

    They are named ``finding-NUMBER-CAUSE`` and ``unexplained-NUMBER``.
    """
    subject = cache(lambda axis, moving: diagnosed_axis(records, axis, diagnosis, moving=moving))
    drawn: dict[tuple[str, tuple[str, ...]], Sketch] = {}
    for finding in diagnosis.findings:
        if (finding.cause, finding.channels) in drawn:
            continue
        moving = finding.cause == Motion.cause
        ready = (subject(axis, moving) for axis in finding.channels)
        one = next((one for one in ready if one is not None), None)
        if one is not None:
            name = f"finding-{len(drawn) + 1}-{finding.cause}"
            panels = _panels_of(one, finding, replicas, seed)
            drawn[finding.cause, finding.channels] = Sketch(name, finding.text, panels)
    left: list[Sketch] = []
    for line, largest in unexplained_parts(diagnosis.unexplained):
        one = subject(largest.channels[0], False)
        if one is not None:
            panels = _panels_unexplained(one, largest.about)
            left.append(Sketch(f"unexplained-{len(left) + 1}", line, panels))
    return [*drawn.values(), *left]


def _panels_of(one: DiagnosedAxis, finding: Finding, replicas: int, seed: int) -> list[Draw]:
    """Return the panels of a finding; the density shows a cause of the fast spectrum better than Allan deviation."""
    declared, view = CAUSES.get(finding.cause), view_of(finding.cause)
    curve = _spectrum if declared is not None and declared.group == "fast spectrum" else _allan
    return [
        lambda panel: _draw_curve(panel, one, curve(one), replicas, seed),
        lambda panel: view(panel, one, finding),
    ]


def _panels_unexplained(one: DiagnosedAxis, about: str) -> list[Draw]:
    """Return law and variance of the residuals; the spectrum; or, of slow parts, Allan deviation and time course."""
    if about == "distribution":
        return [
            lambda panel: draw_histogram(panel, one, NOTHING),
            lambda panel: draw_variance(panel, one, NOTHING),
        ]
    curve, view = (_spectrum, draw_colour) if about == "fast spectrum" else (_allan, draw_course)
    return [lambda panel: _draw_curve(panel, one, curve(one), 0, 0), lambda panel: view(panel, one, NOTHING)]


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
                curve.of(model.sample(len(one.y), one.ready.interval, rng) + path)
                for _ in range(min(replicas, MOST_REPLICAS))
            ]
            low, high = np.min(many, axis=0), np.max(many, axis=0)
            panel.fill_between(curve.place, low, high, color=colour, alpha=0.2, lw=0)
    panel.set(xscale="log", yscale="log", xlabel=curve.label, ylabel=curve.unit, title=one.ready.axis)


def _allan(one: DiagnosedAxis) -> _Curve:
    m = np.unique(np.geomspace(1, max(2, len(one.y) // 5), 32).astype(np.int64))
    tau = np.asarray(m * one.ready.interval, dtype=np.float64)
    return _Curve(
        tau,
        lambda y: shown(one, np.sqrt(overlapping_allan(y, m))),
        lambda model: shown(one, np.sqrt(model.allan_variance(tau, interval=one.ready.interval))),
        "cluster time τ, s",
        f"Allan deviation, {unit_of(one)}",
    )


def _spectrum(one: DiagnosedAxis) -> _Curve:
    n, dt = len(one.y), one.ready.interval
    edges = 4 * np.unique(np.geomspace(1, n // 8, 200).astype(np.int64))
    f = np.asarray(0.5 * (edges[:-1] + edges[1:]) / (n * dt), dtype=np.float64)

    def of(y: FloatArray) -> FloatArray:
        power = np.abs(rfft(y - y.mean())[: edges[-1]]) ** 2 * dt / n
        return shown(one, np.sqrt(np.add.reduceat(power, edges[:-1]) / np.diff(edges)))

    def expected(model: NoiseModel) -> FloatArray:
        return shown(one, np.sqrt(model.psd(f, interval=dt)))

    return _Curve(f, of, expected, "frequency, Hz", f"root of the density, {unit_of(one)}/√Hz")
