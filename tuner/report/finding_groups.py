"""Findings that call for one action in one group, ranked by the drift of position or the white noise that they cause.

One group a cause and sensor; events whose times agree are one, whatever they are called in each axis; lines at
multiples of one spacing are a comb. A filter that takes motion away comes first: a log at rest does not show what that
costs. Findings that make held-out data less likely are grouped by themselves. Every finding stands, complete, in
``result.json``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from models.effects import EFFECTS
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import amount, digits, range_text
from tuner.formats.grouping import gathered, grouped
from tuner.formats.parameter_words import parameter_words
from tuner.synthesis.findings import EVENTS
from tuner.types import Coefficient, Finding
from tuner.types.coefficient import apart

MIN_DRIFT_CHANGE = 1.01
"""Drift or white noise with ÷ without a cause from which it is reported; noise makes a hundred times what is below."""
LEAST_WHITE_SHARE = 0.1
"""Ratio of two white densities below which one sum of terms has its white noise in another term: no comparison."""
KILOMETRES_FROM = 1e4
"""Position error from which it is stated in kilometres, m."""
MIN_COMB_LINES = 3
"""Lines that can show a common spacing."""
MIN_COMB_SPACING = 1e-3
"""Spacing ÷ highest frequency of a comb: closer lines are one line whose frequency wanders."""
COMB_TOLERANCE = 0.02
"""Largest distance of a line of a comb from a multiple of its spacing ÷ spacing; lines at random places are within it
in one of 25 cases each."""
SIMULTANEOUS_WITHIN = 5.0
"""Seconds between events that are one: longer than the edges of an event are uncertain, shorter than most bursts."""
SAMPLES_AT_FAULT = "no entry: the samples themselves are at fault"
"""What a cause changes that no setting can make up for: spikes, motion, rails, stamps."""
OSCILLATION = "no entry: an oscillation leaves no error that grows with time"
LASTING = ("thermal", "attitude")
"""Causes without one effect of their own that are compensated, as those whose effect is a signal are."""


@dataclass(frozen=True)
class FindingGroup:
    """Findings that call for one action.

    Attributes
    ----------
    title : str
        Causes, axes and number, in words.
    figures : str
        Parameters of each cause, those in which axes or findings differ as a range.
    findings : tuple of Finding
        All of them.
    changes : str
        Entry of the configuration that they change, in words.
    drift : mapping of str to (float, float)
        Position error, m, after so long without fixes, with and without the one that moves it most.
    white : float
        White noise with them ÷ without, of the axis where it differs most; 1 where nothing is known of it.
    """

    title: str
    figures: str
    findings: tuple[Finding, ...]
    changes: str
    drift: Mapping[str, tuple[float, float]]
    white: float = 1.0

    @property
    def worth(self) -> float:
        """Logarithm of the largest ratio of drift or white noise with and without it."""
        drifts = (log(a / b) if b > 0.0 else log(1e3) for a, b in self.drift.values() if a > 0.0)
        return max(abs(log(self.white)), *drifts, 0.0)

    @property
    def in_motion(self) -> str:
        """What it does to samples in motion, in words, that of the clearest finding; empty for nothing known."""
        return next((one.in_motion for one in self.findings if one.in_motion), "")


def predicts_worse(finding: Finding) -> bool:
    """Return whether a cause makes held-out data less likely."""
    return finding.gain is not None and finding.gain.contradicts


def contradicted(finding: Finding) -> bool:
    """Return whether held-out data contradict a cause; they do not show an event of another part of the log."""
    declared = CAUSES.get(finding.cause)
    return predicts_worse(finding) and not (declared is not None and declared.happens_once)


def finding_groups(findings: Sequence[Finding], span: float | None = None) -> tuple[FindingGroup, ...]:
    """Return the findings in groups: those first that take motion away, then those that move the position most.

    Parameters
    ----------
    findings : sequence of Finding
        Of a static log, without those that held-out data contradict.
    span : float, optional
        Length of the log, s, for the share of events in it.
    """
    at_once = grouped(findings, lambda event, one: all(_simultaneous(each, one) for each in event))
    together = grouped(at_once, lambda group, event: _belong_together(group[0], event))
    groups = [_group(group, span) for group in together]
    return tuple(sorted(groups, key=lambda group: (not group.in_motion, -round(group.worth, 2))))


def _simultaneous(a: Finding, b: Finding) -> bool:
    """Return whether two findings are events whose times agree, within their intervals too, as do their lengths."""
    when, other = _time(a), _time(b)
    if when is None or other is None or when.value is None or other.value is None:
        return False
    lengths = (one.parameters.get("duration") for one in (a, b))
    return abs(when.value - other.value) <= SIMULTANEOUS_WITHIN and not (
        apart(when, other) or apart(*lengths)
    )


def _belong_together(a: Sequence[Finding], b: Sequence[Finding]) -> bool:
    alike = len({one.cause for one in (*a, *b)}) == 1
    return alike and (_sensors(a) == _sensors(b) or all(one.in_motion for one in (*a, *b)))


def _sensors(findings: Sequence[Finding]) -> frozenset[str]:
    return frozenset(axis.rpartition("_")[0] or axis for one in findings for axis in one.channels)


def event_time(finding: Finding) -> float | None:
    """Return when an event was, s; None for what lasts."""
    found = _time(finding)
    return None if found is None else found.value


def _time(finding: Finding) -> Coefficient | None:
    return finding.parameters.get("time") or finding.parameters.get("start")


def _group(events: Sequence[Sequence[Finding]], span: float | None) -> FindingGroup:
    findings = tuple(finding for event in events for finding in event)
    causes = list(dict.fromkeys(finding.cause for finding in findings))
    axes = list(dict.fromkeys(axis for finding in findings for axis in finding.channels))
    largest = max(findings, key=lambda one: max((a - b for a, b in one.drift.values()), default=0.0))
    what = f"{' and '.join(causes).replace('_', ' ')} in {axes_text(axes)}"
    title = ": ".join(filter(None, (what, _count(findings, len(events), span))))
    said = [_ranges([one for one in findings if one.cause == cause]) for cause in causes]
    if len(causes) > 1:
        said = [f"{cause.replace('_', ' ')}: {text}" for cause, text in zip(causes, said, strict=True)]
    figures = f" ({'; '.join(said)})" if any(said) else ""
    return FindingGroup(
        title, figures, findings, changed_entry(causes[0]), largest.drift, _white_ratio(findings, span)
    )


def _white_ratio(findings: tuple[Finding, ...], span: float | None) -> float:
    """Return white noise with findings ÷ without: as fits without them state it, of events by variance and time."""
    ratios = [
        before / after
        for one in findings
        if one.gain is not None
        for name, (before, after) in one.gain.user.items()
        if name.startswith("white_density") and min(before, after) > LEAST_WHITE_SHARE * max(before, after)
    ]
    more: dict[str, float] = {}
    for event, axis in ((one, axis) for one in findings for axis in one.channels):
        found = event.by_channel.get(axis, event.parameters)
        if span and {"variance_ratio", "duration"} <= found.keys():
            larger = (found["variance_ratio"].value or 1.0) - 1.0
            more[axis] = more.get(axis, 0.0) + larger * min((found["duration"].value or 0.0) / span, 1.0)
    ratios += [(1.0 + one) ** 0.5 for one in more.values()]
    return max(ratios, key=lambda ratio: abs(log(ratio)), default=1.0)


def _ranges(findings: Sequence[Finding]) -> str:
    """Return the parameters of a cause: one number where findings and axes share it, else the range of each unit."""
    said = []
    for name, words in parameter_words(findings[0].figures).items():
        own = [one for one in findings if name in one.figures]
        each = [c for one in own for c in one.of_each(name).values() or [one.parameters[name]]]
        values = gathered((one.unit, one.value or 0.0) for one in each)
        ranges = " and ".join(range_text(of_unit, unit) for unit, of_unit in values.items())
        said.append(f"{words} {ranges if len(each) > 1 else amount(each[0])}")
    return ", ".join(said)


def _count(findings: tuple[Finding, ...], events: int, span: float | None) -> str:
    """Say how many there are, with their share of the time or their spacing; nothing of a single one."""
    times = [when for finding in findings if (when := event_time(finding)) is not None]
    if events == 1 and len(times) > 1:
        return f"one event at {digits(min(times))} s"
    counted = findings[0].parameters if len(findings) == 1 else {}
    if "time_in_motion" in counted:
        number, moved = (counted[name].value or 0.0 for name in ("count", "time_in_motion"))
        return f"{number:.0f} events{_share(moved, span)}"
    if times and events > 1:
        lasting = _union(
            (event_time(f) or 0.0, f.parameters["duration"].value or 0.0)
            for f in findings
            if "duration" in f.parameters
        )
        return f"{events} events{_share(lasting, span)}"
    lines = sorted({f.parameters["frequency"].value or 0.0 for f in findings if "frequency" in f.parameters})
    if len(lines) > 1:
        spacing = comb_spacing(lines)
        apart = f"{len(lines)} frequencies, {lines[0]:.4g} … {lines[-1]:.4g} Hz"
        return apart if spacing is None else f"comb of {len(lines)} lines, {spacing:.4g} Hz apart"
    return ""


def _share(lasting: float, span: float | None) -> str:
    """Return which share of a log lasts so long, s, in words; empty where its span is not known."""
    return f", {digits(100.0 * lasting / span, 2)} % of the time" if span and lasting else ""


def _union(events: Iterable[tuple[float, float]]) -> float:
    """Return the time that events, (start, duration) in s, cover together."""
    covered, end = 0.0, -np.inf
    for start, duration in sorted(events):
        covered += max(start + duration - max(start, end), 0.0)
        end = max(end, start + duration)
    return covered


def comb_spacing(lines: Sequence[float]) -> float | None:
    """Return the spacing of which sorted frequencies, Hz, are multiples up to a common offset; None without one."""
    if len(lines) < MIN_COMB_LINES:
        return None
    frequency = np.asarray(lines)
    spacing = float(np.min(np.diff(frequency)))
    if spacing < MIN_COMB_SPACING * frequency[-1]:
        return None
    order = np.rint((frequency - frequency[0]) / spacing)
    slope, offset = np.polyfit(order, frequency, 1)
    off = np.abs(frequency - offset - slope * order)
    return float(slope) if bool(np.all(off <= COMB_TOLERANCE * slope)) else None


def changed_entry(cause: str) -> str:
    """Return the entry of a configuration that a cause changes, in words, from what its effect declares."""
    effect = EFFECTS.get(cause)
    if cause in EVENTS:
        return "no entry: an event, which the settings leave out"
    if cause in LASTING or (effect is not None and effect.deterministic):
        return "bias states and random walk, smaller once it is compensated"
    if cause == "cross_axis":
        return "no entry: settings of axes are independent"
    if cause == "clipping":
        return "white noise, which lacks what lies beyond the range"
    if effect is None:
        return SAMPLES_AT_FAULT
    if effect.identified_as is not None:
        return OSCILLATION if effect.identified_as == "sinusoid" else "bias states"
    if effect.joins == "preprocessing":
        return SAMPLES_AT_FAULT
    if effect.joins == "law of the noise":
        return "white noise, by its share of the time; its largest stands under worst_case in noise.yaml"
    if "frequency" in effect.locates:
        return OSCILLATION
    return "white noise: the level at low frequencies is written, which is what adds up over time"


def way_text(way: float, longest: float) -> str:
    """Return a distance, in the unit of the longest beside it: metres or kilometres."""
    return f"{digits(1e-3 * way, 2)} km" if longest >= KILOMETRES_FROM else f"{digits(way, 2)} m"


def drift_text(drift: Mapping[str, tuple[float, float]]) -> str:
    """Return what a cause does to the position, in words; empty where nothing is known of it."""
    parts = [
        f"{way_text(a, a)} in {name}, {way_text(b, a)} without this"
        for name, (a, b) in drift.items()
        if a >= MIN_DRIFT_CHANGE * b
    ]
    if not parts:
        return "no drift at rest" if drift else ""
    return f"without fixes one axis drifts {', '.join(parts)}"


def white_text(white: float) -> str:
    """Return what a cause does to white noise, in words; empty where it changes little."""
    return (
        f"white noise {digits(white)} × that without this" if abs(log(white)) >= log(MIN_DRIFT_CHANGE) else ""
    )
