"""JSON of the scores of any filter's output, in the form ``tuner.consistency/1``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tuner.consistency.score_output import OutputScore
from tuner.formats.codec import dump
from tuner.report.json.consistency import consistency_json
from tuner.report.output_cause_text import cause_name, cause_text, change_text
from tuner.types.output_score import OutputCause


def output_score_json(found: OutputScore, *, source: Mapping[str, Any]) -> dict[str, Any]:
    """Return scores, verdicts, causes, states and offset of the clocks of a filter's output."""
    content = consistency_json(found.consistency, source=source, notes=found.notes)
    content["causes"] = [cause_json(cause) for cause in found.causes]
    without = found.without_constants
    content["without_constants"] = (
        None
        if without is None
        else {"verdict": without.honesty.text, "ratios": {one.name: one.ratio for one in without.scores}}
    )
    content["states"] = {} if found.consistency.diverged else {s.name: dump(s) for s in found.states}
    offset = found.time_offset
    content["time_offset"] = (
        None
        if offset is None
        else {
            "value": offset.value,
            "interval": list(offset.interval),
            "unit": "s",
            "removed": offset.removed,
        }
    )
    return content


def cause_json(cause: OutputCause) -> dict[str, Any]:
    """Return a cause with size, interval and alternatives."""
    return {
        "cause": cause.cause,
        "name": cause_name(cause),
        "size": cause.size,
        "interval": list(cause.interval),
        "unit": cause.unit,
        "gain": cause.gain,
        "constant": cause.constant,
        "parameters": {
            name: {"value": value, "interval": [low, high]}
            for name, (value, low, high) in cause.parameters.items()
        },
        "alternatives": [cause_json(other) for other in cause.alternatives],
        "text": cause_text(cause),
        "change": change_text(cause),
    }
