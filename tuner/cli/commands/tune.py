"""`tuner tune`: from a log, a measured drive or both to a filter configuration, with its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tuner.cli.commands.inputs import load_source
from tuner.cli.commands.options import Finite, Output, Reading, common, reading, replicas, term_list
from tuner.cli.progress import Messages


@click.command("tune", short_help="The main job: from a log to a filter configuration, with report.")
@click.argument("log", required=False)
@click.option(
    "-o",
    "--output-dir",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder for the results; default tuner-out/NAME.",
)
@click.option(
    "--horizon",
    type=Finite(min=0, min_open=True),
    default=1000.0,
    show_default=True,
    metavar="S",
    help="Longest time the filter must predict without aiding, s.",
)
@click.option(
    "--drive", metavar="DRIVE", help="Measured drive of the same unit (folder, NPZ, YAML of KF-GINS)."
)
@click.option("--complete", metavar="GRADE", help="Built-in grade that stands in for a sensor the log lacks.")
@click.option("--gnss", metavar="GRADE|LOG", help="GNSS receiver: built-in grade, or a log of fixes at rest.")
@click.option(
    "--terms",
    callback=term_list,
    metavar="LIST",
    help="Fit exactly these noise terms, such as white,random_walk.",
)
@click.option(
    "--latitude",
    type=Finite(-90, 90),
    metavar="DEG",
    help="Latitude of the log: subtracts the Earth's rate from the gyro means.",
)
@replicas
@reading
@common
def command(
    log: str | None, output_dir: Path | None, reading: Reading, output: Output, messages: Messages, **how: Any
) -> None:
    """Turn a static log into a filter configuration, with the check of that filter and a report.

    Writes noise.yaml, the same for other filters, figures, report.html and result.json. LOG may also be a datasheet.
    With --drive, what a measured drive shows to be wrong with the filter enters the configuration too; without LOG,
    the stationary parts of the drive stand in for it. With neither, an IMU is simulated, with an effect drawn from
    --seed hidden in its data.
    """
    from tuner import tune
    from tuner.report.result_set import tune_json, tune_tables, write_tune_result
    from tuner.report.terminal import show

    result = tune(load_source(log, reading, messages), progress=messages.say, **how)
    directory = output_dir or Path("tuner-out") / result.name
    write_tune_result(result, directory)
    if output.tables:
        show(tune_tables(result, directory))
    output.write(tune_json(result))
