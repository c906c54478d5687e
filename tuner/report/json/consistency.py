"""JSON of a check or a drive, in the form ``tuner.consistency/1``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tuner.consistency.drive import DriveResult
from tuner.consistency.error_budget import blind_spots, table
from tuner.navigation.drive.vehicle_constraints import constraint_counts
from tuner.report.verdict_text import explanation_text, verdict_text
from tuner.types.consistency import (
    Check,
    Consistency,
    ErrorBudget,
    Explanation,
    Observability,
    Score,
    Verdict,
)
from tuner.types.records import Drive


def consistency_json(
    found: Consistency, *, source: Mapping[str, Any], notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return scores, verdicts and errors; of a filter that diverged the verdict only.

    Parameters
    ----------
    found : Consistency
        Scores.
    source : mapping
        What was checked, as plain values.
    notes : sequence of str
        What had to be assumed or repaired.
    """
    found = found.shown
    nis = {s.name: _score(s) for s in found.nis}
    white = found.whiteness
    return {
        "schema": "tuner.consistency/1",
        "source": dict(source),
        "consistent": found.consistent,
        "diverged": found.diverged,
        "verdicts": [verdict_text(verdict) for verdict in found.verdicts],
        "verdict_codes": [_verdict(verdict) for verdict in found.verdicts],
        "nees": None if found.nees is None else _score(found.nees),
        "blocks": {s.name: _score(s) for s in found.blocks},
        "nis": nis.get("nis"),
        "nis_parts": {name: value for name, value in nis.items() if name != "nis"},
        "whiteness": None
        if white is None
        else {
            "part": white.part,
            "lag": white.lag,
            "correlation": white.correlation,
            "band": [-white.band, white.band],
            "consistent": white.consistent,
        },
        "outage": [
            {
                "seconds": outage.seconds,
                "rms_m": outage.rms,
                "predicted_m": outage.predicted,
                "ratio": outage.score.ratio,
                "band": _ratio_band(outage.score),
                "windows": outage.windows,
                "consistent": outage.score.consistent,
            }
            for outage in found.outages
        ],
        "errors": {name: list(values) for name, values in found.errors.items()},
        "gated": found.gated,
        "notes": list(notes),
    }


def explanation_json(explanation: Explanation) -> dict[str, Any]:
    """Return what would explain the scores of a filter, with its size and in words."""
    return {
        "source": explanation.source,
        "ratio": explanation.ratio,
        "interval": list(explanation.interval),
        "misfit": explanation.misfit,
        "text": explanation_text(explanation),
    }


def check_json(found: Check, *, source: Mapping[str, Any], budget: bool) -> dict[str, Any]:
    """Return scores, causes and, where wanted, the error budget of a Monte-Carlo check."""
    content = consistency_json(found.consistency, source=source, notes=found.notes)
    content["causes"] = [explanation_json(explanation) for explanation in found.explanations]
    if budget and found.budget is not None and found.observability is not None:
        content["budget"] = budget_json(found.budget, found.observability)
    return content


def navigation_json(found: DriveResult, drive: Drive, *, notes: Sequence[str], seed: int) -> dict[str, Any]:
    """Return scores of a filter on a measured drive, with its final estimates of constants and its constraints."""
    source = {
        "drive": drive.source,
        "digest": drive.digest,
        "config": found.config.name,
        "states": found.settings.size,
        "fixes": sum(len(stretch.fixes) for stretch in found.stretches),
        "estimates": {
            name: [{"value": value, "sd": sd} for value, sd in values]
            for name, values in found.estimates.items()
        },
        "constraints": {name: vars(one) for name, one in constraint_counts(found.solutions).items()},
        "seed": seed,
    }
    return consistency_json(found.consistency, source=source, notes=notes)


def budget_json(budget: ErrorBudget, seen: Observability) -> dict[str, Any]:
    """Return shares of every source, wrong settings that would not show, and the observability of the states."""
    return {
        "sources": list(budget.sources),
        "shares": {
            case: {
                block: shares[:, i].tolist() for i, block in enumerate(("position", "velocity", "attitude"))
            }
            for case, shares in table(budget)
        },
        "unnoticed": {
            name: {
                "too_small_up_to": small if math.isfinite(small) else None,
                "too_large_up_to": large if math.isfinite(large) else None,
            }
            for name, (small, large) in blind_spots(budget).items()
        },
        "sd_ratio_end_to_start": seen.left,
        "weak_directions": [
            {"states": list(d.states), "parts": list(d.parts), "strength": d.strength} for d in seen.weak
        ],
    }


def _verdict(verdict: Verdict) -> dict[str, Any]:
    """Return code, severity, subject and numbers; None stands for a ratio to nothing."""
    return {
        "code": verdict.code.value,
        "severity": verdict.severity.value,
        "subject": verdict.subject or None,
        "numbers": {name: _plain(value) for name, value in verdict.numbers.items()},
        "explanations": [explanation.source for explanation in verdict.explanations],
    }


def _plain(value: float | tuple[float, ...]) -> float | list[float] | None:
    if isinstance(value, tuple):
        return list(value)
    return value if math.isfinite(value) else None


def _score(score: Score) -> dict[str, Any]:
    return {
        "mean": score.mean,
        "dof": score.dof,
        "band": list(score.band),
        "ratio": score.ratio,
        "effective_dof": score.effective,
        "consistent": score.consistent,
    }


def _ratio_band(score: Score) -> list[float]:
    return [(limit / score.dof) ** 0.5 for limit in score.band]
