"""Data of the charts of the page: Allan deviation, spectrum and time course of each axis, in customary units.

A chart is a mapping that plotly.js draws; colours are names that the page replaces by those of its theme.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from tuner.curves.spectrum import psd
from tuner.formats.customary_units import customary_unit, in_customary, pretty, since, stamp
from tuner.jobs import each
from tuner.report.allan_figure import term_label
from tuner.report.interactive_figure import DRAWN_DIGITS, Chart
from tuner.tune_result import TuneResult
from tuner.types import ChannelIdentification, Finding
from tuner.types.prediction import PredictedBlock
from tuner.types.records import DataError, Record

COURSE_PIECES = 1000
"""Pieces of a time course, each drawn from its smallest to its largest sample: more than a screen has columns."""
TERM_DASHES = ("dash", "dot", "dashdot", "longdash", "longdashdot")


def charts(result: TuneResult) -> dict[str, dict[str, Chart]]:
    """Return the charts by kind (``allan``, ``spectrum``, ``course``) and axis; kinds without data are absent."""
    found: dict[str, dict[str, Chart]] = {"allan": {}, "spectrum": {}, "course": {}}
    for axis, channel in result.identification.channels.items():
        if channel.allan.tau.size:
            stated = None if result.datasheet is None else result.datasheet.channels.get(axis)
            found["allan"][axis] = allan_chart(channel, result.predictions.get(axis), stated)
    findings = () if result.diagnosis is None else result.diagnosis.findings

    def of_samples(place: tuple[Record, int]) -> tuple[dict[str, Chart], Chart]:
        record, j = place
        one = replace(record, y=record.y[:, j : j + 1], axes=record.axes[j : j + 1])
        analysed = one if result.diagnosis is None else part_analysed(one, result.diagnosis.parts)
        concerned = [finding for finding in findings if one.axes[0] in finding.channels]
        return (
            spectrum_charts(analysed, result.identification.channels),
            course_chart(one, one.axes[0], concerned),
        )

    places = [(record, j) for record in result.records for j in range(len(record.axes))]
    for (record, j), (spectrum, course) in zip(places, each(of_samples, places), strict=True):
        found["spectrum"] |= spectrum
        found["course"][record.axes[j]] = course
    return {kind: by_axis for kind, by_axis in found.items() if by_axis}


def part_analysed(record: Record, parts: Mapping[str, tuple[float, float]]) -> Record:
    """Return what is analysed of a record, by begin and end, s, of the part of each axis; all where it has none."""
    if record.axes[0] not in parts:
        return record
    first, last = (int(at) for at in np.searchsorted(record.t, parts[record.axes[0]]))
    inside = [(max(start, first), min(stop, last)) for start, stop in record.segments]
    return replace(record, segments=tuple((start, stop) for start, stop in inside if stop > start))


def allan_chart(
    channel: ChannelIdentification,
    predicted: PredictedBlock | None,
    stated: ChannelIdentification | None = None,
) -> Chart:
    """Return measured points with their 95 % band, what the settings predict, the identified sum and each term.

    What a data sheet states is a further line.
    """
    scale = in_customary(1.0, "level", channel.unit)
    unit = pretty(customary_unit("level", channel.unit))
    curve = channel.allan
    low, high = (scale * limit[:, 0] for limit in curve.interval())
    hover = f"τ %{{x:.4~g}} s: %{{y:.4~g}} {unit}"
    traces = [
        _line(curve.tau, low, "band", hover="", width=0.0),
        _line(curve.tau, high, "band", "95 % band", hover="", width=0.0, fill="tonexty"),
    ]
    if predicted is not None:
        tau = predicted.measured.tau[predicted.measured.tau >= predicted.curve.tau[0]]
        variance = predicted.block.allan_variance(tau, predicted.measured.interval)
        traces.append(
            _line(tau, scale * np.sqrt(variance), "predicted", "written settings predict", hover, 3.0)
        )
    fine = np.geomspace(curve.tau[0], curve.tau[-1], 120)
    if channel.model.terms:
        total = scale * np.sqrt(channel.model.allan_variance(fine))
        traces.append(_line(fine, total, "model", "identified sum", hover, 1.6))
    for k, term in enumerate(channel.model.terms):
        deviation = scale * np.sqrt(term.allan_variance(fine))
        label = term_label(channel, term.name).replace("\n", " ")
        dash = TERM_DASHES[k % len(TERM_DASHES)]
        traces.append(_line(fine, deviation, f"term{k % len(TERM_DASHES)}", label, hover, 1.2, dash=dash))
    if stated is not None and stated.model.terms:
        deviation = scale * np.sqrt(stated.model.allan_variance(fine))
        traces.append(_line(fine, deviation, "event", "data sheet", hover, 2.0, dash="longdash"))
    measured = scale * curve.deviation()[:, 0]
    traces.append(_points(curve.tau, measured, "measured", "measured", hover))
    limits = (0.4 * float(np.nanmin(measured)), 3.0 * float(np.nanmax(measured)))
    return _chart(traces, "cluster time τ, s", f"Allan deviation, {unit}", "log", limits)


def spectrum_charts(record: Record, channels: Mapping[str, ChannelIdentification]) -> dict[str, Chart]:
    """Return the root of the density of each axis of a record beside that of its identified noise."""
    try:
        found = psd(record)
    except DataError:
        return {}
    unit = pretty(customary_unit("white.density", record.unit))
    scale = in_customary(1.0, "white.density", record.unit)
    hover = f"%{{x:.4~g}} Hz: %{{y:.4~g}} {unit}"
    low, high = (scale * np.sqrt(limit) for limit in found.interval())
    answer: dict[str, Chart] = {}
    for j, axis in enumerate(found.axes):
        root = scale * np.sqrt(found.density[:, j])
        traces = [
            _line(found.frequency, low[:, j], "band", hover="", width=0.0),
            _line(found.frequency, high[:, j], "band", "95 % band", hover="", width=0.0, fill="tonexty"),
            _line(found.frequency, root, "measured", "measured", hover, 1.4),
        ]
        if axis in channels and channels[axis].model.terms:
            expected = scale * np.sqrt(
                channels[axis].model.psd(found.frequency, interval=channels[axis].interval)
            )
            traces.append(_line(found.frequency, expected, "model", "identified noise", hover, 1.6))
        limits = (0.7 * float(np.nanmin(root)), 1.4 * float(np.nanmax(root)))
        answer[axis] = _chart(traces, "frequency, Hz", f"root of the density, {unit}", "log", limits)
    return answer


def course_chart(record: Record, axis: str, findings: Iterable[Finding]) -> Chart:
    """Return the samples of an axis from their begin on, smallest and largest of each piece, with events marked."""
    begin = float(record.t[0])
    unit = pretty(customary_unit("level", record.unit))
    t, y = _smallest_and_largest(record.t - begin, record.column(axis))
    y = in_customary(1.0, "level", record.unit) * (y - np.median(y))
    traces = [_line(t, y, "measured", "samples less their median", f"%{{x:.6~g}} s: %{{y:.4~g}} {unit}", 0.8)]
    events = sorted(_events(findings))
    if events:
        top = float(np.nanmax(y))
        marks = _points(
            np.array([start - begin for start, _, _ in events]),
            np.full(len(events), top),
            "event",
            "events",
            "%{text}",
        )
        traces.append(marks | {"text": [f"{name} at {stamp(start)} s" for start, _, name in events]})
        traces[-1]["marker"] |= {"symbol": "triangle-down", "size": 10}
    spans = [[_short(start - begin), _short(start - begin + duration)] for start, duration, _ in events]
    return _chart(traces, since(begin), f"samples less their median, {unit}", "linear") | {"spans": spans}


def _events(findings: Iterable[Finding]) -> Iterable[tuple[float, float, str]]:
    """Return start and duration, s, and cause of every finding that happened at a time."""
    for one in findings:
        when = one.parameters.get("time") or one.parameters.get("start")
        if when is not None and when.value is not None:
            lasted = one.parameters.get("duration")
            duration = lasted.value if lasted is not None and lasted.value is not None else 0.0
            yield when.value, duration, one.cause.replace("_", " ")


def _smallest_and_largest(t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest sample of each piece, in the order of time; all of a short record."""
    size = -(-len(y) // COURSE_PIECES)
    if size < 2:
        return t, y
    starts = np.arange(0, len(y), size)
    smallest, largest = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    return np.repeat(t[starts], 2), np.column_stack([smallest, largest]).ravel()


def _line(
    x: FloatArray,
    y: FloatArray,
    colour: str,
    name: str = "",
    hover: str = "",
    width: float = 1.0,
    *,
    dash: str = "solid",
    fill: str = "none",
) -> dict[str, Any]:
    trace = _trace(x, y, name, hover)
    line = {"color": f"--{colour}", "width": width, "dash": dash}
    return trace | {"mode": "lines", "line": line, "fill": fill, "fillcolor": "--band"}


def _points(x: FloatArray, y: FloatArray, colour: str, name: str, hover: str) -> dict[str, Any]:
    return _trace(x, y, name, hover) | {"mode": "markers", "marker": {"color": f"--{colour}", "size": 5}}


def _trace(x: FloatArray, y: FloatArray, name: str, hover: str) -> dict[str, Any]:
    shown = {"hovertemplate": f"{hover}<extra></extra>"} if hover else {"hoverinfo": "skip"}
    return {
        "type": "scatter",
        "x": [_short(v) for v in x],
        "y": [_short(v) for v in y],
        "name": name,
        "showlegend": bool(name),
        **shown,
    }


def _short(value: float) -> float | None:
    return float(f"{value:.{DRAWN_DIGITS}g}") if np.isfinite(value) else None


def _chart(
    traces: Sequence[Mapping[str, Any]],
    x: str,
    y: str,
    scale: str,
    limits: tuple[float, float] | None = None,
) -> dict[str, Any]:
    ends = None if limits is None else [_short(float(np.log10(end))) for end in limits]
    return {"traces": list(traces), "x": x, "y": y, "scale": scale, "range": ends, "spans": []}
