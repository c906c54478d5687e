"""Scores of a filter as JSON, schema ``tuner.consistency/1``.

Of a filter that diverged only the verdicts and the share of fixes refused are stored. Verdicts are codes with numbers
under ``verdict_codes``; `tuner.report` adds them as sentences. A number of a verdict that is null is infinite: a ratio
to nothing.
"""

from __future__ import annotations

import math
from typing import Any

from tuner.formats.codec import dump, store
from tuner.types.consistency import Consistency, Outage, RmsError, Score, Whiteness
from tuner.types.verdict import Verdict


def scores_json(found: Consistency) -> dict[str, Any]:
    """Return scores and verdicts as plain values."""
    content: dict[str, Any] = dump(found)
    return content


def _score(score: Score) -> dict[str, Any]:
    """Return a mean square; `ratio` is true rms ÷ predicted sd."""
    return {
        "name": score.name,
        "mean": score.mean,
        "dof": score.dof,
        "band": score.band,
        "ratio": score.ratio,
        "effective_dof": score.effective,
        "consistent": score.consistent,
        "certain_dof": score.certain,
    }


def _whiteness(white: Whiteness) -> dict[str, Any]:
    """Return an autocorrelation and the band of white innovations."""
    band = (-white.band, white.band)
    return {**vars(white), "band": band, "consistent": white.consistent}


def _outage(outage: Outage) -> dict[str, Any]:
    """Return the position after some time without fixes; `band` is of the ratio, and so is its 95 % `interval`."""
    score = outage.score
    return {
        "seconds": outage.seconds,
        "rms_m": outage.rms,
        "predicted_m": outage.predicted,
        "ratio": score.ratio,
        "band": tuple(math.sqrt(limit / score.dof) for limit in score.band),
        "windows": outage.windows,
        "consistent": score.consistent,
        "score": score,
        "interval": outage.interval,
    }


def _verdict(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict; `explanations` are the names of those in `explained_by`."""
    return {
        "code": verdict.code,
        "severity": verdict.severity,
        "subject": verdict.subject or None,
        "numbers": verdict.numbers,
        "explanations": [explanation.source for explanation in verdict.explanations],
        "explained_by": verdict.explanations,
    }


def _consistency(found: Consistency) -> dict[str, Any]:
    """Return what may be shown of scores, by name."""
    found = found.shown
    nis = {score.name: score for score in found.nis}
    return {
        "schema": "tuner.consistency/1",
        "consistent": found.consistent,
        "diverged": found.diverged,
        "verdict_codes": found.verdicts,
        "nees": found.nees,
        "blocks": {score.name: score for score in found.blocks},
        "nis": nis.pop("nis", None),
        "nis_parts": nis,
        "whiteness": found.whiteness,
        "outage": found.outages,
        "errors": {_error_key(name, one): one.values for name, one in found.errors.items()},
        "gated": found.gated,
    }


def _error_key(name: str, one: RmsError) -> str:
    """Return the stored name of errors: ``position_rms_m``, ``position_innovation_rms_m``, of a state ``name_rms``."""
    if not one.unit:
        return f"{name}_rms"
    what = f"{name.removeprefix('nis_')}_innovation" if name.startswith("nis_") else name
    return f"{what}_rms_{one.unit.replace('/', '_')}"


for _kind, _entries in (
    (Score, _score),
    (Whiteness, _whiteness),
    (Outage, _outage),
    (Verdict, _verdict),
    (Consistency, _consistency),
):
    store(_kind, dump=_entries)
