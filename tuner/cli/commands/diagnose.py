"""`tuner diagnose`: what a simulation of the fitted noise, or of a filter on a drive, gets wrong, and why."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tuner.cli.commands.inputs import assumed, load_data, load_records
from tuner.cli.commands.options import (
    Output,
    Reading,
    common,
    jobs,
    paged,
    reading,
    replicas,
    strict,
    verbose,
)
from tuner.cli.progress import Messages
from tuner.stages import stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tuner.diagnosis.drive import ExaminedDrive
    from tuner.report.document import Document
    from tuner.types import Diagnosis, DriveDiagnosis
    from tuner.types.records import Drive, Record


@click.command("diagnose", short_help="What the simulation gets wrong, why, and the gain of modelling it.")
@click.argument("log", metavar="LOG|DRIVE")
@click.option("--holdout", metavar="LOG2", help="A second log of the same unit, to measure the gain on.")
@click.option(
    "--against",
    metavar="REST",
    help="A log of the same unit in another state, as at rest: what differs, by cause.",
)
@click.option("--config", metavar="CONFIG", help="Of a drive: the filter, as noise.yaml or built-in grade.")
@click.option(
    "--gnss", metavar="GRADE|LOG", help="Of a drive: receiver, where the fixes report no standard deviations."
)
@click.option(
    "--wheels",
    is_flag=True,
    help="Of a drive: assume wheels that do not slip sideways, and test the mounting.",
)
@strict("a misfit stays unexplained")
@replicas
@verbose
@reading
@jobs
@common
@paged
def command(
    log: str,
    holdout: str | None,
    against: str | None,
    config: str | None,
    gnss: str | None,
    wheels: bool,
    replicas: int,
    strict: bool,
    verbose: bool,
    reading: Reading,
    seed: int,
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> int:
    """Find what a simulation of the fitted model gets wrong, and name the causes.

    Of a static LOG: the base noise terms are fitted, the residuals tested, and the model extended by what explains
    them. Of a DRIVE (NPZ with fixes, folder with imu.csv and gnss.csv, YAML of KF-GINS): the innovations of the filter
    of CONFIG are tested; without --config, of a filter made from the stationary parts of the drive.
    """
    from tuner import diagnose
    from tuner.formats.diagnosis import diagnosis_json
    from tuner.readers.source_kind import with_name
    from tuner.report.claims import lawful
    from tuner.report.terminal import show
    from tuner.types import Diagnosis, DriveDiagnosis
    from tuner.types.records import Drive

    stage("reading", 0.05)
    data = load_data(log, reading, messages)
    if against is not None:
        _compare(log, data, against, reading, seed, output, messages)
        return 0
    found: Diagnosis | DriveDiagnosis
    stage("diagnosing", 0.95)
    if isinstance(data, Drive):
        from tuner.diagnosis.drive.explained_drive import examine_drive_of  # a third of a second to load

        examined = examine_drive_of(
            data, config, holdout=holdout, gnss=gnss, wheels=wheels, progress=messages.say
        )
        found, parts = examined.diagnosis, _drive_parts(examined)
    else:
        of_drives = {"--config": config is not None, "--gnss": gnss is not None, "--wheels": wheels}
        if stated := [option for option, given in of_drives.items() if given]:
            raise click.UsageError(f"{stated[0]}: expected with a drive, but a static log has no fixes")
        static = diagnose(
            data,
            holdout=None if holdout is None else load_records(holdout, reading, messages),
            replicas=replicas,
            seed=seed,
            progress=messages.say,
        )
        assert isinstance(static, Diagnosis)
        found, parts = static, _parts(static, data)
    lawful(found)
    stage("writing", 1.0)
    output.write(diagnosis_json(found))
    page(f"Diagnosis of {with_name(Path(log)).name}", parts)
    if output.tables:
        records = () if isinstance(data, Drive) else data
        show(_answer(found, records, log, config, gnss, reading), whole=verbose)
    harmful = isinstance(found, DriveDiagnosis) and not found.credited
    return 1 if strict and (found.unexplained or harmful) else 0


def _answer(
    found: Diagnosis | DriveDiagnosis,
    records: Sequence[Record],
    log: str,
    config: str | None,
    gnss: str | None,
    reading: Reading,
) -> Document:
    """Return the answer with the command that follows from it."""
    from tuner.types import Diagnosis

    if not isinstance(found, Diagnosis):
        from tuner.report.drive_diagnosis_tables import drive_diagnosis_answer

        answer = drive_diagnosis_answer(found)
        return replace(answer, end=(*answer.end, f"Next: {_after_drive(found, log, config, gnss)}"))
    from tuner.report.diagnosis_answer import diagnosis_answer

    return diagnosis_answer(found, records).then("tune", log, *reading.words)


def _after_drive(found: DriveDiagnosis, drive: str, config: str | None, gnss: str | None) -> str:
    """Return what follows from the diagnosis of a drive.

    Settings that nothing contradicts are scored. Those with causes are made anew from themselves and the drive, where
    the filter can hold the causes; wrong fixes are refused by its gate. A fault of the unit that it cannot hold is
    mended first, and what has no cause is looked at.
    """
    from tuner.judgement import judge_drive
    from tuner.types.judgement import Use

    receiver = ["--gnss", gnss] if gnss is not None else []
    judged = ["--config", config] if config is not None else []
    again = shlex.join(["tuner", "diagnose", drive, *judged, *receiver])
    mended = [
        one.consequence
        for one in found.findings
        if one.extension.get("joins") == "preprocessing"
        and one.cause not in found.after.compensation.causes
        and "gnss" not in one.channels
    ]
    if mended:
        return f"{mended[0]}; then {again}"
    if found.unexplained:
        return f"{again} --page diagnosis.html"
    if config is not None and judge_drive(found).use is Use.NOTHING_CONTRADICTS:
        return shlex.join(["tuner", "navigate", drive, *judged, *receiver])
    return shlex.join(
        ["tuner", "tune", *([config] if config is not None else []), "--drive", drive, *receiver]
    )


def _drive_parts(examined: ExaminedDrive) -> Mapping[str, object]:
    """Return the parts of a page: what was found on a drive, and what draws the pictures that prove it."""

    def pictures() -> object:
        from tuner.report.result_views import pictures_of_drive

        return pictures_of_drive(examined)

    return {"What a simulation of the filter gets wrong": examined.diagnosis, "What shows it": pictures}


def _parts(found: Diagnosis, data: Sequence[Record]) -> Mapping[str, object]:
    """Return the parts of a page: the findings of a static log, and what draws the picture that proves each."""

    def pictures() -> object:
        from tuner.report.result_views import pictures_of_findings

        return pictures_of_findings(data, found)

    proofs = {"What shows each finding": pictures} if found.findings else {}
    return {"What a simulation gets wrong": found, **proofs}


def _compare(
    log: str,
    data: Drive | Sequence[Record],
    against: str,
    reading: Reading,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Show what differs between a log and one of the same unit in another state."""
    from tuner.diagnosis.static.compare_logs import compare_states
    from tuner.report.state_lines import state_lines, states_json
    from tuner.report.terminal import show
    from tuner.types.records import DataError, Drive

    if isinstance(data, Drive):
        raise DataError(f"--against {against}: expected with a static log, got the drive {log}")
    stage("comparing the two logs", 1.0)
    comparison = compare_states(data, load_records(against, reading, messages), seed=seed)
    output.write(states_json(comparison))
    if output.tables:
        show(assumed(data))
        show(state_lines(comparison))
