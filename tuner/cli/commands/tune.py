"""`tuner tune`: from a log, a measured drive or both to a filter configuration, with its report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tuner.cli.commands.external_filter import TIME_LIMIT, external_options, tune_filter
from tuner.cli.commands.inputs import load_source
from tuner.cli.commands.options import (
    DIRECTORY,
    Output,
    Reading,
    common,
    horizon,
    jobs,
    latitude,
    noise_terms,
    reading,
    replicas,
    stated_command,
    strict,
    verbose,
)
from tuner.cli.commands.options import lever_arm as with_lever_arm
from tuner.cli.progress import Messages
from tuner.stages import stage

if TYPE_CHECKING:
    from tuner.tune_result import TuneResult


@click.command("tune", short_help="The main job: from a log to a filter configuration, with report.")
@click.argument("log", required=False)
@click.option("-o", "--output-dir", type=DIRECTORY, metavar="DIR", help="Folder; default tuner-out/NAME.")
@horizon
@click.option(
    "--drive",
    metavar="DRIVE",
    help="Measured drive of the same unit: what it shows to be wrong enters the configuration.",
)
@with_lever_arm
@click.option("--complete", metavar="GRADE", help="Built-in grade that stands in for a sensor the log lacks.")
@click.option(
    "--datasheet",
    metavar="GRADE|SHEET",
    help="Data sheet to compare the log with; its bias terms stand in where the log is too short.",
)
@click.option("--gnss", metavar="GRADE|LOG", help="GNSS receiver: built-in grade, or a log of fixes at rest.")
@noise_terms
@latitude
@click.option("--conservative", is_flag=True, help="Use the noise of the worst stretch of LOG throughout.")
@replicas
@external_options
@strict("the settings are not usable without reservation")
@verbose
@reading
@jobs
@common
def command(
    log: str | None,
    output_dir: Path | None,
    strict: bool,
    verbose: bool,
    reading: Reading,
    output: Output,
    messages: Messages,
    filter_command: str | None,
    dialect: str | None,
    filter_timeout: float | None,
    **how: Any,
) -> int:
    """Turn a static log into a filter configuration, with the check of that filter and a report.

    Prints the verdict, the numbers and what matters most; --verbose prints every table. With --to,
    the numbers are those of another filter, under its keys. Writes noise.yaml, the same for other filters, figures,
    report.html and result.json. LOG may also be a datasheet.
    With --drive, what a measured drive shows to be wrong with the filter enters the configuration too; without LOG,
    the stationary parts of the drive stand in for it. With neither, an IMU is simulated, with an effect drawn from
    --seed hidden in its data.

    With --filter, another program filters the drive as it is: settings in its DIALECT are written, it is run, its
    output is scored, and noise, walks and sds of fixes are moved to the best score. LOG may then be a configuration.
    """
    from tuner import tune
    from tuner.report.result_set import tune_json, write_tune_result
    from tuner.report.terminal import show
    from tuner.report.tune_answer import tune_answer

    if how["lever_arm"] is not None and how["drive"] is None:
        raise click.UsageError("--lever-arm: expected --drive DRIVE with it")
    if filter_timeout is not None and filter_command is None:
        raise click.UsageError("--filter-timeout: expected --filter COMMAND with it")
    if filter_command is not None:
        tune_filter(
            filter_command,
            log,
            dialect=dialect,
            drive=how.pop("drive"),
            lever_arm=how.pop("lever_arm"),
            gnss=how.pop("gnss"),
            time_limit=filter_timeout or TIME_LIMIT,
            how=how,
            output_dir=output_dir,
            reading=reading,
            output=output,
            messages=messages,
        )
        return 0
    stage("reading the log", 0.1)
    loaded = load_source(log, reading, messages)
    stage("tuning", 0.8)
    result = tune(loaded, dialect=dialect, progress=messages.say, **how)
    directory = output_dir or Path("tuner-out") / result.name
    stage("drawing the page", 1.0)
    write_tune_result(result, directory, stated_command(click.get_current_context().obj))
    output.write(tune_json(result))
    if output.tables:
        arm = [] if how["lever_arm"] is None else ["--lever-arm", ",".join(map(str, how["lever_arm"]))]
        following = _following(result, (log, *reading.words), how["drive"], arm, dialect, directory)
        show(tune_answer(result, directory, dialect).then(*following), whole=verbose)
    return 1 if strict and not result.verdict.good else 0


def _following(
    result: TuneResult,
    log: Sequence[str | None],
    drive: str | None,
    arm: Sequence[str],
    dialect: str | None,
    directory: Path,
) -> Sequence[str]:
    """Return the command that follows: of a sheet or a short log how long to record, of a drive its files for KF-GINS.

    `log` is what was tuned, with the options that read it; `arm` states the lever arm of the drive.
    """
    from tuner.report.examination_answer import MENDED

    config = str(directory / "noise.yaml")
    stated = [word for word in log if word is not None]
    if log[0] is not None and not result.records:
        return ["plan", *stated]
    if not result.exports:
        return ["diagnose", *(stated or [str(drive)])]
    if result.drive is not None and drive is not None:
        file = directory / "kf-gins" / "kf-gins.yaml"
        if result.examination is not None and result.examination.mends:
            drive = str(directory / MENDED)
        return ["export", config, "--to", "kf-gins", "--drive", drive, *arm, "-o", str(file)]
    if result.withheld and stated:
        return ["plan", *stated]
    return ["export", config] if dialect is None else ["check", config]
