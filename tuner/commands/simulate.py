"""`tuner simulate`: a static log of a sensor, effects hidden on request, the key in a file of its own."""

from __future__ import annotations

from pathlib import Path

import click

from tuner.commands.options import Output, common
from tuner.progress import Messages
from tuner.records import DataError


@click.command("simulate", short_help="A static log of a sensor, with effects hidden on request.")
@click.argument("sensor", metavar="SENSOR")
@click.option(
    "--hide",
    "hidden",
    multiple=True,
    metavar="EFFECT[@AXES][:NAME=VALUE,…]",
    help="Hide an effect; may be repeated.",
)
@click.option("--hours", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
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
    hours: float,
    rate: float | None,
    output_file: Path | None,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Simulate a static log of SENSOR, a built-in grade; what was hidden is written to FILE.key.json."""
    from tuner.files import json_text, write_text
    from tuner.grades import grade_names, load_grade
    from tuner.simulation import simulate
    from tuner.writers import write_log

    if sensor not in grade_names():
        msg = f"{sensor}: expected a built-in grade ({' '.join(grade_names())})"
        raise DataError(msg)
    path = output_file or Path(f"{sensor}.npz")
    records, key = simulate(load_grade(sensor), duration=3600.0 * hours, rate=rate, seed=seed, hidden=hidden)
    write_log(records, path)
    key_path = path.with_name(path.name.split(".")[0] + ".key.json")
    write_text(key_path, json_text(key))
    messages.say(f"wrote {path} and its key {key_path}")
    output.write({"schema": "tuner.simulation/1", "log": str(path), "key": str(key_path)})
