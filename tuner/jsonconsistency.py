"""JSON of a check or a drive, in the form ``tuner.consistency/1``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tuner.budget import Budget, table
from tuner.consistency import Consistency, Score


def consistency_json(
    found: Consistency, *, source: Mapping[str, Any], notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return scores, verdicts and errors.

    Parameters
    ----------
    found : Consistency
        Scores.
    source : mapping
        What was checked, as plain values.
    notes : sequence of str
        What had to be assumed or repaired.
    """
    nis = {s.name: _score(s) for s in found.nis}
    white = found.whiteness
    return {
        "schema": "tuner.consistency/1",
        "source": dict(source),
        "consistent": found.consistent,
        "diverged": found.diverged,
        "verdicts": list(found.verdicts),
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


def budget_json(budget: Budget) -> dict[str, Any]:
    """Return the share of every source in position, velocity and attitude, and sd at the end ÷ at the start."""
    names = ("north", "east", "down")
    titles = ("position", "velocity", "attitude", "gyro_bias", "accel_bias")
    states = [f"{block}_{name}" for block in titles for name in (names if block in titles[:3] else "xyz")]
    return {
        "sources": list(budget.sources),
        "shares": {
            case: {
                block: shares[:, i].tolist() for i, block in enumerate(("position", "velocity", "attitude"))
            }
            for case, shares in table(budget)
        },
        "sd_ratio_end_to_start": dict(zip(states, budget.information.tolist(), strict=True)),
    }


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
