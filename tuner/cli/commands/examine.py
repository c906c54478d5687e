"""`tuner examine`: what is wrong with the streams of a drive, before any filter runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import click

from tuner.cli.commands.options import Output, common, folder, paged, strict, verbose
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("examine", short_help="What is wrong with the streams of a drive, before any filter.")
@click.argument("drive", metavar="DRIVE")
@folder("Write mended.npz, the drive without its faults.")
@strict("something is to be mended")
@verbose
@common
@paged
def command(
    drive: str,
    directory: Path | None,
    strict: bool,
    verbose: bool,
    seed: int,  # noqa: ARG001
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> int:
    """Hold the streams of a drive against one another: inertial unit, fixes, velocities.

    DRIVE is a folder with imu.csv and gnss.csv, an NPZ, a log of messages or a YAML of KF-GINS. In windows of ten
    seconds the inertial unit predicts positions and velocities. What they contradict is named: wrong, repeated or
    delayed readings, units, signs, axes, a step of the datum, standard deviations that are none.
    """
    from tuner import examine
    from tuner.formats.logs import write_drive
    from tuner.readers.drive import read_drive
    from tuner.readers.source_kind import with_name
    from tuner.report.examination_answer import MENDED, examination_answer
    from tuner.report.json.examination import examination_json
    from tuner.report.terminal import show

    stage("reading the drive", 0.1)
    measured = read_drive(drive)
    messages.say("examining")
    stage("holding the streams against one another", 0.95)
    found = examine(measured)
    stage("writing", 1.0)
    following = ["tune", "--drive", drive]
    if directory is not None:
        directory.mkdir(parents=True, exist_ok=True)
        write_drive(found.mended, directory / MENDED)
        following[-1] = str(directory / MENDED)
    elif any(one.done for one in found.repairs):
        following = ["examine", drive, "-o", "mended"]
    page(f"Examination of {with_name(Path(drive)).name}", {"What is to be mended": found})
    output.write(examination_json(found))
    if output.tables:
        answer = examination_answer(found).then(*following)
        show([*answer.whole, *answer.end] if verbose else answer)
    return 1 if strict and found.repairs else 0
