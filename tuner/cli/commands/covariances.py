"""`tuner covariances`: which covariance each stream of a recording should declare, for a filter."""

from __future__ import annotations

from pathlib import Path

import click

from tuner.cli.commands.options import Output, common, folder, strict, verbose
from tuner.cli.progress import Messages
from tuner.stages import stage

FILTERS = ("robot_localization",)
"""Filters whose parameters are documented."""


@click.command("covariances", short_help="Which covariance to give each stream of a recording.")
@click.argument("recording", metavar="BAG|DRIVE")
@click.option("--to", "dialect", type=click.Choice(FILTERS), default=FILTERS[0], help="Filter to write for.")
@click.option("--rest", metavar="LOG", help="Log of the unit at rest: its noise.")
@folder("Write robot_localization.yaml, unless it is refused.")
@strict("the settings are not usable without reservation")
@verbose
@common
def command(
    recording: str,
    dialect: str,  # noqa: ARG001
    rest: str | None,
    directory: Path | None,
    strict: bool,
    verbose: bool,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
) -> int:
    """Say what each stream errs, whether it declares so, and what to write into its messages for a filter.

    The recording is a drive as `tuner navigate` takes it: fixes and an IMU, and perhaps wheels (odometry of a bag,
    wheels.csv of a folder, wheel_t and wheel_v of an NPZ). The errors of each stream are parted into a white part and
    one that lasts. robot_localization has no states for the latter: sds, process noise and gates are chosen for it.
    """
    from tuner.covariances.proposal import FILE, covariances_of, yaml_of
    from tuner.formats.files import write_text
    from tuner.report.covariances_answer import covariances_answer, covariances_json
    from tuner.report.terminal import show

    stage("measuring the streams", 0.9)
    found = covariances_of(recording, rest, messages.say)
    stage("writing", 1.0)
    output.write(covariances_json(found))
    if directory is not None and found.written:
        directory.mkdir(parents=True, exist_ok=True)
        write_text(directory / FILE, yaml_of(found))
        messages.say(f"wrote {directory / FILE}")
    if output.tables:
        answer = covariances_answer(found)
        rest_words = [] if rest is None else ["--rest", rest]
        if directory is None and found.written:
            answer = answer.then("covariances", recording, *rest_words, "-o", "covariances")
        show(answer, whole=verbose)
    return 1 if strict and not found.verdict.startswith("usable:") else 0
