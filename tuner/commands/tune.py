"""`tuner tune`: the main job, from a log to a filter configuration, with everything that stands behind it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from tuner.commands.options import Output, Reading, common, reading, term_list
from tuner.commands.sources import load_identification, source_name
from tuner.progress import Messages

if TYPE_CHECKING:
    from tuner.results import FilterConfig, Identification

ABSENT: Mapping[str, str] = MappingProxyType(
    {
        "diagnosis": "this version does not yet compare replicas of the fitted model with the log",
        "consistency": "this version does not yet run the configured filter on simulated trajectories",
    }
)
"""Parts of the main job that cannot be done, each with its reason."""

EXPORTED = ("kalibr", "kf-gins")
"""Dialects that tune writes beside the native YAML; `tuner export` writes the others."""


@click.command("tune", short_help="The main job: log in, filter configuration out.")
@click.argument("log", required=False)
@click.option(
    "-o",
    "--output-dir",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Default: tuner-out/NAME.",
)
@click.option(
    "--horizon",
    type=click.FloatRange(min=0, min_open=True),
    default=1000.0,
    show_default=True,
    metavar="S",
    help="Longest time the filter must bridge.",
)
@click.option("--complete", metavar="GRADE", help="Built-in grade for a sensor the log lacks.")
@click.option("--gnss", metavar="GRADE", help="Built-in GNSS grade.")
@click.option("--terms", callback=term_list, metavar="LIST", help="Fit exactly this sum of noise terms.")
@click.option(
    "--latitude",
    type=click.FloatRange(-90, 90),
    metavar="DEG",
    help="Take the Earth's rate out of the gyro means.",
)
@reading
@common
def command(
    log: str | None,
    output_dir: Path | None,
    horizon: float,
    complete: str | None,
    gnss: str | None,
    terms: tuple[str, ...] | None,
    latitude: float | None,
    reading: Reading,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Turn a static log into a filter configuration: noise.yaml, exports, figures, result.json.

    LOG may also be a datasheet. Without LOG: a built-in simulated IMU with an effect, drawn from --seed,
    hidden in it.
    """
    from tuner.exporters import export, native
    from tuner.files import json_text, write_text
    from tuner.grades import load_gnss, load_grade
    from tuner.identification import identify
    from tuner.jsonio import identification_json
    from tuner.jsonviews import config_json
    from tuner.report.allan_figure import draw_allan
    from tuner.report.page import write_page
    from tuner.report.tables import identification_tables, show
    from tuner.simulation import demo
    from tuner.synthesis import synthesize

    completion = load_grade(complete) if complete else None
    receiver = load_gnss(gnss) if gnss else None
    key: Mapping[str, Any] | None = None
    if log is None:
        name = f"simulated-{seed}"
        messages.say("simulating an IMU with a hidden effect")
        records, key = demo(seed)
        messages.say("identifying")
        found = identify(records, terms=terms, latitude=latitude)
    else:
        name = source_name(log)
        found = load_identification(log, reading, messages, terms=terms, latitude=latitude)
    messages.say("synthesising the filter configuration")
    config = synthesize(found, name=name, horizon=horizon, complete=completion, gnss=receiver, seed=seed)
    texts = {
        "noise.yaml": native.dumps(config),
        **{f"{dialect}.yaml": export(config, dialect) for dialect in EXPORTED},
    }
    result = {
        "schema": "tuner.result/1",
        "identification": identification_json(found),
        "config": config_json(config),
        "absent": dict(ABSENT),
    }
    directory = output_dir or Path("tuner-out") / name
    figures = [directory / "allan.png", directory / "allan.svg"]
    if any(channel.allan.tau.size for channel in found.channels.values()):
        draw_allan(found, figures, title=name)
    for file, text in texts.items():
        write_text(directory / file, text)
    write_text(directory / "report.html", write_page(found, config, title=name, absent=ABSENT))
    if key is not None:
        write_text(directory / "key.json", json_text(key))
    write_text(directory / "result.json", json_text(result))
    if output.tables:
        show([*identification_tables(found), *_summary(directory, config, found, simulated=key is not None)])
    output.write(result)


def _summary(directory: Path, config: FilterConfig, found: Identification, *, simulated: bool) -> list[str]:
    lines = [f"  configuration: {directory / 'noise.yaml'} ({len(config.channels)} channels)"]
    bounded = [i.quantity for i in config.inflations if i.reason.startswith("bounded")]
    if bounded:
        lines.append(f"  only bounded, half of the 95 % limit is used: {', '.join(bounded)}")
    lines += [
        f"  {i.quantity} × {i.factor:g}: {i.reason}" for i in config.inflations if i.quantity not in bounded
    ]
    lines += [f"  {note}" for note in config.notes if note not in found.notes]
    lines += [f"  no {part}: {reason}" for part, reason in ABSENT.items()]
    if simulated:
        lines.append(f"  what was hidden in the simulated log: {directory / 'key.json'}")
    return lines
