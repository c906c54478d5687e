"""Noise of the sensors and noise of the fixes wrong at once: expectations with two sizes, fitted in turn.

A score that should be 1 is then E s = s₀ + (θ₁² − 1) a₁ + (θ₂² − 1) a₂. Process noise and noise of fixes act on
different products (innovations one after another, errors after outages), so that two sizes, fitted in turn, soon stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from tuner.consistency.attribution.hypotheses import Fit, Hypothesis
from tuner.types.verdict import ExplanationKind

SENSOR_NOISE = (
    "all sensor noise", "gyro white noise", "accelerometer white noise", "gyro bias noise", "accelerometer bias noise",
    "bias noise of gyros and accelerometers",
)  # fmt: skip
FIX_NOISE = ("position and velocity fixes", "position fixes", "velocity fixes")
FIT_ROUNDS = 3
"""Rounds of fits in turn: each leaves a small share of the change of the one before."""


def pairs(rivals: Sequence[Hypothesis]) -> list[tuple[Hypothesis, Hypothesis]]:
    """Return all pairs of a ratio of sensor noise and one of the noise of fixes."""
    scales = {rival.process: rival for rival in rivals if rival.kind is ExplanationKind.SCALE}
    return [
        (scales[one], scales[other])
        for one in SENSOR_NOISE
        for other in FIX_NOISE
        if one in scales and other in scales
    ]


def beside(one: Hypothesis, other: Hypothesis, size: float) -> Hypothesis:
    """Return a hypothesis beside another one that holds with a known size ln θ."""
    more = other.expected(size) - other.expected(0.0)
    return replace(one, expected=lambda x: one.expected(x) + more)


def fitted_in_turn(
    one: Hypothesis,
    other: Hypothesis,
    fit: Callable[[Hypothesis], Fit],
) -> tuple[Fit, Fit]:
    """Return the fits of two hypotheses that hold together, each beside the other."""
    second = fit(other)
    for _ in range(FIT_ROUNDS):
        first = fit(beside(one, other, second.size))
        second = fit(beside(other, one, first.size))
    return first, second
