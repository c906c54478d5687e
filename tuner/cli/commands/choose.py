"""`tuner choose`: which built-in grade keeps the position without fixes within a limit."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import click

from tuner.cli.commands.options import Finite, Output, common, paged, verbose
from tuner.cli.progress import Messages


@click.command("choose", short_help="Which grade keeps the position without fixes within a limit.")
@click.option(
    "--outage",
    type=Finite(min=1.0, max=300.0),
    default=60.0,
    show_default=True,
    metavar="S",
    help="Time without fixes, s.",
)
@click.option(
    "--error",
    type=Finite(min=0.0, min_open=True),
    default=2.0,
    show_default=True,
    metavar="M",
    help="Largest horizontal error after the outage, rms, m.",
)
@click.option(
    "--gnss", default="spp", show_default=True, metavar="GRADE", help="Built-in receiver before the outage."
)
@click.option("--wheels", is_flag=True, help="A vehicle on wheels that do not slip sideways.")
@verbose
@common
@paged
def command(
    outage: float,
    error: float,
    gnss: str,
    wheels: bool,
    verbose: bool,
    seed: int,  # noqa: ARG001
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> None:
    """Rank the built-in grades by the drift that a filter of each predicts, and state the largest N and B that suffice.

    The filter is aided for fifteen minutes in a city, then left without fixes. Only noise and biases count.
    """
    from tuner import choose
    from tuner.report.json.views import choice_json
    from tuner.report.sensor_answers import choice_answer
    from tuner.report.terminal import show

    messages.say("predicting the drift of every grade (a first use compiles the filter: about 20 s)")
    found = choose(outage, error, gnss=gnss, wheels=wheels)
    output.write(choice_json(found))
    page("Choice of a sensor", {f"{error:g} m after {outage:g} s": found})
    if output.tables:
        show(choice_answer(found), whole=verbose)
