"""Scores of a filter for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from tuner.budget import Budget
from tuner.budget import table as budget_rows
from tuner.consistency import Consistency, Score

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


def consistency_tables(found: Consistency, notes: Sequence[str] = ()) -> list[Table | str]:
    """Return the scores, the errors and the verdicts."""
    table = Table(title="true rms ÷ predicted sd (99 % over all scores, 10 % margin)")
    table.add_column("score")
    for name in ("ratio", "for the filter", "rms", "predicted", "verdict"):
        table.add_column(name, justify="right")
    metres = {outage.score.name: (outage.rms, outage.predicted) for outage in found.outages}
    for score in found.scores:
        rms, predicted = metres.get(score.name, (None, None))
        table.add_row(
            _TITLES.get(score.name, score.name),
            f"{score.ratio:.3f}",
            _band(score),
            "" if rms is None else f"{rms:.3g} m",
            "" if predicted is None else f"{predicted:.3g} m",
            "" if score.consistent else "optimistic" if score.ratio > 1.0 else "pessimistic",
        )
    white = found.whiteness
    if white is not None:
        table.add_row(
            f"correlation of {white.part} innovations, lag {white.lag}",
            f"{white.correlation:+.3f}",
            f"±{white.band:.3f}",
            "",
            "",
            "" if white.consistent else "correlated",
        )
    answer: list[Table | str] = [table]
    answer += [f"  {name}: {', '.join(f'{v:.3g}' for v in values)}" for name, values in found.errors.items()]
    if found.gated:
        answer.append(f"  fixes refused by the gate: {100.0 * found.gated:.2g} %")
    answer += [f"  note: {note}" for note in notes]
    answer.append("consistent" if found.consistent else "NOT consistent")
    answer += [f"  {sentence}" for sentence in found.verdicts]
    return answer


def budget_table(budget: Budget) -> Table:
    """Return the share of every source in per cent: position, velocity, attitude, aided and without fixes."""
    rows = budget_rows(budget)
    view = Table(title="share of the variance of position / velocity / attitude, %")
    view.add_column("source")
    for case, _ in rows:
        view.add_column(case, justify="right")
    for j, name in enumerate(budget.sources):
        view.add_row(name, *(" / ".join(f"{100.0 * x:.0f}" for x in shares[j]) for _, shares in rows))
    return view


def _band(score: Score) -> str:
    low, high = ((limit / score.dof) ** 0.5 for limit in score.band)
    return f"{low:.2f} … {high:.2f}"
