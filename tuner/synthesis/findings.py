"""Identification and diagnosis of one log, made to say the same.

=============================  =====================================================================
finding                        what becomes of the identification
=============================  =====================================================================
line                           the channel is identified again with a sinusoid
gauss_markov, telegraph        again with one Gauss–Markov process more, unless it has that one already
all others                     as it is: a filter that does not compensate them meets them; a note says so
=============================  =====================================================================

An inflation speaks of the noise that the diagnosis fitted first. Its factor is put on the setting of the filter
now, and left out where that is enough already.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from tuner.formats.diagnosis import config_finding
from tuner.formats.documents import plain
from tuner.identification.arma import Likelihood
from tuner.identification.channel import identify_channel
from tuner.types import (
    ChannelIdentification,
    Diagnosis,
    Enlargement,
    FilterConfig,
    Finding,
    Identification,
    Quantity,
    TermEstimate,
)
from tuner.types.records import IdentificationError, Record

MARKOV_CAUSES = ("gauss_markov", "telegraph")
"""Causes whose spectrum is that of a Gauss–Markov process."""
IN_THE_NOISE = ("vibration", "lowpass", "colour", *MARKOV_CAUSES)
"""Causes that the noise fitted together with them holds in its own terms."""
SAME_TIME = 2.0
"""Ratio of two time constants up to which they are those of one process."""
WORTH_SAYING = 1.02
"""Factor up to which nothing is inflated."""


def agreed(
    records: Sequence[Record],
    identification: Identification,
    diagnosis: Diagnosis,
    *,
    arma: Likelihood | None = "fast",
) -> Identification:
    """Return the identification with the terms that were found in its channels, and notes on other findings.

    Parameters
    ----------
    records : sequence of Record
        What was identified.
    identification : Identification
        Noise of the base terms.
    diagnosis : Diagnosis
        Findings on the same log.
    arma : str, optional
        Time-series model beside the sum of terms, as of `tuner.identification.identify`.
    """
    channels = dict(identification.channels)
    notes = list(identification.notes)
    for record in records:
        for axis in [a for a in record.axes if a in channels]:
            mine = [f for f in diagnosis.findings if axis in f.channels]
            more = _further(channels[axis], [_of(f, axis) for f in mine])
            if more:
                channels[axis] = _again(record, channels[axis], more, arma)
            left = dict.fromkeys(f.cause for f in mine if f.cause not in ("line", *MARKOV_CAUSES))
            if left:
                notes.append(
                    f"{axis} was identified with {', '.join(left)} in it{_without(diagnosis, axis, record.unit)}"
                )
    return replace(identification, channels=channels, notes=tuple(notes))


def _of(finding: Finding, axis: str) -> tuple[str, Mapping[str, float | None]]:
    """Return a cause and its values in one channel."""
    parameters = finding.by_channel.get(axis, finding.parameters)
    return finding.cause, {name: c.value for name, c in parameters.items()}


def _further(
    channel: ChannelIdentification, causes: Sequence[tuple[str, Mapping[str, float | None]]]
) -> list[str]:
    """Return the terms that the causes add to those the channel has."""
    known = [t.coefficients["time_constant"].value for t in channel.terms if t.name == "gauss_markov"]
    more = []
    for cause, values in causes:
        if cause == "line":
            more.append("sinusoid")
        elif cause in MARKOV_CAUSES:
            time = _correlation_time(values)
            if not any(t and time and 1.0 / SAME_TIME < t / time < SAME_TIME for t in known):
                more.append("gauss_markov")
    return more


def _correlation_time(values: Mapping[str, float | None]) -> float | None:
    """Return the correlation time of a Gauss–Markov process, or of a telegraph: 1/T = 1/low + 1/high."""
    low, high = values.get("dwell_low"), values.get("dwell_high")
    return 1.0 / (1.0 / low + 1.0 / high) if low and high else values.get("time_constant")


def _again(
    record: Record, before: ChannelIdentification, more: Sequence[str], arma: Likelihood | None
) -> ChannelIdentification:
    """Return the channel identified with further terms, its bounds kept; as it was where that does not work."""
    present = [t.name for t in before.terms if t.present]
    try:
        after = identify_channel(
            record, before.axis, terms=(*present, *more), method=before.method, arma=arma
        )
    except IdentificationError as error:
        warning = (
            f"the terms {', '.join(more)} that were found could not be fitted beside the others: {error}"
        )
        return replace(before, warnings=(*before.warnings, warning))
    if absent := [t.name for t in after.terms if t.name in more and not t.present]:
        warning = (
            f"{', '.join(absent)} was found by the diagnosis, but beside the other terms the data allow none"
        )
        return replace(before, warnings=(*before.warnings, warning))
    names = {t.name for t in after.terms}
    bounds = tuple(t for t in before.terms if not t.present and t.name not in names)
    return replace(after, mean=before.mean, terms=tuple(_ordered(after.terms, bounds, before)))


def _ordered(
    terms: Sequence[TermEstimate], bounds: Sequence[TermEstimate], before: ChannelIdentification
) -> list[TermEstimate]:
    """Return terms and bounds in the order of the first identification, further ones last."""
    order = [t.name for t in before.terms]
    return sorted([*terms, *bounds], key=lambda t: order.index(t.name) if t.name in order else len(order))


def _without(diagnosis: Diagnosis, axis: str, unit: str) -> str:
    """Say what noise is left once the findings are taken out."""
    if axis not in diagnosis.models:
        return ""
    figures = [
        f"{term.name} {name} {getattr(term, name):.3g} {si}"
        for term in diagnosis.models[axis].terms
        if term.name != "arma"
        for name, si in zip(term.PARAMETERS, term.units(unit), strict=True)
    ]
    return f"; without: {', '.join(figures)}" if figures else ""


def settled_inflations(diagnosis: Diagnosis, config: FilterConfig) -> tuple[Enlargement, ...]:
    """Return the inflations that a configuration made from the same log still needs.

    Stretches of noise follow one another: of several inflations of a quantity for one reason the largest holds.

    Parameters
    ----------
    diagnosis : Diagnosis
        Findings.
    config : FilterConfig
        Settings before any of these inflations.
    """
    settled: dict[tuple[Quantity, str], Enlargement] = {}
    for inflation in diagnosis.inflations:
        axis, field = inflation.quantity.owner, inflation.quantity.field
        if axis not in config.channels:
            continue
        factor = inflation.factor
        if field == "white_density" and axis in diagnosis.base:
            factor *= diagnosis.base[axis].white_density() / config.channels[axis].white_density
        reason = (inflation.quantity, inflation.reason)
        if factor > WORTH_SAYING and (reason not in settled or factor > settled[reason].factor):
            settled[reason] = replace(inflation, factor=factor)
    return tuple(settled.values())


def findings_for_config(diagnosis: Diagnosis) -> tuple[Mapping[str, Any], ...]:
    """Return the findings as plain values, each with the noise of its channels as fitted together with it."""
    findings = []
    for finding in diagnosis.findings:
        entry = config_finding(finding)
        models = {a: plain(diagnosis.models[a].as_dict()) for a in finding.channels if a in diagnosis.models}
        if models:
            entry["extension"] = {**entry["extension"], "models": models}
        findings.append(entry)
    return tuple(findings)


def judge_hidden(key: Mapping[str, Any], diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return each effect of a simulation's key with what the diagnosis made of it.

    Returns
    -------
    list of dict
        The entries of the key with ``found`` (the cause was named in one of its channels) and ``named`` (the causes
        named there).
    """
    judged = []
    for hidden in key["hidden"]:
        there = [f for f in diagnosis.findings if set(f.channels) & set(hidden["channels"])]
        named = list(dict.fromkeys(f.cause for f in there))
        judged.append({**hidden, "found": hidden["cause"] in named, "named": named})
    return judged
