"""Tables, lines and figures as parts of a page."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from tuner.report.figure_files import CHARTS
from tuner.report.interactive_figure import Chart

PICTURE_BYTES = 2_500_000
"""Bytes that all pictures of findings take in a page; further ones stand beside it, so that it stays below 6 MB."""
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

    @classmethod
    def of(cls, files: Mapping[str, bytes], name: str, caption: str, *, titled: bool = False) -> Picture:
        """Return a figure by its files, those of `PAGE_SUFFIXES` among them, and their name without a suffix."""
        return cls(caption, f"{name}.svg", files[f"{name}.svg"], json.loads(files[name + CHARTS]), titled)

    @property
    def address(self) -> str:
        """Its drawing as an address, for a page."""
        svg = COORDINATES.sub(lambda found: TOO_FINE.sub(rb"\1", found[0]), self.svg)
        return f"data:image/svg+xml;base64,{b64encode(svg).decode()}"

    @property
    def size(self) -> int:
        """Bytes that it takes on a page at most, its drawing written in base64."""
        return 4 * len(self.svg) // 3 + len(json.dumps(list(self.charts or ()), separators=(",", ":")))


def with_room(pictures: Iterable[Picture]) -> list[Picture]:
    """Return the pictures that a page has room for, the first ones first."""
    room, shown = PICTURE_BYTES, []
    for one in pictures:
        if one.size <= room:
            shown.append(one)
            room -= one.size
    return shown


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
