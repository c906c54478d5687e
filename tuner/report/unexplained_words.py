"""What no finding explains of a static log, in words: one line for each part of the samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tuner.formats.axis_words import axes_text
from tuner.judgement import ABOUT
from tuner.report.finding_groups import MIN_DRIFT_CHANGE
from tuner.types import Unexplained


def unexplained_lines(unexplained: Sequence[Unexplained]) -> list[str]:
    """Return one line for each part of the samples that is not explained, the largest first."""
    return [line for line, _ in unexplained_parts(unexplained)]


def unexplained_parts(unexplained: Sequence[Unexplained]) -> list[tuple[str, Unexplained]]:
    """Return what is not explained of each part of the samples, in words and where it shows most, the largest first.

    A line says what shows most there, in which axes, where, how much and to what effect, and how many statistics more
    show it. The effect is that on the axis in which it makes most of the drift that the model has, said once an axis.
    """
    parts: list[tuple[str, Unexplained]] = []
    said: set[tuple[str, ...]] = set()
    for about in dict.fromkeys(one.part for one in sorted(unexplained, key=lambda one: -one.nats)):
        tests = [one for one in unexplained if one.part == about]
        axes = list(dict.fromkeys(axis for one in tests for axis in one.channels))
        largest = max(tests, key=lambda one: one.nats)
        felt = max(tests, key=lambda one: max((a / b for a, b in one.drift.values() if b), default=0.0))
        most = f", most in {axes_text(largest.channels)}" if set(axes) > set(largest.channels) else ""
        place = f", {largest.place}" if largest.place else ""
        line = f"{largest.statistic} in {axes_text(axes)}{most}{place}"
        if more := len({one.statistic for one in tests}) - 1:
            line += f"; {more} more statistic{'s' * (more > 1)} of {ABOUT.get(about, about)}"
        if felt.drift and felt.channels not in said:
            where = f" in {axes_text(felt.channels)}" if len(axes) > 1 else ""
            line += f"; {_left_text(felt.drift)}{where}"
            said.add(felt.channels)
        parts.append((line, largest))
    return parts


def _left_text(drift: Mapping[str, tuple[float, float]]) -> str:
    """Return what is left of the drift beside the model, in words: shares, where the axis drifts more than that."""
    parts = [
        f"{100.0 * (seen / model - 1.0):.2g} % more after {after}"
        for after, (seen, model) in drift.items()
        if model > 0.0 and seen >= MIN_DRIFT_CHANGE * model
    ]
    return (
        f"position drifts {', '.join(parts)} than by the model"
        if parts
        else "no more drift than by the model"
    )
