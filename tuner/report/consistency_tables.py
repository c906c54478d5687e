"""Consistency scores and the error budget of a filter: the answer, and beside it each score with its band."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rich.table import Table

from models.filter_states import FILTER_STATES
from tuner.consistency.error_budget import blind_spots
from tuner.consistency.error_budget import table as budget_rows
from tuner.report.consistency_answer import NAMES, consistency_answer
from tuner.report.titled_table import titled_table
from tuner.report.verdict_text import observability_text, verdict_text
from tuner.types.consistency import Check, Consistency, ErrorBudget, Observability, Score
from tuner.types.verdict import VerdictCode

HEADS = ("score", "ratio", "for the filter", "verdict")
"""Of a table of scores."""
IN_THE_TABLE = (VerdictCode.OPTIMISTIC, VerdictCode.PESSIMISTIC, VerdictCode.CORRELATED_INNOVATIONS)
"""Verdicts on one score each, which its row says."""
OFF_WORDS = (
    "optimistic: it errs more than it says; pessimistic: it errs less, or, of innovations, errors of the fixes stay "
    "alike from fix to fix"
)


def score_title(name: str) -> str:
    """Return what a score is of, in words."""
    words = FILTER_STATES[name].meaning if name in FILTER_STATES else name.replace("_", " ")
    return NAMES.get(name, words)


def band_of(score: Score) -> tuple[float, float]:
    """Return the ratios, true rms ÷ predicted sd, that do not speak against the filter."""
    low, high = score.band
    return math.sqrt(low / score.dof), math.sqrt(high / score.dof)


def score_rows(scores: Iterable[Score]) -> list[list[str]]:
    """Return what each score is of, its ratio and band, and what it says where it is off, as `HEADS`."""
    rows = []
    for one in scores:
        low, high = band_of(one)
        said = "" if one.consistent else "optimistic" if one.ratio > 1.0 else "pessimistic"
        rows.append([score_title(one.name), f"{one.ratio:.3f}", f"{low:.2f} … {high:.2f}", said])
    return rows


def consistency_tables(
    found: Consistency, notes: Sequence[str] = (), to_do: Sequence[str] = ()
) -> list[Table | str]:
    """Return the answer, each score with its band, errors by axis, and other verdicts; of one that diverged these."""
    scored = found.shown
    rows = score_rows(scored.scores)
    if (white := scored.whiteness) is not None:
        name = f"correlation of {white.part} innovations, lag {white.lag}"
        said = "" if white.consistent else "correlated"
        rows.append([name, f"{white.correlation:+.3f}", f"±{white.band:.3f}", said])
    windows = (f"{one.score.name} {one.windows}" for one in scored.outages)
    return [
        *consistency_answer(found, notes, to_do).whole,
        *titled_table("true rms ÷ predicted sd (99 % over all scores, 10 % margin)", HEADS, rows),
        *([f"  windows: {', '.join(windows)}"] if scored.outages else []),
        *(f"  {_errors_text(name, each)}" for name, each in scored.errors.items() if len(each) > 1),
        *(f"  {verdict_text(verdict)}" for verdict in scored.verdicts if verdict.code not in IN_THE_TABLE),
        *([] if found.honesty.good else [f"  {OFF_WORDS}"]),
    ]


def consistency_verdict(found: Consistency) -> tuple[bool, str]:
    """Return whether the verdict on a filter is good, and its words."""
    return found.honesty.good, f"Verdict: {found.honesty.text}."


def check_tables(found: Check, *, budget: bool) -> list[Table | str]:
    """Return the tables of a Monte-Carlo check, the error budget before them where wanted."""
    tables = consistency_tables(found.consistency, found.notes)
    if budget and found.budget is not None and found.observability is not None:
        return [*budget_tables(found.budget, found.observability), *tables]
    return tables


def budget_tables(budget: ErrorBudget, seen: Observability) -> list[Table | str]:
    """Return the shares of every source, what is left of the prior, and what stays hidden.

    Shares are per cent of the variances of position, velocity and attitude, aided and without fixes. Beside
    them stands by how much the sd of a source may be wrong before any error leaves the 10 % margin.
    """
    cases, spots = budget_rows(budget), blind_spots(budget)
    rows = []
    for j, name in enumerate(budget.sources):
        small, large = spots[name]
        shares = (" / ".join(f"{100.0 * x:.0f}" for x in part[j]) for _, part in cases)
        rows.append([name, *shares, f"{small:.2g}, {'never' if math.isinf(large) else f'{large:.2g}'}"])
    heads = ["source", *(case for case, _ in cases), "shows where × too small, large"]
    left = ([name, f"{100.0 * value:.3g}"] for name, value in seen.left.items())
    return [
        *titled_table("share of the variance of position / velocity / attitude, %", heads, rows),
        *titled_table("sd after the last fix, % of that at the start", ("state", "%"), left),
        *(f"  {sentence}" for sentence in observability_text(seen)),
    ]


def _errors_text(name: str, values: Sequence[float]) -> str:
    """Return rms errors in words: position_rms_m gives "rms of position: north 0.1, east 0.2, down 0.3 m"."""
    what, _, unit = name.partition("_rms_")
    size, shown = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, unit.replace("m_s", "m/s"))
    parts = (f"{axis} {size * v:.3g}" for axis, v in zip(("north", "east", "down"), values, strict=False))
    return f"rms of {what.replace('_', ' ')}: {', '.join(parts)} {shown}"
