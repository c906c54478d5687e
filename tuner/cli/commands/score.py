"""`tuner score`: any filter on trial, by the file that it wrote."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import click

from tuner.cli.commands.options import DIRECTORY, Output, common, stated_command, strict, verbose
from tuner.cli.progress import Messages
from tuner.stages import counted, stage
from tuner.types.one_line import printable


def _columns(_context: click.Context, parameter: click.Parameter, value: str | None) -> dict[str, str] | None:
    """Turn ``sd_n=stdN,t=stamp`` into columns by our name (a callback of click)."""
    if value is None:
        return None
    pairs = [part.partition("=") for part in value.split(",")]
    if any(not equals or not name.strip() or not column.strip() for name, equals, column in pairs):
        raise click.UsageError(f"{parameter.opts[0]} {value}: expected NAME=COLUMN with commas between")
    return {name.strip(): column.strip() for name, _, column in pairs}


def _windows(
    _context: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> list[tuple[float, float]]:
    """Turn ``BEGIN,END`` texts into windows of time (a callback of click)."""
    windows = []
    for text in values:
        try:
            begin, end = (float(part) for part in text.split(","))
        except ValueError:
            begin = end = math.nan
        if not begin < end < math.inf:
            raise click.UsageError(f"{parameter.opts[0]} {text}: expected BEGIN,END, s, the second larger")
        windows.append((begin, end))
    return windows


@click.command("score", short_help="Any filter on trial: is its output as uncertain as it says?")
@click.argument("estimates", metavar="ESTIMATE…", nargs=-1, required=True)
@click.option(
    "--truth",
    "truths",
    multiple=True,
    metavar="FILE",
    help="A better solution, one for all estimates or one for each; without it the innovations are scored.",
)
@click.option(
    "--against",
    "earlier",
    multiple=True,
    metavar="FILE",
    help="What the same filter wrote before a change, one for each estimate: is it worse now?",
)
@click.option(
    "--columns", callback=_columns, metavar="NAME=COLUMN,…", help="Columns of a CSV of the estimate."
)
@click.option(
    "--truth-columns", callback=_columns, metavar="NAME=COLUMN,…", help="Columns of a CSV of the truth."
)
@click.option("--topic", metavar="NAME", help="Topic of a ROS bag of the estimate.")
@click.option("--truth-topic", metavar="NAME", help="Topic of a ROS bag of the truth.")
@click.option("--frame", metavar="AXES", help="Axes of x, y, z of the estimate: NED, ENU, NWU, ECEF, …")
@click.option("--truth-frame", metavar="AXES", help="Axes of x, y, z of the truth.")
@click.option("--body", metavar="AXES", help="Axes of the body of the estimate: FRD (default), FLU, RFU, …")
@click.option("--truth-body", metavar="AXES", help="Axes of the body of the truth.")
@click.option(
    "--align",
    type=click.Choice(["none", "yaw", "se3"]),
    default="none",
    show_default=True,
    help="What is taken out of the estimate: a shift and a turn about the vertical (yaw), or about all axes (se3).",
)
@click.option("--align-time", is_flag=True, help="Take out the offset between the clocks.")
@click.option(
    "--align-body",
    is_flag=True,
    help="Take out a constant rotation between the bodies of estimate and truth.",
)
@click.option(
    "--outage",
    "outages",
    multiple=True,
    callback=_windows,
    metavar="BEGIN,END",
    help="Time without fixes, s; may be repeated.",
)
@click.option(
    "--imu",
    metavar="LOG|CONFIG|GRADE",
    help="The inertial unit: its noise at rest helps to tell which assumption of the filter is wrong.",
)
@click.option(
    "-o", "--output-dir", type=DIRECTORY, metavar="DIR", help="Write report.html, score.svg, score.json."
)
@strict("the filter is not shown to be honest")
@verbose
@common
def command(
    estimates: tuple[str, ...],
    truths: tuple[str, ...],
    earlier: tuple[str, ...],
    columns: dict[str, str] | None,
    truth_columns: dict[str, str] | None,
    topic: str | None,
    truth_topic: str | None,
    frame: str | None,
    truth_frame: str | None,
    body: str | None,
    truth_body: str | None,
    align: str,
    align_time: bool,
    align_body: bool,
    outages: list[tuple[float, float]],
    imu: str | None,
    output_dir: Path | None,
    strict: bool,
    verbose: bool,
    seed: int,
    output: Output,
    messages: Messages,
) -> int:
    """Score the output of any filter by its errors, or by its innovations.

    ESTIMATE is a CSV with columns t, lat, lon, height or n, e, d, vn, ve, vd, roll, pitch, yaw, their sds sd_NAME, an
    NPZ, a trajectory of TUM, KITTI or EuRoC, odometry, poses or a path in a ROS bag, text of Inertial Explorer, a .pos
    of RTKLIB, or what KF-GINS or NaveGo write. Several are runs of a Monte Carlo. With --against, --strict ends with
    exit status 1 unless the estimate is not worse than before: a test for continuous integration.
    """
    from tuner.consistency.output_comparison import changed_scores, differences
    from tuner.consistency.score_output import score_outputs
    from tuner.consistency.trajectory_alignment import Alignment
    from tuner.formats.codec import dump
    from tuner.readers.estimate import read_estimate
    from tuner.report.claims import lawful
    from tuner.report.json.output_score import output_score_json
    from tuner.report.output_change_answer import output_change_answer
    from tuner.report.output_score_tables import output_score_answer
    from tuner.report.terminal import show

    stage("reading", 0.3)
    outputs, former = (
        [read_estimate(path, frame=frame, body=body, columns=columns, topic=topic) for path in counted(paths)]
        for paths in (estimates, earlier)
    )
    references = [
        read_estimate(
            path,
            frame=truth_frame,
            body=truth_body,
            columns=truth_columns,
            topic=truth_topic,
            beside=outputs[0],
        )
        for path in truths
    ]
    stage("scoring", 0.95)
    score = partial(
        score_outputs,
        truths=references,
        how=Alignment(align),
        align_time=align_time,
        align_body=align_body,
        outages=outages,
        sensor_noise=None if imu is None else _sensor_noise(imu),
    )
    found, change = None, None
    if former and not references and not all(one.has_innovations for one in (*outputs, *former)):
        change = differences(outputs, former)
    else:
        found = score(outputs)
        change = changed_scores(found, score(former)) if former else None
        lawful(found)
    source = {
        "estimates": [printable(name) for name in estimates],
        "truths": [printable(name) for name in truths],
        "against": [printable(name) for name in earlier],
        "align": align,
        "align_time": align_time,
        "align_body": align_body,
        "imu": None if imu is None else printable(imu),
        "runs": len(outputs),
        "seed": seed,
    }
    stage("writing", 1.0)
    content = {"source": source} if found is None else output_score_json(found, source=source)
    content |= {} if change is None else {"change": dump(change)}
    if output_dir is not None:
        from tuner.report.output_score_page import write_output_score

        if found is None:
            raise click.UsageError("-o: expected a truth (--truth) or innovations beside it, found neither")
        shown = stated_command(click.get_current_context().obj)
        write_output_score(found, content, output_dir, shown, change)
        messages.say(f"written: {output_dir}")
    output.write(content)
    answer = output_change_answer(change, found) if change else output_score_answer(found) if found else None
    if output.tables and answer is not None:
        words = click.get_current_context().obj
        show(answer.then(*words, "-o", "score") if found and output_dir is None else answer, whole=verbose)
    verdict = change.verdict if change else found.consistency.honesty if found else None
    return 1 if strict and not (verdict and verdict.good) else 0


def _sensor_noise(source: str) -> tuple[float, float]:
    """Return the white densities of gyros and accelerometers, rms over the axes, of a log, configuration or grade."""
    from tuner import identify, read, synthesize
    from tuner.readers.source_kind import is_log
    from tuner.synthesis.load_config import load_config
    from tuner.types.records import DataError

    if is_log(source):
        records = read(source)
        config = synthesize(identify(records), records=records)
    else:
        config = load_config(source)
    found = []
    for sensor in ("gyro", "accel"):
        squares = [c.white_density**2 for axis, c in config.channels.items() if axis.startswith(sensor)]
        if not squares:
            raise DataError(f"--imu {source}: expected gyroscopes and accelerometers, found no {sensor}")
        found.append(math.sqrt(sum(squares) / len(squares)))
    return found[0], found[1]
