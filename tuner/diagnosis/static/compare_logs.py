"""Differences of two logs of one unit, such as at rest and with motors on, by cause and by what they do to a filter.

A cause of one log is that of the other where what locates it (a frequency, a period) agrees; then its sizes are
compared. Coefficients of the noise, and means, which vibration shifts by rectification, are compared at 95 %
(`tuner.identification.comparison`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from models.units import unit_of_samples
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.diagnose import diagnose
from tuner.identification.comparison import compare_identifications
from tuner.identification.identify import identify
from tuner.types import Coefficient, Diagnosis, Finding
from tuner.types.coefficient import apart
from tuner.types.records import DataError, Record

NOISE, MEAN = "noise", "mean"
"""What differs where no cause does: a coefficient of the noise terms, and the mean."""
ENTRY_OF_GROUP: Mapping[str, str] = {
    "fast spectrum": "white_density",
    "distribution": "white_density",
}
"""Entry of an axis in the configuration that causes of a group move."""
ENTRY_OF_CAUSE: Mapping[str, str] = {
    "gauss_markov": "markov",
    "telegraph": "markov",
    "step": "random_walk_density",
    "warmup": "constant_sd",
    "line": "",
    "comb": "",
    "vibration": "",
    "skewed_noise": "",
    "spikes": "",
}
"""The same of single causes; what is bounded, or taken out of the samples, leaves the noise as it is."""
ENTRY_OF_TERM: Mapping[str, str] = {
    "white": "white_density",
    "bias_instability": "markov",
    "gauss_markov": "markov",
    "random_walk": "random_walk_density",
    "ramp": "ramp_sd",
    "mean": "constant_sd",
}
"""Entry that a noise term, or the mean, is written to."""


@dataclass(frozen=True)
class Difference:
    """One thing in which two states of a unit differ.

    Attributes
    ----------
    axis : str
    cause : str
        Code of a cause, ``noise`` for a coefficient that changed, or ``mean``.
    parameter : str
        What was compared, such as ``amplitude`` or ``white.density``.
    at_rest, running : Coefficient or None
        Its size in either log, SI; None where the log does not have it.
    entry : str
        Entry of the configuration that it moves, such as ``channels.gyro_x.white_density``; empty for none.
    place : mapping of str to Coefficient
        What locates a cause, such as its ``frequency``, SI.
    """

    axis: str
    cause: str
    parameter: str
    at_rest: Coefficient | None
    running: Coefficient | None
    entry: str
    place: Mapping[str, Coefficient] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class StateComparison:
    """Differences of two states of a unit, by axis, and the diagnosis of either log."""

    differences: tuple[Difference, ...]
    at_rest: Diagnosis
    running: Diagnosis


def compare_states(running: Sequence[Record], at_rest: Sequence[Record], *, seed: int = 0) -> StateComparison:
    """Compare a log of a unit in operation with one at rest.

    Raises
    ------
    DataError
        Where the logs share no axis, or a log cannot be analysed.
    """
    axes = [a for record in running for a in record.axes if any(a in other.axes for other in at_rest)]
    if not axes:
        theirs, mine = (" ".join(a for r in log for a in r.axes) for log in (running, at_rest))
        raise DataError(
            f"--against: expected an axis of the log, {theirs}, got {mine}; give two logs of one unit"
        )
    found, before = diagnose(running, seed=seed), diagnose(at_rest, seed=seed)
    rows = compare_identifications(
        ["at rest", "running"], [identify(at_rest, arma=None), identify(running, arma=None)]
    ).axes
    differences: list[Difference] = []
    for axis in axes:
        differences += _by_cause(axis, found.findings, before.findings)
        for row in rows.get(axis, ()):
            term = row.name.partition(".")[0]
            if row.differs and term in ENTRY_OF_TERM:
                cause = MEAN if term == MEAN else NOISE
                entry = f"channels.{axis}.{ENTRY_OF_TERM[term]}"
                differences.append(Difference(axis, cause, row.name, row.values[0], row.values[-1], entry))
    return StateComparison(tuple(differences), before, found)


def _by_cause(axis: str, running: Sequence[Finding], at_rest: Sequence[Finding]) -> list[Difference]:
    """Return the causes that one log has and the other has not, and those whose sizes differ."""
    mine, others = ([f for f in found if axis in f.channels] for found in (running, at_rest))
    differences = []
    for finding in mine:
        twin = next((other for other in others if _same(axis, finding, other)), None)
        if twin is not None:
            others.remove(twin)
        name = _size(axis, finding)
        now, then = _value(axis, finding, name), None if twin is None else _value(axis, twin, name)
        if twin is None or apart(now, then):
            place = _place(axis, finding)
            entry = _entry(axis, finding.cause)
            differences.append(Difference(axis, finding.cause, name, then, now, entry, place))
    for finding in others:
        name = _size(axis, finding)
        then = _value(axis, finding, name)
        place, entry = _place(axis, finding), _entry(axis, finding.cause)
        differences.append(Difference(axis, finding.cause, name, then, None, entry, place))
    return differences


def _place(axis: str, finding: Finding) -> dict[str, Coefficient]:
    """Return what locates a finding on an axis."""
    values = {name: _value(axis, finding, name) for name in _locating(finding.cause)}
    return {name: value for name, value in values.items() if value is not None}


def _entry(axis: str, cause: str) -> str:
    """Return the entry of the configuration that a cause moves; empty for none."""
    declared = CAUSES.get(cause)
    group = "" if declared is None else declared.group
    entry = ENTRY_OF_CAUSE.get(cause, ENTRY_OF_GROUP.get(group, ""))
    return f"channels.{axis}.{entry}" if entry else ""


def _value(axis: str, finding: Finding, name: str) -> Coefficient | None:
    return finding.by_channel.get(axis, finding.parameters).get(name)


def _locating(cause: str) -> tuple[str, ...]:
    declared = CAUSES.get(cause)
    return () if declared is None or declared.effect is None else declared.effect.locates


def _size(axis: str, finding: Finding) -> str:
    """Return the name of the parameter that says how much there is of a cause: one in the unit of the axis if any."""
    places = _locating(finding.cause)
    sizes = [n for n in finding.parameters if n not in places] or list(finding.parameters)
    unit = unit_of_samples(axis)
    return next((n for n in sizes if finding.parameters[n].unit == unit), next(iter(sizes), ""))


def _same(axis: str, one: Finding, other: Finding) -> bool:
    """Return whether findings of two logs are one cause, at one place where it has one."""
    return one.cause == other.cause and not any(
        apart(_value(axis, one, name), _value(axis, other, name)) for name in _locating(one.cause)
    )
