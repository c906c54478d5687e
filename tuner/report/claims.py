"""What a result claims, for the invariants: they are checked before it is printed, drawn or written."""

from __future__ import annotations

import re
from collections.abc import Iterator

import yaml

from tuner.consistency.score_drive import DriveResult
from tuner.consistency.score_output import OutputScore
from tuner.exporters import kalibr
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.customary_units import digits
from tuner.invariants import Claims, Statement, violations
from tuner.judgement import curve_axes, judge_drive, judge_log, judge_noise, lost_shares
from tuner.report.coefficient_text import coefficients_of
from tuner.report.drive_answer import outage_rows
from tuner.report.noise_table import PAIR
from tuner.tune_result import TuneResult
from tuner.types import AppliedNoiseScale, Diagnosis, DriveDiagnosis, FilterConfig, Identification
from tuner.types.consistency import Check, Consistency
from tuner.types.honesty import ratio_text
from tuner.types.records import DataError

Result = (
    TuneResult | Identification | Diagnosis | DriveDiagnosis | Check | DriveResult | OutputScore | Consistency
)
"""What is shown or written."""


def lawful(result: Result) -> None:
    """Refuse a result that violates an invariant.

    Raises
    ------
    DataError
        Its first violation, in one line.
    """
    if found := violations(claims_of(result)):
        raise DataError(
            f"withdrawn, as the answer would contradict itself: {found[0]}; please report the command and its input"
        )


def claims_of(result: Result) -> Claims:
    """Return what a result claims."""
    if isinstance(result, TuneResult):
        return _of_tune(result)
    if isinstance(result, Identification):
        return Claims(judge_noise(result), lost=lost_shares(result), statements=tuple(_identified(result)))
    if isinstance(result, Diagnosis | DriveDiagnosis):
        verdict = judge_drive(result) if isinstance(result, DriveDiagnosis) else judge_log(result)
        left = tuple(one.statistic for one in result.unexplained)
        return Claims(verdict, unexplained=left, names=result.findings)
    found = result if isinstance(result, Consistency) else result.consistency
    return Claims(found.honesty, (found,), errors=_errors(found))


def _of_tune(result: TuneResult) -> Claims:
    scores = [run.consistency for run in (result.check, result.measured) if run is not None]
    diagnoses = [one for one in (result.diagnosis, result.drive and result.drive.diagnosis) if one]
    late = None if result.choice is None else result.choice.after
    return Claims(
        result.verdict,
        tuple(scores),
        tuple(u.statistic for one in diagnoses for u in one.unexplained),
        tuple(finding for one in diagnoses for finding in one.findings),
        {name: known for found in scores for name, known in _errors(found).items()},
        lost_shares(result.identification),
        (
            *_identified(result.identification, curve_axes(result.predictions)),
            *_written(result),
            *_without_fixes(result),
        ),
        tuple(result.exports),
        None if late is None or late.fixes_rms is None else (late.tracking_rms, late.fixes_rms),
    )


def _without_fixes(result: TuneResult) -> Iterator[Statement]:
    """Yield errors without fixes on the drive, as they stand beside the choice of its settings and in its score."""
    if result.choice is None or result.measured is None:
        return
    scored = result.measured.consistency.outages
    for one, (name, size, _, ratio) in zip(scored, outage_rows(result.choice, scored), strict=True):
        scored_ratio = ratio_text(one.score.ratio, one.interval)
        for what, texts in {"error": (size, digits(one.rms)), "÷ predicted": (ratio, scored_ratio)}.items():
            for place, text in zip(("beside the choice", "in the score"), texts, strict=True):
                yield Statement(f"{what}, {name}", place, float(text.split()[0]))


def _errors(found: Consistency) -> dict[str, bool]:
    """Return the figures that an answer calls errors, and whether they are distances to a truth."""
    return {name: found.has_truth for name in found.errors if not name.startswith("nis_")}


def _identified(found: Identification, elsewhere: list[str] | None = None) -> Iterator[Statement]:
    """Yield the coefficients of the terms, but for those of axes whose numbers are the curve's."""
    for axis, channel in found.channels.items():
        if axis in (elsewhere or ()):
            continue
        for (name, number), one in coefficients_of(channel).items():
            if one.value is not None:
                quantity = f"{axis}.identified.{number}.{name}"
                yield Statement(quantity, "identified", one.value, one.interval, one.upper)


def _written(result: TuneResult) -> Iterator[Statement]:
    """Yield what is entered in another filter, as the screen has it from the configuration and as its file has it."""
    yield from inflation_statements(result.config)
    written = yaml.safe_load(result.exports[PAIR]) if PAIR in result.exports else {}
    for sensor, name in {"gyro": "gyroscope", "accel": "accelerometer"}.items():
        if channels := triad(result.config, sensor) if written else ():
            target = kalibr.DIALECT.target(result.config)
            shown = white(channels, "", target), walk(result.config, channels, "", target)
            for key, one in zip((f"{name}_noise_density", f"{name}_random_walk"), shown, strict=True):
                yield Statement(key, "on the screen", one.value)
                yield Statement(key, f"in {PAIR}", written[key])


def inflation_statements(config: FilterConfig) -> Iterator[Statement]:
    """Yield the factors of records with their intervals, and to three digits as their reasons begin with them."""
    for one in config.inflations:
        quantity = f"factor on {one.quantity}"
        if isinstance(one, AppliedNoiseScale):
            yield Statement(quantity, "among the records", one.factor, one.interval)
            stated = re.search(r"× ([0-9.]+(?:e[+-]?[0-9]+)?)", one.reason)
            if stated is not None and one.factor != 1.0:
                yield Statement(f"{quantity} as worded", "in its reason", float(stated[1]))
                yield Statement(f"{quantity} as worded", "in its record", float(f"{one.factor:.3g}"))
