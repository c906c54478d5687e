"""Panels of the figures of a static diagnosis: for each kind of cause, the view of the residuals in which it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d
from scipy.special import ndtr

from models.arrays import FloatArray
from tuner.diagnosis import cause
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.formats.customary_units import customary_unit, in_customary, pretty, since
from tuner.report.diagnosed_axis import DiagnosedAxis, parameters
from tuner.report.row_panels import Mark, draw_rows
from tuner.report.two_level_path import two_level_path
from tuner.types import Finding

View = Callable[[Axes, DiagnosedAxis, Finding], None]
"""Draws into a panel what an axis shows of a finding."""
NOTHING = Finding("", (), "", 0.0, 1.0, {}, "")
"""What stands for a finding in views of what none explains."""

DATA_COLOUR, CAUSE_COLOUR, MODEL_COLOUR = "#1f5fa8", "#c2410c", "0.45"
LONG_COURSE = 7200.0
"""Span of a time course from which on it is shown in hours, s."""
OUTLYING_SHARE = 0.02
"""Share of the bands of a spectrum that may lie beyond its panel: a line elsewhere must not flatten its shape."""
COURSE_BLOCKS = 600
"""Blocks of a time course: as many as the panel has pixels to show."""


def shown(subject: DiagnosedAxis, values: FloatArray) -> FloatArray:
    """Return values in the customary unit of the axis."""
    return values * in_customary(1.0, "level", subject.ready.unit)


def unit_of(subject: DiagnosedAxis) -> str:
    """Return the customary unit of the axis."""
    return pretty(customary_unit("level", subject.ready.unit))


def _elapsed(subject: DiagnosedAxis, t: FloatArray) -> FloatArray:
    """Return times from the begin of a log on, in hours where it is long, else in seconds."""
    return np.asarray((t - subject.record.t[0]) / (3600.0 if np.ptp(subject.t) > LONG_COURSE else 1.0))


def _time(subject: DiagnosedAxis) -> str:
    """Return the label of an axis of such times."""
    return since(subject.record.t[0], "h" if np.ptp(subject.t) > LONG_COURSE else "s")


def blocks(x: FloatArray, count: int = COURSE_BLOCKS) -> FloatArray:
    """Return the samples as rows of blocks, shape (count or fewer, size)."""
    size = max(1, len(x) // count)
    return x[: len(x) // size * size].reshape(-1, size)


def _periodogram(subject: DiagnosedAxis) -> tuple[FloatArray, FloatArray]:
    e = np.clip(subject.fitted.e, -5.0, 5.0)
    power = np.abs(rfft(e)[1:]) ** 2 / (len(e) * float(np.mean(e * e)))
    return np.arange(1, len(power) + 1) / (len(e) * subject.ready.interval), power


def draw_peak(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw the spectrum of the residuals around a line or a resonance."""
    f, power = _periodogram(subject)
    values = parameters(finding, subject.ready.axis)
    centre, step = values["frequency"], f[0]
    width = centre / values["quality"] if "quality" in values else 0.0
    reach = max(40.0 * step, 6.0 * width)
    smooth = max(1, int(0.15 * width / step))
    near = (f > centre - reach - step) & (f < centre + reach)
    panel.plot(f[near], uniform_filter1d(power, smooth)[near], color=DATA_COLOUR, lw=0.9, label="residuals")
    panel.axhline(1.0, color=MODEL_COLOUR, ls="--", lw=0.9, label="expected without it")
    panel.axvline(centre, color=CAUSE_COLOUR, lw=1.0, alpha=0.6, label=f"{centre:.6g} Hz")
    if width:
        panel.axvspan(centre - 0.5 * width, centre + 0.5 * width, color=CAUSE_COLOUR, alpha=0.15, lw=0)
    panel.set(xlabel="frequency, Hz", ylabel="spectrum of the residuals", title="spectrum around it")


def draw_colour(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw the whole spectrum of the residuals and that of the extended model."""
    f, power = _periodogram(subject)
    rows, at = blocks(power, 200).mean(axis=1), blocks(f, 200).mean(axis=1)
    panel.plot(at, rows, ".", ms=3, color=DATA_COLOUR, label="residuals (means over a band)")
    panel.axhline(1.0, color=MODEL_COLOUR, ls="--", lw=0.9, label="expected without any finding")
    panel.plot(at, subject.expected(at), color=CAUSE_COLOUR, lw=1.3, label="expected with what was found")
    top = float(max(np.quantile(rows, 1.0 - OUTLYING_SHARE), 1.0))
    panel.set_ylim(0.0, 1.3 * top)
    if cutoff := parameters(finding, subject.ready.axis).get("cutoff"):
        panel.axvline(cutoff, color=CAUSE_COLOUR, ls=":", lw=1.0, label=f"cut-off {cutoff:.4g} Hz")
    panel.set(xlabel="frequency, Hz", ylabel="spectrum of the residuals", title="shape of the spectrum")


def draw_temperature(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw bias over temperature, in the order of time, and the bias that was found."""
    assert subject.temperature is not None
    both = subject.without_others(finding.cause), subject.signals[finding.cause]
    bias, signal = (shown(subject, blocks(x).mean(axis=1)) for x in both)
    celsius, when = (blocks(x).mean(axis=1) for x in (subject.temperature, _elapsed(subject, subject.t)))
    bias = bias - bias.mean()
    dots = panel.scatter(celsius, bias, c=when, s=6, cmap="viridis", lw=0, label="means of the samples")
    panel.plot(celsius, signal, color=CAUSE_COLOUR, lw=1.2, label="found")
    assert panel.figure is not None
    panel.figure.colorbar(dots, ax=panel, label=_time(subject))
    panel.set(xlabel="temperature, °C", ylabel=f"bias, {unit_of(subject)}", title="bias over temperature")


def draw_course(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw the bias over time, with the event or the transient that was found."""
    values = parameters(finding, subject.ready.axis)
    part = slice(None)
    if "dwell_low" in values:
        stay = 12.0 * (values["dwell_low"] + values["dwell_high"])
        part = slice(0, max(64, int(stay / subject.ready.interval)))
    middle = blocks(subject.t[part]).mean(axis=1)
    when = _elapsed(subject, middle)
    bias = shown(subject, blocks(subject.without_others(finding.cause)[part]).mean(axis=1))
    panel.plot(when, bias - bias.mean(), color=DATA_COLOUR, lw=0.8, label="means of the samples")
    if "dwell_low" in values and "size" in values and len(middle) > 1:
        step = float(middle[1] - middle[0])
        size = float(shown(subject, np.array(values["size"])))
        path = two_level_path(bias, step, size, (values["dwell_low"], values["dwell_high"]))
        panel.plot(when, path - bias.mean(), color=CAUSE_COLOUR, lw=1.4, label="likeliest two levels")
    if finding.cause in subject.signals:
        signal = shown(subject, blocks(subject.signals[finding.cause][part]).mean(axis=1))
        panel.plot(when, signal - signal.mean(), color=CAUSE_COLOUR, lw=1.4, label="found")
    for event in subject.values("motion") if finding.cause == "motion" else ():
        _draw_span(panel, subject, event)
    panel.set(xlabel=_time(subject), ylabel=f"bias, {unit_of(subject)}", title="time course")


def draw_variance(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw the variance of the residuals over time, with the burst or the drift that was found."""
    square, values = np.minimum(subject.left**2, 25.0), parameters(finding, subject.ready.axis)
    if "period" in values:
        draw_swell(panel, square, subject.t, values)
        return
    when = _elapsed(subject, blocks(subject.t, 300).mean(axis=1))
    rows = blocks(square, 300)
    panel.plot(when, rows.mean(axis=1), ".", ms=3, color=DATA_COLOUR, label="residuals")
    half = 1.96 * np.sqrt(2.0 / rows.shape[1])
    panel.axhspan(1.0 - half, 1.0 + half, color="0.85", lw=0, label="95 % of the model's")
    if "variance_ratio" in values:
        _draw_span(panel, subject, values, label=f"variance × {values['variance_ratio']:.3g}")
    elif "slope" in values:
        unit, celsius = finding.parameters["slope"].unit, subject.temperature
        by = subject.t if celsius is None or unit != "1/K" else celsius
        course = blocks(by, 300).mean(axis=1)
        level = np.exp(values["slope"] * (course - course.mean()))
        panel.plot(when, level * rows.mean() / level.mean(), color=CAUSE_COLOUR, lw=1.4, label="found")
    panel.set(xlabel=_time(subject), ylabel="variance of the residuals", title="variance over time")


def _draw_span(
    panel: Axes, subject: DiagnosedAxis, values: Mapping[str, float], label: str | None = None
) -> None:
    """Mark when something happened, by its start and duration."""
    first, last = _elapsed(subject, values["start"] + np.array([0.0, values["duration"]]))
    panel.axvspan(first, last, color=CAUSE_COLOUR, alpha=0.2, lw=1.5, label=label)


def draw_swell(panel: Axes, square: FloatArray, t: FloatArray, values: Mapping[str, float]) -> None:
    """Draw the mean squares of the residuals, shape (n,), over the phase of the period that was found."""
    phase = (t - t[0]) / values["period"] % 1.0
    number = int(np.clip(values["period"] / (t[1] - t[0]), 4, 48))
    place = np.minimum((phase * number).astype(int), number - 1)
    count = np.maximum(np.bincount(place, minlength=number), 1)
    middle, mean = (np.arange(number) + 0.5) / number, np.bincount(place, square, number) / count
    panel.plot(middle, mean, ".", ms=4, color=DATA_COLOUR, label="residuals")
    wave = complex(np.sum(mean * np.exp(2j * np.pi * middle)))
    course = np.exp(values["depth"] * np.cos(2.0 * np.pi * middle - np.angle(wave)))
    panel.plot(middle, course * mean.mean() / course.mean(), color=CAUSE_COLOUR, lw=1.4, label="found")
    panel.set(xlabel=f"phase of {values['period']:.5g} s", ylabel="variance of the residuals")
    panel.set_title("variance over a period")


def draw_histogram(panel: Axes, subject: DiagnosedAxis, _: Finding) -> None:
    """Draw the distribution of the residuals beside the normal one."""
    e = subject.left
    reach = float(min(max(6.0, np.max(np.abs(e)) * 1.02), 40.0))
    edges = np.linspace(-reach, reach, 121)
    count = np.histogram(e, edges)[0]
    middle = 0.5 * (edges[1:] + edges[:-1])
    _draw_counts(panel, count, edges, "residuals")
    expected = len(e) * np.diff(ndtr(edges))
    panel.plot(middle, expected, color=MODEL_COLOUR, ls="--", lw=1.2, label="normal distribution")
    panel.set(xlabel="residual, standard deviations", ylabel="samples", title="distribution of the residuals")


def draw_codes(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw how often each value was read; for repeated readings, how often each difference."""
    what, values_of = "samples", subject.y
    if "fraction" in parameters(finding, subject.ready.axis):
        what, values_of = "differences of samples", np.diff(subject.y)
    numbers = shown(subject, values_of)
    low, high = np.quantile(numbers, [1e-4, 1.0 - 1e-4])
    count, edges = np.histogram(numbers, np.linspace(low, high, 201))
    _draw_counts(panel, count, edges, what)
    label = f"{what} less their median, {unit_of(subject)}"
    panel.set(ylabel="count", xlabel=label, title=f"histogram of the {what}")


def _draw_counts(panel: Axes, count: NDArray[np.intp], edges: FloatArray, label: str) -> None:
    """Draw how many samples lie between edges; where there is none, the panel shows it below one."""
    panel.stairs(np.maximum(count, 0.3), edges, fill=True, color=DATA_COLOUR, alpha=0.6, label=label)
    panel.set(yscale="log", ylim=(0.3, 3.0 * max(float(count.max()), 1.0)))


def draw_pairs(panel: Axes, subject: DiagnosedAxis, finding: Finding) -> None:
    """Draw every value that a finding has in pairs of channels, with its 95 % interval."""
    (name,) = parameters(finding, subject.ready.axis)
    each = {pair: own[name] for pair, own in finding.by_channel.items()} or {"": finding.parameters[name]}
    draw_rows(
        panel,
        [
            (pair.replace("_", " "), [Mark(value.value, DATA_COLOUR, value.interval)])
            for pair, value in each.items()
        ],
    )
    panel.axvline(0.0, color=MODEL_COLOUR, ls="--", lw=0.9, label="independent channels")
    panel.set(xlabel=f"{name} of the residuals, 95 %", title="what the channels share")


def draw_stamps(panel: Axes, subject: DiagnosedAxis, _: Finding) -> None:
    """Draw how far the stamps lie from an even clock over time, and where samples are missing."""
    panel.set(title="time stamps", xlabel=_time(subject), ylabel="stamp less even clock, ms")
    if subject.record.stamp_course is None:
        return
    stamps, low, high, missing = subject.record.stamp_course.T
    t = _elapsed(subject, stamps)
    panel.fill_between(t, 1e3 * low, 1e3 * high, color=DATA_COLOUR, alpha=0.3, lw=0.5)
    panel.plot(t, 5e2 * (low + high), color=DATA_COLOUR, lw=0.8, label="stamps")
    gaps = missing > 0
    if gaps.any():
        words = f"{missing.sum():.0f} samples missing"
        panel.plot(t[gaps], 1e3 * high[gaps], "v", ms=6, color=CAUSE_COLOUR, label=words)


VIEWS: Mapping[cause.View, View] = {
    "time course": draw_course,
    "peak": draw_peak,
    "spectrum": draw_colour,
    "temperature": draw_temperature,
    "variance": draw_variance,
    "histogram": draw_histogram,
    "values": draw_codes,
    "pairs": draw_pairs,
    "time stamps": draw_stamps,
}
"""Figure of each view that a cause can ask for."""


def view_of(code: str) -> View:
    """Return the figure of a cause; the time course for one that is not declared."""
    declared = CAUSES.get(code)
    return draw_course if declared is None else VIEWS[declared.view]
