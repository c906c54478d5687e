"""`tuner diagnose`: what the simulation of the fitted noise gets wrong, why, and what naming it gains."""

from __future__ import annotations

import click

from tuner.commands.options import Output, Reading, common, reading
from tuner.commands.sources import load_records
from tuner.progress import Messages


@click.command("diagnose", short_help="What the simulation gets wrong, why, and the gain of saying so.")
@click.argument("log")
@click.option("--holdout", metavar="LOG2", help="A second log of the same unit, to measure the gain on.")
@click.option(
    "--replicas", type=click.IntRange(min=0), default=0, show_default=True, help="Replicas for bands."
)
@click.option("--strict", is_flag=True, help="Exit status 1 where a misfit stays unexplained.")
@reading
@common
def command(
    log: str,
    holdout: str | None,
    replicas: int,
    strict: bool,
    reading: Reading,
    seed: int,
    output: Output,
    messages: Messages,
) -> int:
    """Fit the base noise to a static log, test what is left in every way, name the causes of alarms."""
    from tuner.diagnosis import diagnose
    from tuner.jsondiagnosis import diagnosis_json
    from tuner.report.diagnosis_tables import diagnosis_tables
    from tuner.report.tables import show

    records = load_records(log, reading, messages)
    second = None if holdout is None else load_records(holdout, reading, messages)
    messages.say("diagnosing")
    found = diagnose(records, holdout=second, replicas=replicas, seed=seed)
    if output.tables:
        show(diagnosis_tables(found))
    output.write(diagnosis_json(found))
    return 1 if strict and found.unexplained else 0
