"""Step 2, analyse: the public diagnosis on every log of a folder, without the key.

``python answer.py LOGS ANSWERS`` writes one ``NAME.json`` a log; nothing of the generator is imported.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from tuner.diagnosis import diagnose
from tuner.jsondiagnosis import diagnosis_json
from tuner.readers import read


def answer(path: Path) -> dict[str, Any]:
    """Return the diagnosis of a log as its JSON, with the seconds it took and the error if it broke."""
    out: dict[str, Any] = {}
    began, cpu = time.perf_counter(), time.process_time()
    try:
        records = read(path)
        began, cpu = time.perf_counter(), time.process_time()
        other = path.with_suffix(".b.npz")
        found = diagnose(records, holdout=read(other)) if other.exists() else diagnose(records)
        out = diagnosis_json(found)
        out["error"] = None
    except Exception:  # whatever breaks is a result: the scorer counts it
        out |= {"error": traceback.format_exc(limit=-3), "findings": [], "unexplained": [], "notes": []}
    out["seconds"], out["cpu"] = time.perf_counter() - began, time.process_time() - cpu
    return out


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
