"""`tuner fleet`: many logs, one row a unit: limits, outlying units, spread."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from tuner.cli.commands.options import (
    DIRECTORY,
    Output,
    Reading,
    common,
    latitude,
    noise_terms,
    reading,
    strict,
    verbose,
)
from tuner.cli.progress import Messages
from tuner.jobs import usable
from tuner.stages import stage


@click.command("fleet", short_help="Many logs, one row a unit: limits, outlying units, spread.")
@click.argument("logs", nargs=-1, required=True, metavar="FOLDER|GLOB|LOG…")
@click.option("-o", "--output-dir", type=DIRECTORY, metavar="DIR", help="Folder; default tuner-fleet/NAME.")
@click.option(
    "--limits", metavar="FILE", help="YAML with the largest noise, drift and offset of each sensor."
)
@click.option(
    "--datasheet",
    metavar="GRADE|SHEET",
    help="Data sheet from which limits follow that --limits leaves open.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=usable,
    metavar="N",
    help="Processes; default one for each core.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler that does the work instead of --jobs.")
@strict("a unit is not PASS, stands apart, or cannot be used")
@verbose
@noise_terms
@latitude
@reading
@common
def command(
    logs: tuple[str, ...],
    output_dir: Path | None,
    strict: bool,
    verbose: bool,
    reading: Reading,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
    **how: Any,
) -> int:
    """Measure every log, judge it by limits or a sheet, name what is odd and why, and say how far units differ.

    Writes fleet.csv, fleet.parquet, fleet.html, spread.csv, grade.yaml and fleet.json. Started again after an
    interruption, only what is missing in DIR/units is measured. A log that cannot be used is a row with the reason.
    """
    from tuner import fleet
    from tuner.production.fleet import output_folder
    from tuner.report.fleet_answer import fleet_answer, looked_at
    from tuner.report.fleet_files import GRADE, fleet_json, write_fleet
    from tuner.report.terminal import show

    directory = output_folder(logs, output_dir)
    stated = {name: value for name, value in asdict(reading).items() if value is not None}
    stage("measuring the units", 0.98)
    result = fleet(logs, store=directory / "units", reading=stated, progress=messages.count("units"), **how)
    stage("writing", 1.0)
    written = write_fleet(result, directory)
    messages.say(f"wrote {', '.join(written)} into {directory}")
    output.write(fleet_json(result))
    if output.tables:
        answer = fleet_answer(result)
        odd, measured = (
            [unit.file for unit in units if unit.measurement is not None]
            for units in (looked_at(result), result.units)
        )
        if odd:
            answer = answer.then("diagnose", odd[0], *reading.words)
        elif unstated := [
            u.file for u in result.units if u.measurement is not None and u.measurement.unit_unstated
        ]:
            answer = answer.then("identify", unstated[0], *reading.words)
        elif GRADE in written:
            answer = answer.then("tune", str(directory / GRADE))
        elif measured:
            answer = answer.then("tune", measured[0], *reading.words)
        show(answer, whole=verbose)
    failed = looked_at(result) or any(u.verdict not in ("", "PASS") for u in result.units)
    return 1 if strict and failed else 0
