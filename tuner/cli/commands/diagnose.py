"""`tuner diagnose`: what the simulation of the fitted noise gets wrong, why, and what naming it gains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from tuner.cli.commands.inputs import load_data, load_records
from tuner.cli.commands.options import Output, Reading, common, reading, replicas, strict
from tuner.cli.progress import Messages

if TYPE_CHECKING:
    from tuner.types import Diagnosis


@click.command("diagnose", short_help="What the simulation gets wrong, why, and the gain of saying so.")
@click.argument("log", metavar="LOG|DRIVE")
@click.option("--holdout", metavar="LOG2", help="A second log of the same unit, to measure the gain on.")
@click.option("--config", metavar="CONFIG", help="Of a drive: the filter, as YAML or built-in grade.")
@click.option("--gnss", metavar="GRADE|LOG", help="Of a drive: receiver, where fixes report no sds.")
@click.option(
    "--wheels", is_flag=True, help="Of a drive: wheels do not slip sideways; the stated mounting is tested."
)
@strict("a misfit stays unexplained")
@replicas
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
    """Fit the base noise to a static log, test the residuals in many ways, name the causes of what they show.

    Of a drive (NPZ with fixes, folder with imu.csv and gnss.csv, YAML of KF-GINS) the innovations of the filter are
    tested: of the filter of CONFIG, or without it of one made from the parts in which the vehicle stands.
    """
    from tuner import diagnose
    from tuner.formats.diagnosis import diagnosis_json
    from tuner.report.drive_diagnosis_tables import drive_tables
    from tuner.report.static_diagnosis_tables import diagnosis_tables
    from tuner.report.terminal import show
    from tuner.types import DriveDiagnosis

    found: Diagnosis | DriveDiagnosis = diagnose(
        load_data(log, reading, messages),
        holdout=None if holdout is None else load_records(holdout, reading, messages),
        replicas=replicas,
        seed=seed,
        config=config,
        gnss=gnss,
        wheels=wheels,
        progress=messages.say,
    )
    if output.tables:
        show(drive_tables(found) if isinstance(found, DriveDiagnosis) else diagnosis_tables(found))
    output.write(diagnosis_json(found))
    harmful = isinstance(found, DriveDiagnosis) and not found.credited
    return 1 if strict and (found.unexplained or harmful) else 0
