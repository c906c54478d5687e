"""The answer of `check`, `navigate` and `score`: verdict, scores, errors, what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tuner.formats.customary_units import digits
from tuner.formats.reference_words import reference_line
from tuner.report.document import Document, document
from tuner.report.verdict_text import verdict_text
from tuner.types.consistency import Consistency, Score
from tuner.types.verdict import Severity

OFF = "*"
"""Mark behind a ratio that is shown to be off 1."""
NAMES = {
    "nees": "all states",
    "gyro_bias": "gyro bias",
    "accel_bias": "accelerometer bias",
    "nis": "innovations",
    "nis_position": "position innovations",
    "nis_velocity": "velocity innovations",
}
"""Scores in an answer, where their names are none."""


def consistency_answer(found: Consistency, notes: Sequence[str] = (), to_do: Sequence[str] = ()) -> Document:
    """Return the verdict on a filter with its reason, its scores and errors, what to do, and notes that have room.

    Parameters
    ----------
    found : Consistency
        Scores of a filter.
    notes : sequence of str, optional
        What was repaired, found and assumed.
    to_do : sequence of str, optional
        What explains the verdict and what to change, and where files are.
    """
    found = found.shown
    said = [f"Verdict: {found.honesty.text}", *reference_line(notes), *explanation_lines(found)]
    said += [*_score_lines(found), *_error_lines(found), *to_do]
    return document(said, [f"Note: {note}" for note in notes], beyond="every score with its band")


def explanation_lines(found: Consistency) -> list[str]:
    """Return why a filter diverged, or which setting explains its scores best; nothing where it is honest."""
    if found.honesty.good:
        return []
    explained = [one for one in found.verdicts if one.severity in (Severity.EXPLANATION, Severity.DIVERGED)]
    texts = [verdict_text(replace(one, explanations=one.explanations[:1])) for one in explained[:2]]
    return [f"{text[:1].upper()}{text[1:]}" for text in texts]


def _score_lines(found: Consistency) -> list[str]:
    """Return true ÷ predicted of every score, and of the outages with their errors."""
    elsewhere = {outage.score.name for outage in found.outages}
    if len(found.nis) > 1:  # the first is of all together
        elsewhere.add(found.nis[0].name)
    parts = [
        f"{NAMES.get(one.name, one.name.replace('_', ' '))} {_ratio(one)}"
        for one in found.scores
        if one.name not in elsewhere
    ]
    white = found.whiteness
    if white is not None and not white.consistent:
        parts.append(f"innovations correlated, {white.correlation:+.2f} at lag {white.lag}")
    lines = []
    if parts:
        mark = f" ({OFF}: off)" if OFF in "".join(parts) else ""
        of = (
            "True ÷ predicted error"
            if found.has_truth
            else "Innovations, and distance to the smoother, ÷ predicted"
        )
        lines.append(f"{of}{mark}: {', '.join(parts)}")
    if found.outages:
        each = (
            f"{one.score.name.removeprefix('outage ')} {digits(one.rms)} ({digits(one.predicted)}) m"
            f"{'' if one.score.consistent else OFF}"
            for one in found.outages
        )
        of = "error" if found.has_truth else "distance to the withheld fixes"
        lines.append(f"Without fixes, {of} (predicted): {', '.join(each)}")
    return lines


def _ratio(score: Score) -> str:
    return f"{digits(score.ratio)}{'' if score.consistent else OFF}"


def _error_lines(found: Consistency) -> list[str]:
    """Return rms errors over all axes, and how many fixes were refused."""
    parts = []
    innovations = all(name.rpartition("_rms_")[0].endswith("_innovation") for name in found.errors)
    for name, values in found.errors.items():
        what, _, unit = f"{name}_".partition("_rms_")
        unit = unit.removesuffix("_")
        size, shown = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, unit.replace("m_s", "m/s"))
        words = what.removesuffix("_innovation") if innovations else what
        parts.append(f"{words.replace('_', ' ')} {digits(size * math.hypot(*values))} {shown}".rstrip())
    gated = [f"{100.0 * found.gated:.2g} % of fixes refused"] if found.gated else []
    errors = (
        [f"{'Distance to the fixes' if innovations else 'Error'}, rms: {', '.join(parts)}"] if parts else []
    )
    return ["; ".join([*errors, *gated])] if errors or gated else []
