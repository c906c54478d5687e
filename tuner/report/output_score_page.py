"""The score of any filter's output as a folder: one page, its figure, JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from models.arrays import FloatArray
from tuner.consistency.correlated_errors import autocorrelation
from tuner.consistency.output_comparison import OutputChange
from tuner.consistency.output_scores import normalized
from tuner.consistency.score_output import OutputScore
from tuner.formats.customary_units import since
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.report.curve_panels import draw_banded
from tuner.report.figure_files import CHARTS, PAGE_SUFFIXES, new_figure, rendered
from tuner.report.html_page import write_sections_page
from tuner.report.output_change_answer import output_change_answer
from tuner.report.output_score_tables import output_score_answer
from tuner.report.page_parts import Picture
from tuner.types.filter_output import BLOCKS
from tuner.types.one_line import printable

MAX_DRAWN_EPOCHS = 1500
"""Points of a line: three a pixel of the page; fifteen panels with their bands keep it below 6 MB."""
UNITS = ((1.0, "m"), (1.0, "m/s"), (np.degrees(1.0), "deg"), (np.degrees(1.0), "deg/s"), (1.0, "m/s²"))
"""Size and name of the unit in which each block is drawn."""
AXES = (("north", "east", "down"),) * 3 + (("x", "y", "z"),) * 2
ERROR_COLOUR, OUTAGE_COLOUR = "#1d4ed8", "#fecaca"
BAND_LABEL = "in bands of ±3 sd as the filter states"
LEAST_DRAWN = 10
"""Epochs from which on their autocorrelation is drawn."""


@dataclass(frozen=True)
class _Block:
    """Errors or innovations of a block over time.

    Times, shape (n,), values, their sds as the filter states, and values normalised by these, shape (n, 3).
    """

    title: str
    place: int
    t: FloatArray
    value: FloatArray
    sd: FloatArray
    normal: FloatArray


def write_output_score(
    found: OutputScore,
    content: Mapping[str, Any],
    directory: Path,
    command: str = "",
    change: OutputChange | None = None,
) -> None:
    """Write ``report.html``, ``score.svg``, ``score.png`` and ``score.json``.

    Parameters
    ----------
    found : OutputScore
        Scores, errors over time.
    content : mapping
        The JSON.
    directory : Path
        Made where it does not exist; a set that is there is replaced in one step.
    command : str
        What was typed; empty where the page is made from Python.
    change : OutputChange, optional
        What became of an earlier output: it stands first.
    """
    blocks, pictures, files = _blocks(found), [], {}
    if blocks:
        figure = _figure(blocks, found.runs[0].estimate.outages if found.runs else ())
        files = rendered(figure, "score", (".png", *PAGE_SUFFIXES))
        caption = (
            "Errors and the ±3 sd that the filter states; right: autocorrelation of the normalised errors."
        )
        pictures = [Picture.of(files, "score", caption)]
        del files[f"score{CHARTS}"]
    sections = [("Is it honest?", output_score_answer(found), pictures)]
    if change is not None:
        sections.insert(0, ("Is it worse than before?", output_change_answer(change, None), []))
    verdict = found.consistency.honesty if change is None else change.verdict
    title = printable(f"Score of {', '.join(Path(output.name).name for output in found.outputs[:3])}")
    files["report.html"] = write_sections_page(title, sections, command, verdict).encode()
    files["score.json"] = json_text(dict(content) | {MANIFEST: digests(files)}).encode()
    write_set(directory, files, last="score.json")


def _blocks(found: OutputScore) -> list[_Block]:
    """Return the blocks of the errors of the first run that are known; without a truth, of its innovations."""
    if found.runs:
        run, what = found.runs[0], "error"
        t, value, normal = run.t, run.error, normalized(run)
        covariance = run.covariance
    else:
        output, what = found.outputs[0], "innovation"
        rows = np.isfinite(output.innovation).any(axis=1)
        t, value, covariance = output.t[rows], output.innovation[rows], output.innovation_covariance[rows]
        normal = value / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    sd = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    own = [slice(k, k + 3) for k in range(0, value.shape[1], 3)]
    return [
        _Block(f"{BLOCKS[i].replace('_', ' ')} {what}", i, t, value[:, part], sd[:, part], normal[:, part])
        for i, part in enumerate(own)
        if np.isfinite(value[:, part.start]).any()
    ]


def _figure(blocks: Sequence[_Block], outages: Iterable[tuple[float, float]]) -> Figure:
    """Return a row for each block: its components over time in bands of ±3 sd, and its autocorrelation."""
    begin = float(blocks[0].t[0])
    with new_figure((13.0, 2.2 * len(blocks))) as figure:
        for row, block in zip(figure.subplots(len(blocks), 4, squeeze=False), blocks, strict=True):
            (factor, unit), step = UNITS[block.place], -(-len(block.t) // MAX_DRAWN_EPOCHS)
            for j, axis in enumerate(AXES[block.place]):
                value, reach = factor * block.value[::step, j], 3.0 * factor * block.sd[::step, j]
                label = BAND_LABEL if block is blocks[0] and j == 0 else None
                look: dict[str, Any] = {"color": ERROR_COLOUR, "lw": 0.7, "label": label}
                draw_banded(row[j], block.t[::step] - begin, value, (-reach, reach), **look)
                for start, end in outages:
                    row[j].axvspan(start - begin, end - begin, color=OUTAGE_COLOUR, alpha=0.4, lw=0.0)
                row[j].set(title=f"{block.title} {axis}, {unit}", xlabel=since(begin))
            row[3].set(title=f"{block.title}: autocorrelation", xlabel="lag, s")
            good = np.isfinite(block.normal).all(axis=1)
            if np.count_nonzero(good) >= LEAST_DRAWN:
                rho = autocorrelation(block.normal[good])[: np.count_nonzero(good) // 2]
                lag = float(np.median(np.diff(block.t))) * np.arange(len(rho))
                row[3].plot(lag, rho, color=ERROR_COLOUR, lw=0.9)
                row[3].axhline(0.0, color="0.45", lw=0.6)
    return figure
