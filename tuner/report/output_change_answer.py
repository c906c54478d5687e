"""The answer of `score --against`: whether a change made the output of a filter worse, row by row."""

from __future__ import annotations

import math

from tuner.consistency.output_comparison import (
    LEAST_COUNT,
    WORSE_CHANCE,
    Difference,
    OutputChange,
    PairedScore,
)
from tuner.consistency.score_output import OutputScore
from tuner.formats.customary_units import digits, percent, range_text
from tuner.report.document import Document, document
from tuner.report.output_score_tables import output_score_answer
from tuner.report.titled_table import titled_table


def output_change_answer(found: OutputChange, after: OutputScore | None) -> Document:
    """Return the verdict on a change, a row a quantity, and the verdict on the later output alone.

    Parameters
    ----------
    found : OutputChange
        What the change made of it.
    after : OutputScore or None
        Scores of the later output; None where it has none.
    """
    alone = [] if after is None else [f"The later output alone: {after.consistency.shown.honesty.text}"]
    more = [] if after is None else list(output_score_answer(after).whole)
    if found.differences:
        differences = ("", "rms of the difference", "largest, sds", "at, s", "sds after ÷ before")
        table = titled_table("", differences, [_difference_row(one) for one in found.differences])
        return document([f"Verdict: {found.verdict.text}", *table])
    heads = ("rms", "before", "after", "after ÷ before", "true ÷ predicted")
    table = titled_table("", heads, [_row(one) for one in found.scores])
    counts = range_text([one.count for one in found.scores], significant=2)
    legend = (
        f"( ): interval of the ratio; of two equal filters {percent(WORSE_CHANCE)} are called worse or better; "
        f"independent epochs: {counts}, {LEAST_COUNT:g} are needed"
    )
    return document(
        [f"Verdict: {found.verdict.text}", *table, legend, *alone],
        more=more,
        beyond="scores of the later output",
    )


def _row(one: PairedScore) -> list[str]:
    """Return the cells of a row."""
    value, low, high = one.error
    return [
        _titled(one),
        *(digits(_factor(one.unit) * rms) for rms in one.rms),
        f"{digits(value)} ({digits(low)} to {digits(high)})" if high < math.inf else digits(value),
        " → ".join(map(digits, one.honesty)),
    ]


def _difference_row(one: Difference) -> list[str]:
    """Return the cells of a row of outputs without a truth."""
    in_sds = [digits(one.largest), digits(one.at), digits(one.sds)] if one.sds == one.sds else ["–"] * 3
    return [_titled(one), digits(_factor(one.unit) * one.rms), *in_sds]


def _titled(one: PairedScore | Difference) -> str:
    """Return what a row is of, with its unit."""
    return f"{one.name.replace('_', ' ')}, {one.unit.replace('rad', 'deg')}"


def _factor(unit: str) -> float:
    """Return the size of a unit in that of its row, angles in degrees."""
    return math.degrees(1.0) if "rad" in unit else 1.0
