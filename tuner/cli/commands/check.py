"""`tuner check`: Monte-Carlo consistency of the filter that a configuration describes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import click

from tuner.cli.commands.options import Finite, Output, common, jobs, paged, strict, verbose
from tuner.cli.progress import Messages
from tuner.stages import stage


@click.command("check", short_help="Is the filter consistent? Monte-Carlo on simulated trajectories.")
@click.argument("config", metavar="CONFIG")
@click.option(
    "--truth", metavar="CONFIG2", help="Simulate sensor, receiver, start and installation of CONFIG2."
)
@click.option(
    "--trajectory",
    default="city",
    show_default=True,
    metavar="NAME",
    help="Trajectory: static straight circle figure_eight s_turns climb city.",
)
@click.option(
    "--duration",
    type=Finite(min=60.0, max=86400.0),
    default=3600.0,
    show_default=True,
    metavar="S",
    help="Length of a run, s.",
)
@click.option(
    "--runs",
    type=click.IntRange(min=2, max=10000),
    default=25,
    show_default=True,
    metavar="N",
    help="Number of simulated runs, each with new turn-on biases.",
)
@click.option("--gnss", metavar="GRADE", help="Built-in receiver, instead of the configuration's.")
@click.option("--budget", is_flag=True, help="Add the error budget: the share of every source in the errors.")
@click.option(
    "--engine",
    type=click.Choice(["compiled", "filterpy"]),
    default="compiled",
    show_default=True,
    help="filterpy: filter the first runs with the readable filter, too, as many as take half a minute (one of an "
    "hour), and say whether both agree.",
)
@strict("the filter is not shown to be honest")
@verbose
@jobs
@common
@paged
def command(
    config: str,
    truth: str | None,
    trajectory: str,
    duration: float,
    runs: int,
    gnss: str | None,
    budget: bool,
    engine: Literal["compiled", "filterpy"],
    strict: bool,
    verbose: bool,
    seed: int,
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> int:
    """Simulate the filter of CONFIG many times and score its errors against those it predicts.

    CONFIG is a noise.yaml, a kf-gins.yaml or the name of a built-in grade. The scores are NEES, NIS, the whiteness of
    the innovations, and the position error after 10, 30, 60 and 300 s without fixes.
    """
    from tuner import check
    from tuner.catalogue.grades import DEFAULT_RECEIVER, receiver_or_default
    from tuner.catalogue.trajectories import load_trajectory
    from tuner.formats.customary_units import digits
    from tuner.report.answer_layout import span_text
    from tuner.report.claims import lawful
    from tuner.report.consistency_answer import check_answer
    from tuner.report.json.consistency import check_json
    from tuner.report.terminal import show
    from tuner.simulation.load_truth import load_truth
    from tuner.synthesis.load_config import load_config

    configured = load_config(config, gnss=gnss, default_gnss=DEFAULT_RECEIVER)
    simulated = None if truth is None else load_truth(truth)
    motion = load_trajectory(trajectory, duration)
    messages.say(f"simulating {runs} × {duration:g} s")
    stage("simulating", 0.97)
    found = check(configured, motion, truth=simulated, runs=runs, seed=seed, budget=budget, engine=engine)
    lawful(found)
    stage("writing", 1.0)
    source = {
        "config": configured.name,
        "truth": configured.name if simulated is None else simulated.sensor.name,
        "trajectory": trajectory,
        "duration_s": duration,
        "runs": runs,
        "states": found.states,
        "seed": seed,
    }
    page(f"Check of the filter of {configured.name}", {"Is it consistent?": found})
    output.write(check_json(found, source=source, budget=budget))
    if output.tables:
        receiver = receiver_or_default(configured.gnss)
        sd = f"fixes of {digits(receiver.position_sd[0], 2)} m (--gnss)"
        about = (
            f"{config} on {runs} simulated drives of {span_text(duration)} ({trajectory}), {sd}; errors are drawn "
            f"from {'its own noise: the log is not tested' if truth is None else truth}"
        )
        answer = check_answer(found, about)
        following = answer.then("navigate", "DRIVE", "--config", config)
        show(following if found.honest else answer, whole=verbose or budget)
    return 1 if strict and not found.honest else 0
