"""`tuner curve`: one empirical curve of a log with its intervals, raw."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import click

from tuner.cli.commands.inputs import assumed, load_records
from tuner.cli.commands.options import Output, Reading, common, paged, reading, verbose
from tuner.cli.progress import Messages
from tuner.stages import counted, stage
from tuner.types.records import DataError

ESTIMATORS = (
    "adev",
    "oadev",
    "twogroup",
    "mdev",
    "hdev",
    "ohdev",
    "totdev",
    "theo1",
    "theobr",
    "theoh",
    "nsec",
    "psd",
    "acf",
    "pacf",
)


@click.command("curve", short_help="One empirical curve: Allan family, spectrum, correlation.")
@click.argument("log")
@click.option(
    "--estimator", type=click.Choice(ESTIMATORS), default="oadev", show_default=True, help="Statistic."
)
@click.option("--tau", metavar="LIST", help="Cluster times, s, separated by commas; default log-spaced.")
@reading
@verbose
@common
@paged
def command(
    log: str,
    estimator: str,
    tau: str | None,
    reading: Reading,
    verbose: bool,
    seed: int,  # noqa: ARG001
    page: Callable[[str, Mapping[str, object]], None],
    output: Output,
    messages: Messages,
) -> None:
    """Compute one empirical curve of a log with its intervals: raw, without preprocessing or bias correction."""
    from tuner.curves import empirical
    from tuner.formats.curves import curves_json
    from tuner.readers.source_kind import source_name
    from tuner.report.curve_tables import curve_answer
    from tuner.report.terminal import show

    wanted = None if tau is None else _seconds(tau)
    stage("reading the log", 0.5)
    records = load_records(log, reading, messages)
    stage(f"computing {estimator}", 1.0)
    try:
        found = [empirical(record, estimator, tau=wanted) for record in counted(records)]
    except ValueError as error:
        raise DataError(f"{log}: {error}") from error
    output.write(curves_json(found))
    page(f"{estimator} of {log}", {r.name: one for r, one in zip(records, found, strict=True)})
    if output.tables:
        show(assumed(records))
        answer = curve_answer(found, [f"{estimator} of {source_name(log)}"])
        show(answer.then("identify", log, *reading.words), whole=verbose)


def _seconds(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise click.UsageError(
            f"--tau: expected seconds separated by commas, such as 1,10,100, got {text!r}"
        ) from None
