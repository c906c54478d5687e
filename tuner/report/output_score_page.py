"""The score of any filter's output as a folder: one page, its figure, JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from models.arrays import FloatArray
from tuner.consistency.correlated_errors import autocorrelation
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.output_scores import normalized
from tuner.consistency.score_output import OutputScore
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.report.consistency_tables import consistency_tables, consistency_verdict
from tuner.report.figure_files import figure_bytes, lay_out
from tuner.report.html_page import write_sections_page
from tuner.report.interactive_figure import charts_of_figure
from tuner.report.output_cause_text import cause_text, change_text
from tuner.report.output_score_tables import states_table
from tuner.report.page_parts import Picture
from tuner.types.filter_output import BLOCKS
from tuner.types.one_line import printable

MAX_DRAWN_EPOCHS = 1500
"""Points of a line: three a pixel of the page; fifteen panels with their bands keep it below 6 MB."""
_UNITS = (
    (1.0, "m"),
    (1.0, "m/s"),
    (float(np.degrees(1.0)), "deg"),
    (float(np.degrees(1.0)), "deg/s"),
    (1.0, "m/s²"),
)
_AXES = (("north", "east", "down"),) * 3 + (("x", "y", "z"),) * 2
ERROR_COLOUR, BAND_COLOUR = "#1d4ed8", "#d6d3d1"
BAND_LABEL = "±3 sd as the filter states"


def write_output_score(
    found: OutputScore, content: Mapping[str, Any], directory: Path, command: str = ""
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
    """
    figure = _drawn(found)
    if figure is not None:
        lay_out(figure)
    files = {} if figure is None else {f"score.{kind}": figure_bytes(figure, kind) for kind in ("png", "svg")}
    pictures = (
        []
        if figure is None
        else [
            Picture(
                "Errors (blue) and the ±3 sd that the filter states (grey), over time, s; right: autocorrelation of "
                "the normalised errors.",
                "score.svg",
                files["score.svg"],
                charts_of_figure(figure),
            )
        ]
    )
    sections: list[tuple[str, Sequence[Table | str], Sequence[Picture]]] = [
        ("Is it consistent?", consistency_tables(found.consistency, found.notes), pictures)
    ]
    if found.causes:
        lines = [line for cause in found.causes for line in (cause_text(cause), change_text(cause))]
        sections.append(("What explains it, and what to change", lines, []))
    if found.states and not found.consistency.diverged:
        sections.append(("State by state", states_table(found.states), []))
    verdict = consistency_verdict(found.consistency)
    title = printable(f"Score of {', '.join(Path(output.name).name for output in found.outputs[:3])}")
    files["report.html"] = write_sections_page(title, sections, command, verdict).encode()
    files["score.json"] = json_text(dict(content) | {MANIFEST: digests(files)}).encode()
    write_set(directory, files, last="score.json")


def _drawn(found: OutputScore) -> Figure | None:
    if found.runs:
        run = found.runs[0]
    else:
        output = found.outputs[0]
        rows = np.flatnonzero(np.isfinite(output.innovation).any(axis=1))
        return _innovation_figure(output.t[rows], output.innovation[rows], output.innovation_covariance[rows])
    known = [i for i in range(5) if np.isfinite(run.error[:, 3 * i]).any()]
    if not known:
        return None
    figure = Figure(figsize=(13.0, 2.1 * len(known)), layout="constrained")
    axes = figure.subplots(len(known), 4, squeeze=False)
    for row, i in zip(axes, known, strict=True):
        for j in range(3):
            _error_panel(row[j], run, i, j)
        _correlation_panel(row[3], run, i)
    _label(axes)
    return figure


def _label(axes: Any) -> None:
    """Say what the axes and the colours of panels over time, and of autocorrelations beside them, are."""
    for panel in axes[:, :3].flat:
        panel.set_xlabel("time, s", fontsize=8)
    axes[0, 0].legend(fontsize=7, framealpha=0.85)


def _error_panel(ax: Axes, run: OutputErrors, block: int, axis: int) -> None:
    factor, unit = _UNITS[block]
    step = math.ceil(len(run) / MAX_DRAWN_EPOCHS)
    t, k = run.t[::step], 3 * block + axis
    sd = 3.0 * factor * np.sqrt(np.maximum(run.covariance[::step, k, k], 0.0))
    ax.fill_between(t, -sd, sd, color=BAND_COLOUR, linewidth=0.0, label=BAND_LABEL)
    ax.plot(t, factor * run.error[::step, k], color=ERROR_COLOUR, linewidth=0.7, label="error")
    for begin, end in run.estimate.outages:
        ax.axvspan(begin, end, color="#fecaca", alpha=0.4, linewidth=0.0)
    ax.set_title(f"{BLOCKS[block].replace('_', ' ')} {_AXES[block][axis]}, {unit}", fontsize=9)
    ax.tick_params(labelsize=7)


def _correlation_panel(ax: Axes, run: OutputErrors, block: int) -> None:
    w = normalized(run)[:, 3 * block : 3 * block + 3]
    good = np.isfinite(w).all(axis=1)
    ax.set_title(f"{BLOCKS[block].replace('_', ' ')}: autocorrelation", fontsize=9)
    ax.set_xlabel("lag, s", fontsize=8)
    ax.tick_params(labelsize=7)
    if np.count_nonzero(good) < 10:
        return
    rho = autocorrelation(w[good])
    half = len(rho) // 2
    ax.plot(float(np.median(np.diff(run.t))) * np.arange(half), rho[:half], color=ERROR_COLOUR, linewidth=0.9)
    ax.axhline(0.0, color="#78716c", linewidth=0.6)


def _innovation_figure(t: FloatArray, z: FloatArray, s: FloatArray) -> Figure:
    """Return innovations in the band of ±3 sd, and their autocorrelation."""
    parts = [i for i in (0, 1) if np.isfinite(z[:, 3 * i]).any()]
    figure = Figure(figsize=(13.0, 2.4 * max(len(parts), 1)), layout="constrained")
    axes = figure.subplots(max(len(parts), 1), 4, squeeze=False)
    for row, i in zip(axes, parts, strict=False):
        sd = np.sqrt(np.einsum("kii->ki", s))
        for j in range(3):
            k = 3 * i + j
            row[j].fill_between(
                t, -3.0 * sd[:, k], 3.0 * sd[:, k], color=BAND_COLOUR, linewidth=0.0, label=BAND_LABEL
            )
            row[j].plot(t, z[:, k], color=ERROR_COLOUR, linewidth=0.7, label="innovation")
            name = "position" if i == 0 else "velocity"
            row[j].set_title(f"{name} innovation {_AXES[0][j]}, {('m', 'm/s')[i]}", fontsize=9)
        w = z[:, 3 * i : 3 * i + 3] / sd[:, 3 * i : 3 * i + 3]
        w = w[np.isfinite(w).all(axis=1)]
        rho = autocorrelation(w)[:60]
        row[3].plot(np.arange(len(rho)), rho, color=ERROR_COLOUR, linewidth=0.9)
        row[3].set_title("autocorrelation", fontsize=9)
        row[3].set_xlabel("lag, fixes", fontsize=8)
    _label(axes)
    return figure
