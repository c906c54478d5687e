"""What nobody needs is not loaded: a command of a static log starts half a second sooner."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("scipy.stats", "statsmodels", "filterpy", "pandas", "tuner.diagnosis.drive", "tuner.external")
FOR_DRIVES = (
    "scipy.interpolate",
    "scipy.optimize",
    "tuner.navigation.drive.run",
    "tuner.consistency.score_drive",
)
FOR_FILTERS = ("tuner.consistency.check", "tuner.consistency.score_drive", "matplotlib")


def test_a_log_is_tuned_and_shown_without_what_only_drives_and_tables_need() -> None:
    code = (
        "import sys, tuner.pipeline, tuner.diagnosis.static.diagnose; "
        f"print(sorted(set({FOR_FILTERS!r}) & set(sys.modules))); "
        f"import tuner.report.result_set; print(sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert found.splitlines() == ["[]", "[]"]


def test_a_filter_is_checked_and_reported_without_what_only_drives_need() -> None:
    code = (
        "import sys, tuner.cli.commands.check, tuner.simulation.load_truth, tuner.consistency.check, "
        "tuner.report.consistency_answer, tuner.report.json.consistency; "
        f"print(sorted(set({FOR_DRIVES!r}) & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert found.strip() == "[]"
