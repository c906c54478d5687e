"""`tuner compare`: logs, identifications, datasheets and built-in grades side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

import click

from tuner.cli.commands.inputs import load_sources
from tuner.cli.commands.options import Output, Reading, common, drawable, paged, reading, verbose
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("compare", short_help="Logs, identifications and built-in grades side by side.")
@click.argument("sources", nargs=-1, metavar="[A B …]")
@click.option(
    "--by",
    type=click.Choice(["still", "temperature"]),
    help="Compare the parts of one log: its stationary parts, or three bins of temperature.",
)
@click.option(
    "--gnss",
    default="spp",
    show_default=True,
    metavar="GRADE",
    help="Built-in receiver that aids the filter before the drift.",
)
@click.option(
    "--figure",
    type=click.Path(path_type=Path, dir_okay=False),
    callback=drawable,
    metavar="FILE",
    help="Draw the Allan curves of all sources over one another into FILE (PNG or SVG).",
)
@verbose
@reading
@common
@paged
def command(
    sources: tuple[str, ...],
    by: Literal["still", "temperature"] | None,
    gnss: str,
    figure: Path | None,
    verbose: bool,
    reading: Reading,
    seed: int,  # noqa: ARG001
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> None:
    """Compare sensors: noise terms, limits of datasheets (pass or fail), drift after 10, 60 and 300 s without fixes.

    Tests at 95 % whether the last source differs from the first, and ranks all by that drift, with wheels and without.

    A source is a log (log.bin:IMU.1 is one inertial unit of several in it), an Allan curve, a datasheet, a
    noise.yaml, the JSON of identify or tune, or the name of a built-in grade. With --by, the parts of one log are
    compared. Without arguments, the grades are listed.
    """
    from tuner import compare
    from tuner.catalogue.grades import grade_names, load_grade
    from tuner.report.json.views import comparison_json, grades_json
    from tuner.report.sensor_answers import comparison_answer, grade_tables, steadiest
    from tuner.report.terminal import show

    if by is None and not sources:
        grades = [load_grade(name) for name in grade_names()]
        output.write(grades_json(grades))
        if output.tables:
            show(grade_tables(grades))
        return
    stage("reading", 0.1)
    loaded = load_sources(sources, reading, messages)
    stage("comparing", 0.95)
    comparison = compare(*loaded, by=by, gnss=gnss, progress=messages.say)
    stage("writing", 1.0)
    output.write(comparison_json(comparison))
    page("Comparison of " + ", ".join(comparison.noise.names), {"Side by side": comparison})
    if figure is not None:
        from tuner.report.figure_files import write_figure
        from tuner.report.overlaid_figure import overlaid_figure

        write_figure(overlaid_figure(comparison.noise), figure)
        messages.say(f"wrote {figure}")
    if output.tables:
        answer = comparison_answer(comparison)
        chosen = sources[steadiest(comparison) if by is None else 0]
        show(answer.then("tune", chosen, *reading.words), whole=verbose)
