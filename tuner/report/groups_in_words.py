"""Groups of findings in words of an answer: what each does, and which setting it changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tuner.report.finding_groups import FindingGroup, drift_text, way_texts
from tuner.report.terminal import LINE_WIDTH


def group_in_words(group: FindingGroup) -> str:
    """Return a finding, what it does to the position, and which setting it changes."""
    parts = [group.in_motion, drift_text(_most_moved(group.drift)), f"changes {_entry(group.changes)}"]
    return f"{group.short[:1].upper()}{group.short[1:]}: " + "; ".join(part for part in parts if part)


def groups_in_short(groups: Sequence[FindingGroup]) -> str:
    """Return findings and how far they move the position: ``1000 s drift: step accel z 2557→684 m; …``."""
    moved = [_most_moved(one.drift) if one.worth > 0.0 and not one.in_motion else {} for one in groups]
    names = {name for one in moved for name in one}
    alike = len(names) == 1 and all(moved)
    parts = []
    for group, one in zip(groups, moved, strict=True):
        does = f": {group.in_motion or f'changes {_entry(group.changes)}'}"
        for name, pair in one.items():
            does = " " if alike else f": {name} drift "
            does += "→".join(way_texts(*pair))
        parts.append(f"{group.short.replace(' in ', ' ', 1)}{does}")
    text = "; ".join(parts)
    if groups[0].in_motion and len(groups) == 1 and len(text) > LINE_WIDTH:
        text = groups[0].in_motion
    return f"{names.pop()} drift: {text}" if alike else f"{text[:1].upper()}{text[1:]}"


def _most_moved(drift: Mapping[str, tuple[float, float]]) -> Mapping[str, tuple[float, float]]:
    """Return the time after which a finding moves the position most; the page has all of them."""
    most = max(drift, key=lambda name: drift[name][0] / max(drift[name][1], 1e-9), default=None)
    return {} if most is None else {most: drift[most]}


def _entry(changes: str) -> str:
    """Return the changed entry without what is said of how it changes."""
    return changes.partition(",")[0].partition(":")[0]
