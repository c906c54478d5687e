"""Groups of findings in words of an answer: what each does, and which setting it changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

from tuner.diagnosis.static.outcome import UNKNOWN
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import percent
from tuner.limits import LOST_SHARE, SHOWN_CHANGE
from tuner.report.document import sentence
from tuner.report.finding_groups import (
    SAMPLES_AT_FAULT,
    FindingGroup,
    contradicted,
    drift_text,
    finding_groups,
    predicts_worse,
    white_text,
)
from tuner.synthesis.findings import LEFT_OUT
from tuner.types import Finding


def group_in_words(group: FindingGroup, *, figures: bool = True) -> str:
    """Return a finding, and what it does."""
    return f"{sentence(group.title)}: {effect_in_words(group, figures=figures)}"


def effect_in_words(group: FindingGroup, *, figures: bool = True) -> str:
    """Return how sure the cause of a finding is, what it does, which setting it changes, and its figures."""
    parts = [
        certainty(group.findings),
        group.in_motion,
        white_text(group.white),
        "" if _left_out(group) else drift_text(_most_moved(group.drift)),
        _entry(group.changes),
    ]
    return f"{'; '.join(part for part in parts if part)}{group.figures * figures}".lstrip()


def _most_moved(drift: Mapping[str, tuple[float, float]]) -> Mapping[str, tuple[float, float]]:
    """Return the time after which a finding moves the position most; the table of all findings has the others."""
    most = max(drift, key=lambda name: drift[name][0] / max(drift[name][1], 1e-9), default=None)
    return {} if most is None else {most: drift[most]}


def certainty(findings: Sequence[Finding]) -> str:
    """Return how sure the cause of findings is, with those that come near: of each axis, or the least of all findings.

    An event that makes held-out data less likely has none.
    """
    said: dict[tuple[str, str], set[str]] = {}
    for one in sorted(findings, key=lambda one: (_share(one), _certainty(one))):
        if not predicts_worse(one):
            said.setdefault(_certainty(one), set()).update(one.channels)
    of_axes = len(said) > 1 and sum(map(len, said.values())) == len(set().union(*said.values()))
    parts = [
        f"{'at least ' * (len(said) > 1 and not of_axes)}{sure}"
        f"{f' in {axes_text(sorted(axes))}' * of_axes}{rivals}"
        for (sure, rivals), axes in [*said.items()][: None if of_axes else 1]
        if sure
    ]
    if worse := sum(map(predicts_worse, findings)):
        number = f"{worse} of {len(findings)} " if worse < len(findings) else ""
        parts.append(f"{number}not confirmed by held-out data")
    return "; ".join(parts)


def _share(finding: Finding) -> float:
    """Return the share of a cause in the weight of all that explain the data."""
    return 1.0 / (1.0 + sum(one.score for one in finding.alternatives))


def _certainty(finding: Finding) -> tuple[str, str]:
    """Return how sure a cause is, and those that come near."""
    share = _share(finding)
    if round(100.0 * share) == 100.0:
        return "certain" if finding.gain is not None and finding.gain.nats > 0.0 else "", ""
    near = (one for one in finding.alternatives if round(100.0 * one.score * share) > 0.0)
    others = ["another cause" if one.cause == UNKNOWN else one.cause.replace("_", " ") for one in near]
    return f"{percent(share)} likely", f"{', else ' * bool(others)}{' or '.join(others)}"


def _entry(changes: str) -> str:
    """Return the changed entry without what is said of how it changes."""
    entry = changes.partition(",")[0].partition(":")[0]
    return "concerns no setting" if entry == "no entry" else f"setting concerned: {entry}"


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
    doubted : str
        What held-out data do not confirm, in one sentence; empty for nothing.
    """

    felt: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    doubted: str = ""


def findings_in_words(
    findings: Sequence[Finding], span: float | None, *, figures: bool = True
) -> FindingsInWords:
    """Return findings of a log of a length, s, by what they change, with or without their figures."""
    refuted = [one for one in findings if contradicted(one)]
    groups = finding_groups([one for one in findings if one not in refuted], span)
    felt = [one for one in groups if changes_much(one)]
    faults = [one for one in groups if one not in felt and _is_fault(one)]
    idle = [one for one in groups if one not in felt and one not in faults]
    names = "; ".join(one.title for one in finding_groups(refuted, span))
    return FindingsInWords(
        tuple(group_in_words(one, figures=figures) for one in felt),
        tuple(group_in_words(one, figures=figures) for one in faults),
        tuple(f"{one.title}{one.figures * figures}" for one in idle),
        f"Found, but not confirmed by held-out data: {names}" if names else "",
    )


def changes_much(group: FindingGroup) -> bool:
    """Return whether findings take motion away, or change white noise or drift by `SHOWN_CHANGE`."""
    return bool(group.in_motion) or _left_out(group) or group.worth >= log(1.0 + SHOWN_CHANGE)


def _left_out(group: FindingGroup) -> bool:
    """Return whether samples of these findings are left out before any noise is judged: no drift shows them."""
    return any(LEFT_OUT in one.extension for one in group.findings)


def _is_fault(group: FindingGroup) -> bool:
    """Return whether samples are at fault, to an unknown effect or more than `LOST_SHARE` of them."""
    shares = (f.parameters["fraction"].value or 0.0 for f in group.findings if "fraction" in f.parameters)
    counts = not group.drift or max(shares, default=0.0) > LOST_SHARE
    return group.changes == SAMPLES_AT_FAULT and counts
