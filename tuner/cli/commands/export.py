"""`tuner export`: one configuration in the dialect of one filter."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tuner.cli.commands.options import POSITIVE, RATE, Output, common
from tuner.cli.commands.options import lever_arm as with_lever_arm
from tuner.cli.progress import Messages


@click.command("export", short_help="Write a configuration in the dialect of another filter.")
@click.argument("config", required=False, metavar="CONFIG")
@click.option("--to", "dialect", metavar="DIALECT", help="Name of the dialect; --list shows all.")
@click.option(
    "-o",
    "--output-file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="File to write; default standard output.",
)
@click.option(
    "--drive",
    metavar="DRIVE",
    help="With --to kf-gins -o FILE: also write this drive, beside FILE, as KF-GINS reads it.",
)
@with_lever_arm
@click.option(
    "--rate", type=RATE, metavar="HZ", help="Rate of the IMU that DIALECT reads; default that of the log."
)
@click.option(
    "--step",
    type=POSITIVE,
    metavar="SECONDS",
    help="Prediction step of that filter; default what it is stated to use.",
)
@click.option("--list", "list_dialects", is_flag=True, help="List the dialects and their units.")
@common
def command(
    config: str | None,
    dialect: str | None,
    output_file: Path | None,
    drive: str | None,
    lever_arm: tuple[float, float, float] | None,
    rate: float | None,
    step: float | None,
    list_dialects: bool,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
) -> None:
    """Write CONFIG, a noise.yaml or the name of a built-in grade, in the dialect and units of another filter."""
    from tuner import export
    from tuner.exporters import DIALECTS
    from tuner.formats.files import write_text
    from tuner.report.dialect_tables import dialect_tables
    from tuner.report.document import document
    from tuner.report.terminal import show
    from tuner.synthesis.load_config import load_config

    if list_dialects or (config is not None and dialect is None):
        titles = {k: {"title": d.title, "units": d.units} for k, d in DIALECTS.items()}
        output.write({"schema": "tuner.dialects/1", "dialects": titles})
        if output.tables:
            answer = document(dialect_tables(DIALECTS))
            show(answer if config is None else answer.then("export", config, "--to", "vins"))
        return
    if config is None or dialect is None:
        raise click.UsageError("export: expected CONFIG and --to DIALECT; --list shows the dialects")
    if dialect not in DIALECTS:
        raise click.UsageError(f"--to: {DIALECTS.unknown(dialect)}")
    if lever_arm is not None and drive is None:
        raise click.UsageError("--lever-arm: expected --drive DRIVE with it")
    if drive is not None:
        if dialect != "kf-gins" or output_file is None:
            raise click.UsageError("--drive: expected --to kf-gins and -o FILE with it")
        if (rate, step) != (None, None):
            raise click.UsageError("--rate, --step: expected without --drive, which states its own rate")
        _write_with_drive(config, drive, lever_arm, output_file, messages)
        text = output_file.read_text("utf-8")
    else:
        interval = None if rate is None else 1.0 / rate
        text = export(load_config(config), dialect, interval=interval, step=step)
        if output_file is not None:
            write_text(output_file, text)
            empty = all(line.startswith("#") for line in text.splitlines())
            kept = ": no parameter, as each keeps its stock value for the reason it gives" if empty else ""
            messages.say(f"wrote {output_file}{kept}")
        elif output.tables:
            sys.stdout.write(text)
    output.write({"schema": "tuner.export/1", "dialect": dialect, "text": text})


def _write_with_drive(
    config: str, drive: str, lever_arm: tuple[float, float, float] | None, path: Path, messages: Messages
) -> None:
    """Write settings of KF-GINS and, beside them, the drive as KF-GINS reads it."""
    from tuner.exporters.judged_drive import export_drive
    from tuner.exporters.kf_gins_drive import write_drive

    files, _ = export_drive(drive, config, lever_arm=lever_arm, progress=messages.say)
    write_drive(files, path)
    for note in files.notes:
        messages.say(note)
    messages.say(f"wrote {path} and its files")
