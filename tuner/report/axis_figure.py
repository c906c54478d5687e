"""Spectrum and time course of one axis of a log, beside its identified noise and with what happened in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tuner.curves.spectrum import psd
from tuner.formats.customary_units import customary_unit, in_customary, pretty, since
from tuner.formats.grouping import gathered
from tuner.report.allan_figure import MEASURED_COLOUR, MODEL_COLOUR, STATED_COLOUR
from tuner.report.curve_panels import draw_banded
from tuner.report.figure_files import new_figure
from tuner.report.finding_groups import event_time
from tuner.report.interactive_figure import thinned
from tuner.types import ChannelIdentification, Finding
from tuner.types.records import DataError, Record

COURSE_POINTS = 2000
"""Points of a time course: smallest and largest sample of half as many pieces, more than a screen has columns."""


def axis_figure(
    record: Record,
    part: tuple[float, float] | None = None,
    channel: ChannelIdentification | None = None,
    findings: Sequence[Finding] = (),
) -> Figure:
    """Return spectrum and time course of a record of one axis; without a spectrum where it is too short for one.

    Parameters
    ----------
    record : Record
        Of one axis.
    part : (float, float), optional
        Begin and end of what was analysed, s on the clock of the record: of that the spectrum is.
    channel : ChannelIdentification, optional
        Its noise.
    findings : sequence of Finding
        Of the axis; those that happened at a time are marked.
    """
    with new_figure((11.0, 4.4)) as figure:
        spectrum, course = figure.subplots(1, 2)
        _draw_spectrum(spectrum, part_analysed(record, part), channel)
        _draw_course(course, record, findings)
        for panel in (spectrum, course):
            panel.set_title(record.axes[0])
    return figure


def part_analysed(record: Record, part: tuple[float, float] | None) -> Record:
    """Return what is analysed of a record, by begin and end, s, of that part; all where it has none."""
    if part is None:
        return record
    first, last = (int(at) for at in np.searchsorted(record.t, part))
    inside = [(max(start, first), min(stop, last)) for start, stop in record.segments]
    return replace(record, segments=tuple((start, stop) for start, stop in inside if stop > start))


def _draw_spectrum(panel: Axes, record: Record, channel: ChannelIdentification | None) -> None:
    try:
        found = psd(record)
    except DataError:
        return
    scale, f = in_customary(1.0, "white.density", record.unit), found.frequency
    root = scale * np.sqrt(found.density[:, 0])
    ends = (scale * np.sqrt(end[:, 0]) for end in found.interval())
    unit = pretty(customary_unit("white.density", record.unit))
    panel.set(xscale="log", yscale="log", ylim=(0.7 * np.nanmin(root), 1.4 * np.nanmax(root)))
    panel.set(xlabel="frequency, Hz", ylabel=f"root of the density, {unit}")
    draw_banded(panel, f, root, ends, lw=1.4, color=MEASURED_COLOUR, label="measured, with 95 % band")
    if channel is not None and channel.model.terms:
        expected = scale * np.sqrt(channel.model.psd(f, interval=channel.interval))
        panel.plot(f, expected, color=MODEL_COLOUR, lw=1.6, label="identified noise")


def _draw_course(panel: Axes, record: Record, findings: Iterable[Finding]) -> None:
    begin = float(record.t[0])
    t, y = thinned(record.t - begin, record.y[:, 0], COURSE_POINTS)
    y = in_customary(1.0, "level", record.unit) * (y - np.median(record.y[:, 0]))
    panel.set_xlabel(since(begin))
    panel.set_ylabel(f"samples less their median, {pretty(customary_unit('level', record.unit))}")
    panel.plot(t, y, lw=0.8, color=MEASURED_COLOUR, label="smallest and largest sample of each piece of time")
    panel.margins(x=0.0)
    spans_of = gathered(
        (one.cause.replace("_", " "), (when, _lasted(one)))
        for one in findings
        if (when := event_time(one)) is not None
    )
    for cause, spans in spans_of.items():
        starts = [start - begin for start, _ in spans]
        panel.plot(starts, np.full(len(spans), np.nanmax(y)), "v", ms=7, color=STATED_COLOUR, label=cause)
        for start, lasted in spans:
            panel.axvspan(start - begin, start - begin + lasted, color=STATED_COLOUR, alpha=0.15, lw=1.0)


def _lasted(event: Finding) -> float:
    """Return the duration of what happened at a time, s; 0 for none."""
    duration = event.parameters.get("duration")
    return 0.0 if duration is None else duration.value or 0.0
