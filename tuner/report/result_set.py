"""The results of `tune` as a folder of files and as JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from tuner.consistency.score_drive import DriveResult
from tuner.formats.codec import dump
from tuner.formats.configuration import config_json
from tuner.formats.diagnosis import diagnosis_json
from tuner.formats.documents import json_text
from tuner.formats.file_set import MANIFEST, digests, write_set
from tuner.formats.identification import identification_json
from tuner.formats.logs import drive_npz
from tuner.formats.prediction import predictions_json
from tuner.pipeline import CHECK_RUNS, CHECK_TRAJECTORY
from tuner.report.allan_figure import allan_figure
from tuner.report.claims import lawful
from tuner.report.examination_answer import MENDED
from tuner.report.figure_files import CHARTS, PAGE_SUFFIXES, Sketch, draw_all, rendered
from tuner.report.html_page import CAPTIONS, write_page
from tuner.report.json.consistency import consistency_json
from tuner.report.json.examination import examination_json
from tuner.report.page_parts import Picture
from tuner.report.static_diagnosis_figures import finding_figures
from tuner.synthesis.calibration import calibration_json
from tuner.synthesis.findings import judge_hidden
from tuner.tune_result import TuneResult
from tuner.types.consistency import Check

LAST = "result.json"
"""The file of a set that has the digests of the others."""


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
    if result.examination is not None and result.examination.mends:
        files[MENDED] = drive_npz(result.examination.filtered)
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
    config, diagnosis, key = result.config, result.diagnosis, result.key
    parts = {
        "diagnosis": None if diagnosis is None else diagnosis_json(diagnosis),
        "hidden": None if diagnosis is None or key is None else judge_hidden(key, diagnosis),
        "examination": None if result.examination is None else examination_json(result.examination),
        "drive": None if result.drive is None else diagnosis_json(result.drive.diagnosis),
        "navigation": _scores_json(result.measured, drive=config.provenance.get("drive"), config=config.name),
        "run": None if result.run is None else dump(result.run),
        "calibration": None if result.calibration is None else calibration_json(result.calibration),
        "consistency": _scores_json(
            result.check,
            config=config.name,
            trajectory=CHECK_TRAJECTORY,
            runs=CHECK_RUNS,
            seed=result.seed,
        ),
        "prediction": predictions_json(result.predictions) if result.predictions else None,
        "config": config_json(config) if result.exports else None,
    }
    return {
        "schema": "tuner.result/1",
        "verdict": dump(result.verdict),
        "identification": identification_json(result.identification),
        **{name: part for name, part in parts.items() if part is not None},
        "absent": dict(result.absent),
        "withheld": dict(result.withheld),
    }


def _scores_json(run: DriveResult | Check | None, **source: object) -> dict[str, Any] | None:
    """Return the scores of a filter on what `source` names; None where it was not run."""
    return None if run is None else consistency_json(run.consistency, source=source, notes=run.notes)
