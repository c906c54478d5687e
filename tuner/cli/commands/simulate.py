"""`tuner simulate`: a static log or a drive, effects hidden on request, the key in a file of its own."""

from __future__ import annotations

from pathlib import Path

import click

from tuner.cli.commands.options import Finite, Output, common
from tuner.cli.progress import Messages


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
    from tuner.formats.files import json_text, write_text
    from tuner.formats.logs import write_drive, write_log
    from tuner.readers.source_kind import source_name
    from tuner.simulation.simulate_source import simulate_source
    from tuner.types.records import Drive

    made = simulate_source(
        sensor,
        trajectory=trajectory,
        gnss=gnss,
        duration=3600.0 * hours,
        rate=rate,
        hidden=hidden,
        seed=seed,
    )
    for note in made.notes:
        messages.say(note)
    if isinstance(made.data, Drive):
        path = output_file or Path(f"{source_name(sensor)}-{trajectory}.npz")
        write_drive(made.data, path)
    else:
        path = output_file or Path(f"{made.name}.npz")
        write_log(made.data, path)
    key_path = path.with_name(Path(path.name.removesuffix(".gz")).stem + ".key.json")
    write_text(key_path, json_text(made.key))
    messages.say(f"wrote {path} and its key {key_path}")
    output.write({"schema": "tuner.simulation.static/1", "log": str(path), "key": str(key_path)})
