"""What `tuner diagnose` says of whole static recordings, and what the findings change.

    TUNER_DATA=FOLDER python benchmarks/findings.py [NAME …]

A row a recording below FOLDER/static: single findings, their groups, those groups that move no position, findings that
held-out data contradict, processor time with all children, and below it what changes the position.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tuner import diagnose
from tuner.readers import read
from tuner.report.finding_groups import contradicted, drift_text, finding_groups
from tuner.types import Diagnosis
from tuner.types.records import DataError

OPTIONS = {"stim300_static": {"rate": 125.0}}
"""What a file does not state of itself."""


def processor_time() -> float:
    """Return the processor time of this process and its finished children, s."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def main() -> None:
    """Print the table."""
    folder = Path(os.environ.get("TUNER_DATA", "")) / "static"
    if not folder.is_dir():
        sys.exit("TUNER_DATA: expected a folder with recordings in 'static', found none")
    print("| recording | single findings | groups | of these move no position | contradicted | s |")
    print("|---|---|---|---|---|---|")
    for path in sorted(folder.glob("*.npz")):
        if sys.argv[1:] and path.stem not in sys.argv[1:]:
            continue
        start = processor_time()
        try:
            records = read(path, **OPTIONS.get(path.stem, {}))
            found = diagnose(records)
        except DataError as error:
            print(f"{path.stem}: left out: {error}")
            continue
        assert isinstance(found, Diagnosis)
        span = max(record.span for record in records)
        good = [one for one in found.findings if not contradicted(one)]
        groups = finding_groups(good, span)
        idle = [group for group in groups if not group.matters]
        print(
            f"| {path.stem} | {len(found.findings)} | {len(groups)} | {len(idle)} | {len(found.findings) - len(good)} "
            f"| {processor_time() - start:.0f} |"
        )
        for group in groups:
            if group.matters:
                print(f"  {group.title}; {drift_text(group.drift)}; changes {group.changes}")
        print(f"  no position: {'; '.join(group.title for group in idle)}", flush=True)


if __name__ == "__main__":
    main()
