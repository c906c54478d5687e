"""`tuner diagnose`: what the simulation of the fitted noise gets wrong, why, and what naming it gains."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from tuner.cli.commands.inputs import examined_drive, is_drive, load_drive, load_receiver, load_records
from tuner.cli.commands.options import Output, Reading, common, reading
from tuner.cli.progress import Messages
from tuner.types.records import DataError


@click.command("diagnose", short_help="What the simulation gets wrong, why, and the gain of saying so.")
@click.argument("log", metavar="LOG|DRIVE")
@click.option("--holdout", metavar="LOG2", help="A second log of the same unit, to measure the gain on.")
@click.option(
    "--config", metavar="CONFIG", help="Of a drive: YAML or built-in grade that the filter believes."
)
@click.option("--gnss", metavar="GRADE|LOG", help="Of a drive: receiver, where fixes report no sds.")
@click.option(
    "--wheels", is_flag=True, help="Of a drive: wheels do not slip sideways; the stated mounting is tested."
)
@click.option(
    "--replicas", type=click.IntRange(min=0), default=0, show_default=True, help="Replicas for bands."
)
@click.option("--strict", is_flag=True, help="Exit status 1 where a misfit stays unexplained.")
@reading
@common
def command(
    log: str,
    holdout: str | None,
    config: str | None,
    gnss: str | None,
    wheels: bool,
    replicas: int,
    strict: bool,
    reading: Reading,
    seed: int,
    output: Output,
    messages: Messages,
) -> int:
    """Fit the base noise to a static log, test what is left in every way, name the causes of alarms.

    Of a drive (NPZ with fixes, folder with imu.csv and gnss.csv, YAML of KF-GINS) the filter is criticised: the one of
    CONFIG, or without it one made from the parts in which the vehicle stands.
    """
    if is_drive(log):
        if holdout is not None:
            msg = f"--holdout {holdout}: expected with a static log; of a drive the last 40 % are held out"
            raise DataError(msg)
        return _drive(log, config, gnss, wheels, strict, output, messages)
    if config is not None or gnss is not None or wheels:
        given = "--config" if config is not None else "--gnss" if gnss is not None else "--wheels"
        msg = f"{given}: expected with a drive, but {Path(log).name} has no fixes"
        raise DataError(msg)
    from tuner.diagnosis import diagnose
    from tuner.formats.diagnosis import diagnosis_json
    from tuner.report.diagnosis_tables import diagnosis_tables
    from tuner.report.tables import show

    records = load_records(log, reading, messages)
    second = None if holdout is None else load_records(holdout, reading, messages)
    messages.say("diagnosing")
    found = diagnose(records, holdout=second, replicas=replicas, seed=seed)
    if output.tables:
        show(diagnosis_tables(found))
    output.write(diagnosis_json(found))
    return 1 if strict and found.unexplained else 0


def _drive(
    drive: str,
    config: str | None,
    gnss: str | None,
    wheels: bool,
    strict: bool,
    output: Output,
    messages: Messages,
) -> int:
    """Criticise the filter of a drive."""
    from tuner.cli.commands.check import load_filter
    from tuner.formats.diagnosis import diagnosis_json
    from tuner.report.drive_tables import drive_tables
    from tuner.report.tables import show
    from tuner.synthesis.from_drive import config_of_drive, receiver_of, standing

    measured = load_drive(drive)
    receiver = None if gnss is None else load_receiver(gnss, messages)
    if config is None:
        believed = config_of_drive(measured, standing(measured), gnss=receiver)
        messages.say(believed.notes[0])
    else:
        believed = load_filter(config, receiver, supposed=receiver_of(measured))
    found = examined_drive(measured, believed, messages, wheels=wheels).diagnosis
    if config is None:
        found = replace(found, notes=(believed.notes[0], *found.notes))
    if output.tables:
        show(drive_tables(found))
    output.write(diagnosis_json(found))
    return 1 if strict and (found.unexplained or not found.credited) else 0
