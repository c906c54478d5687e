"""Verdicts on a filter and what explains them, as English sentences."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from models.filter_states import FILTER_STATES
from tuner.consistency.attribution.installation import CLOCK
from tuner.consistency.attribution.sensitivity import UNMODELLED_TIME_CONSTANT
from tuner.consistency.observability import HARDLY_OBSERVED
from tuner.formats.customary_units import percent
from tuner.formats.outage_words import errors_words
from tuner.types.consistency import ERROR_UNITS, Observability
from tuner.types.honesty import claim_name
from tuner.types.verdict import Explanation, ExplanationKind, Verdict, VerdictCode

_DEGREES_PER_RADIAN = float(np.degrees(1.0))
_UNITS = (
    ("position", 1.0, "m"),
    ("velocity", 1.0, "m/s"),
    ("tilt", _DEGREES_PER_RADIAN, "deg"),
    ("heading", _DEGREES_PER_RADIAN, "deg"),
    ("gyro bias", _DEGREES_PER_RADIAN, "deg/s"),
    ("accelerometer bias", 1.0, "m/s²"),
)
"""How names of states begin, factor from SI and customary unit."""
MAX_RIVALS = 3
"""Rival explanations that a sentence names beside the likeliest: more make it unreadable."""


def verdict_text(verdict: Verdict) -> str:
    """Return a verdict as a sentence."""
    said = VERDICTS[verdict.code]
    if isinstance(said, str):
        return said.format(subject=verdict.subject, **verdict.numbers)
    return said(verdict)


def explanation_text(explanation: Explanation) -> str:
    """Return an explanation of scores, and the same in other words where there are such."""
    words = _explanation(explanation)
    if explanation.beside is not None:
        return f"both {words} and {_explanation(explanation.beside)}"
    other = explanation.equivalent
    return words if other is None else f"{words}, or in other words: {_explanation(other)}"


def observability_text(observability: Observability) -> tuple[str, ...]:
    """Return sentences on states that the trajectory does not distinguish, or hardly shows."""
    left = observability.left
    sentences = []
    for direction in observability.weak:
        names = ", ".join(direction.states[:-1]) + f" and {direction.states[-1]}"
        shares = " and ".join(f"{percent(left[name])}" for name in direction.states)
        sentences.append(
            f"cannot be distinguished on this trajectory: {names} ({shares} of their prior sd left)"
        )
    hardly = [f"{name} ({percent(value)})" for name, value in left.items() if value > HARDLY_OBSERVED]
    if hardly:
        sentences.append(f"hardly better known than at the start: {', '.join(hardly)}")
    return tuple(sentences)


def _start(verdict: Verdict) -> str:
    attitude, gyros = (
        ", ".join(f"{x:.2g}" for x in np.degrees(verdict.numbers[name]))
        for name in ("attitude_sd", "gyro_bias_sd")
    )
    return (
        f"its start (1 sd: attitude {attitude} deg, gyro constants {gyros} deg/s) is more "
        "than a linear filter always recovers from; let the vehicle stand to find the gyro biases first, and give it "
        "what is left of them as constants"
    )


def _far(verdict: Verdict) -> str:
    parts = (
        f"{name}, configured as none"
        if np.isinf(ratio).any()
        else f"{name} {np.max(ratio):.2g} times as large"
        for name, ratio in verdict.numbers.items()
    )
    return f"the simulated errors are far larger than the filter is configured for: {', '.join(parts)}"


def _spurious(verdict: Verdict) -> str:
    factor, unit = next((f, unit) for first, f, unit in _UNITS if verdict.subject.startswith(first))
    own, linear = (
        f"{factor * float(np.max(verdict.numbers[k])):.2g} {unit}" for k in ("filter_sd", "linear_sd")
    )
    return (
        f"the filter takes its own errors for information: its {verdict.subject} has {own} "
        f"(1 sd, while aided), where this motion supports {linear}; its noise "
        "cannot be judged here: simulate turns and changes of speed, or begin with a smaller uncertainty"
    )


def _explained(verdict: Verdict) -> str:
    likeliest, *others = map(explanation_text, verdict.explanations[: MAX_RIVALS + 1])
    rivals = f"; not distinguished from it: {'; '.join(others)}" if others else ""
    return f"{likeliest}: that explains the runs best{rivals}"


def _scored(verdict: Verdict) -> str:
    """Return which score is off, an outage with its errors and how well the windows tell."""
    known = verdict.numbers
    if {"rms", "predicted", "interval", "windows"} <= known.keys():
        rms, predicted, ratio, windows = (
            float(np.max(known[name])) for name in ("rms", "predicted", "ratio", "windows")
        )
        low, high = np.broadcast_to(known["interval"], 2).tolist()
        said = errors_words(rms, predicted, ratio, (low, high), int(windows))
    else:
        said = f"{known['ratio']:.2f} × what the filter predicts"
    return f"{score_title(verdict.subject)}: {said}: {verdict.code.value}"


def score_title(name: str, *, has_truth: bool = True) -> str:
    """Return what a score is of, in words."""
    words = FILTER_STATES[name].meaning if name in FILTER_STATES else claim_name(name, has_truth=has_truth)
    return f"{words}, 3-D" if name in ERROR_UNITS else words


def _explanation(explanation: Explanation) -> str:
    ratio, interval, process = explanation.ratio, explanation.interval, explanation.process
    match explanation.kind:
        case ExplanationKind.SCALE:
            return f"{process} (sd) {_factor(ratio, interval)} too {'small' if ratio > 1.0 else 'large'}"
        case ExplanationKind.TIME_CONSTANT:
            side = "long" if ratio < 1.0 else "short"
            return f"{explanation.source} {_factor(ratio, interval)} too {side}"
        case ExplanationKind.MISSING_CORRELATED:
            return (
                f"errors of the {process} that stay for some {explanation.time_constant:.3g} s are "
                f"missing, about {ratio:.2g} times{_between(*interval)} their white sd"
            )
        case ExplanationKind.INSTALLATION:
            unit = "s" if process == CLOCK else "m"
            return f"the {process} of the truth is {abs(ratio):.3g} {unit} off that of the filter"
    beside, alone = MISSING[explanation.kind]
    if explanation.time_constant is None:
        return f"{process} {alone} is missing"
    size = f"about {ratio:.2g} times{_between(*interval)} as strong"
    return f"{process} {beside} state ({explanation.time_constant:.3g} s) is missing, {size}"


def _factor(ratio: float, interval: tuple[float, float]) -> str:
    """Return a factor, taken above 1, with its interval."""
    low, high = interval if ratio > 1.0 else (1.0 / interval[1], 1.0 / interval[0])
    return f"about {max(ratio, 1.0 / ratio):.2g} times{_between(max(low, 1.0), high)}"


def _between(low: float, high: float) -> str:
    """Return an interval in words, nothing where it is narrower than the digits shown."""
    return "" if f"{low:.2g}" == f"{high:.2g}" else f" ({low:.2g} … {high:.2g})"


OF_SOME = f"of some {UNMODELLED_TIME_CONSTANT:g} s"
MISSING = {
    ExplanationKind.MISSING_SLOWER: ("over decades slower than the slowest", "over decades"),
    ExplanationKind.MISSING_NEXT: ("a decade slower than the slowest", OF_SOME),
    ExplanationKind.MISSING_FASTER: ("a decade faster than the fastest", OF_SOME),
}
"""Where a process is missing: beside a state that the filter has, and in a filter without one."""
VERDICTS: Mapping[VerdictCode, str | Callable[[Verdict], str]] = {
    VerdictCode.DIVERGED: "the filter diverged: its output cannot be used",
    VerdictCode.NOT_FINITE: "the filter diverged: its errors are not finite",
    VerdictCode.RUNS_DIVERGED: (
        "the filter diverged in {diverged_runs} of {runs} runs: its output cannot be used"
    ),
    VerdictCode.FIXES_REFUSED: (
        "the filter diverged and refuses most of its fixes: its output cannot be used"
    ),
    VerdictCode.START_NOT_LINEAR: _start,
    VerdictCode.TRUTH_FAR: _far,
    VerdictCode.SPURIOUS_INFORMATION: _spurious,
    VerdictCode.EXPLAINED: _explained,
    VerdictCode.NOT_EXPLAINED: "no single cause explains the scores",
    VerdictCode.OPTIMISTIC: _scored,
    VerdictCode.PESSIMISTIC: _scored,
    VerdictCode.CORRELATED_INNOVATIONS: (
        "the {subject} innovations are correlated: {correlation:+.2f} at lag {lag}, where white ones stay within "
        "±{band:.2f}"
    ),
    VerdictCode.CONSISTENT: ("no score contradicts the filter: none is shown to be 10 % from its prediction"),
}
"""What each verdict says, with its numbers by their names."""
