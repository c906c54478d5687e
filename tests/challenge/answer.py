"""Step 2: run the public diagnosis on every log of a folder, without the ground truth.

``python answer.py LOGS ANSWERS`` writes one ``NAME.json`` a log, or a drive where the sheet of a sensor lies
beside it; nothing of the generator is imported.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from tuner.catalogue.datasheet_format import parse_sheet
from tuner.catalogue.grades import grade_identification, parse_gnss
from tuner.diagnosis import diagnose
from tuner.formats.diagnosis import diagnosis_json
from tuner.readers import read
from tuner.readers.drive import read_drive
from tuner.synthesis import synthesize
from tuner.types import Diagnosis, FilterConfig


def answer(path: Path) -> dict[str, Any]:
    """Return the diagnosis of a log or drive as its JSON, with the seconds it took and the error if it broke."""
    sheet = path.with_suffix(".sensor.yaml")
    out: dict[str, Any] = {}
    began, cpu = time.perf_counter(), time.process_time()
    try:
        if sheet.exists():
            from tuner.diagnosis.drive import diagnose_drive

            drive, config = read_drive(path), configured(sheet)
            began, cpu = time.perf_counter(), time.process_time()
            told = diagnose_drive(drive, config)
            out = diagnosis_json(Diagnosis(told.findings, told.unexplained, told.notes))
            for finding in out["findings"]:
                finding["channels"], finding["by_channel"] = ["drive"], {}
        else:
            records, other = read(path, assume="si"), path.with_suffix(".b.npz")
            began, cpu = time.perf_counter(), time.process_time()
            found = (
                diagnose(records, holdout=read(other, assume="si")) if other.exists() else diagnose(records)
            )
            out = diagnosis_json(found)
        out["error"] = None
    except Exception:  # whatever breaks is a result: the scorer counts it
        out |= {"error": traceback.format_exc(limit=-3), "findings": [], "unexplained": [], "notes": []}
    out["seconds"], out["cpu"] = time.perf_counter() - began, time.process_time() - cpu
    return out


def configured(sheet: Path) -> FilterConfig:
    """Return the filter that the sheets of a sensor and of the receiver beside it ask for."""
    receiver = sheet.with_name(sheet.name.replace(".sensor.", ".gnss."))
    grade = parse_sheet(sheet.read_text(encoding="utf-8"), source=str(sheet))
    gnss = parse_gnss(receiver.read_text(encoding="utf-8"), source=str(receiver))
    return synthesize(grade_identification(grade), gnss=gnss)


def main(logs: Path, answers: Path) -> None:
    """Answer every log of a folder that has no answer yet."""
    answers.mkdir(parents=True, exist_ok=True)
    for path in sorted(logs.glob("*.npz")):
        target = answers / f"{path.stem}.json"
        if path.stem.endswith(".b") or target.exists():
            continue
        target.write_text(json.dumps(answer(path)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
