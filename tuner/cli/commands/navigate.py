"""`tuner navigate`: a measured drive filtered as a configuration says, and scored."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import click

from tuner.cli.commands.options import (
    POSITIVE,
    Output,
    common,
    folder,
    paged,
    state,
    strict,
    three_numbers,
    verbose,
)
from tuner.cli.commands.options import lever_arm as with_lever_arm
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("navigate", short_help="Filter a measured drive: innovations, errors, outages.")
@click.argument("drive", metavar="DRIVE")
@click.option(
    "--config",
    required=True,
    metavar="CONFIG",
    help="The filter: a noise.yaml or the name of a built-in grade.",
)
@click.option("--gnss", metavar="GRADE", help="Built-in receiver, instead of the configuration's.")
@click.option("--imu-frame", metavar="FRAME", help="Axes of the sensor in the vehicle: FRD, FLU, RFU, …")
@click.option(
    "--mounting-rpy",
    callback=three_numbers,
    metavar="R,P,Y",
    help="Mounting angles, deg: v_sensor = Rz Ry Rx v_vehicle.",
)
@with_lever_arm
@click.option(
    "--state",
    "states",
    multiple=True,
    callback=state,
    metavar="NAME=SD",
    help="A further state of the filter with its prior sd; may be repeated.",
)
@click.option(
    "--non-holonomic",
    is_flag=False,
    flag_value=0.2,
    type=POSITIVE,
    metavar="[SD]",
    help="Non-holonomic constraint, once a second: sideways and vertical velocity within SD m/s (0.2).",
)
@click.option(
    "--zero-velocity",
    is_flag=False,
    flag_value=0.05,
    type=POSITIVE,
    metavar="[SD]",
    help="Zero-velocity updates where the unit is as quiet as at the start: within SD m/s (0.05), no turn.",
)
@folder("Write solution.csv, track.kml, track.gpx and figures of track, innovations and errors there.")
@strict("the filter is not shown to be honest")
@verbose
@common
@paged
def command(
    drive: str,
    config: str,
    gnss: str | None,
    imu_frame: str | None,
    mounting_rpy: tuple[float, float, float] | None,
    lever_arm: tuple[float, float, float] | None,
    states: dict[str, float],
    non_holonomic: float | None,
    zero_velocity: float | None,
    directory: Path | None,
    strict: bool,
    verbose: bool,
    seed: int,
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> int:
    """Filter a measured drive and score the filter: innovations, outages, errors. --verbose shows every score.

    DRIVE is a folder with imu.csv and gnss.csv, an NPZ, or a YAML of KF-GINS. Fixes are withheld for 10, 30 and 60 s at
    a time to score the prediction; errors are against the reference where the drive has one.
    """
    from tuner.consistency.score_drive import navigate_drive
    from tuner.examination.examined_drive import examined_drive
    from tuner.navigation.compensation import with_stated_arm
    from tuner.navigation.drive.vehicle_constraints import Vehicle
    from tuner.readers.drive import read_drive, with_mounting
    from tuner.readers.source_kind import with_name
    from tuner.report.answer_layout import span_text
    from tuner.report.claims import lawful
    from tuner.report.consistency_answer import consistency_answer
    from tuner.report.json.navigation import navigation_json
    from tuner.report.solution_set import attitude_text, write_solution
    from tuner.report.terminal import show
    from tuner.synthesis.from_drive import config_for_drive

    stage("reading the drive", 0.1)
    recorded = with_mounting(read_drive(drive), frame=imu_frame, rpy_deg=mounting_rpy, lever_arm=lever_arm)
    stage("examining the drive", 0.5)
    measured, _ = examined_drive(recorded, messages.say)
    messages.say("navigating")
    vehicle = Vehicle(non_holonomic, zero_velocity)
    stage("filtering the drive", 0.95)
    settings, left_out = with_stated_arm(config_for_drive(measured, config, gnss=gnss), lever_arm)
    measured = replace(measured, notes=(*measured.notes, *left_out))
    found = navigate_drive(measured, settings, states=states, vehicle=vehicle)
    lawful(found)
    stage("writing", 1.0)
    if directory is not None:
        write_solution(found, measured, directory)

    def pictures() -> object:
        from tuner.report.result_views import pictures_of_solution

        return pictures_of_solution(found, measured)

    tuned_on = found.config.provenance.get("drive") or {}
    if tuned_on.get("digest") == measured.digest:
        advice = (
            "`tuner tune` made these settings from this drive: its report.html names the causes; score them on another "
            "drive of the unit"
        )
    else:
        own = ["--gnss", gnss] if gnss is not None else []
        command_line = shlex.join(["tuner", "diagnose", drive, "--config", config, *own])
        lacking = {
            "--imu-frame": imu_frame,
            "--mounting-rpy": mounting_rpy,
            "--lever-arm": lever_arm,
            "--state": states,
            "--non-holonomic": non_holonomic,
            "--zero-velocity": zero_velocity,
        }
        beside = ", ".join(name for name, value in lacking.items() if value)
        without = f", without {beside}, which it has not" if beside else ""
        advice = f"`{command_line}` looks for causes{without}"
    notes = found.notes
    stated = notes if found.consistency.honesty.good else (*notes, advice)
    page(
        f"Filter of {Path(config).name} on {with_name(Path(drive)).name}",
        {"Is it consistent?": found, "What it did": pictures},
    )
    output.write(navigation_json(found, measured, notes=stated, seed=seed))
    if output.tables:
        to_do = [] if found.consistency.honesty.good else [f"Next: {advice}"]
        if directory is not None:
            to_do.append(f"Solution, tracks and figures: {directory}")
            notes = (attitude_text(measured), *found.notes)
        length = span_text(float(measured.imu_t[-1] - measured.imu_t[0]))
        against = "no reference: errors are unknown, distances are known"
        against = against if measured.reference is None else "scored against its reference"
        about = f"{measured.name}, {length}, with {config}; {against}"
        show(consistency_answer(found.consistency, notes, to_do, about), whole=verbose)
    return 1 if strict and not found.consistency.honesty.good else 0
