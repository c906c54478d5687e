"""Verdicts on a filter from its scores: which speak against it, by how much, and what explains them."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.types.consistency import Consistency, Score
from tuner.types.verdict import Explanation, Severity, Verdict, VerdictCode

NOT_FINITE = (Verdict(VerdictCode.NOT_FINITE, Severity.DIVERGED),)
"""The verdicts on errors of which some are not finite."""


def verdicts(found: Consistency) -> tuple[Verdict, ...]:
    """Return a verdict for each score that speaks against a filter, the largest deviation first; or that none does."""
    if found.diverged:
        return (Verdict(VerdictCode.DIVERGED, Severity.DIVERGED),)
    bad = sorted((s for s in found.scores if not s.consistent), key=_deviation, reverse=True)
    outages: dict[str, dict[str, float | tuple[float, ...]]] = {
        one.score.name: {
            "ratio": one.score.ratio,
            "rms": one.rms,
            "predicted": one.predicted,
            "interval": one.interval,
            "windows": float(one.windows),
        }
        for one in found.outages
    }
    answer = [
        Verdict(
            VerdictCode.OPTIMISTIC if score.ratio > 1.0 else VerdictCode.PESSIMISTIC,
            Severity.INCONSISTENT,
            score.name,
            outages.get(score.name, {"ratio": score.ratio}),
        )
        for score in bad
    ]
    white = found.whiteness
    if white is not None and not white.consistent:
        answer.append(
            Verdict(
                VerdictCode.CORRELATED_INNOVATIONS,
                Severity.INCONSISTENT,
                white.part,
                {"correlation": white.correlation, "lag": white.lag, "band": white.band},
            )
        )
    return tuple(answer) or (Verdict(VerdictCode.CONSISTENT, Severity.CONSISTENT),)


def with_explanations(found: Consistency, explanations: Sequence[Explanation]) -> tuple[Verdict, ...]:
    """Return the explanations of the scores, followed by the verdicts on them.

    Parameters
    ----------
    found : Consistency
        Scores.
    explanations : sequence of Explanation
        From `tuner.consistency.attribution.attribute`, the likeliest first; may be empty.
    """
    answer = verdicts(found)
    if found.consistent:
        return answer
    code = VerdictCode.EXPLAINED if explanations else VerdictCode.NOT_EXPLAINED
    return (Verdict(code, Severity.EXPLANATION, explanations=tuple(explanations)), *answer)


def _deviation(score: Score) -> float:
    return max(score.ratio, 1.0 / score.ratio) if score.ratio > 0.0 else float("inf")
