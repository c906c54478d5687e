"""`tuner simulate`: a static log or a drive with hidden effects, and the ground truth in a file of its own."""

from __future__ import annotations

from pathlib import Path

import click

from tuner.cli.commands.options import POSITIVE, RATE, Output, common
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("simulate", short_help="A log or a drive of a sensor, with effects on request.")
@click.argument("sensor", metavar="SENSOR")
@click.option(
    "--hide",
    "effects",
    multiple=True,
    metavar="EFFECT[@AXES][:NAME=VALUE,…]",
    help="Add an effect to the data, by its name alone or with all values, SI, such as "
    "line@gyro_x:frequency=12,amplitude=1e-4 (Hz, rad/s); may be repeated.",
)
@click.option("--trajectory", metavar="NAME", help="Simulate a drive along this built-in trajectory.")
@click.option("--gnss", metavar="GRADE", help="Built-in GNSS receiver of the drive.")
@click.option("--hours", type=POSITIVE, default=1.0, show_default=True, metavar="H", help="Length, h.")
@click.option(
    "--rate",
    type=RATE,
    metavar="HZ",
    help="Sampling rate, Hz; default that of the sensor.",
)
@click.option(
    "-o",
    "--output-file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="CSV, CSV.GZ or NPZ file (a drive: NPZ); default SENSOR.npz.",
)
@common
def command(
    sensor: str,
    effects: tuple[str, ...],
    trajectory: str | None,
    gnss: str | None,
    hours: float,
    rate: float | None,
    output_file: Path | None,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Simulate a static log of SENSOR or, with --trajectory, a drive with GNSS fixes.

    SENSOR is a built-in grade, or a noise.yaml of tune, whose noise and findings are simulated (findings of a drive
    with --trajectory only). The ground truth, with every hidden effect, is written to FILE.key.json.
    """
    from tuner.formats.documents import json_text
    from tuner.formats.files import write_text
    from tuner.formats.logs import write_drive, write_log
    from tuner.readers.source_kind import source_name
    from tuner.simulation.simulate_source import simulate_source
    from tuner.types.records import Drive

    stage("simulating", 0.5)
    made = simulate_source(
        sensor,
        trajectory=trajectory,
        gnss=gnss,
        duration=3600.0 * hours,
        rate=rate,
        effects=effects,
        seed=seed,
    )
    stage("writing", 1.0)
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
