"""How each type of result is shown: numbers as a data frame, tables, and a figure. One entry a type in `VIEWS`.

`tuner.types.shown` has its methods of results from here; ``--page`` of the commands makes one offline page of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from tuner.consistency.choose_grade import GradeChoice
from tuner.consistency.compare_sensors import SensorComparison
from tuner.consistency.score_drive import DriveResult
from tuner.consistency.score_output import OutputScore
from tuner.diagnosis.drive import ExaminedDrive
from tuner.examination.examine import Examination
from tuner.formats.packages import install
from tuner.identification.static_test_plan import StaticTestPlan
from tuner.invariants import violations
from tuner.report import terminal
from tuner.report.allan_figure import allan_figure
from tuner.report.answer_layout import settings_answer
from tuner.report.claims import Result, claims_of
from tuner.report.consistency_answer import check_answer, consistency_answer
from tuner.report.curve_tables import curve_answer
from tuner.report.diagnosis_answer import diagnosis_answer
from tuner.report.document import Document, document
from tuner.report.drive_diagnosis_figures import drive_figures
from tuner.report.drive_diagnosis_tables import drive_diagnosis_answer
from tuner.report.examination_answer import examination_answer
from tuner.report.figure_files import PAGE_SUFFIXES, Sketch, draw_all, rendered
from tuner.report.fleet_answer import fleet_answer
from tuner.report.fleet_files import fleet_frame
from tuner.report.html_page import tables_html, write_sections_page
from tuner.report.identification_answer import identification_answer
from tuner.report.output_score_tables import output_score_answer
from tuner.report.overlaid_figure import overlaid_figure
from tuner.report.page_parts import Picture, with_room
from tuner.report.result_figures import (
    choice_figure,
    curve_figure,
    drift_figure,
    examination_figure,
    fleet_figure,
    noise_scales_figure,
    plan_figure,
    scores_figure,
    settings_figure,
)
from tuner.report.result_frames import (
    choice_frame,
    comparison_frame,
    consistency_frame,
    curve_frame,
    examination_frame,
    findings_frame,
    identification_frame,
    plan_frame,
    settings_frame,
)
from tuner.report.sensor_answers import choice_answer, comparison_answer, plan_answer
from tuner.report.solution_figures import solution_pictures
from tuner.report.static_diagnosis_figures import finding_figures
from tuner.report.tune_answer import tune_answer
from tuner.tune_result import TuneResult
from tuner.types import (
    AllanCurve,
    Correlogram,
    Diagnosis,
    FilterConfig,
    Identification,
    Spectrum,
)
from tuner.types.consistency import Check, Consistency
from tuner.types.diagnosis import DriveDiagnosis
from tuner.types.fleet import Fleet
from tuner.types.records import DataError, Drive, Record


@dataclass(frozen=True)
class View:
    """How a type is shown.

    Attributes
    ----------
    frame : callable
        Returns its numbers as a data frame.
    index : tuple of str
        Columns of the frame that are the axes of a dataset.
    figure : callable
        Returns its figure.
    caption : str
        What the figure shows.
    answer : callable
        Returns its answer, of which `print` shows what the command does, and notebooks and pages the whole.
    """

    frame: Callable[[Any], pd.DataFrame]
    index: tuple[str, ...]
    figure: Callable[[Any], Figure]
    caption: str
    answer: Callable[[Any], Document]


def view_of(result: object) -> View:
    """Return how a result is shown."""
    return VIEWS[type(result)]


def html_of(result: object) -> str:
    """Return the whole answer of a result for a notebook."""
    return tables_html(view_of(result).answer(result).whole)


def text_of(result: object) -> str:
    """Return the answer of a result, for `print`: options of the command are methods here."""
    found = violations(claims_of(result)) if isinstance(result, Result) else ()
    answer = document(f"Withdrawn: {text}" for text in found) if found else view_of(result).answer(result)
    return terminal.text_of(answer).replace("--verbose", ".to_pandas()")


def dataset_of(result: object) -> Any:
    """Return the numbers of a result as an `xarray.Dataset`; rows that share their place are numbered.

    Raises
    ------
    DataError
        Where xarray is not installed.
    """
    try:
        import xarray
    except ImportError as error:
        raise DataError(f"to_xarray: xarray is not installed: {install('xarray', 'xarray')}") from error
    view = view_of(result)
    frame, index = view.frame(result), list(view.index)
    if frame.duplicated(index).any():
        frame["which"] = frame.groupby(index).cumcount()
        index.append("which")
    return xarray.Dataset.from_dataframe(frame.set_index(index))


@dataclass(frozen=True)
class Part:
    """A part of a page that is not one result: what it says, and its pictures."""

    answer: Document
    pictures: Sequence[Picture]


def page_of(results: Mapping[str, object], title: str, command: str) -> str:
    """Return one offline page of results by their headings: tables and figure of each, and how it is made again.

    What takes long to draw is given as a function that makes its `Part`.
    """
    sections = []
    for heading, result in results.items():
        made = result() if callable(result) else result
        part = made if isinstance(made, Part) else _part_of(made)
        sections.append((heading, part.answer, part.pictures))
    judged = next(
        (r.consistency.honesty for r in results.values() if isinstance(r, Check | DriveResult)), None
    )
    return write_sections_page(title, sections, command, judged)


def _part_of(result: object) -> Part:
    view = view_of(result)
    return pictured(view.answer(result), view.figure(result), view.caption)


def pictured(answer: Document, figure: Figure, caption: str) -> Part:
    """Return an answer and its figure, where that has anything drawn."""
    drawn = any(panel.has_data() for panel in figure.axes)
    return Part(answer, [Picture.of(rendered(figure, "figure"), "figure", caption)] if drawn else [])


def pictures_of_findings(records: Sequence[Record], diagnosis: Diagnosis) -> Part:
    """Return the picture that proves each finding, as many as a page has room for."""
    drawn = _drawn(finding_figures(records, diagnosis))
    shown = with_room(drawn)
    without = "without a picture here, which `tuner tune` draws"
    return Part(document(f"{without}: {one.caption}" for one in drawn if one not in shown), shown)


def pictures_of_drive(examined: ExaminedDrive) -> Part:
    """Return the pictures of the diagnosis of a drive: of each finding first, then of the whole filter."""
    proofs = {finding.text for finding in examined.diagnosis.findings}
    return Part(
        document(()),
        sorted(_drawn(drive_figures(examined)), key=lambda picture: picture.caption not in proofs),
    )


def _drawn(sketches: Sequence[Sketch]) -> list[Picture]:
    """Draw figures, and return them with their captions."""
    files = draw_all([one.files for one in sketches])
    return [Picture.of(files, one.name, one.caption, titled=True) for one in sketches]


SOLUTION_CAPTIONS = {
    "track": "Track of the filter, of the fixes, and of the reference where there is one",
    "errors": "Errors: reference less filter, in bands of ± 3 predicted sds",
    "innovations": "Innovations: fixes less their prediction, in bands of ± 3 predicted sds; ×: refused by the gate",
}


def pictures_of_solution(found: DriveResult, drive: Drive) -> Part:
    """Return the pictures of a filtered drive: track, errors against the reference, innovations."""
    drawn = solution_pictures(found, drive, PAGE_SUFFIXES)
    captions = {name: words for name, words in SOLUTION_CAPTIONS.items() if f"{name}.svg" in drawn}
    return Part(document(()), [Picture.of(drawn, name, words) for name, words in captions.items()])


SCORES_CAPTION = "True rms ÷ predicted sd of each score, with the band in which the filter is consistent"
VIEWS: dict[type, View] = {
    TuneResult: View(
        lambda r: settings_frame(r.config),
        ("axis", "setting"),
        lambda r: allan_figure(r.identification, predictions=r.predictions),
        "Allan deviation: measured, identified terms, and what the settings predict",
        lambda r: tune_answer(r, None),
    ),
    Identification: View(
        identification_frame,
        ("axis", "coefficient"),
        allan_figure,
        "Allan deviation: measured with its 95 % interval, and the identified terms",
        lambda i: identification_answer(str(i.source.get("name", "unnamed")), i),
    ),
    FilterConfig: View(
        settings_frame,
        ("axis", "setting"),
        settings_figure,
        "Allan deviation of the noise that the filter assumes of each axis",
        settings_answer,
    ),
    Diagnosis: View(
        lambda d: findings_frame(d.findings),
        ("finding", "parameter"),
        lambda d: drift_figure(d.findings),
        "Position error of one sensor axis without fixes, with each finding in the samples and without it",
        diagnosis_answer,
    ),
    DriveDiagnosis: View(
        lambda d: findings_frame(d.findings),
        ("finding", "parameter"),
        lambda d: noise_scales_figure(d.noise_scales),
        "Size of each noise setting that the drive shows ÷ that stated, with 95 % intervals: with no cause named, and "
        "with all findings in the filter; 1 is right, arrows are limits",
        drive_diagnosis_answer,
    ),
    Examination: View(
        examination_frame,
        ("repair",),
        examination_figure,
        "By how much the readings of each stream miss the motion of the inertial unit, as recorded and as mended",
        examination_answer,
    ),
    Check: View(
        lambda c: consistency_frame(c.consistency),
        ("score",),
        lambda c: scores_figure(c.consistency.scores),
        SCORES_CAPTION,
        check_answer,
    ),
    DriveResult: View(
        lambda r: consistency_frame(r.consistency),
        ("score",),
        lambda r: scores_figure(r.consistency.scores),
        SCORES_CAPTION,
        lambda r: consistency_answer(r.consistency, r.notes),
    ),
    OutputScore: View(
        lambda s: consistency_frame(s.consistency, s.states),
        ("score",),
        lambda s: scores_figure([*s.consistency.scores, *s.states]),
        SCORES_CAPTION,
        output_score_answer,
    ),
    Consistency: View(
        consistency_frame,
        ("score",),
        lambda c: scores_figure(c.scores),
        SCORES_CAPTION,
        consistency_answer,
    ),
    SensorComparison: View(
        comparison_frame,
        ("axis", "coefficient", "source"),
        lambda c: overlaid_figure(c.noise),
        "Allan deviation of every axis: measured (points, 95 % band, fit), stated (dashed)",
        comparison_answer,
    ),
    GradeChoice: View(
        choice_frame,
        ("grade",),
        choice_figure,
        "Predicted error after the outage, with the limit",
        choice_answer,
    ),
    StaticTestPlan: View(
        plan_frame,
        ("axis", "coefficient"),
        plan_figure,
        "Hours until each term reaches the wanted accuracy, worst axis of each sensor; the line: hours planned",
        plan_answer,
    ),
    Fleet: View(
        fleet_frame,
        ("unit",),
        fleet_figure,
        "Each unit ÷ the median of the fleet, outlying ones named",
        fleet_answer,
    ),
    **{
        kind: View(
            curve_frame,
            ("axis", along),
            curve_figure,
            "The curve with its 95 % interval",
            lambda c: curve_answer([c], c.axes),
        )
        for kind, along in ((AllanCurve, "tau"), (Spectrum, "frequency"), (Correlogram, "lag"))
    },
}
"""Every type of result, with how it is shown."""
