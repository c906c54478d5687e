"""Small figures of results: curves, scores with their bands, drifts, the units of a fleet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from tuner.consistency.choose_grade import GradeChoice
from tuner.formats.customary_units import customary_unit, in_customary, pretty
from tuner.production.quantities import is_logarithmic
from tuner.report.consistency_tables import score_title
from tuner.report.drive_diagnosis_tables import SHORT_NAMES
from tuner.report.figure_files import new_figure
from tuner.report.finding_groups import finding_groups
from tuner.report.overlaid_figure import SOURCE_COLOURS, STATED_TAU
from tuner.types import AllanCurve, Correlogram, FilterConfig, Finding, NoiseScaleEstimate, Spectrum
from tuner.types.consistency import Score
from tuner.types.fleet import Fleet
from tuner.types.prediction import NoiseBlock

GOOD_COLOUR, BAD_COLOUR = "#15803d", "#b91c1c"


def curve_figure(found: AllanCurve | Spectrum | Correlogram) -> Figure:
    """Return an empirical curve of every axis with its interval, or with the band of white noise."""
    with new_figure((6.4, 4.4)) as figure:
        panel = figure.subplots()
        for k, axis in enumerate(found.axes):
            colour = SOURCE_COLOURS[k % len(SOURCE_COLOURS)]
            if isinstance(found, Correlogram):
                panel.plot(found.lag, found.value[:, k], ".-", ms=3, lw=0.8, color=colour, label=axis)
                continue
            one = in_customary(1.0, "level", found.unit)
            low, high = found.interval()
            if isinstance(found, AllanCurve):
                x, y, scale = found.tau, found.deviation(), one
            else:
                x, y, scale = found.frequency, found.density, one**2
            panel.fill_between(x, scale * low[:, k], scale * high[:, k], color=colour, alpha=0.15, lw=0)
            panel.plot(x, scale * y[:, k], ".-", ms=3, lw=0.8, color=colour, label=axis)
        if isinstance(found, Correlogram):
            panel.axhspan(-found.band, found.band, color="0.85", lw=0)
            panel.set(xlabel="lag, s", ylabel=found.statistic)
        else:
            unit = pretty(customary_unit("level", found.unit))
            panel.set(xscale="log", yscale="log")
            if isinstance(found, AllanCurve):
                panel.set(xlabel="cluster time τ, s", ylabel=f"{found.estimator}, {unit}")
            else:
                panel.set(xlabel="frequency, Hz", ylabel=f"two-sided density, ({unit})²/Hz")
        panel.grid(which="major", color="0.88", lw=0.6)
        panel.legend(fontsize=8)
    return figure


def settings_figure(config: FilterConfig) -> Figure:
    """Return the Allan deviation of the noise that a filter assumes of each axis."""
    tau = np.geomspace(*STATED_TAU, 200)
    units = list(dict.fromkeys(channel.unit for channel in config.channels.values()))
    with new_figure((5.4 * len(units), 4.2)) as figure:
        for unit, panel in zip(units, figure.subplots(1, len(units), squeeze=False)[0], strict=True):
            own = [c for c in config.channels.values() if c.unit == unit]
            for channel, colour in zip(own, SOURCE_COLOURS, strict=False):
                block = NoiseBlock(channel.white_density, channel.markov, channel.random_walk_density)
                deviation = np.sqrt(block.allan_variance(tau, config.interval))
                scale = in_customary(1.0, "level", unit)
                panel.plot(tau, scale * deviation, color=colour, lw=1.2, label=channel.axis)
            panel.set(xscale="log", yscale="log", xlabel="cluster time τ, s")
            panel.set_ylabel(f"Allan deviation, {pretty(customary_unit('level', unit))}")
            panel.grid(which="major", color="0.88", lw=0.6)
            panel.legend(fontsize=8)
    return figure


RATIO_TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 0.7, 1.0, 1.4, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Ratios named along their axis: most scores lie within a factor of 2, where decades name nothing but 1."""
CLOSE_RATIO_TICKS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 1.7)
"""Ratios that are named where all lie within a factor of 3 of one another."""


def scores_figure(scores: Sequence[Score]) -> Figure:
    """Return true rms ÷ predicted sd of every score with the band of a consistent filter."""
    with new_figure((9.4, 1.0 + 0.25 * len(scores))) as figure:
        panel = figure.subplots()
        for k, score in enumerate(scores):
            low, high = ((limit / score.dof) ** 0.5 for limit in score.band)
            panel.plot([low, high], [k, k], color="0.75", lw=7, solid_capstyle="butt")
            panel.plot(score.ratio, k, "o", color=GOOD_COLOUR if score.consistent else BAD_COLOUR)
        panel.axvline(1.0, color="0.4", lw=0.8)
        panel.set(xscale="log", xlabel="true rms ÷ predicted sd (grey: consistent)")
        low, high = panel.get_xlim()
        named = CLOSE_RATIO_TICKS if high < 3.0 * low else RATIO_TICKS
        ticks = [ratio for ratio in named if low <= ratio <= high]
        panel.set_xticks(ticks, [f"{ratio:g}" for ratio in ticks])
        panel.minorticks_off()
        panel.set_yticks(range(len(scores)), [score_title(score.name).replace("_", " ") for score in scores])
        panel.invert_yaxis()
    return figure


def drift_figure(findings: Sequence[Finding]) -> Figure:
    """Return the position error without fixes with each group of findings in the samples, and without it."""
    groups = [group for group in finding_groups(findings) if group.drift]
    with new_figure((9.4, 1.4 + 0.34 * max(len(groups), 1))) as figure:
        panel = figure.subplots()
        for k, group in enumerate(groups):
            time, (with_it, without) = max(group.drift.items(), key=lambda item: item[1][0] - item[1][1])
            panel.plot([without, with_it], [k, k], color="0.75", lw=2)
            panel.plot(with_it, k, "o", color=BAD_COLOUR, label=None if k else "with it in the samples")
            panel.plot(without, k, "o", color=GOOD_COLOUR, label=None if k else "without it")
            panel.annotate(f" {time}", (with_it, k), va="center", fontsize=8)
        panel.set_yticks(range(len(groups)), [group.short for group in groups])
        panel.set_xlabel("position error of one sensor axis, m")
        panel.invert_yaxis()
        if groups:
            panel.set_xscale("log")
            panel.legend(fontsize=8)
        else:
            panel.set_title("no finding moves the position")
    return figure


def noise_scales_figure(estimates: Sequence[NoiseScaleEstimate]) -> Figure:
    """Return the factor on each noise setting that a drive shows, with no cause named and with all findings."""
    shown = [one for one in estimates if one.identifiable and one.stated is not None]
    with new_figure((9.4, 1.4 + 0.5 * max(len(shown), 1))) as figure:
        panel = figure.subplots()
        for k, one in enumerate(shown):
            for factor, offset, colour, label in (
                (one.plain, -0.15, "0.5", "with no cause named"),
                (one.named, 0.15, GOOD_COLOUR, "with all findings"),
            ):
                at, name = k + offset, None if k else label
                if factor.value is not None and factor.interval is not None:
                    panel.plot(factor.interval, [at, at], color=colour, lw=2)
                    panel.plot(factor.value, at, "o", color=colour, label=name)
                elif factor.upper is not None:
                    panel.plot(factor.upper, at, "<", color=colour, label=name)
        panel.axvline(1.0, color="0.4", lw=0.8)
        panel.set_yticks(range(len(shown)), [SHORT_NAMES[one.setting] for one in shown])
        panel.set(xscale="log", xlabel="shown by the drive ÷ stated")
        panel.invert_yaxis()
        if shown:
            panel.legend(fontsize=8)
        else:
            panel.set_title("the drive determines none of the noise settings")
    return figure


def choice_figure(found: GradeChoice) -> Figure:
    """Return the predicted error of every grade, with the limit."""
    with new_figure((9.4, 1.0 + 0.25 * len(found.ranking))) as figure:
        panel = figure.subplots()
        for k, one in enumerate(found.ranking):
            panel.plot(one.error, k, "o", color=GOOD_COLOUR if one.error <= found.limit else BAD_COLOUR)
        panel.axvline(found.limit, color="0.2", lw=1, ls="--", label=f"limit {found.limit:g} m")
        panel.set_yticks(range(len(found.ranking)), [one.name for one in found.ranking])
        panel.set(xscale="log", xlabel=f"horizontal error after {found.outage:g} s without fixes, m (rms)")
        panel.invert_yaxis()
        panel.grid(color="0.9", lw=0.6)
        panel.legend(fontsize=8)
    return figure


def fleet_figure(fleet: Fleet) -> Figure:
    """Return every unit ÷ the median of the fleet in each quantity, outlying ones with their names."""
    known = [unit for unit in fleet.units if unit.measurement is not None]
    names = [name for name in fleet.spread if is_logarithmic(name)]
    with new_figure((1.6 + 0.55 * max(len(names), 6), 4.4)) as figure:
        panel = figure.subplots()
        for k, name in enumerate(names):
            found = [(u, u.measurement.quantities.get(name)) for u in known if u.measurement is not None]
            values = {u.name: c.value for u, c in found if c is not None and c.value is not None}
            median = float(np.median(list(values.values()))) if values else 0.0
            if median == 0.0:
                continue
            panel.plot(
                np.full(len(values), k), np.array(list(values.values())) / median, ".", color="0.5", ms=4
            )
            for unit in known:
                if any(one.quantity == name for one in unit.outliers) and unit.name in values:
                    ratio = values[unit.name] / median
                    panel.plot(k, ratio, "o", color=BAD_COLOUR)
                    panel.annotate(f" {unit.name}", (k, ratio), fontsize=7)
        panel.set_xticks(
            range(len(names)),
            [name.replace("_", " ").replace(".", " ") for name in names],
            rotation=60,
            ha="right",
            fontsize=8,
        )
        panel.set(yscale="log", ylabel="unit ÷ median of the fleet")
    return figure
