"""Scores of a filter as JSON, schema ``tuner.consistency/1``.

Of a filter that diverged only the verdicts and the share of fixes refused are stored. Verdicts are codes with numbers
under ``verdict_codes``; `tuner.report` adds them as sentences. A number of a verdict that is null is infinite: a ratio
to nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self, TypeAlias

from tuner.formats.codec import dump, stored_form
from tuner.types.consistency import Consistency, Outage, RmsError, Score, Whiteness
from tuner.types.verdict import Explanation, Severity, Verdict, VerdictCode


def scores_json(found: Consistency) -> dict[str, Any]:
    """Return scores and verdicts as plain values."""
    content: dict[str, Any] = dump(found)
    return content


@stored_form(Score)
@dataclass(frozen=True)
class _ScoreForm:
    """A mean square; `ratio` is true rms ÷ predicted sd."""

    name: str
    mean: float
    dof: int
    band: tuple[float, float]
    ratio: float
    effective_dof: float
    consistent: bool
    certain_dof: float | None

    @classmethod
    def of(cls, score: Score, /) -> Self:
        """Return the form of a score."""
        return cls(
            score.name,
            score.mean,
            score.dof,
            score.band,
            score.ratio,
            score.effective,
            score.consistent,
            score.certain,
        )


@stored_form(Whiteness)
@dataclass(frozen=True)
class _WhitenessForm:
    """An autocorrelation and the band of white innovations."""

    part: str
    lag: int
    correlation: float
    band: tuple[float, float]
    consistent: bool

    @classmethod
    def of(cls, white: Whiteness, /) -> Self:
        """Return the form of an autocorrelation."""
        return cls(white.part, white.lag, white.correlation, (-white.band, white.band), white.consistent)


@stored_form(Outage)
@dataclass(frozen=True)
class _OutageForm:
    """Position after some time without fixes; `band` is of the ratio, and so is its 95 % `interval`."""

    seconds: float
    rms_m: float
    predicted_m: float
    ratio: float
    band: tuple[float, float]
    windows: int
    consistent: bool
    score: Score
    interval: tuple[float, float]

    @classmethod
    def of(cls, outage: Outage, /) -> Self:
        """Return the form of an outage."""
        score = outage.score
        low, high = (math.sqrt(limit / score.dof) for limit in score.band)
        return cls(
            outage.seconds,
            outage.rms,
            outage.predicted,
            score.ratio,
            (low, high),
            outage.windows,
            score.consistent,
            score,
            outage.interval,
        )


_Numbers: TypeAlias = float | tuple[float, ...]


@stored_form(Verdict)
@dataclass(frozen=True)
class _VerdictForm:
    """A verdict; `explanations` are the names of those in `explained_by`."""

    code: VerdictCode
    severity: Severity
    subject: str | None
    numbers: Mapping[str, _Numbers]
    explanations: tuple[str, ...]
    explained_by: tuple[Explanation, ...]

    @classmethod
    def of(cls, verdict: Verdict, /) -> Self:
        """Return the form of a verdict."""
        return cls(
            verdict.code,
            verdict.severity,
            verdict.subject or None,
            verdict.numbers,
            tuple(explanation.source for explanation in verdict.explanations),
            verdict.explanations,
        )


@stored_form(Consistency)
@dataclass(frozen=True, kw_only=True)
class _ConsistencyForm:
    """Scores of a filter, by name."""

    schema: Literal["tuner.consistency/1"] = "tuner.consistency/1"
    consistent: bool
    diverged: bool
    verdict_codes: tuple[Verdict, ...]
    nees: Score | None
    blocks: Mapping[str, Score]
    nis: Score | None
    nis_parts: Mapping[str, Score]
    whiteness: Whiteness | None
    outage: tuple[Outage, ...]
    errors: Mapping[str, tuple[float, ...]]
    gated: float

    @classmethod
    def of(cls, found: Consistency, /) -> Self:
        """Return the form of what may be shown of the scores."""
        found = found.shown
        nis = {score.name: score for score in found.nis}
        return cls(
            consistent=found.consistent,
            diverged=found.diverged,
            verdict_codes=found.verdicts,
            nees=found.nees,
            blocks={score.name: score for score in found.blocks},
            nis=nis.pop("nis", None),
            nis_parts=nis,
            whiteness=found.whiteness,
            outage=found.outages,
            errors={_error_key(name, one): one.values for name, one in found.errors.items()},
            gated=found.gated,
        )


def _error_key(name: str, one: RmsError) -> str:
    """Return the stored name of errors: ``position_rms_m``, ``position_innovation_rms_m``, of a state ``name_rms``."""
    if not one.unit:
        return f"{name}_rms"
    what = f"{name.removeprefix('nis_')}_innovation" if name.startswith("nis_") else name
    return f"{what}_rms_{one.unit.replace('/', '_')}"
