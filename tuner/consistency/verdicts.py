"""Scores in words: what is wrong with a filter, by how much, and what explains it."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.consistency.attribution import Cause
from tuner.consistency.scores import Consistency, Score

_WHAT = {
    "nees": "the errors of all states together",
    "position": "the position error",
    "velocity": "the velocity error",
    "attitude": "the attitude error",
    "gyro_bias": "the error of the gyro biases",
    "accel_bias": "the error of the accelerometer biases",
    "nis": "the innovations",
    "nis_position": "the position innovations",
    "nis_velocity": "the velocity innovations",
}


def verdicts(found: Consistency) -> tuple[str, ...]:
    """Return a sentence for each thing that speaks against a filter, the gravest first; or that none does."""
    if found.diverged:
        return ("the filter diverged: nothing it says can be used",)
    bad = sorted((s for s in found.scores if not s.consistent), key=_gravity, reverse=True)
    sentences = [_sentence(score) for score in bad]
    white = found.whiteness
    if white is not None and not white.consistent:
        sentences.append(
            f"the {white.part} innovations are correlated: {white.correlation:+.2f} at lag {white.lag}, "
            f"where white ones stay within ±{white.band:.2f}"
        )
    return tuple(sentences) or (
        "nothing speaks against the filter: no score is shown to be 10 % from honest",
    )


def explained(found: Consistency, causes: Sequence[Cause]) -> tuple[str, ...]:
    """Return the verdicts with, before them, the source that explains them.

    Parameters
    ----------
    found : Consistency
        Scores.
    causes : sequence of Cause
        From `tuner.consistency.attribution.attribute`, best first; may be empty.
    """
    sentences = verdicts(found)
    if found.consistent:
        return sentences
    if not causes:
        return ("no single cause explains the scores", *sentences)
    reason = f"{causes[0].text}: that explains the runs best"
    if len(causes) > 1:
        reason += "; not told from it: " + "; ".join(cause.text for cause in causes[1:4])
    return (reason, *sentences)


def _gravity(score: Score) -> float:
    return max(score.ratio, 1.0 / score.ratio) if score.ratio > 0.0 else float("inf")


def _sentence(score: Score) -> str:
    what = _WHAT.get(score.name)
    if what is None:
        what = f"the position error after {score.name.removeprefix('outage ')} without fixes"
    verb = "are" if what.endswith(("innovations", "together")) else "is"
    side = "optimistic" if score.ratio > 1.0 else "pessimistic"
    return f"{what} {verb} {score.ratio:.2f} × what the filter predicts: {side}"
