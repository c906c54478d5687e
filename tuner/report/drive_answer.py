"""What a drive changed, for the answer of `tune`: its first findings, and errors before and after in one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from tuner.diagnosis.drive.held_out_gain import change_interval
from tuner.formats.customary_units import digits
from tuner.report.answer_layout import LINE_WIDTH, wrapped

if TYPE_CHECKING:
    from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
    from tuner.types import Finding

SHOWN_FINDINGS = 2
"""Findings of a drive in the answer: what a reader acts on first."""


def finding_lines(findings: Sequence[Finding], choice: HeldOutChoice | None) -> list[str]:
    """Return the clearest findings of a drive, how many more there are, and whether they entered the settings."""
    if not findings:
        return ["On the drive: nothing found that the filter does not expect"]
    entered = choice is None or choice.kept.startswith("with the findings")
    lines = [
        f"On the drive: {one.text}" + (f" → {one.consequence}" if entered else "")
        for one in findings[:SHOWN_FINDINGS]
    ]
    further = len(findings) - SHOWN_FINDINGS
    more = f"{further} more findings of the drive on the page" if further > 0 else ""
    left = (
        "" if entered else "findings are not in the settings: its last 40 % is predicted no better with them"
    )
    if said := "; ".join(part for part in (more, left) if part):
        lines.append(said[:1].upper() + said[1:])
    return lines


def choice_lines(choice: HeldOutChoice) -> list[Table | str]:
    """Return what was kept, and errors with fixes and without them before and after, each change with its interval."""
    before, after = choice.before, choice.after
    if choice.kept == "as it began" or before is None or after is None:
        return [*wrapped(f"After the drive: {choice.note}", 2)]
    factors = "".join(f"; {name.replace('_', ' ')} × {digits(x, 3)}" for name, x in choice.factors.items())
    table = Table(box=None, padding=(0, 2, 0, 0), width=LINE_WIDTH, show_header=False)
    for _ in range(5):
        table.add_column(no_wrap=True)
    table.add_row("position error, rms, m", "before", "after", "change, 95 %", "true ÷ predicted")
    alone = "" if after.fixes_rms is None else f"fixes alone {digits(after.fixes_rms)}"
    table.add_row("with fixes", digits(before.tracking_rms), digits(after.tracking_rms), "", alone)
    ratios = {
        a.seconds: f"{b.ratio:.2f} → {a.ratio:.2f}"
        for b, a in zip(before.outages, after.outages, strict=False)
    }
    for seconds, pairs in choice.outages.items():
        old, new = np.sqrt(pairs.mean(axis=0)).tolist()
        low, high = (_signed(end) for end in change_interval(pairs))
        head = f"after {seconds:.0f} s without ({len(pairs)} times)"
        table.add_row(head, digits(old), digits(new), f"{low} to {high}", ratios.get(seconds, ""))
    return [
        *wrapped(f"After the drive, kept: {choice.kept}{factors}", 2),
        table,
        "Without fixes: the whole drive; with fixes, true ÷ predicted: its last 40 %",
    ]


def _signed(change: float) -> str:
    """Return a change with its sign, to two digits."""
    return ("+" if change > 0.0 else "") + digits(change, 2)
