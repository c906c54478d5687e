"""Tables, lines and figures as parts of a page."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from tuner.report.figure_files import CHARTS
from tuner.report.interactive_figure import Chart

ROW_HEIGHT = 1.7
"""Height of a row with a name in a chart, rem."""
COORDINATES = re.compile(rb'\b(?:d|x|y)="[^"]*"')
"""Coordinates of a drawing."""
TOO_FINE = re.compile(rb"(\.\d\d)\d+")
"""Decimals finer than a hundredth of a point."""


@dataclass(frozen=True)
class Picture:
    """A figure on file.

    Attributes
    ----------
    caption : str
        What it shows.
    name : str
        Its name beside the page.
    svg : bytes
        Its drawing.
    charts : sequence of Chart, optional
        Its panels, to read values off.
    titled : bool
        Whether the caption stands in the drawing already.
    """

    caption: str
    name: str
    svg: bytes
    charts: Sequence[Chart] | None = None
    titled: bool = False


def shown(picture: Picture, panels: list[Chart] | None = None) -> dict[str, Any]:
    """Return a figure as a template takes it: caption, name, its drawing as an address, and its charts.

    Its charts are added to the `panels` of the page, where they are known by their numbers.
    """
    svg = COORDINATES.sub(lambda found: TOO_FINE.sub(rb"\1", found[0]), picture.svg)
    own = [] if panels is None else list(picture.charts or ())
    first = 0 if panels is None else len(panels)
    if panels is not None:
        panels += own
    return {
        "caption": picture.caption,
        "name": picture.name,
        "address": f"data:image/svg+xml;base64,{b64encode(svg).decode()}",
        "titled": picture.titled,
        "charts": range(first, first + len(own)),
        "heights": [_height(chart) for chart in own],
    }


def titled_pictures(drawn: Sequence[tuple[str, Path]], files: Mapping[str, bytes]) -> list[Picture]:
    """Return figures with their captions in them, by caption and path, from their SVG and charts."""
    return [
        Picture(
            caption,
            path.name,
            files[path.name],
            json.loads(files[path.with_suffix(CHARTS).name]),
            titled=True,
        )
        for caption, path in drawn
    ]


def picture_size(picture: Picture) -> int:
    """Return how many bytes a picture takes on a page, its drawing written in base64."""
    return 4 * len(picture.svg) // 3 + len(json.dumps(list(picture.charts or ()), separators=(",", ":")))


def _height(chart: Chart) -> float | None:
    """Return the height, rem, of a chart with a name on each of its rows; None for others, which are all alike."""
    rows = len(chart.get("names", {}).get("y", {}).get("at", ()))
    return 10.0 + ROW_HEIGHT * rows if rows else None


def blocks(content: Sequence[Table | str]) -> list[dict[str, Any]]:
    """Return tables as they come and runs of lines as lists."""
    answer: list[dict[str, Any]] = []
    for block in content:
        if isinstance(block, Table):
            rows = [list(row) for row in zip(*(column.cells for column in block.columns), strict=True)]
            head = [str(column.header).replace("\n", " ") for column in block.columns]
            right = any(column.justify == "right" for column in block.columns)
            answer.append({"title": str(block.title or ""), "head": head, "rows": rows, "words": not right})
        elif answer and "lines" in answer[-1]:
            answer[-1]["lines"].append(block.strip())
        else:
            answer.append({"lines": [block.strip()]})
    return answer
