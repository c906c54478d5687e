"""What findings on a log mean for its identification and for a filter that is set from it.

==============================  ====================================================================
finding                         what becomes of the identification
==============================  ====================================================================
line                            the terms are chosen beside a sinusoid
gauss_markov, telegraph         the terms are chosen beside a Gauss–Markov process
motion                          left out with what is about it: it is no noise of the sensor
overflow                        its samples are put back by the range of the register
error_code, wrong readings      other rows near by stand in their place from the first
spikes                          the same where they change the noise, and what is left has no tails
burst                           left out where it makes white noise seem larger by 5 %: the quieter state is the noise
step, recovery                  what they add to the samples is taken out where an axis has one: an event is no noise
all others                      as it is: a filter that does not compensate them meets them; a note says so
==============================  ====================================================================

Which term stands for a cause is a fact of its effect (`models.effects.Effect.identified_as`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models.effects import EFFECTS
from models.noise import Arma, NoiseModel, White
from tuner.formats.customary_units import phrase
from tuner.formats.diagnosis import config_finding
from tuner.formats.documents import plain
from tuner.limits import SHOWN_CHANGE
from tuner.types import (
    Coefficient,
    Diagnosis,
    Enlargement,
    FilterConfig,
    Finding,
    Identification,
    Quantity,
)
from tuner.types.records import Record

EVENTS = ("step", "recovery")
"""Findings that happen once: no noise, whatever a filter does about them; several are a noise of their own."""
TAKEN_OUT = ("motion", "overflow", "error_code")
"""Findings that are no longer in the samples when these are identified again."""
LEFT_OUT = "left_out"
"""Key of the extension of a finding whose samples are left out before any noise is judged: their times by axis, or
True where they were left out from the first."""
WORTH_SAYING = 1.02
"""Factor up to which nothing is inflated."""


def left_out(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings without which the settings are: wrong readings, and events that no axis has two of."""
    many = Counter(axis for one in findings if one.cause in EVENTS for axis in one.channels)
    return [
        one
        for one in findings
        if LEFT_OUT in one.extension
        or (one.cause in EVENTS and all(many[axis] == 1 for axis in one.channels))
    ]


def terms_found(diagnosis: Diagnosis) -> dict[str, tuple[str, ...]]:
    """Return the noise terms that the findings add to those of each axis, one a finding."""
    found: dict[str, list[str]] = {}
    for finding in diagnosis.findings:
        effect = EFFECTS.get(finding.cause)
        if effect is not None and effect.identified_as is not None:
            for axis in finding.channels:
                found.setdefault(axis, []).append(effect.identified_as)
    return {axis: tuple(terms) for axis, terms in found.items()}


def noisier_stretches(diagnosis: Diagnosis, record: Record) -> list[tuple[float, float]]:
    """Return begin and end, s, of the bursts of an axis that make its white noise seem larger by `SHOWN_CHANGE`.

    The quieter state is the noise of the sensor, unless bursts last most of the time; that in a burst is advice.
    """
    left = []
    for axis in record.axes:
        bursts = [
            [values[name].value or 0.0 for name in ("start", "duration", "variance_ratio")]
            for one in diagnosis.findings
            if one.cause == "burst" and axis in one.channels
            for values in (one.by_channel.get(axis, one.parameters),)
        ]
        noisier = [
            (start, start + length, length * (ratio - 1.0)) for start, length, ratio in bursts if ratio > 1.0
        ]
        rare = 2.0 * sum(end - start for start, end, _ in noisier) < record.span
        if rare and 1.0 + sum(more for *_, more in noisier) / record.span > (1.0 + SHOWN_CHANGE) ** 2:
            left += [(start, end) for start, end, _ in noisier]
    return left


def without_stretches(record: Record, stretches: Sequence[tuple[float, float]]) -> Record:
    """Return the record without stretches, begin and end in s; itself where they hold none of it, or all."""
    segments = list(record.segments)
    for stretch in stretches:
        first, last = np.searchsorted(record.t, stretch).tolist()
        segments = [
            part for a, b in segments for part in ((a, min(b, first)), (max(a, last), b)) if part[1] > part[0]
        ]
    changed = segments and tuple(segments) != record.segments
    return replace(record, segments=tuple(segments)) if changed else record


def with_notes_on_findings(
    identification: Identification, diagnosis: Diagnosis, records: Sequence[Record]
) -> Identification:
    """Return the identification with a note on each axis that was identified with other findings in it.

    A filter that does not compensate them meets them, so they stay in its noise. Events outside of the segments of
    `records`, those identified, are not in it.
    """
    notes, gone = list(identification.notes), left_out(diagnosis.findings)
    for axis, channel in identification.channels.items():
        causes = dict.fromkeys(
            f.cause
            for f in diagnosis.findings
            if axis in f.channels and f not in gone and _in_segments(f, axis, records)
        )
        left = [cause for cause in causes if cause not in TAKEN_OUT and not _is_identified(cause)]
        if left:
            named = ", ".join(cause.replace("_", " ") for cause in left)
            lawful = any(_is_law(cause) for cause in left)
            without = "" if lawful else _without(diagnosis, axis, channel.unit)
            notes.append(f"{axis} was identified with {named} in it{without}")
    return replace(identification, notes=tuple(notes))


def _in_segments(finding: Finding, axis: str, records: Sequence[Record]) -> bool:
    """Return whether a finding is in the segments of the records of an axis; what does not begin and end is.

    What ends or begins within half a sample of a segment is beside it.
    """
    start, duration = (finding.parameters.get(name) for name in ("start", "duration"))
    if start is None or duration is None or start.value is None or duration.value is None:
        return True
    begin, end = start.value, start.value + duration.value
    return any(
        record.t[first] + 0.5 * record.interval < end and begin < record.t[last - 1] + 0.5 * record.interval
        for record in records
        if axis in record.axes
        for first, last in record.segments
    )


def _is_identified(cause: str) -> bool:
    """Return whether a noise term of the identification stands for a cause."""
    effect = EFFECTS.get(cause)
    return effect is not None and effect.identified_as is not None


def _is_law(cause: str) -> bool:
    """Return whether a cause is the law of the noise: its model then has the power of all samples."""
    effect = EFFECTS.get(cause)
    return effect is not None and effect.joins == "law of the noise"


def _without(diagnosis: Diagnosis, axis: str, unit: str) -> str:
    """Say what noise is left once the findings are taken out; shaped white noise by its density at low frequencies."""
    if axis not in diagnosis.models:
        return ""
    terms = diagnosis.models[axis].terms
    white = NoiseModel(term for term in terms if isinstance(term, White | Arma))
    density = float(np.sqrt(white.psd(np.zeros(1))[0])) if white.terms else 0.0
    figures = [f"white density {_figure(density, 'white.density', unit)}"] if density else []
    figures += [
        f"{term.name} {name} ".replace("_", " ") + _figure(getattr(term, name), f"{term.name}.{name}", unit)
        for term in terms
        if not isinstance(term, White | Arma)
        for name in term.PARAMETERS
    ]
    return f"; without: {', '.join(figures)}" if figures else ""


def _figure(value: float, quantity: str, unit: str) -> str:
    """Return a number without an interval in its customary unit."""
    return phrase(Coefficient(value, None, None, unit), quantity, unit)


def settled_inflations(
    diagnosis: Diagnosis, config: FilterConfig, records: Sequence[Record] = ()
) -> tuple[Enlargement, ...]:
    """Return the inflations that a configuration made from the same log still needs.

    Stretches of noise follow one another: of several inflations of a quantity for one reason the largest holds. That of
    a share of the record is a ratio to the rms over the record, which the settings are, or to the rest, where they are
    without the stretch; others are of the base model.

    Parameters
    ----------
    diagnosis : Diagnosis
        Findings.
    config : FilterConfig
        Settings before any of these inflations.
    records : sequence of Record, optional
        Those that the settings are of.
    """
    settled: dict[tuple[Quantity, str], Enlargement] = {}
    for finding, inflation in ((one, each) for one in diagnosis.findings for each in one.inflations):
        axis, field = inflation.quantity.owner, inflation.quantity.field
        if axis not in config.channels:
            continue
        factor = inflation.factor
        if field == "white_density" and axis in diagnosis.base and inflation.time_share in (None, 1.0):
            factor *= diagnosis.base[axis].white_density() / config.channels[axis].white_density
        elif records and not _in_segments(finding, axis, records):
            ratio = finding.by_channel.get(axis, finding.parameters).get("variance_ratio")
            factor = factor if ratio is None else float(np.sqrt(ratio.value or 1.0))
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
