"""The files of a fleet: one row a unit as CSV, Parquet and page; spread, grade, JSON."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path

import pandas as pd

from tuner.formats.codec import dump
from tuner.formats.csv_text import as_text, no_formula
from tuner.formats.customary_units import phrase
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.production.fleet import RESULTS
from tuner.production.quantities import SYMBOLS, customary, pretty_unit, title, unit_name
from tuner.production.spread import grade_yaml
from tuner.report.coefficient_text import ends_of
from tuner.report.document import document
from tuner.report.figure_files import figure_bytes
from tuner.report.fleet_answer import (
    fleet_answer,
    frame_table,
    outlier_text,
    reason_of,
    reasons,
    spread_frame,
    verdict_of,
    worst_first,
)
from tuner.report.html_page import write_sections_page
from tuner.report.page_parts import Picture
from tuner.report.result_figures import fleet_figure
from tuner.types import Coefficient
from tuner.types.fleet import Fleet, FleetUnit

NAMES = ("unit", "file")
"""Columns of names: one such as ``+1`` is no number."""
PAGE_SYMBOLS = ("N", "B", "K", "mean")
"""Symbols of the quantities on the page, where a unit has one line; the files have all."""
GRADE = "grade.yaml"
"""The fleet as a built-in sensor."""


def write_fleet(fleet: Fleet, directory: Path) -> list[str]:
    """Write the files of a fleet into a folder, replacing those of an earlier run; return their names."""
    frame = fleet_frame(fleet)
    files = {
        "fleet.csv": _csv(frame),
        "spread.csv": _csv(spread_frame(fleet)),
        "fleet.html": fleet_page(fleet).encode(),
    }
    if importlib.util.find_spec("pyarrow") is not None:
        buffer = io.BytesIO()
        frame.to_parquet(buffer, index=False)
        files["fleet.parquet"] = buffer.getvalue()
    grade = grade_yaml(fleet)
    if grade is not None:
        files[GRADE] = grade.encode()
    files[RESULTS] = json_text(fleet_json(fleet) | {MANIFEST: digests(files)}).encode()
    write_set(directory, files, last=RESULTS)
    return list(files)


def fleet_json(fleet: Fleet) -> dict[str, object]:
    """Return a fleet as plain values; how many units were measured in this run is not a property of the fleet."""
    content: dict[str, object] = dump(fleet)
    content.pop("measured")
    return {"schema": "tuner.fleet/1", **content}


def fleet_frame(fleet: Fleet) -> pd.DataFrame:
    """Return one row a unit, in customary units; of each quantity the value and the ends of its 95 % interval.

    A quantity that a log only bounds has no value, and the bound as the upper end.
    """
    names = dict.fromkeys(q for u in fleet.units if u.measurement for q in u.measurement.quantities)
    rows = []
    for unit in fleet.units:
        one = unit.measurement
        row: dict[str, object] = {
            "unit": unit.name,
            "file": unit.file,
            "verdict": unit.verdict,
            "reason": "; ".join(reasons(unit, fleet)),
            "limits": "; ".join(unit.broken),
            "outlying": "; ".join(outlier_text(o, fleet) for o in unit.outliers),
            "advice": "; ".join(unit.advice),
            "assumed": "" if one is None else "; ".join(one.assumptions),
            "notes": ""
            if one is None
            else "; ".join(note for note in one.notes if note not in one.assumptions),
            "error": unit.error or "",
            "rate [Hz]": None if one is None else one.rate,
            "span [s]": None if one is None else one.span,
            "sha256": "" if one is None else one.digest,
        }
        for name in names:
            row |= _cells(name, None if one is None else one.quantities.get(name), fleet)
        rows.append(row)
    frame = pd.DataFrame(rows)
    numeric = [c for c in frame.columns if c.endswith("]")]
    return frame.astype(dict.fromkeys(numeric, float))


def _cells(name: str, found: Coefficient | None, fleet: Fleet) -> dict[str, object]:
    unit = fleet.channel_units[name.rpartition(".")[0]]
    heads = (title(name), f"{title(name)} low", f"{title(name)} high")
    return {
        f"{head} [{unit_name(name, unit)}]": None if x is None else customary(x, name, unit)
        for head, x in zip(heads, ends_of(found), strict=True)
    }


def fleet_page(fleet: Fleet) -> str:
    """Return the page: the answer with its picture, and one row a unit, verdict and reason first, the worst on top."""
    names = [name for name in fleet.spread if name.rpartition(".")[2] in PAGE_SYMBOLS]
    rows = [
        {"unit": unit.name, "verdict": verdict_of(unit), "reason": reason_of(unit, fleet)}
        | dict(_page_cell(name, unit, fleet) for name in names)
        for unit in worst_first(fleet)
    ]
    drawn = Picture(
        "Each unit ÷ the median of the fleet, outlying ones named",
        "fleet.svg",
        figure_bytes(fleet_figure(fleet), ".svg"),
    )
    return write_sections_page(
        fleet.name,
        [
            ("Summary", fleet_answer(fleet), [drawn] if fleet.spread else []),
            ("Units", document(frame_table(pd.DataFrame(rows))), []),
        ],
    )


def _page_cell(name: str, unit: FleetUnit, fleet: Fleet) -> tuple[str, str]:
    """Return head and cell of a quantity of a unit on the page."""
    channel, _, symbol = name.rpartition(".")
    si = fleet.channel_units[channel]
    found = None if unit.measurement is None else unit.measurement.quantities.get(name)
    cell = "–" if found is None else phrase(found, SYMBOLS[symbol], si, with_unit=False)
    return f"{title(name)}, {pretty_unit(name, si)}", cell


def _csv(frame: pd.DataFrame) -> bytes:
    """Return a table as CSV in which no text, nor the name of a column, is a formula to a spreadsheet."""
    text = frame.select_dtypes(exclude="number").columns
    safe = frame.assign(
        **{name: frame[name].map(as_text if name in NAMES else no_formula) for name in text}
    ).rename(columns=no_formula)
    return str(safe.to_csv(index=False, float_format="%.6g", lineterminator="\n")).encode()
