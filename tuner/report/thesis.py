"""What a chapter of a thesis needs of a log: figures, tables as CSV and LaTeX, preparation and methods in words."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from tuner.curves import acf, pacf
from tuner.formats.axis_words import axes_text
from tuner.formats.csv_text import as_text
from tuner.formats.customary_units import customary_unit, digits, in_customary, phrase, pretty, symbol
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.formats.grouping import gathered
from tuner.formats.identification import identification_json
from tuner.identification import identify
from tuner.judgement import curve_axes
from tuner.report.allan_figure import MEASURED_COLOUR, allan_figure
from tuner.report.coefficient_text import LEVEL_NAMES, coefficients_of, ends_of
from tuner.report.figure_files import new_figure, rendered
from tuner.report.identification_tables import UNKNOWN
from tuner.report.noise_table import legend, measured_table
from tuner.report.series_model_tables import (
    ABOUT_TESTS,
    ROOTS,
    chance,
    model_rows,
    order_name,
    remarks,
    roots_text,
)
from tuner.types import ArmaFit, ChannelIdentification, Coefficient, Identification
from tuner.types.coefficient import apart
from tuner.types.prediction import PredictedBlock
from tuner.types.records import DataError, Record

CHAPTER, STORED = "chapter.tex", "identification.json"
"""The text that holds tables and figures, and the identification, which has the digests of all files."""
FIGURE_SUFFIXES = (".pdf", ".png")
METHODS: Mapping[str, str] = {
    "likelihood": "likelihood",
    "leastsquares": "least squares",
    "slopes": "slopes",
}
"""Estimators of the same terms, with what tables call them."""
BASE = (
    "white.density",
    "bias_instability.level",
    "random_walk.density",
    "quantization.increment_sd",
    "ramp.rate",
)
"""Coefficients of the five terms of an Allan curve: N, B, K, Q, R."""
CORRELATED_LAGS = 50
"""Samples up to which correlograms are drawn."""
DIFFERENCES: Mapping[str, str] = {
    "leastsquares": "It knows octaves of the Allan curve to a quarter of the record, the likelihood every frequency. "
    "Where both differ beyond their intervals, the terms do not describe all of the curve",
    "slopes": "Each is read where the curve has the slope of its term: other terms add there, and a filter takes",
}
"""What sets other estimators apart from the likelihood."""
DELIMITERS: Mapping[str, Any] = {
    "block_start_string": "<%",
    "block_end_string": "%>",
    "variable_start_string": "<<",
    "variable_end_string": ">>",
    "comment_start_string": "<#",
    "comment_end_string": "#>",
}
"""Of the template: LaTeX has braces of its own."""
SIGNS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "√Hz": r"$\sqrt{\mathrm{Hz}}$", "√h": r"$\sqrt{\mathrm{h}}$",
    "√": r"$\surd$", "µ": r"$\mu$", "±": r"$\pm$", "×": r"$\times$", "÷": r"$\div$", "≤": r"$\leq$", "≥": r"$\geq$",
    "→": r"$\to$", "−": r"$-$", "·": r"$\cdot$", "°": r"$^\circ$", "…": r"\ldots{}", "–": "--", "²": r"$^2$",
    "₂": r"$_2$",
    "φ": r"$\varphi$", "θ": r"$\theta$", "σ": r"$\sigma$", "τ": r"$\tau$", "η": r"$\eta$", "χ": r"$\chi$",
    "Σ": r"$\Sigma$", "Δ": r"$\Delta$", "<": r"$<$", ">": r"$>$", "|": r"$|$", "ê": r"\^e", "Θ": r"$\Theta$",
}  # fmt: skip
"""LaTeX of signs that are none of its letters."""


@dataclass(frozen=True)
class Sheet:
    """A table of a chapter: name, caption, heads and rows in words, and the same with all digits for a CSV."""

    name: str
    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    columns: Sequence[str]
    numbers: Iterable[Sequence[object]]


def write_thesis(
    records: Sequence[Record],
    found: Identification,
    predictions: Mapping[str, PredictedBlock],
    directory: Path,
    *,
    name: str,
) -> list[str]:
    """Write the material of a chapter on a log into a folder, in place of that of an earlier run; return the files.

    Parameters
    ----------
    records : sequence of Record
        The log at rest.
    found : Identification
        Its noise by the likelihood, with ARMA models.
    predictions : mapping of str to PredictedBlock
        How settings predict its Allan curves.
    directory : Path
        The folder.
    name : str
        Of the log.

    Raises
    ------
    DataError
        Where the folder holds another text of the name `CHAPTER`: of the user's own, or changed by them.
    """
    _expect_own(directory)
    channels, read = list(found.channels.values()), curve_axes(predictions)
    by_method = {
        method: found if method == channels[0].method else identify(records, method=method, arma=None)
        for method in METHODS
    }
    fits = {one.axis: one.arma for one in channels if one.arma is not None}
    sensors = gathered((axis.partition("_")[0], (axis, fit)) for axis, fit in fits.items())
    sheets = [
        _measured(found, predictions),
        _estimators(by_method, read),
        _levels(channels),
        _curves(channels),
    ]
    sheets += [_orders(fits)] if fits else []
    models = [sheet for sensor, own in sensors.items() for sheet in _models(sensor, dict(own))]
    figures = {"allan": allan_figure(found, title=name, predictions=predictions)}
    figures |= {"correlograms": correlogram_figure(records)} if fits else {}
    environment = Environment(
        loader=PackageLoader("tuner.report"),
        trim_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
        autoescape=False,
        **DELIMITERS,
    )
    environment.filters["tex"] = latex
    page = environment.get_template(f"{CHAPTER}.j2")
    files = {f"{one.name}.csv": _csv(one) for one in (*sheets, *models)}
    files |= {f"{one.name}.tex": page.render(only=one).encode() for one in (*sheets, *models) if one.rows}
    for key, figure in figures.items():
        files |= rendered(figure, key, FIGURE_SUFFIXES)
    files[CHAPTER] = page.render(
        only=None,
        name=name,
        hours=digits(records[0].span / 3600.0),
        rate=digits(records[0].rate, 4),
        models=models,
        read=axes_text(read),
        differences=list(_differences(by_method, read)),
        remarks=[(one.axis, ". ".join([*one.warnings, *_prepared(one)])) for one in channels],
    ).encode()
    files[STORED] = json_text(identification_json(found) | {MANIFEST: digests(files)}).encode()
    write_set(directory, files, last=STORED)
    return list(files)


def _expect_own(directory: Path) -> None:
    """Refuse a folder whose chapter is not as an earlier run left it."""
    text, stored = directory / CHAPTER, directory / STORED
    if text.is_file():
        known = digests({CHAPTER: text.read_bytes()})[CHAPTER]
        if not stored.is_file() or known not in stored.read_text(encoding="utf-8", errors="replace"):
            raise DataError(
                f"{text}: expected no such file, or one as this command wrote it, found another: "
                "move it, or choose another folder"
            )


def latex(text: str) -> str:
    """Return a text with the signs that LaTeX needs."""
    return re.sub("|".join(map(re.escape, SIGNS)), lambda sign: SIGNS[sign[0]], text)


def _csv(sheet: Sheet) -> bytes:
    """Return the numbers of a table as CSV."""
    frame = pd.DataFrame(sheet.numbers, columns=list(sheet.columns))
    return str(frame.map(as_text).to_csv(index=False, lineterminator="\n")).encode()


def _prepared(channel: ChannelIdentification) -> Iterator[str]:
    """Yield how a series was prepared, and what a reader of its model must know."""
    if channel.arma is not None:
        fit = channel.arma
        found = (f"{name} {roots_text(fit, name)}" for name in ROOTS)
        yield "; ".join([*fit.steps, f"chosen: {order_name(fit)}", *found, *remarks(fit)]) + "."


def _customary(c: Coefficient, quantity: str, unit: str) -> list[float | None]:
    """Return value and ends of a coefficient in its customary unit."""
    return [None if one is None else in_customary(one, quantity, unit) for one in ends_of(c)]


def _measured(found: Identification, predictions: Mapping[str, PredictedBlock]) -> Sheet:
    """Return the noise as it stands on the first screen."""
    table = measured_table(found, predictions=predictions)
    heads = [str(column.header) for column in table.columns]
    rows = [list(map(str, row)) for row in zip(*(column.cells for column in table.columns), strict=True)]
    return Sheet("measured", f"Measured noise. {legend(table)}", heads, rows, heads, rows)


def _estimators(by_method: Mapping[str, Identification], read: Container[str]) -> Sheet:
    """Return N, B, K, Q and R of every axis by every method, but of those read off their curve."""
    rows, numbers = [], []
    for axis, channel in by_method["likelihood"].channels.items():
        for quantity in BASE:
            got = {method: _estimate(by_method[method].channels[axis], quantity) for method in METHODS}
            got |= {method: UNKNOWN for method in got if method != "likelihood" and got[method].value is None}
            if axis in read or all(one == UNKNOWN for one in got.values()):
                continue
            unit = customary_unit(quantity, channel.unit)
            said = (phrase(one, quantity, channel.unit, with_unit=False) for one in got.values())
            rows.append([f"{axis} {symbol(quantity)}, {pretty(unit)}", *said])
            numbers += [
                [axis, symbol(quantity), unit, method, *_customary(one, quantity, channel.unit)]
                for method, one in got.items()
            ]
    caption = "Coefficients by three estimators, with 95 % intervals; < is a limit, – no estimate"
    columns = ["axis", "coefficient", "unit", "estimator", "value", "lower", "upper"]
    return Sheet("estimators", caption, ["", *METHODS.values()], rows, columns, numbers)


def _estimate(channel: ChannelIdentification, quantity: str) -> Coefficient:
    """Return a coefficient of an axis; an unknown one where its terms have none."""
    return coefficients_of(channel).get((quantity, 0), UNKNOWN)


def _levels(channels: Sequence[ChannelIdentification]) -> Sheet:
    """Return mean, Allan deviation at 10 s, its minimum and where that is."""
    each = [[(name, getattr(one, name)) for name in LEVEL_NAMES] for one in channels]
    rows = [
        [f"{one.axis}, {pretty(customary_unit('level', one.unit))}"]
        + [phrase(c, "level", one.unit, with_unit=False) for _, c in values]
        + [digits(one.minimum_tau)]
        for one, values in zip(channels, each, strict=True)
    ]
    numbers = (
        *(
            [one.axis, name, customary_unit("level", one.unit), *_customary(c, "level", one.unit)]
            for one, values in zip(channels, each, strict=True)
            for name, c in values
        ),
        *([one.axis, "minimum_tau", "s", one.minimum_tau, None, None] for one in channels),
    )
    caption = (
        "Mean, Allan deviation at 10 s, the smallest, that ÷ 0.664 (of flicker alone it would be B), its τ"
    )
    heads = ["", *LEVEL_NAMES.values(), "at τ, s"]
    return Sheet(
        "levels", caption, heads, rows, ["axis", "quantity", "unit", "value", "lower", "upper"], numbers
    )


def _curves(channels: Sequence[ChannelIdentification]) -> Sheet:
    """Return every point of the Allan curves, for a CSV alone."""
    numbers: list[list[object]] = []
    for one in channels:
        ends = np.hstack([one.allan.deviation(), *one.allan.interval(), one.allan.dof])
        ends[:, :3] *= in_customary(1.0, "level", one.unit)
        unit = customary_unit("level", one.unit)
        numbers += [
            [one.axis, unit, tau, *row] for tau, row in zip(one.allan.tau, ends.tolist(), strict=True)
        ]
    columns = ["axis", "unit", "tau_s", "allan_deviation", "lower", "upper", "degrees_of_freedom"]
    return Sheet("curves", "", [], [], columns, numbers)


def _orders(fits: Mapping[str, ArmaFit]) -> Sheet:
    """Return AIC and BIC of every order less the least of each: the best five by BIC, and the best by AIC."""
    rows, numbers = [], []
    for axis, fit in fits.items():
        aic, bic = fit.scores_by("aic"), fit.scores_by("bic")
        numbers += [[axis, p, q, aic[p, q], bic[p, q]] for p, q in bic]
        best = dict.fromkeys(
            [*sorted(bic, key=lambda order: bic[order])[:5], min(aic, key=lambda order: aic[order])]
        )
        for p, q in best:
            more = (digits(one[p, q] - min(one.values())) for one in (aic, bic))
            rows.append([axis, f"({p},{q})", *more])
    caption = "Orders of an ARMA model: AIC and BIC less the least of each; all orders are in orders.csv"
    return Sheet(
        "orders", caption, ["", "(p,q)", "AIC", "BIC"], rows, ["axis", "p", "q", "AIC", "BIC"], numbers
    )


def _models(sensor: str, fits: Mapping[str, ArmaFit]) -> Iterator[Sheet]:
    """Yield the models of a sensor, and the tests of its series and of their residuals."""
    rows = [row for row in model_rows(list(fits.values())) if row[0] not in ROOTS]
    numbers = (
        *(
            [axis, f"{name}_{i + 1}", *ends_of(c)]
            for axis, fit in fits.items()
            for name, part in (("ar", fit.ar), ("ma", fit.ma))
            for i, c in enumerate(part)
        ),
        *([axis, "variance", fit.variance, None, None] for axis, fit in fits.items()),
    )
    caption = "ARMA models: φ of past samples, θ of past innovations e, with 95 % intervals"
    columns = ["axis", "coefficient", "value", "lower", "upper"]
    yield Sheet(f"arma_{sensor}", caption, ["", *fits], rows, columns, numbers)
    nulls = {t.name: t.null for fit in fits.values() for t in fit.tests}
    chances = [
        [f"{name}: {null}", *(chance(fit, name)[1] for fit in fits.values())] for name, null in nulls.items()
    ]
    every = [
        [a, t.name, t.null, t.statistic, t.p_value, t.found] for a, fit in fits.items() for t in fit.tests
    ]
    columns = ["axis", "test", "null", "statistic", "p", "found"]
    yield Sheet(f"tests_{sensor}", ABOUT_TESTS, ["test: null hypothesis", *fits], chances, columns, every)


def correlogram_figure(records: Sequence[Record]) -> Figure:
    """Draw autocorrelation and partial autocorrelation of every axis of a log."""
    axes = [(record, axis) for record in records for axis in record.axes]
    with new_figure((9.0, 1.7 * len(axes) + 0.5)) as figure:
        grid = figure.subplots(len(axes), 2, squeeze=False, sharex=True)
        for (record, axis), panels in zip(axes, grid, strict=True):
            longest = max(b - a for a, b in record.segments)
            lags = np.arange(1.0, min(CORRELATED_LAGS, longest // 4) + 1.0)
            own = replace(record, y=record.column(axis)[:, None], axes=(axis,))
            for panel, make, title in zip(panels, (acf, pacf), ("ACF", "PACF"), strict=True):
                found = make(own, lag=(lags * record.interval).tolist())
                panel.vlines(lags, 0.0, found.value[:, 0], color=MEASURED_COLOUR, lw=1.4)
                panel.axhspan(-found.band, found.band, color="0.85", lw=0)
                panel.set(title=f"{axis}: {title}", xlabel="lag, samples")
    return figure


def _differences(by_method: Mapping[str, Identification], read: Container[str]) -> Iterator[str]:
    """Yield how far estimators differ from the likelihood, and why; of axes whose terms predict their curve."""
    for method, why in DIFFERENCES.items():
        said = []
        for quantity in BASE:
            pairs = {
                axis: (_estimate(channel, quantity), _estimate(by_method[method].channels[axis], quantity))
                for axis, channel in by_method["likelihood"].channels.items()
                if axis not in read
            }
            known = {axis: pair for axis, pair in pairs.items() if pair[0].value and pair[1].value}
            ratios = [(other.value or 0.0) / (own.value or 1.0) for own, other in known.values()]
            if ratios:
                span = " to ".join(dict.fromkeys([digits(min(ratios)), digits(max(ratios))]))
                differing = [axis for axis, pair in known.items() if apart(*pair)]
                beyond = f", beyond both intervals on {axes_text(differing)}" if differing else ""
                said.append(f"{symbol(quantity)} {span} × ({axes_text(list(known))}{beyond})")
        if said:
            yield f"{METHODS[method]} ÷ likelihood: {'; '.join(said)}. {why}."
