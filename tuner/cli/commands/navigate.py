"""`tuner navigate`: a measured drive through the filter of a configuration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from tuner.cli.commands.check import load_filter
from tuner.cli.commands.options import Finite, Output, common
from tuner.cli.progress import Messages
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.types.records import Drive

AS_REPORTED = (
    "no receiver is named: fixes are believed to err as they report, each by itself; name one (--gnss GRADE) for "
    "errors that stay"
)


@click.command("navigate", short_help="Filter a measured drive: innovations, errors, outages.")
@click.argument("drive", metavar="DRIVE")
@click.option("--config", required=True, metavar="CONFIG", help="YAML or the name of a built-in grade.")
@click.option("--gnss", metavar="GRADE", help="Built-in receiver, in place of the configuration's.")
@click.option("--imu-frame", metavar="FRAME", help="Axes of the sensor in the vehicle: FRD, FLU, RFU.")
@click.option("--mounting-rpy", metavar="R,P,Y", help="Mounting angles, deg: v_sensor = Rz Ry Rx v_vehicle.")
@click.option("--lever-arm", metavar="X,Y,Z", help="From sensor to antenna, forward, right, down, m.")
@click.option("--state", "states", multiple=True, metavar="NAME=SD", help="A further state; may be repeated.")
@click.option(
    "--non-holonomic",
    is_flag=False,
    flag_value=0.2,
    type=Finite(min=0.0, min_open=True),
    metavar="[SD]",
    help="Wheels do not slip: sideways and vertical velocity within SD m/s (0.2), once a second.",
)
@click.option(
    "--zero-velocity",
    is_flag=False,
    flag_value=0.05,
    type=Finite(min=0.0, min_open=True),
    metavar="[SD]",
    help="Where the unit is as calm as at the start it stands: velocity within SD m/s (0.05), no turn.",
)
@click.option("--strict", is_flag=True, help="Exit status 1 where the filter is not consistent.")
@common
def command(
    drive: str,
    config: str,
    gnss: str | None,
    imu_frame: str | None,
    mounting_rpy: str | None,
    lever_arm: str | None,
    states: tuple[str, ...],
    non_holonomic: float | None,
    zero_velocity: float | None,
    strict: bool,
    seed: int,
    output: Output,
    messages: Messages,
) -> int:
    """Filter DRIVE, a folder with imu.csv and gnss.csv, an NPZ, or a YAML of KF-GINS.

    Fixes are withheld for 10, 30 and 60 s at a time to see how far the prediction can be trusted; errors are
    against the reference where the drive has one.
    """
    from tuner.catalogue.grades import load_gnss
    from tuner.consistency.drive import navigate_drive
    from tuner.navigation.drive.vehicle_constraints import Vehicle, accounts
    from tuner.readers.drive import read_drive
    from tuner.report.consistency_tables import consistency_tables
    from tuner.report.json.consistency import consistency_json
    from tuner.report.tables import show
    from tuner.synthesis.from_drive import receiver_of

    measured = _placed(read_drive(drive), imu_frame, mounting_rpy, lever_arm)
    receiver = None if gnss is None else load_gnss(gnss)
    supposed = receiver_of(measured)
    believed = load_filter(config, receiver, supposed=supposed)
    further = dict(_state(text) for text in states)
    messages.say("navigating (kernels are compiled on first use: some ten seconds)")
    vehicle = Vehicle(non_holonomic, zero_velocity)
    found = navigate_drive(measured, believed, states=further, vehicle=vehicle)
    notes = found.notes
    if believed.gnss == supposed and not supposed.correlated:
        notes = (*notes, AS_REPORTED)
    if not found.consistency.consistent:
        notes = (*notes, f"`tuner diagnose {drive} --config {config}` looks for the causes")
    estimates = {
        name: [{"value": value, "sd": sd} for value, sd in values] for name, values in found.estimates.items()
    }
    source = {
        "drive": measured.source,
        "digest": measured.digest,
        "config": believed.name,
        "states": found.settings.size,
        "fixes": sum(len(stretch.fixes) for stretch in found.stretches),
        "estimates": estimates,
        "constraints": {name: vars(one) for name, one in accounts(found.solutions).items()},
        "seed": seed,
    }
    if output.tables:
        show(consistency_tables(found.consistency, notes))
    output.write(consistency_json(found.consistency, source=source, notes=notes))
    return 1 if strict and not found.consistency.consistent else 0


def _placed(drive: Drive, frame: str | None, rpy: str | None, arm: str | None) -> Drive:
    """Return the drive with mounting and lever arm as the user gives them."""
    from tuner.readers.drive import FRAMES, mounting_of
    from tuner.readers.drive_npz import FARTHEST

    if frame is not None and frame.upper() not in FRAMES:
        msg = f"--imu-frame {frame}: expected one of {' '.join(FRAMES)}"
        raise DataError(msg)
    angles = None if rpy is None else _three("--mounting-rpy", rpy)
    mounting = mounting_of(frame, angles)
    if mounting is not None:
        drive = replace(drive, mounting=mounting)
    if arm is None:
        return drive
    return replace(drive, lever_arm=_three("--lever-arm", arm, up_to=FARTHEST))


def _three(option: str, text: str, *, up_to: float = math.inf) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not (math.isfinite(x + y + z) and max(abs(x), abs(y), abs(z)) <= up_to):
        most = "" if math.isinf(up_to) else f", {up_to:g} at most,"
        msg = f"{option} {text}: expected three numbers{most} with commas between"
        raise DataError(msg)
    return x, y, z


def _state(text: str) -> tuple[str, float]:
    from models.state_layout import OPTIONAL

    name, _, value = text.partition("=")
    try:
        sd = float(value)
    except ValueError:
        sd = -1.0
    if name not in OPTIONAL or not 0.0 < sd < math.inf:
        msg = f"--state {text}: expected NAME=SD with NAME one of {' '.join(OPTIONAL)} and a positive SD"
        raise DataError(msg)
    return name, sd
