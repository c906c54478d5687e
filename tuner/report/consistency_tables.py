"""Consistency scores and the error budget of a filter in tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from models.filter_states import FILTER_STATES
from tuner.consistency.error_budget import blind_spots
from tuner.consistency.error_budget import table as budget_rows
from tuner.formats.customary_units import percent
from tuner.formats.outage_words import outage_words
from tuner.report.verdict_text import observability_text, verdict_text
from tuner.types.consistency import Check, Consistency, ErrorBudget, Observability, Outage, Score
from tuner.types.verdict import Verdict, VerdictCode

_TITLES = {
    "nees": "NEES, all",
    "position": "NEES, position",
    "velocity": "NEES, velocity",
    "attitude": "NEES, attitude",
    "gyro_bias": "NEES, gyro bias",
    "accel_bias": "NEES, accelerometer bias",
    "nis": "NIS, all",
    "nis_position": "NIS, position",
    "nis_velocity": "NIS, velocity",
}


_OPTIMISTIC = "optimistic: it errs more than it says, so nothing downstream may rely on its sds"
_PESSIMISTIC = "pessimistic: it errs less than it says; safe, but it uses its sensors less than it could"
_SMALL_INNOVATIONS = (
    "pessimistic innovations: smaller than predicted, for instance because errors of the fixes stay alike from fix to "
    "fix; they do not show that the filter errs less than it says"
)
_PESSIMISTIC_IN_PART = "pessimistic: of these outputs alone it errs less than it says; others err more"


def score_title(name: str) -> str:
    """Return what a score is of, in words."""
    if name in FILTER_STATES and name not in _TITLES:
        return f"NEES, {FILTER_STATES[name].meaning}"
    return _TITLES.get(name, name)


def consistency_tables(found: Consistency, notes: Sequence[str] = ()) -> list[Table | str]:
    """Return the scores, the errors and the verdicts; of a filter that diverged the verdict only."""
    found = found.shown
    table = Table(title="true rms ÷ predicted sd (99 % over all scores, 10 % margin)")
    table.add_column("score")
    for name in ("ratio", "for the filter", "verdict"):
        table.add_column(name, justify="right")
    for score in found.scores:
        table.add_row(
            score_title(score.name),
            f"{score.ratio:.3f}",
            _band(score),
            "" if score.consistent else "optimistic" if score.ratio > 1.0 else "pessimistic",
        )
    white = found.whiteness
    if white is not None:
        table.add_row(
            f"correlation of {white.part} innovations, lag {white.lag}",
            f"{white.correlation:+.3f}",
            f"±{white.band:.3f}",
            "" if white.consistent else "correlated",
        )
    answer: list[Table | str] = [table] if found.scores else []
    answer += [f"  without fixes for {_outage_text(outage)}" for outage in found.outages]
    answer += [f"  {_errors_text(name, values)}" for name, values in found.errors.items()]
    if found.gated:
        answer.append(f"  fixes refused by the gate: {percent(found.gated)}")
    answer += [f"  note: {note}" for note in notes]
    answer.append(f"Verdict: {found.honesty.text}")
    answer += [f"  {verdict_text(verdict)}" for verdict in found.verdicts]
    return answer + [f"  {text}" for text in meanings(found.verdicts)]


def meanings(verdicts: Sequence[Verdict]) -> list[str]:
    """Return what optimistic and pessimistic scores mean for a user: nothing is safe where any is optimistic."""
    small = [one.subject for one in verdicts if one.code is VerdictCode.PESSIMISTIC]
    if not any(one.code is VerdictCode.OPTIMISTIC for one in verdicts):
        return [_PESSIMISTIC] if small else []
    innovations = [name for name in small if name.startswith("nis")]
    outputs = [_PESSIMISTIC_IN_PART] if len(innovations) < len(small) else []
    return [_OPTIMISTIC, *outputs, *([_SMALL_INNOVATIONS] if innovations else [])]


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
    rows, spots = budget_rows(budget), blind_spots(budget)
    shares = Table(title="share of the variance of position / velocity / attitude, %")
    shares.add_column("source")
    for case, _ in rows:
        shares.add_column(case, justify="right")
    shares.add_column("shows where × too small, large", justify="right")
    for j, name in enumerate(budget.sources):
        small, large = spots[name]
        cells = (" / ".join(f"{100.0 * x:.0f}" for x in part[j]) for _, part in rows)
        shares.add_row(name, *cells, f"{small:.2g}, {'never' if math.isinf(large) else f'{large:.2g}'}")
    left = Table(title="sd after the last fix, % of that at the start")
    left.add_column("state")
    left.add_column("%", justify="right")
    for name, value in seen.left.items():
        left.add_row(name, f"{100.0 * value:.3g}")
    return [shares, left, *(f"  {sentence}" for sentence in observability_text(seen))]


def _outage_text(found: Outage) -> str:
    """Return errors after some time without fixes, their prediction, and how well the windows tell the ratio."""
    return outage_words(
        found.seconds, found.rms, found.predicted, found.score.ratio, found.interval, found.windows
    )


def _errors_text(name: str, values: Sequence[float]) -> str:
    """Return rms errors in words: position_rms_m gives "rms of position: north 0.1, east 0.2, down 0.3 m"."""
    what, _, unit = name.partition("_rms_")
    size, shown = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, unit.replace("m_s", "m/s"))
    parts = (f"{axis} {size * v:.3g}" for axis, v in zip(("north", "east", "down"), values, strict=False))
    return f"rms of {what.replace('_', ' ')}: {', '.join(parts)} {shown}"


def _band(score: Score) -> str:
    low, high = ((limit / score.dof) ** 0.5 for limit in score.band)
    return f"{low:.2f} … {high:.2f}"
