"""The results of `tune` as a folder of files, as JSON, and as tables for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.table import Table

from tuner.formats.codec import dump
from tuner.formats.configuration import config_json
from tuner.formats.customary_units import digits
from tuner.formats.diagnosis import diagnosis_json
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.formats.identification import identification_json
from tuner.formats.prediction import predictions_json
from tuner.pipeline import CHECK_RUNS, CHECK_TRAJECTORY
from tuner.report.allan_figure import allan_figure
from tuner.report.calibration_text import calibration_lines
from tuner.report.claims import lawful
from tuner.report.consistency_tables import consistency_tables
from tuner.report.figure_files import CHARTS, PAGE_SUFFIXES, Sketch, draw_all, rendered
from tuner.report.html_page import CAPTIONS, write_page
from tuner.report.identification_tables import identification_tables
from tuner.report.json.consistency import consistency_json
from tuner.report.noise_table import states_tables
from tuner.report.page_parts import Picture
from tuner.report.prediction_tables import prediction_tables
from tuner.report.static_diagnosis_figures import finding_figures
from tuner.report.static_diagnosis_tables import diagnosis_tables, hidden_effect_lines
from tuner.synthesis.calibration import calibration_json
from tuner.synthesis.findings import judge_hidden
from tuner.tune_result import TuneResult
from tuner.types import BoundUsed, Enlargement

LAST = "result.json"
"""The file of a set that has the digests of the others."""

Section = tuple[str, Sequence[Table | str]]


def write_tune_result(result: TuneResult, directory: Path, command: str = "") -> None:
    """Write configurations, figures, ``report.html``, ``result.json`` and the key of a simulated log.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    directory : Path
        Made where it does not exist; a set that is there is replaced in one step.
    command : str, optional
        What was typed, for the page.
    """
    lawful(result)
    write_set(directory, tune_files(result, command), last=LAST)


def tune_files(result: TuneResult, command: str = "") -> dict[str, bytes]:
    """Return the content of every file of a result by its name; ``result.json`` has the SHA-256 of the others."""
    found = result.identification
    sketches: list[Sketch] = []
    if result.diagnosis is not None:
        sketches += finding_figures(result.records, result.diagnosis, result.replicas, result.seed)
    if result.drive is not None:
        from tuner.report.drive_diagnosis_figures import drive_figures  # loads the diagnosis of drives

        sketches += drive_figures(result.drive)
    figures: list[Callable[[], Mapping[str, bytes]]] = [one.files for one in sketches]
    if measured := any(channel.allan.tau.size for channel in found.channels.values()):
        figures.insert(0, partial(_allan_files, result))
    drawn = draw_all(figures)
    pictures = [Picture.of(drawn, one.name, one.caption, titled=True) for one in sketches]
    allan = Picture.of(drawn, "allan", CAPTIONS[0]) if measured else None
    files = {name: content for name, content in drawn.items() if not name.endswith(CHARTS)}
    files |= {name: _encoded(text) for name, text in result.exports.items()}
    files["report.html"] = _encoded(write_page(result, pictures, allan, command))
    if result.key is not None:
        files["key.json"] = _encoded(json_text(result.key))
    return files | {LAST: _encoded(json_text({**tune_json(result), MANIFEST: digests(files)}))}


def _allan_files(result: TuneResult) -> dict[str, bytes]:
    stated = {} if result.datasheet is None else result.datasheet.channels
    found, predicted = result.identification, result.predictions
    figure = allan_figure(found, title=result.name, predictions=predicted, stated=stated)
    return rendered(figure, "allan", (".png", *PAGE_SUFFIXES))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", errors="replace")


def tune_json(result: TuneResult) -> dict[str, Any]:
    """Return the result in the form ``tuner.result/1``; parts that were not run stand under ``absent``."""
    content: dict[str, Any] = {
        "schema": "tuner.result/1",
        "verdict": dump(result.verdict),
        "identification": identification_json(result.identification),
    }
    if result.diagnosis is not None:
        content["diagnosis"] = diagnosis_json(result.diagnosis)
        if result.key is not None:
            content["hidden"] = judge_hidden(result.key, result.diagnosis)
    if result.drive is not None:
        content["drive"] = diagnosis_json(result.drive.diagnosis)
    if result.measured is not None:
        content["navigation"] = consistency_json(
            result.measured.consistency,
            source={"drive": result.config.provenance.get("drive"), "config": result.config.name},
            notes=result.measured.notes,
        )
    if result.calibration is not None:
        content["calibration"] = calibration_json(result.calibration)
    if result.check is not None:
        content["consistency"] = consistency_json(
            result.check.consistency,
            source={
                "config": result.config.name,
                "trajectory": CHECK_TRAJECTORY,
                "runs": CHECK_RUNS,
                "seed": result.seed,
            },
            notes=result.check.notes,
        )
    if result.predictions:
        content["prediction"] = predictions_json(result.predictions)
    if result.exports:
        content["config"] = config_json(result.config)
    return {**content, "absent": dict(result.absent), "withheld": dict(result.withheld)}


def tune_sections(result: TuneResult) -> list[Section]:
    """Return the parts of the result beyond noise and configuration, each with its heading."""
    sections: list[Section] = []
    if result.diagnosis is not None:
        judged = [] if result.key is None else judge_hidden(result.key, result.diagnosis)
        content = [*diagnosis_tables(result.diagnosis, result.records), *hidden_effect_lines(judged)]
        sections.append(("Diagnosis: what a simulation of the noise gets wrong", content))
    if result.predictions:
        sections.append(("Does the configuration predict the record?", prediction_tables(result.predictions)))
    if result.calibration is not None:
        sections.append(("Calibration from poses", calibration_lines(result.calibration)))
    if result.drive is not None:
        from tuner.report.drive_diagnosis_tables import drive_tables

        sections.append(("Drive diagnosis", drive_tables(result.drive.diagnosis)))
    if result.measured is not None:
        tables = consistency_tables(result.measured.consistency, result.measured.notes)
        sections.append(("The filter on the measured drive", tables))
    if result.check is not None:
        tables = consistency_tables(result.check.consistency, result.check.notes)
        sections.append(("Consistency of the filter", tables))
    return sections


def tune_tables(result: TuneResult, directory: Path) -> list[Table | str]:
    """Return everything that `tune --verbose` prints: noise, each section, a summary of what is in `directory`."""
    tables = [block for _, content in tune_sections(result) for block in content]
    noise = [
        *identification_tables(result.identification),
        *states_tables(result.config),
    ]
    return [*noise, *tables, *_summary(result, directory)]


def _while(worst: Enlargement) -> str:
    """Return for what part of the record the noise is larger, in words; empty where that is not known."""
    return "" if worst.time_share is None else f" for {digits(100.0 * worst.time_share, 2)} % of the record"


def _summary(result: TuneResult, directory: Path) -> list[str]:
    config = result.config
    lines = [f"  Verdict: {result.verdict.text}"]
    if result.exports:
        lines.append(f"  configuration: {directory / 'noise.yaml'} ({len(config.channels)} channels)")
    bounded = [str(i.quantity) for i in config.inflations if isinstance(i, BoundUsed)]
    if bounded:
        lines.append(f"  only bounded, half of the 95 % limit is used: {', '.join(bounded)}")
    lines += [
        f"  {i.quantity} × {i.factor:.4g}: {i.reason}"
        for i in config.inflations
        if isinstance(i, Enlargement)
    ]
    lines += [
        f"  at its worst {i.quantity} × {i.factor:.4g}{_while(i)}, not in the settings: {i.reason}"
        for i in config.worst_case
    ]
    lines += [f"  {note}" for note in config.notes if note not in result.identification.notes]
    return lines + [f"  no {part}: {reason}" for part, reason in result.absent.items()]
