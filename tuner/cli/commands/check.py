"""`tuner check`: the filter that a configuration describes, flown many times on a simulated sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tuner.cli.commands.inputs import is_file
from tuner.cli.commands.options import Finite, Output, common
from tuner.cli.progress import Messages
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.simulation.imu import Sensor
    from tuner.types import FilterConfig, GnssNoise

RECEIVER = "spp"
"""Receiver that goes with a built-in grade."""


@click.command("check", short_help="Is the filter honest? Monte-Carlo on simulated trajectories.")
@click.argument("config", metavar="CONFIG")
@click.option(
    "--truth", metavar="CONFIG2", help="The sensor is this one, not the one the filter believes in."
)
@click.option("--trajectory", default="city", show_default=True, metavar="NAME", help="Built-in trajectory.")
@click.option(
    "--duration",
    type=Finite(min=60.0),
    default=3600.0,
    show_default=True,
    metavar="S",
    help="Of a run.",
)
@click.option(
    "--runs", type=click.IntRange(min=2), default=40, show_default=True, help="Simulated switch-ons."
)
@click.option("--gnss", metavar="GRADE", help="Built-in receiver, in place of the configuration's.")
@click.option("--budget", is_flag=True, help="Add the share of every source in the errors.")
@click.option("--strict", is_flag=True, help="Exit status 1 where the filter is not consistent.")
@common
def command(
    config: str,
    truth: str | None,
    trajectory: str,
    duration: float,
    runs: int,
    gnss: str | None,
    budget: bool,
    strict: bool,
    seed: int,
    output: Output,
    messages: Messages,
) -> int:
    """Fly the filter of CONFIG, a YAML or the name of a built-in grade, and score errors against predictions.

    Scores are NEES, NIS, whiteness of innovations and the position error after 10, 30, 60 and 300 s without
    fixes.
    """
    from models.trajectory.catalogue import TRAJECTORIES
    from tuner.catalogue.grades import load_gnss
    from tuner.consistency.check import check
    from tuner.report.consistency_tables import budget_tables, consistency_tables
    from tuner.report.json.consistency import budget_json, consistency_json, explanation_json
    from tuner.report.tables import show

    if trajectory not in TRAJECTORIES:
        msg = f"--trajectory {trajectory}: expected one of {' '.join(TRAJECTORIES)}"
        raise DataError(msg)
    receiver = None if gnss is None else load_gnss(gnss)
    believed = load_filter(config, receiver)
    sensor, true_receiver = (None, None) if truth is None else load_truth(truth)
    messages.say(f"flying {runs} × {duration:g} s (kernels are compiled on first use: some ten seconds)")
    with messages.bar("flying") as advance:
        found = check(
            believed,
            TRAJECTORIES[trajectory](duration),
            sensor=sensor,
            receiver=true_receiver,
            runs=runs,
            seed=seed,
            budget=budget,
            progress=advance,
        )
    source = {
        "config": believed.name,
        "truth": believed.name if sensor is None else sensor.name,
        "trajectory": trajectory,
        "duration_s": duration,
        "runs": runs,
        "states": found.states,
        "seed": seed,
    }
    if output.tables:
        shares = []
        if budget and found.budget is not None and found.observability is not None:
            shares = budget_tables(found.budget, found.observability)
        show([*shares, *consistency_tables(found.consistency, found.notes)])
    content = consistency_json(found.consistency, source=source, notes=found.notes)
    content["causes"] = [explanation_json(explanation) for explanation in found.explanations]
    if budget and found.budget is not None and found.observability is not None:
        content["budget"] = budget_json(found.budget, found.observability)
    output.write(content)
    return 1 if strict and not found.consistency.consistent else 0


def load_filter(
    source: str, receiver: GnssNoise | None, *, supposed: GnssNoise | None = None
) -> FilterConfig:
    """Return the configuration a word stands for: a YAML file, ours or of KF-GINS, or a built-in grade made into one.

    A receiver replaces that of a file; without one, a grade gets the one that is `supposed`, or the built-in.

    Raises
    ------
    DataError
        If it is neither.
    """
    from dataclasses import replace

    from tuner.catalogue.grades import grade_identification, grade_names, load_gnss, load_grade
    from tuner.formats import native
    from tuner.readers import kf_gins_settings
    from tuner.synthesis import synthesize

    if is_file(source):
        path = Path(source)
        theirs = path.suffix in (".yaml", ".yml") and kf_gins_settings.is_settings(_content(path))
        config = kf_gins_settings.load(path) if theirs else native.load(path)
        return config if receiver is None else replace(config, gnss=receiver)
    if source not in grade_names():
        msg = f"{source}: expected a file or a built-in grade ({' '.join(grade_names())}), found neither"
        raise DataError(msg)
    return synthesize(
        grade_identification(load_grade(source)), gnss=receiver or supposed or load_gnss(RECEIVER)
    )


def _content(path: Path) -> object:
    """Return the content of a YAML, None where it is none: then the native reader says what is wrong."""
    import yaml

    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return None


def load_truth(source: str) -> tuple[Sensor, GnssNoise | None]:
    """Return the sensor a word stands for, and its receiver where it names one."""
    from tuner.catalogue.grades import grade_names, load_grade
    from tuner.simulation.imu import sensor_of_config, sensor_of_grade

    if source in grade_names() and not is_file(source):
        return sensor_of_grade(load_grade(source)), None
    config = load_filter(source, None)
    return sensor_of_config(config), config.gnss
