"""Small figures of results: curves, scores with their bands, drifts, what is reached by each, the units of a fleet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from tuner.consistency.choose_grade import GradeChoice
from tuner.examination.examine import Examination
from tuner.formats.customary_units import in_customary, symbol
from tuner.identification.record_length import LONGEST_HOURS
from tuner.identification.static_test_plan import StaticTestPlan
from tuner.production.quantities import is_logarithmic
from tuner.report.curve_panels import SENSORS, SOURCE_COLOURS, STATED_TAU, draw_banded, sensor_panels
from tuner.report.curve_tables import Curve, shown_curve
from tuner.report.drive_diagnosis_tables import SHORT_NAMES
from tuner.report.figure_files import new_figure
from tuner.report.finding_groups import finding_groups
from tuner.report.row_panels import Mark, row_figure
from tuner.report.verdict_text import score_title
from tuner.types import Correlogram, FilterConfig, Finding, NoiseScaleEstimate
from tuner.types.consistency import Score
from tuner.types.fleet import Fleet
from tuner.types.prediction import NoiseBlock

GOOD_COLOUR, BAD_COLOUR = "#15803d", "#b91c1c"


def curve_figure(found: Curve) -> Figure:
    """Return an empirical curve of every axis with its interval, or with the band of white noise."""
    with new_figure((6.4, 4.4)) as figure:
        panel = figure.subplots()
        one = shown_curve(found)
        panel.set(xlabel=one.across, ylabel=one.up)
        if isinstance(found, Correlogram):
            panel.axhspan(-found.band, found.band, color="0.85", lw=0)
        else:
            panel.set(xscale="log", yscale="log")
        for k, axis in enumerate(found.axes):
            look = {"ms": 3, "lw": 0.8, "color": SOURCE_COLOURS[k % len(SOURCE_COLOURS)], "label": axis}
            ends = one.ends or (one.y, one.y)
            draw_banded(panel, one.x, one.y[:, k], (end[:, k] for end in ends), ".-", **look)
    return figure


def settings_figure(config: FilterConfig) -> Figure:
    """Return the Allan deviation of the noise that a filter assumes of each axis."""
    tau = np.geomspace(*STATED_TAU, 200)
    with sensor_panels(channel.unit for channel in config.channels.values()) as (figure, panels):
        for channel in config.channels.values():
            block = NoiseBlock(channel.white_density, channel.markov, channel.random_walk_density)
            deviation = np.sqrt(block.allan_variance(tau, config.interval))
            panel, scale = panels[channel.unit], in_customary(1.0, "level", channel.unit)
            colour = SOURCE_COLOURS[len(panel.lines) % len(SOURCE_COLOURS)]
            panel.plot(tau, scale * deviation, color=colour, lw=1.2, label=channel.axis)
    return figure


def scores_figure(scores: Sequence[Score]) -> Figure:
    """Return true rms ÷ predicted sd of every score with the band of a consistent filter."""
    rows = []
    for score in scores:
        low, high = ((limit / score.dof) ** 0.5 for limit in score.band)
        judged = Mark(score.ratio, GOOD_COLOUR if score.consistent else BAD_COLOUR)
        rows.append((score_title(score.name), [Mark(None, "0.75", (low, high), width=7.0), judged]))
    return row_figure(rows, "true rms ÷ predicted sd (grey: consistent)", 1.0)


def drift_figure(findings: Sequence[Finding]) -> Figure:
    """Return the position error without fixes with each group of findings in the samples, and without it."""
    rows = []
    for group in finding_groups(findings):
        if group.drift:
            time, (with_it, without) = max(group.drift.items(), key=lambda item: item[1][0] - item[1][1])
            line = Mark(None, "0.75", (without, with_it))
            red = Mark(with_it, BAD_COLOUR, label="with it in the samples", text=f" {time}")
            rows.append((group.title, [line, red, Mark(without, GOOD_COLOUR, label="without it")]))
    return row_figure(rows, "position error of one sensor axis, m", nothing="no finding moves the position")


def noise_scales_figure(estimates: Sequence[NoiseScaleEstimate]) -> Figure:
    """Return the factor on each noise setting that a drive shows, with no cause named and with all findings."""
    rows = []
    for one in estimates:
        if one.identifiable and one.stated is not None:
            ways = (
                (one.plain, 0.15, "0.5", "with no cause named"),
                (one.named, -0.15, GOOD_COLOUR, "with all findings"),
            )
            marks = [
                Mark(factor.value, colour, factor.interval, label, up=up)
                if factor.value is not None
                else Mark(factor.upper, colour, None, label, "<", up=up)
                for factor, up, colour, label in ways
            ]
            rows.append((SHORT_NAMES[one.setting], marks))
    nothing = "the drive determines none of the noise settings"
    return row_figure(rows, "shown by the drive ÷ stated", 1.0, nothing=nothing)


def _reached_figure(values: Mapping[str, float], limit: float, limit_label: str, what: str) -> Figure:
    """Return a value a row, good up to a limit."""
    rows = [(name, [Mark(one, GOOD_COLOUR if one <= limit else BAD_COLOUR)]) for name, one in values.items()]
    return row_figure(rows, what, limit, limit_label)


def choice_figure(found: GradeChoice) -> Figure:
    """Return the predicted error of every grade, with the limit."""
    what = f"horizontal error after {found.outage:g} s without fixes, m (rms)"
    errors = {one.name: one.error for one in found.ranking}
    return _reached_figure(errors, found.limit, f"limit {found.limit:g} m", what)


def plan_figure(plans: StaticTestPlan) -> Figure:
    """Return the hours that the wanted accuracy of each noise term takes, and those that are planned."""
    first = next(iter(plans.values()))
    hours: dict[str, float] = {}
    for axis, plan in plans.items():
        for one in plan.parameters:
            name = f"{symbol(one.name)} of {SENSORS[plans.units[axis]]}"
            hours[name] = max(hours.get(name, 0.0), LONGEST_HOURS if one.hours is None else one.hours)
    what = f"hours for a relative sd of {100 * first.accuracy:g} %"
    return _reached_figure(hours, first.hours, f"planned: {first.hours:g} h", what)


def fleet_figure(fleet: Fleet) -> Figure:
    """Return every unit ÷ the median of the fleet in each quantity, outlying ones with their names."""
    rows = []
    for name in filter(is_logarithmic, fleet.spread):
        found = [(u, u.measurement.quantities.get(name)) for u in fleet.units if u.measurement is not None]
        values = [(u, c.value) for u, c in found if c is not None and c.value is not None]
        median = float(np.median([value for _, value in values])) if values else 0.0
        if median != 0.0:
            marks = [Mark(np.array([value for _, value in values]) / median, "0.5", sign=".")]
            marks += [
                Mark(value / median, BAD_COLOUR, text=f" {unit.name}")
                for unit, value in values
                if any(one.quantity == name for one in unit.outliers)
            ]
            rows.append((name.replace("_", " ").replace(".", " "), marks))
    return row_figure(rows, "unit ÷ median of the fleet")


def examination_figure(found: Examination) -> Figure:
    """Draw by how much the readings of each stream miss the motion of the inertial unit, as recorded and as mended."""
    with new_figure((8.0, 2.2 * len(found.misfit))) as figure:
        panels = figure.subplots(len(found.misfit), 1, sharex=True, squeeze=False)
        for panel, (name, (t, before, after)) in zip(panels[:, 0], found.misfit.items(), strict=True):
            unit = next(one.unit for one in found.noise if one.stream == name)
            for values, colour, label in (
                (before, BAD_COLOUR, "as recorded"),
                (after, GOOD_COLOUR, "as mended"),
            ):
                there = np.isfinite(values)
                panel.semilogy(
                    t[there], np.maximum(values[there], 1e-4), ".", ms=3, color=colour, label=label
                )
            panel.set_ylabel(f"{name}, {unit}")
        panels[-1, 0].set_xlabel("time from the first sample of the inertial unit, s")
    return figure
