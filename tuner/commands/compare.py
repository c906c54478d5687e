"""`tuner compare`: logs, identifications, datasheets and built-in grades side by side."""

from __future__ import annotations

import click

from tuner.commands.options import Output, Reading, common, reading
from tuner.commands.sources import load_identification, source_name
from tuner.progress import Messages
from tuner.records import DataError


@click.command("compare", short_help="Logs, identifications and built-in grades side by side.")
@click.argument("sources", nargs=-1, metavar="[A B …]")
@reading
@common
def command(
    sources: tuple[str, ...],
    reading: Reading,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
) -> None:
    """Compare sensors coefficient by coefficient; where intervals allow, say which differ and by how much.

    A source is a log, a curve, a datasheet, a noise.yaml or the name of a built-in grade. Without
    arguments: list the grades.
    """
    from tuner.comparison import compare
    from tuner.grades import grade_names, load_grade
    from tuner.jsonviews import comparison_json, grades_json
    from tuner.report.tables import comparison_tables, grade_tables, show

    if not sources:
        grades = [load_grade(name) for name in grade_names()]
        if output.tables:
            show(grade_tables(grades))
        output.write(grades_json(grades))
        return
    if len(sources) < 2:
        known = " ".join(grade_names())
        msg = f"compare: expected two sources or more, got {sources[0]}; add a log or a grade ({known})"
        raise DataError(msg)
    names = [source_name(source) for source in sources]
    found = [load_identification(source, reading, messages, arma=None) for source in sources]
    comparison = compare(names, found)
    if output.tables:
        show(comparison_tables(comparison))
    output.write(comparison_json(comparison))
