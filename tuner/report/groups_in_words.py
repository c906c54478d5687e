"""Groups of findings in words of an answer: what each does, and which setting it changes."""

from __future__ import annotations

from collections.abc import Mapping

from tuner.report.finding_groups import FindingGroup, drift_text, white_text


def group_in_words(group: FindingGroup) -> str:
    """Return a finding, what it does to white noise and position, and which setting it changes."""
    parts = [
        group.in_motion,
        white_text(group.white),
        drift_text(_most_moved(group.drift)),
        f"changes {_entry(group.changes)}",
    ]
    return f"{group.short[:1].upper()}{group.short[1:]}: " + "; ".join(part for part in parts if part)


def _most_moved(drift: Mapping[str, tuple[float, float]]) -> Mapping[str, tuple[float, float]]:
    """Return the time after which a finding moves the position most; the page has all of them."""
    most = max(drift, key=lambda name: drift[name][0] / max(drift[name][1], 1e-9), default=None)
    return {} if most is None else {most: drift[most]}


def _entry(changes: str) -> str:
    """Return the changed entry without what is said of how it changes."""
    return changes.partition(",")[0].partition(":")[0]
