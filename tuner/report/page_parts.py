"""Tables, lines and figures as parts of a page."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from tuner.report.page_charts import Chart

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


def shown(picture: Picture) -> dict[str, Any]:
    """Return a figure as a template takes it: caption, name, and its drawing as an address."""
    svg = COORDINATES.sub(lambda found: TOO_FINE.sub(rb"\1", found[0]), picture.svg)
    address = f"data:image/svg+xml;base64,{b64encode(svg).decode()}"
    return {
        "caption": picture.caption,
        "name": picture.name,
        "address": address,
        "titled": picture.titled,
    }


def blocks(content: Sequence[Table | str]) -> list[dict[str, Any]]:
    """Return tables as they come and runs of lines as lists."""
    answer: list[dict[str, Any]] = []
    for block in content:
        if isinstance(block, Table):
            rows = [list(row) for row in zip(*(column.cells for column in block.columns), strict=True)]
            head = [str(column.header) for column in block.columns]
            right = any(column.justify == "right" for column in block.columns)
            answer.append({"title": str(block.title or ""), "head": head, "rows": rows, "words": not right})
        elif answer and "lines" in answer[-1]:
            answer[-1]["lines"].append(block.strip())
        else:
            answer.append({"lines": [block.strip()]})
    return answer
