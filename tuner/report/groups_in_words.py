"""Groups of findings in words of an answer: what each does, and which setting it changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

from tuner.limits import LOST_SHARE, SHOWN_CHANGE
from tuner.report.finding_groups import (
    SAMPLES_AT_FAULT,
    FindingGroup,
    contradicted,
    drift_text,
    finding_groups,
    white_text,
)
from tuner.types import Finding


def group_in_words(group: FindingGroup) -> str:
    """Return a finding, what it does to white noise and position, and which setting it changes."""
    parts = [
        group.in_motion,
        white_text(group.white),
        drift_text(_most_moved(group.drift)),
        f"changes {_entry(group.changes)}",
    ]
    return f"{group.title[:1].upper()}{group.title[1:]}: " + "; ".join(part for part in parts if part)


def _most_moved(drift: Mapping[str, tuple[float, float]]) -> Mapping[str, tuple[float, float]]:
    """Return the time after which a finding moves the position most; the page has all of them."""
    most = max(drift, key=lambda name: drift[name][0] / max(drift[name][1], 1e-9), default=None)
    return {} if most is None else {most: drift[most]}


def _entry(changes: str) -> str:
    """Return the changed entry without what is said of how it changes."""
    return changes.partition(",")[0].partition(":")[0]


@dataclass(frozen=True)
class FindingsInWords:
    """Findings of a static log, one line a group.

    Attributes
    ----------
    felt : tuple of str
        Those that take motion away or change white noise or drift by `SHOWN_CHANGE`, the most first.
    faults : tuple of str
        Samples at fault to an effect that is not known, or more than `LOST_SHARE` of them.
    idle : tuple of str
        Names of the others.
    refuted : tuple of str
        Names of those that held-out data contradict.
    """

    felt: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    refuted: tuple[str, ...] = ()

    @property
    def doubted(self) -> str:
        """What held-out data do not confirm, in one sentence; empty for nothing."""
        return f"Found, but not confirmed by held-out data: {'; '.join(self.refuted)}" if self.refuted else ""


def findings_in_words(findings: Sequence[Finding], span: float | None) -> FindingsInWords:
    """Return findings of a log of a length, s, by what they change."""
    refuted = [one for one in findings if contradicted(one)]
    groups = finding_groups([one for one in findings if one not in refuted], span)
    felt = [one for one in groups if one.in_motion or one.worth >= log(1.0 + SHOWN_CHANGE)]
    faults = [one for one in groups if one not in felt and _is_fault(one)]
    idle = [one for one in groups if one not in felt and one not in faults]
    return FindingsInWords(
        tuple(map(group_in_words, felt)),
        tuple(map(group_in_words, faults)),
        tuple(one.title for one in idle),
        tuple(one.short for one in finding_groups(refuted, span)),
    )


def _is_fault(group: FindingGroup) -> bool:
    if group.changes != SAMPLES_AT_FAULT:
        return False
    shares = [
        one.parameters["fraction"].value or 0.0 for one in group.findings if "fraction" in one.parameters
    ]
    return not group.drift or max(shares, default=0.0) > LOST_SHARE
