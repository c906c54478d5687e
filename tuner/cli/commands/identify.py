"""`tuner identify`: the noise terms of a log, with intervals; several logs of one sensor are pooled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from tuner.cli.commands.inputs import load_sources
from tuner.cli.commands.options import (
    DIRECTORY,
    Output,
    Reading,
    common,
    drawable,
    jobs,
    latitude,
    noise_terms,
    paged,
    reading,
    strict,
    verbose,
)
from tuner.cli.progress import Messages
from tuner.stages import counted, stage

if TYPE_CHECKING:
    from tuner.identification.arma import Criterion
    from tuner.report.document import Document
    from tuner.report.result_views import Part
    from tuner.types import Identification
    from tuner.types.prediction import PredictedBlock

ARMA_CRITERIA: Mapping[str, Criterion | None] = MappingProxyType({"bic": "bic", "aic": "aic", "off": None})
METHODS = ("likelihood", "leastsquares", "slopes")


@click.command("identify", short_help="Noise terms of a log, with intervals.")
@click.argument("logs", nargs=-1, required=True, metavar="LOG [LOG…]")
@noise_terms
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="likelihood",
    show_default=True,
    help="How coefficients are estimated: by the likelihood of the spectrum, or from the Allan curve.",
)
@click.option(
    "--arma",
    type=click.Choice(list(ARMA_CRITERIA)),
    default="bic",
    show_default=True,
    help="Criterion that chooses the order of the ARMA model beside the terms; off for none.",
)
@latitude
@click.option(
    "--figure",
    type=click.Path(path_type=Path, dir_okay=False),
    callback=drawable,
    metavar="FILE",
    help="Draw the Allan figure into FILE (PNG or SVG).",
)
@click.option(
    "--thesis",
    type=DIRECTORY,
    metavar="DIR",
    help="Write the material of a chapter into DIR: figures, tables as CSV and LaTeX, ARMA orders up to (5,5).",
)
@strict("the noise is not usable without reservation")
@verbose
@reading
@jobs
@common
@paged
def command(
    logs: tuple[str, ...],
    terms: tuple[str, ...] | None,
    method: str,
    arma: str,
    latitude: float | None,
    figure: Path | None,
    thesis: Path | None,
    verbose: bool,
    reading: Reading,
    seed: int,  # noqa: ARG001
    strict: bool,
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> int:
    """Find the noise terms of each axis, with intervals: quantization, white, flicker, random walk, ramp and others.

    Prints N, B and K, axes that agree in one row; --verbose prints every term, bound and reason. Where the terms do not
    predict the Allan curve of the log, the answer says so, and --verbose also prints the settings of a filter that do,
    as `tuner tune` writes them. Several logs of one sensor are pooled, with their spread. A CSV with columns
    tau,deviation[,dof] is fitted as an Allan curve. A CSV of GNSS fixes of an antenna at rest (t,lat,lon,height,…)
    gives the errors of the receiver. --thesis DIR writes what a chapter on a log needs.
    """
    from tuner.formats.codec import dump
    from tuner.formats.identification import identification_json
    from tuner.formats.prediction import settings_json
    from tuner.identification.arma import HIGHEST_ORDER, MAX_ORDER
    from tuner.identification.identify_source import identify_fixes, identify_source
    from tuner.identification.several_logs import pool
    from tuner.judgement import judge_noise
    from tuner.readers.gnss_log import is_fixes
    from tuner.readers.source_kind import source_name
    from tuner.report.claims import lawful
    from tuner.report.identification_answer import identification_answer, pooled_answer
    from tuner.report.identification_tables import receiver_lines
    from tuner.report.json.views import pooled_json, receiver_json
    from tuner.report.terminal import show
    from tuner.segments.conditions import at_rest
    from tuner.synthesis import synthesize
    from tuner.synthesis.prediction import hold_to_records

    if len(logs) == 1 and is_fixes(logs[0]):
        receiver = identify_fixes(logs[0], messages.say)
        output.write(receiver_json(receiver))
        if output.tables:
            show(receiver_lines(receiver))
        return 0
    stage("reading", 0.2)
    loaded = load_sources(logs, reading, messages)
    if thesis is not None and (len(loaded) > 1 or isinstance(loaded[0], str)):
        raise click.UsageError(f"--thesis: expected one log with samples, found {', '.join(logs)}")
    if thesis is not None and (method != "likelihood" or terms):
        raise click.UsageError(
            "--thesis: it chooses terms and compares methods; leave --method and --terms out"
        )
    stage("identifying the noise", 0.7)
    found = [
        identify_source(
            source,
            terms=terms,
            method=method,
            arma=ARMA_CRITERIA[arma],
            arma_orders=MAX_ORDER if thesis is None else HIGHEST_ORDER,
            latitude=latitude,
            progress=messages.say,
        )
        for source in counted(loaded)
    ]
    stage("comparing the noise with the Allan curve", 1.0)
    settings = [
        hold_to_records(synthesize(one), at_rest(source))
        if not isinstance(source, str) and method == "likelihood"
        else None
        for source, one in zip(loaded, found, strict=True)
    ]
    verdicts = [
        judge_noise(one, {} if written is None else written[1])
        for one, written in zip(found, settings, strict=True)
    ]
    exit_status = 1 if strict and not all(one.good for one in verdicts) else 0
    for one in found:
        lawful(one)
    names = [source_name(log) for log in logs]
    answers = [
        identification_answer(name, one, *(written or ()))
        for name, one, written in zip(names, found, settings, strict=True)
    ]
    predictions = [{} if written is None else written[1] for written in settings]
    parts = {
        name: partial(_part, one, answer, predicted)
        for name, one, answer, predicted in zip(names, found, answers, predictions, strict=True)
    }
    page("Noise of " + ", ".join(names), parts)
    if len(found) > 1:
        output.write(pooled_json(names, found, pool(found)))
    else:
        written = settings[0]
        added = {} if written is None else {"settings": settings_json(*written)}
        output.write(identification_json(found[0]) | added | {"verdict": dump(verdicts[0])})
    if figure is not None:
        from tuner.report.allan_figure import allan_figure
        from tuner.report.figure_files import write_figure

        for name, one, predicted in zip(names, found, predictions, strict=True):
            path = figure if len(found) == 1 else figure.with_stem(f"{figure.stem}-{name}")
            write_figure(allan_figure(one, title=name, predictions=predicted), path)
            messages.say(f"wrote {path}")
    if thesis is not None:
        from tuner.report.thesis import CHAPTER, write_thesis

        (log,) = loaded
        assert not isinstance(log, str)
        files = write_thesis(at_rest(log), found[0], predictions[0], thesis, name=names[0])
        messages.say(f"wrote {thesis / CHAPTER} and {len(files) - 1} files beside it")
    if output.tables:
        several = len(answers) > 1
        answer = pooled_answer(pool(found), names, answers) if several else answers[0]
        show(answer.then("compare" if several else "tune", *logs, *reading.words), whole=verbose)
    return exit_status


def _part(found: Identification, answer: Document, predictions: Mapping[str, PredictedBlock]) -> Part:
    """Return the part of a page on a log: the answer of the terminal, and its curves with those of its settings."""
    from tuner.report.allan_figure import allan_figure  # loads what draws
    from tuner.report.result_views import VIEWS, pictured
    from tuner.tune_result import TuneResult

    return pictured(answer, allan_figure(found, predictions=predictions), VIEWS[TuneResult].caption)
