"""`tuner simulate`: a static log or a drive, effects hidden on request, the key in a file of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tuner.cli.commands.inputs import is_file, source_name
from tuner.cli.commands.options import Finite, Output, common
from tuner.cli.progress import Messages
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.types.records import Drive


@click.command("simulate", short_help="A log or a drive of a sensor, with effects hidden on request.")
@click.argument("sensor", metavar="SENSOR")
@click.option(
    "--hide",
    "hidden",
    multiple=True,
    metavar="EFFECT[@AXES][:NAME=VALUE,…]",
    help="Hide an effect; may be repeated.",
)
@click.option("--trajectory", metavar="NAME", help="A drive along a built-in trajectory, as NPZ.")
@click.option("--gnss", metavar="GRADE", help="Built-in receiver of a drive.")
@click.option("--hours", type=Finite(min=0, min_open=True), default=1.0, show_default=True)
@click.option(
    "--rate",
    type=Finite(min=0, min_open=True),
    metavar="HZ",
    help="Default: the rate of the sensor.",
)
@click.option(
    "-o",
    "--output-file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="CSV, CSV.GZ or NPZ; default SENSOR.npz.",
)
@common
def command(
    sensor: str,
    hidden: tuple[str, ...],
    trajectory: str | None,
    gnss: str | None,
    hours: float,
    rate: float | None,
    output_file: Path | None,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Simulate SENSOR, a built-in grade: a static log, or a drive along a trajectory with a receiver.

    SENSOR may also be a noise.yaml of tune: its noise and its findings are made again, those of a drive with
    --trajectory. What was hidden is written to FILE.key.json.
    """
    from tuner.catalogue.grades import grade_names, load_grade
    from tuner.formats.files import json_text, write_text
    from tuner.formats.logs import write_drive, write_log
    from tuner.simulation.static import simulate

    again = sensor not in grade_names() and is_file(sensor)
    if sensor not in grade_names() and not again:
        msg = f"{sensor}: expected a built-in grade ({' '.join(grade_names())}) or a noise.yaml"
        raise DataError(msg)
    if gnss is not None and trajectory is None:
        msg = f"--gnss {gnss}: expected --trajectory with it; a static log has no receiver"
        raise DataError(msg)
    key: dict[str, Any]
    if trajectory is not None:
        path = output_file or Path(f"{source_name(sensor)}-{trajectory}.npz")
        drive, key = _drive(sensor, trajectory, gnss, 3600.0 * hours, rate, seed, hidden, messages)
        write_drive(drive, path)
    elif again:
        from tuner.formats import native
        from tuner.simulation.from_config import remade

        config = native.load(Path(sensor))
        path = output_file or Path(f"{config.name}.npz")
        channels, findings, notes = remade(config)
        for note in notes:
            messages.say(note)
        records, key = simulate(
            channels,
            duration=3600.0 * hours,
            rate=rate or 1.0 / config.interval,
            seed=seed,
            hidden=(*findings, *hidden),
        )
        write_log(records, path)
    else:
        path = output_file or Path(f"{sensor}.npz")
        records, key = simulate(
            load_grade(sensor), duration=3600.0 * hours, rate=rate, seed=seed, hidden=hidden
        )
        write_log(records, path)
    key_path = path.with_name(Path(path.name.removesuffix(".gz")).stem + ".key.json")
    write_text(key_path, json_text(key))
    messages.say(f"wrote {path} and its key {key_path}")
    output.write({"schema": "tuner.simulation/1", "log": str(path), "key": str(key_path)})


def _drive(
    sensor: str,
    trajectory: str,
    gnss: str | None,
    duration: float,
    rate: float | None,
    seed: int,
    hidden: tuple[str, ...],
    messages: Messages,
) -> tuple[Drive, dict[str, Any]]:
    """Simulate a drive of a built-in grade, or of a configuration with its findings."""
    from models.trajectory.catalogue import TRAJECTORIES
    from tuner.catalogue.grades import grade_names, load_gnss, load_grade
    from tuner.cli.commands.check import RECEIVER
    from tuner.formats import native
    from tuner.simulation.drive import simulate_drive
    from tuner.simulation.from_config import remade, remade_drive

    if trajectory not in TRAJECTORIES:
        msg = f"--trajectory {trajectory}: expected one of {' '.join(TRAJECTORIES)}"
        raise DataError(msg)
    motion = TRAJECTORIES[trajectory](duration)
    if sensor in grade_names():
        receiver = load_gnss(gnss or RECEIVER)
        return simulate_drive(load_grade(sensor), motion, receiver, rate=rate, seed=seed, hidden=hidden)
    config = native.load(Path(sensor))
    own = config.gnss if gnss is None else None
    channels, at_rest, notes = remade(config, drive=True)
    effects, more = remade_drive(config, receiver=own is not None)
    for note in (*notes, *more):
        messages.say(note)
    return simulate_drive(
        channels,
        motion,
        own or load_gnss(gnss or RECEIVER),
        rate=rate or 1.0 / config.interval,
        seed=seed,
        hidden=(*effects, *hidden),
        at_rest=at_rest,
        name=config.name,
    )
