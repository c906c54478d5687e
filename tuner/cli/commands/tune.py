"""`tuner tune`: from a log, a measured drive or both to a filter configuration, with its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tuner.cli.commands.inputs import load_source
from tuner.cli.commands.options import Finite, Output, Reading, common, reading, replicas, term_list
from tuner.cli.progress import Messages


@click.command("tune", short_help="The main job: log in, filter configuration out.")
@click.argument("log", required=False)
@click.option(
    "-o",
    "--output-dir",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Default: tuner-out/NAME.",
)
@click.option(
    "--horizon",
    type=Finite(min=0, min_open=True),
    default=1000.0,
    show_default=True,
    metavar="S",
    help="Longest time the filter must predict without aiding, s.",
)
@click.option("--drive", metavar="DRIVE", help="A measured drive; its findings enter the configuration.")
@click.option("--complete", metavar="GRADE", help="Built-in grade for a sensor the log lacks.")
@click.option("--gnss", metavar="GRADE|LOG", help="Built-in GNSS grade, or a log of fixes at rest.")
@click.option("--terms", callback=term_list, metavar="LIST", help="Fit exactly this sum of noise terms.")
@click.option("--latitude", type=Finite(-90, 90), metavar="DEG", help="Subtract the Earth's rate.")
@replicas
@reading
@common
def command(
    log: str | None, output_dir: Path | None, reading: Reading, output: Output, messages: Messages, **how: Any
) -> None:
    """Turn a static log into a filter configuration: noise.yaml, exports, figures, result.json.

    LOG may also be a datasheet. With --drive, errors of the filter that the drive shows enter the configuration too;
    without LOG, the stationary parts of the drive are the log. With neither: a built-in simulated IMU in which an
    effect, drawn from --seed, is hidden.
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
