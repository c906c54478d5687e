"""`tuner plan`: which terms H hours can show, and the hours a wanted accuracy needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import click

from tuner.cli.commands.inputs import load_source
from tuner.cli.commands.options import Output, Reading, common, paged, reading
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("plan", short_help="How long a static test must be.")
@click.argument("source", metavar="SENSOR-OR-LOG")
@click.option(
    "--accuracy",
    type=float,
    default=0.1,
    show_default=True,
    metavar="SHARE",
    help="Wanted relative standard deviation of each term.",
)
@click.option(
    "--hours", type=float, default=1.0, show_default=True, metavar="H", help="Length of the test, h."
)
@reading
@common
@paged
def command(
    source: str,
    accuracy: float,
    hours: float,
    reading: Reading,
    seed: int,  # noqa: ARG001
    output: Output,
    messages: Messages,
    page: Callable[[str, Mapping[str, object]], None],
) -> None:
    """Plan a static test: the Cramér–Rao bound of every noise term, and the hours that a wanted accuracy needs.

    The expected noise is that of a built-in grade, a datasheet or an earlier log of the sensor.
    """
    from tuner.identification.identify_source import identify_source
    from tuner.identification.static_test_plan import plan_test
    from tuner.readers.source_kind import source_name
    from tuner.report.identification_answer import terms_too_short
    from tuner.report.json.views import plan_json
    from tuner.report.sensor_answers import plan_answer
    from tuner.report.terminal import show

    stage("reading", 0.2)
    loaded = load_source(source, reading, messages) or source
    stage("identifying the noise", 0.8)
    identification = identify_source(loaded, arma=None, progress=messages.say)
    stage("planning", 1.0)
    plans = replace(plan_test(identification, hours=hours, accuracy=accuracy), name=source_name(source))
    output.write(plan_json(plans))
    page(f"Static test of {source}", {"How long must it last?": plans})
    if output.tables:
        unseen = terms_too_short(identification)
        answer = plan_answer(plans, unseen)
        lacking = [p.hours for plan in plans.values() for p in plan.parameters if not p.shown and p.hours]
        stated = [f"--accuracy={accuracy:g}", f"--hours={math.ceil(max(lacking, default=0.0)):g}"]
        following = ["plan", source, *stated] if lacking else ["tune", source]
        show(answer if unseen and not lacking else answer.then(*following, *reading.words))
