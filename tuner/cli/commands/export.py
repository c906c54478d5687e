"""`tuner export`: one configuration in the dialect of one filter."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tuner.cli.commands.options import Output, common
from tuner.cli.progress import Messages


@click.command("export", short_help="Write a configuration in the dialect of another filter.")
@click.argument("config", required=False, metavar="CONFIG")
@click.option("--to", "dialect", metavar="DIALECT", help="See --list.")
@click.option(
    "-o",
    "--output-file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Default: standard output.",
)
@click.option("--drive", metavar="DRIVE", help="With --to kf-gins -o FILE: the drive, written beside FILE.")
@click.option("--list", "list_dialects", is_flag=True, help="Show the dialects and their units.")
@common
def command(
    config: str | None,
    dialect: str | None,
    output_file: Path | None,
    drive: str | None,
    list_dialects: bool,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
) -> None:
    """Export CONFIG, a noise.yaml of tune or the name of a built-in grade."""
    from tuner.cli.commands.configs import load_config
    from tuner.exporters import DIALECTS, export
    from tuner.formats.files import write_text
    from tuner.report.tables import dialect_tables, show

    if list_dialects:
        if output.tables:
            show(dialect_tables(DIALECTS))
        output.write(
            {
                "schema": "tuner.dialects/1",
                "dialects": {k: {"title": d.title, "units": d.units} for k, d in DIALECTS.items()},
            }
        )
        return
    if config is None or dialect is None:
        msg = "export: expected CONFIG and --to DIALECT; --list shows the dialects"
        raise click.UsageError(msg)
    if dialect not in DIALECTS:
        msg = f"--to: {DIALECTS.unknown(dialect)}"
        raise click.UsageError(msg)
    if drive is not None:
        if dialect != "kf-gins" or output_file is None:
            msg = "--drive: expected --to kf-gins and -o FILE with it"
            raise click.UsageError(msg)
        from tuner.cli.commands.check import load_filter
        from tuner.cli.commands.inputs import load_drive
        from tuner.exporters.kf_gins_drive import write_drive
        from tuner.synthesis.from_drive import receiver_of

        measured = load_drive(drive)
        believed = load_filter(config, None, supposed=receiver_of(measured))
        for note in write_drive(measured, believed, output_file):
            messages.say(note)
        messages.say(f"wrote {output_file} and its files")
        output.write({"schema": "tuner.export/1", "dialect": dialect, "text": output_file.read_text("utf-8")})
        return
    text = export(load_config(config), dialect)
    if output_file is None:
        if output.tables:
            sys.stdout.write(text)
    else:
        write_text(output_file, text)
        messages.say(f"wrote {output_file}")
    output.write({"schema": "tuner.export/1", "dialect": dialect, "text": text})
