"""`python -m examples.papers`: the figures, tables and claims of the three papers, reproduced and judged."""

from __future__ import annotations

import time
from pathlib import Path

import click

from examples.papers import ITEMS, Settings, chosen, run
from examples.papers.figures import draw_item
from examples.papers.pages import item_table, papers_json, papers_markdown
from tuner.cli.commands.options import DIRECTORY, Output, common
from tuner.cli.progress import Messages
from tuner.formats.documents import json_text
from tuner.formats.files import write_text
from tuner.report.terminal import show
from tuner.stages import counted


@click.command()
@click.argument("names", nargs=-1, type=click.Choice([*ITEMS, "all"]), metavar="[NAME…|all]")
@click.option(
    "-o",
    "--output-directory",
    type=DIRECTORY,
    metavar="DIR",
    help="Write papers.md into DIR, figures and papers.json into DIR/papers.",
)
@click.option(
    "--small", is_flag=True, help="Smaller samples: all items in about a minute, with wider intervals."
)
@common
def command(
    names: tuple[str, ...],
    output_directory: Path | None,
    small: bool,
    seed: int,
    output: Output,
    messages: Messages,
) -> None:
    """Reproduce figures, tables and claims of the three papers; without NAME, list the items.

    Each item simulates data with the paper's settings, runs the functions of the package, draws the paper's figure and
    judges every claim: reproduced, corrected or untestable. The page is written after each item, so that an interrupted
    run keeps what is finished.
    """
    if not names:
        click.echo("\n".join(ITEMS))
        return
    items = []
    if output_directory is not None:
        (output_directory / "papers").mkdir(parents=True, exist_ok=True)
    for name in counted(chosen(names)):
        messages.say(f"{name} …")
        begin = time.perf_counter()
        items.append(run(name, Settings(seed, small)))
        if output_directory is not None:
            draw_item(items[-1], output_directory / "papers" / f"{name}.png")
            write_text(output_directory / "papers.md", papers_markdown(items, "papers/"))
            write_text(output_directory / "papers" / "papers.json", json_text(papers_json(items)))
        messages.say(f"{name}: {time.perf_counter() - begin:.1f} s")
        if output.tables:
            show([item_table(items[-1])])
    if output_directory is not None:
        messages.say(f"wrote {output_directory / 'papers.md'}")
    output.write(papers_json(items))


if __name__ == "__main__":
    command(prog_name="python -m examples.papers")
