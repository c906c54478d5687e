"""The answer of `identify`: recording, verdict, and the noise of each axis; of several logs what they share."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import customary_unit, digits, pretty, symbol
from tuner.formats.grouping import gathered, grouped
from tuner.identification.identify import BY_DIAGNOSIS
from tuner.identification.identify_channel import CURVE_DISAGREES
from tuner.judgement import curve_axes, judge_noise
from tuner.report.alike_sentences import alike_sentences
from tuner.report.answer_layout import recording_text
from tuner.report.coefficient_text import coefficients_of
from tuner.report.document import Document, document
from tuner.report.identification_tables import identification_tables, pooled_tables
from tuner.report.noise_table import NAMES, legend, measured_table, states_tables
from tuner.report.series_model_tables import orders_line
from tuner.report.terms_rows import MAIN_TERMS, TermsRow, joined_rows, single_row
from tuner.report.titled_table import table_of
from tuner.types import Coefficient, FilterConfig, Identification, PooledChannel
from tuner.types.coefficient import TOO_SHORT, hours_needed
from tuner.types.prediction import PredictedBlock

UNEQUAL_BELOW = 0.05
"""Probability below which logs are said to differ."""


def identification_answer(
    name: str,
    found: Identification,
    config: FilterConfig | None = None,
    predictions: Mapping[str, PredictedBlock] = MappingProxyType({}),
) -> Document:
    """Return what was found in a log: recording, verdict, noise of each axis, what limits it.

    Parameters
    ----------
    name : str
        Of the log.
    found : Identification
        Its noise terms.
    config, predictions : FilterConfig and mapping of str to PredictedBlock, optional
        The settings that `tune` would write, and how they predict the log. Of an axis whose terms do not predict its
        Allan curve the numbers are those of the curve.
    """
    table = measured_table(found, predictions=predictions)
    read = curve_axes(predictions)
    by_terms = replace(
        found, channels={axis: one for axis, one in found.channels.items() if axis not in read}
    )
    return document(
        [
            f"{name}: {recording_text(found)}",
            f"Verdict: {judge_noise(found, predictions).text}",
            table,
            legend(table),
            orders_line(list(found.channels.values())),
        ],
        [*warning_lines(found, predicted=predictions), *_too_short(by_terms)],
        more=[*identification_tables(found), *([] if config is None else states_tables(config))],
        beyond="all terms, bounds with reasons, means, ARMA",
    )


def warning_lines(found: Identification, *, predicted: Container[str] = ()) -> list[str]:
    """Return what limits the terms of a log, with its axes.

    What the diagnosis found stands among the findings. Of axes whose settings were `predicted` on their Allan curve the
    verdict and the table say how far terms and curve agree.
    """
    said = alike_sentences(
        (text, one.axis)
        for one in found.channels.values()
        for text in one.warnings
        if BY_DIAGNOSIS not in text and not (one.axis in predicted and text.startswith(CURVE_DISAGREES))
    )
    return [f"Warning: {text}" for text in said]


def pooled_answer(
    pooled: Mapping[str, PooledChannel], names: Sequence[str], each: Sequence[Document] = ()
) -> Document:
    """Return what several logs of one sensor have in common and in what they differ, beside the answer of `each`."""
    rows = joined_rows(_pooled_row(one) for one in pooled.values() if one.mean is not None)
    differing = gathered(
        (symbol(one.name), channel.axis)
        for channel in pooled.values()
        if channel.mean is not None
        for one in (*channel.coefficients, channel.mean)
        if one.p_value < UNEQUAL_BELOW
    )
    text = "; ".join(f"{sign} of {axes_text(axes)}" for sign, axes in differing.items())
    verdict = (
        f"logs differ (p < {UNEQUAL_BELOW:g}) in {text}" if text else "no coefficient differs from log to log"
    )
    two = ": there their range, of two; a third log gives an interval" if text and len(names) == 2 else ""
    more = [*pooled_tables(pooled, names), *(part for one in each for part in one.whole)]
    about = f"{len(names)} logs pooled: ± ( ) 95 % of the mean over the logs; < 95 % limit"
    parts: list[Table | str] = [about, f"Verdict: {verdict}{two}", terms_table([("", row) for row in rows])]
    return document(parts, more=more, beyond="each log")


def _pooled_row(pooled: PooledChannel) -> TermsRow:
    """Return the pooled coefficients of an axis as a row; the values of all logs where they give no interval."""
    row = single_row(pooled.axis, pooled.unit, [(c.name, c.value) for c in pooled.coefficients])
    every = {
        c.name: tuple(Coefficient(v, None, None, c.value.unit) for v in c.values if v is not None)
        for c in pooled.coefficients
        if c.name in row.coefficients and c.value.value is not None and c.value.interval is None
    }
    return replace(row, coefficients={**row.coefficients, **every})


def terms_table(rows: Sequence[tuple[str, TermsRow]]) -> Table:
    """Return N, B and K of every row, behind the name of its source, under the units of the sensors."""
    units = list(dict.fromkeys(row.unit for _, row in rows))
    heads = (
        f"{NAMES[name]},\n{' | '.join(pretty(customary_unit(name, unit)) for unit in units)}"
        for name in MAIN_TERMS
    )
    lines = (
        (f"{name} {axes_text(row.axes)}".strip(), *map(row.cell, MAIN_TERMS))
        for unit in units
        for name, row in rows
        if row.unit == unit
    )
    return table_of(("", *heads), lines, words=4)


def terms_too_short(found: Identification) -> str:
    """Return what a longer record would show: terms, with the axes in parentheses where it is not all of them.

    Sensors with all their axes have no letters.
    """
    short = gathered(
        (NAMES.get(name, symbol(name)), channel.axis)
        for channel in found.channels.values()
        for (name, _), c in coefficients_of(channel).items()
        if c.value is None and (c.reason or "").startswith(TOO_SHORT)
    )
    said = []
    for sign, axes in short.items():
        sensors = grouped(axes, lambda group, axis: group[0].partition("_")[0] == axis.partition("_")[0])
        where = ", ".join(sensor_or_axes(own, list(found.channels)) for own in sensors)
        said.append(sign if len(axes) == len(found.channels) else f"{sign} ({where})")
    return ", ".join(said)


def sensor_or_axes(axes: list[str], every: Sequence[str]) -> str:
    """Return axes in few words, those of a whole sensor by its name."""
    sensor = axes[0].partition("_")[0]
    whole = axes == [axis for axis in every if axis.partition("_")[0] == sensor]
    return sensor if whole else axes_text(axes)


def _too_short(found: Identification) -> list[str]:
    """Return which terms of which axes a longer record would show; empty where none is bounded for that reason."""
    text = terms_too_short(found)
    bounds = [c for one in found.channels.values() for term in one.terms for c in term.coefficients.values()]
    hours = [needed for c in bounds if (needed := hours_needed(c.reason)) is not None]
    longer = f"; half of each limit would show in {digits(max(hours), 2)} h" if hours else ""
    return [f"The log is too short to show {text}{longer}"] if text else []
