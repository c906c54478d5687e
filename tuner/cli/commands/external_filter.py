"""`tuner tune --filter`: the settings of another program's filter, which is run without changes, are tuned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tuner.cli.commands.inputs import load_source
from tuner.cli.commands.options import POSITIVE, Command, Output, Reading
from tuner.cli.progress import Messages
from tuner.stages import stage

TIME_LIMIT = 600.0
"""Default limit of a run, s: forty of them are then a night at most."""


def external_options(command: Command) -> Command:
    """Add ``--filter``, ``--to`` and ``--filter-timeout``."""
    for option in (
        click.option(
            "--filter-timeout",
            type=POSITIVE,
            metavar="SECONDS",
            help=f"Longest time that one run of COMMAND may take; default {TIME_LIMIT:g}.",
        ),
        click.option(
            "--to",
            "dialect",
            metavar="DIALECT",
            help="Also write and show the settings as another filter reads them; `tuner export --list` names all.",
        ),
        click.option(
            "--filter",
            "filter_command",
            metavar="COMMAND",
            help='With --drive and --to: tune this program instead of our filter, such as "KF-GINS {config}". '
            "{config}, {drive}, {imu}, {gnss}, {output} stand for paths.",
        ),
    ):
        command = option(command)
    return command


def tune_filter(
    filter_command: str,
    log: str | None,
    *,
    dialect: str | None,
    drive: str | None,
    lever_arm: tuple[float, float, float] | None,
    gnss: str | None,
    time_limit: float,
    how: dict[str, Any],
    output_dir: Path | None,
    reading: Reading,
    output: Output,
    messages: Messages,
) -> None:
    """Tune the settings of a program and write them with its scores."""
    from tuner import tune
    from tuner.external.program import program_of
    from tuner.external.tune_external import tune_external
    from tuner.formats import noise_yaml
    from tuner.formats.documents import json_text
    from tuner.formats.file_set import MANIFEST, digests, write_set
    from tuner.navigation.compensation import with_stated_arm
    from tuner.readers.drive import read_drive, with_mounting
    from tuner.readers.drive_checks import possible_drive
    from tuner.readers.source_kind import is_log
    from tuner.report.external_tables import external_json, external_tables
    from tuner.report.terminal import show
    from tuner.synthesis.from_drive import config_for_drive, config_of_drive, stationary_noise

    if drive is None or dialect is None:
        raise click.UsageError("--filter: expected --drive DRIVE and --to DIALECT with it")
    if log is None or not is_log(log):
        load_source(log, reading, messages)  # refuses what states how a log is read
    program = program_of(filter_command, time_limit=time_limit)
    # The program filters the drive as it is.
    measured = possible_drive(with_mounting(read_drive(drive), lever_arm=lever_arm))
    if log is None:
        config = config_of_drive(measured, stationary_noise(measured))
    elif is_log(log):
        stage("tuning on the log", 0.3)
        found = tune(load_source(log, reading, messages), gnss=gnss, progress=messages.say, **how)
        config = config_for_drive(measured, found.config)
    else:
        config = config_for_drive(measured, log, gnss=gnss)
    config, _ = with_stated_arm(config, lever_arm)
    stage("running the filter with other settings", 1.0)
    advance = messages.count("runs at most") or (lambda _done, _total: None)
    result = tune_external(program, measured, config, dialect, path=drive, progress=advance)
    for note in result.notes:
        messages.say(note)
    directory = output_dir or Path("tuner-out") / f"{measured.name}-{dialect}"
    content = external_json(result, source={"filter": filter_command, "drive": drive, "log": log})
    files = {
        f"{dialect}.txt": result.text.encode(),
        "noise.yaml": noise_yaml.dumps(result.config).encode(),
    }
    files["result.json"] = json_text({**content, MANIFEST: digests(files)}).encode()
    write_set(directory, files, last="result.json")
    output.write(content)
    if output.tables:
        show([*external_tables(result), f"  written: {directory}"])
