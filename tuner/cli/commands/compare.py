"""`tuner compare`: logs, identifications, datasheets and built-in grades side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from tuner.cli.commands.inputs import is_log, load_identification, load_records, source_name
from tuner.cli.commands.options import Output, Reading, common, reading
from tuner.cli.progress import Messages
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.types import Identification


@click.command("compare", short_help="Logs, identifications and built-in grades side by side.")
@click.argument("sources", nargs=-1, metavar="[A B …]")
@click.option(
    "--by",
    type=click.Choice(["still", "temperature"]),
    help="Compare the parts of one log: stretches at rest between motions, or bins of temperature.",
)
@reading
@common
def command(
    sources: tuple[str, ...],
    by: str | None,
    reading: Reading,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
) -> None:
    """Compare sensors coefficient by coefficient; where intervals allow, say which differ and by how much.

    Ratios are of the last source to the first. A source is a log, a curve, a datasheet, a noise.yaml,
    the JSON of identify or tune, or the name of a built-in grade. With --by: the parts of one log.
    Without arguments: list the grades.
    """
    from tuner.catalogue.grades import grade_names, load_grade
    from tuner.identification.comparison import compare
    from tuner.report.json.views import comparison_json, grades_json
    from tuner.report.tables import comparison_tables, grade_tables, show

    if by is not None:
        names, found = _parts(sources, by, reading, messages)
    elif not sources:
        grades = [load_grade(name) for name in grade_names()]
        if output.tables:
            show(grade_tables(grades))
        output.write(grades_json(grades))
        return
    elif len(sources) < 2:
        known = " ".join(grade_names())
        msg = (
            f"compare: expected two sources or more, got {sources[0]}; add a log or a grade ({known}), "
            "or take one log apart with --by"
        )
        raise DataError(msg)
    else:
        names = [source_name(source) for source in sources]
        found = [load_identification(source, reading, messages, arma=None) for source in sources]
    comparison = compare(names, found)
    if output.tables:
        show(comparison_tables(comparison))
    output.write(comparison_json(comparison))


def _parts(
    sources: Sequence[str], by: str, reading: Reading, messages: Messages
) -> tuple[list[str], list[Identification]]:
    """Return names and identifications of the parts of one log."""
    from tuner.identification import identify
    from tuner.segments.conditions import still_parts, temperature_parts

    if len(sources) != 1 or not is_log(sources[0]):
        msg = f"compare --by {by}: expected one log, got {' '.join(sources) or 'none'}"
        raise DataError(msg)
    records = load_records(sources[0], reading, messages)
    parts = still_parts(records) if by == "still" else temperature_parts(records)
    messages.say(f"identifying {len(parts)} parts")
    return [part.name for part in parts], [identify(part.records, arma=None) for part in parts]
