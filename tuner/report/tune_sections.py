"""What `tune` found beside the answer, part by part: for ``--verbose`` and for the page."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, term_title
from tuner.formats.grouping import gathered
from tuner.report.calibration_text import calibration_lines
from tuner.report.consistency_answer import consistency_answer
from tuner.report.pose_run_answer import growth_table, pose_run_lines
from tuner.report.prediction_tables import prediction_tables
from tuner.tune_result import TuneResult

Section = tuple[str, str, Sequence[Table | str]]
"""Name of a part, its heading and its content."""


def tune_sections(result: TuneResult) -> list[Section]:
    """Return prediction, calibration, drive and checks, those that there are."""
    measured, check = (
        () if run is None else consistency_answer(run.consistency, run.notes).whole
        for run in (result.measured, result.check)
    )
    drive: Sequence[Table | str] = ()
    if result.drive is not None:
        from tuner.report.drive_diagnosis_tables import (
            drive_diagnosis_answer,
        )  # loads the diagnosis of drives

        drive = drive_diagnosis_answer(result.drive.diagnosis).whole
    sections: list[Section] = [
        ("prediction", "Does it predict the log?", prediction_tables(result.predictions)),
        (
            "calibration",
            "Calibration",
            [] if result.calibration is None else calibration_lines(result.calibration),
        ),
        (
            "run",
            "The run beside poses",
            [] if result.run is None else [*pose_run_lines(result.run), growth_table(result.run)],
        ),
        ("measured", "The filter on the measured drive", measured),
        ("drive", "The drive", drive),
        ("check", "Filter check: simulated", check),
    ]
    return [(at, heading, [_of_part(one) for one in content]) for at, heading, content in sections if content]


def _of_part(one: Table | str) -> Table | str:
    """Return a line that is no verdict on the settings: an answer has one."""
    return one.replace("Verdict: ", "This part alone: ") if isinstance(one, str) else one


def setting_reasons(result: TuneResult) -> list[str]:
    """Return how each noise term is represented, every enlargement with its reason, and where initial sds are from."""
    config = result.config
    handling = gathered(
        (f"{term_title(name) or name}: {how}", channel.axis)
        for channel in config.channels.values()
        for name, how in channel.handling.items()
    )
    worst = (
        (one, "" if one.time_share is None else f" for {digits(100.0 * one.time_share, 2)} % of the record")
        for one in config.worst_case
    )
    return [
        *(f"{text} [{axes_text(axes)}]" for text, axes in handling.items()),
        *(f"{one.quantity} × {one.factor:.4g}: {one.reason}" for one in config.inflations),
        *(
            f"at its worst {one.quantity} × {one.factor:.4g}{share}, not in the settings: {one.reason}"
            for one, share in worst
        ),
        *(f"{name}: {reason}" for name, reason in config.initial.reasons.items()),
    ]
