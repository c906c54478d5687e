"""JSON of a check, in the form ``tuner.consistency/1``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tuner.consistency.error_budget import blind_spots, table
from tuner.formats.codec import dump
from tuner.formats.consistency import scores_json
from tuner.report.verdict_text import explanation_text, verdict_text
from tuner.types.consistency import Check, Consistency, ErrorBudget, Observability
from tuner.types.verdict import Explanation


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
    content = scores_json(found)
    return {
        "schema": content.pop("schema"),
        "source": dict(source),
        "verdict": dump(found.honesty),
        "verdicts": [verdict_text(verdict) for verdict in found.verdicts],
        **content,
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
        **({} if explanation.beside is None else {"beside": explanation_json(explanation.beside)}),
    }


def check_json(found: Check, *, source: Mapping[str, Any], budget: bool) -> dict[str, Any]:
    """Return scores, causes and, where wanted, the error budget of a Monte-Carlo check."""
    content = consistency_json(found.consistency, source=source, notes=found.notes)
    if found.engines is not None:
        content["engines"] = {**dump(found.engines), "agree": found.engines.agree}
    content["causes"] = [explanation_json(explanation) for explanation in found.explanations]
    if budget and found.budget is not None and found.observability is not None:
        content["budget"] = budget_json(found.budget, found.observability)
    return content


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
