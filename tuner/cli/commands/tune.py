"""`tuner tune`: the main job, from a log to a filter configuration, with everything that stands behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tuner.cli.commands.inputs import (
    examined_drive,
    is_log,
    load_drive,
    load_identification,
    load_receiver,
    load_records,
    source_name,
)
from tuner.cli.commands.options import Finite, Output, Reading, common, reading, term_list
from tuner.cli.progress import Messages
from tuner.types import BoundUsed, Enlargement
from tuner.types.records import DataError

if TYPE_CHECKING:
    from rich.table import Table

    from tuner.types import Diagnosis, FilterConfig, Identification
    from tuner.types.consistency import Check
    from tuner.types.records import Record

CHECK_RUNS = 20
"""Simulated hours on the city trajectory behind the verdict of tune; `tuner check` flies more and others."""
DEMO_RECEIVER = "spp"
"""Receiver that goes with the built-in simulated IMU."""
NO_SAMPLES = "the source holds no samples that could be compared with a simulation"
NO_LOG = "without a static log; of the unit only the standing parts of the drive are known"

EXPORTED = ("kalibr", "kf-gins")
"""Dialects that tune writes beside the native YAML; `tuner export` writes the others."""


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
    help="Longest time the filter must bridge.",
)
@click.option(
    "--drive", metavar="DRIVE", help="A measured drive of the unit: findings enter the configuration."
)
@click.option("--complete", metavar="GRADE", help="Built-in grade for a sensor the log lacks.")
@click.option("--gnss", metavar="GRADE|LOG", help="Built-in GNSS grade, or a log of fixes at rest.")
@click.option("--terms", callback=term_list, metavar="LIST", help="Fit exactly this sum of noise terms.")
@click.option(
    "--latitude",
    type=Finite(-90, 90),
    metavar="DEG",
    help="Take the Earth's rate out of the gyro means.",
)
@click.option(
    "--replicas",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="Simulated records a finding, for bands.",
)
@reading
@common
def command(
    log: str | None,
    output_dir: Path | None,
    horizon: float,
    drive: str | None,
    complete: str | None,
    gnss: str | None,
    terms: tuple[str, ...] | None,
    latitude: float | None,
    replicas: int,
    reading: Reading,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Turn a static log into a filter configuration: noise.yaml, exports, figures, result.json.

    LOG may also be a datasheet. With a drive, what the drive says against the filter enters the configuration, too;
    without LOG, the parts in which it stands are the log. With neither: a built-in simulated IMU with an effect, drawn
    from --seed, hidden in it.
    """
    from tuner.catalogue.grades import load_grade
    from tuner.diagnosis.drive.config_after_drive import config_after_drive
    from tuner.exporters import export
    from tuner.formats import native
    from tuner.formats.configuration import config_json
    from tuner.formats.diagnosis import diagnosis_json
    from tuner.formats.files import json_text, write_text
    from tuner.formats.identification import identification_json
    from tuner.identification import identify
    from tuner.report.allan_figure import draw_allan
    from tuner.report.consistency_tables import consistency_tables
    from tuner.report.diagnosis_figure import draw_findings
    from tuner.report.diagnosis_tables import diagnosis_tables, hidden_words
    from tuner.report.drive_figure import draw_drive
    from tuner.report.drive_tables import drive_tables
    from tuner.report.json.consistency import consistency_json
    from tuner.report.page import write_page
    from tuner.report.tables import identification_tables, show
    from tuner.segments.conditions import at_rest
    from tuner.segments.multi_position import calibrate
    from tuner.simulation.static import demo
    from tuner.synthesis import inflate, synthesize
    from tuner.synthesis.calibration import calibration_json, calibration_words, with_calibration
    from tuner.synthesis.findings import agreed, findings_for_config, judge_hidden, settled_inflations
    from tuner.synthesis.from_drive import identification_of_drive, receiver_of, standing

    completion = load_grade(complete) if complete else None
    key: Mapping[str, Any] | None = None
    records: tuple[Record, ...] = ()
    measured = None if drive is None else load_drive(drive)
    receiver = receiver_of(measured) if gnss is None and measured is not None else None
    if receiver is None and (gnss or log is None):
        receiver = load_receiver(gnss or DEMO_RECEIVER, messages)
    if measured is not None:
        name = measured.name if log is None else f"{source_name(log)}-{measured.name}"
        if log is not None and is_log(log):
            records = load_records(log, reading, messages)
    elif log is None:
        name = f"simulated-{seed}"
        messages.say("simulating an IMU with a hidden effect")
        records, key = demo(seed)
    else:
        name = source_name(log)
        if is_log(log):
            records = load_records(log, reading, messages)
    absent: dict[str, str] = {}
    diagnosis: Diagnosis | None = None
    if records:
        still = at_rest(records, messages.say)
        messages.say("identifying")
        found = identify(still, terms=terms, latitude=latitude)
        messages.say("diagnosing")
        diagnosis = _diagnosed(records, replicas, seed, absent)
        if diagnosis is not None and terms is None:
            found = agreed(still, found, diagnosis)
    elif log is None:
        assert measured is not None
        found = identification_of_drive(measured, standing(measured))
        absent["static diagnosis"] = NO_LOG
    else:
        found = load_identification(log, reading, messages, terms=terms, latitude=latitude)
        absent["diagnosis"] = NO_SAMPLES
    messages.say("synthesising the filter configuration")
    carried = () if diagnosis is None else findings_for_config(diagnosis)
    config = synthesize(
        found, name=name, horizon=horizon, complete=completion, gnss=receiver, seed=seed, findings=carried
    )
    if diagnosis is not None:
        config = inflate(config, settled_inflations(diagnosis, config))
    calibration = calibrate(records) if records else None
    if calibration is not None:
        config = with_calibration(config, calibration)
    examined = None
    if measured is not None:
        examined = examined_drive(measured, config, messages)
        config = config_after_drive(examined)
    texts = {
        "noise.yaml": native.dumps(config),
        **{f"{dialect}.yaml": export(config, dialect) for dialect in EXPORTED},
    }
    result: dict[str, Any] = {"schema": "tuner.result/1", "identification": identification_json(found)}
    judged: list[dict[str, Any]] = []
    if diagnosis is not None:
        result["diagnosis"] = diagnosis_json(diagnosis)
        if key is not None:
            judged = judge_hidden(key, diagnosis)
            result["hidden"] = judged
    if examined is not None:
        result["drive"] = diagnosis_json(examined.diagnosis)
    if calibration is not None:
        result["calibration"] = calibration_json(calibration)
    checked = _checked(config, seed, messages, absent)
    if checked is not None:
        result["consistency"] = consistency_json(
            checked.consistency,
            source={"config": config.name, "trajectory": "city", "runs": CHECK_RUNS, "seed": seed},
            notes=checked.notes,
        )
    result |= {"config": config_json(config), "absent": absent}
    directory = output_dir or Path("tuner-out") / name
    if any(channel.allan.tau.size for channel in found.channels.values()):
        draw_allan(found, [directory / "allan.png", directory / "allan.svg"], title=name)
    told = [] if diagnosis is None else [*diagnosis_tables(diagnosis), *hidden_words(judged)]
    pictures = [] if diagnosis is None else draw_findings(records, diagnosis, directory, replicas, seed)
    for file, text in texts.items():
        write_text(directory / file, text)
    sections: list[tuple[str, Sequence[Table | str]]]
    sections = [("What a simulation of it gets wrong", told)] if told else []
    about_poses = [] if calibration is None else calibration_words(calibration)
    if about_poses:
        sections.append(("Calibration from poses", about_poses))
    of_drive = [] if examined is None else drive_tables(examined.diagnosis)
    if examined is not None:
        sections.append(("What the drive says", of_drive))
        pictures += draw_drive(examined, directory)
    verdict = [] if checked is None else consistency_tables(checked.consistency, checked.notes)
    if verdict:
        sections.append(("Is the filter honest?", verdict))
    page = write_page(found, config, title=name, sections=sections, figures=pictures, absent=absent)
    write_text(directory / "report.html", page)
    if key is not None:
        write_text(directory / "key.json", json_text(key))
    write_text(directory / "result.json", json_text(result))
    if output.tables:
        show(
            [
                *identification_tables(found),
                *told,
                *about_poses,
                *of_drive,
                *verdict,
                *_summary(directory, config, found, absent),
            ]
        )
    output.write(result)


def _diagnosed(
    records: Sequence[Record], replicas: int, seed: int, absent: dict[str, str]
) -> Diagnosis | None:
    """Return the diagnosis, or None with the reason put into `absent`."""
    from tuner.diagnosis import diagnose

    try:
        return diagnose(records, replicas=replicas, seed=seed)
    except DataError as error:
        absent["diagnosis"] = str(error)
        return None


def _checked(config: FilterConfig, seed: int, messages: Messages, absent: dict[str, str]) -> Check | None:
    """Return the check on simulated hours of city driving, or None with the reason put into `absent`."""
    from models.trajectory.catalogue import TRAJECTORIES
    from tuner.consistency.check import DURATION, check

    messages.say(f"checking the filter on {CHECK_RUNS} simulated hours")
    try:
        return check(config, TRAJECTORIES["city"](DURATION), runs=CHECK_RUNS, seed=seed)
    except DataError as error:
        absent["consistency"] = str(error)
        return None


def _summary(
    directory: Path, config: FilterConfig, found: Identification, absent: Mapping[str, str]
) -> list[str]:
    lines = [f"  configuration: {directory / 'noise.yaml'} ({len(config.channels)} channels)"]
    bounded = [str(i.quantity) for i in config.inflations if isinstance(i, BoundUsed)]
    if bounded:
        lines.append(f"  only bounded, half of the 95 % limit is used: {', '.join(bounded)}")
    lines += [
        f"  {i.quantity} × {i.factor:.4g}: {i.reason}"
        for i in config.inflations
        if isinstance(i, Enlargement)
    ]
    lines += [f"  {note}" for note in config.notes if note not in found.notes]
    return lines + [f"  no {part}: {reason}" for part, reason in absent.items()]
