"""The diagnosis of a static log: the headline, and in tables all findings with their gains, rejected tests, notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import amount
from tuner.formats.parameter_words import parameter_words
from tuner.judgement import ABOUT
from tuner.report.finding_groups import LEAST_WHITE_SHARE, MIN_DRIFT_CHANGE, contradicted, drift_text
from tuner.types import Coefficient, Diagnosis, Finding, Gain, Unexplained


def unexplained_lines(unexplained: Sequence[Unexplained]) -> list[str]:
    """Return one line for each part of the samples that is not explained, the largest first."""
    return [line for line, _ in unexplained_parts(unexplained)]


def unexplained_parts(unexplained: Sequence[Unexplained]) -> list[tuple[str, Unexplained]]:
    """Return what is not explained of each part of the samples, in words and where it shows most, the largest first.

    A line says what shows most there, in which axes, where, how much and to what effect, and how many statistics more
    show it. The effect is that on the axis in which it makes most of the drift that the model has, said once an axis.
    """
    parts: list[tuple[str, Unexplained]] = []
    said: set[tuple[str, ...]] = set()
    for about, tests in sorted(
        _by_part(unexplained).items(), key=lambda part: -max(one.nats for one in part[1])
    ):
        axes = list(dict.fromkeys(axis for one in tests for axis in one.channels))
        largest = max(tests, key=lambda one: one.nats)
        felt = max(tests, key=lambda one: max((a / b for a, b in one.drift.values() if b), default=0.0))
        most = f", most in {axes_text(largest.channels)}" if len(axes) > 1 else ""
        place = f", {largest.place}" if largest.place else ""
        line = f"{largest.statistic} in {axes_text(axes)}{most}{place}"
        where = f" in {axes_text(felt.channels)}" if len(axes) > 1 else ""
        if more := len({one.statistic for one in tests}) - 1:
            line += f"; {more} more statistic{'s' * (more > 1)} of {ABOUT.get(about, about)}"
        if felt.drift and felt.channels not in said:
            line += f"; {left_text(felt.drift)}{where}"
            said.add(felt.channels)
        parts.append((line, largest))
    return parts


def _by_part(unexplained: Sequence[Unexplained]) -> dict[str, list[Unexplained]]:
    """Return the statistics by what of the samples they are about."""
    parts: dict[str, list[Unexplained]] = {}
    for one in unexplained:
        parts.setdefault(one.about or one.statistic, []).append(one)
    return parts


def left_text(drift: Mapping[str, tuple[float, float]]) -> str:
    """Return what is left of the drift beside the model, in words: shares, where the axis drifts more than that."""
    if not drift:
        return ""
    more = {after: 100.0 * (seen / model - 1.0) for after, (seen, model) in drift.items() if model > 0.0}
    worst = {after: share for after, share in more.items() if share >= 100.0 * (MIN_DRIFT_CHANGE - 1.0)}
    parts = [f"{share:.2g} % more after {after}" for after, share in worst.items()]
    return (
        f"position drifts {', '.join(parts)} than by the model"
        if parts
        else "no more drift than by the model"
    )


def diagnosis_tables(diagnosis: Diagnosis) -> list[Table | str]:
    """Return one table of findings, their words and gains, and the rejected tests without a cause."""
    answer: list[Table | str] = []
    if diagnosis.quiet:
        answer.append("  nothing contradicts a simulation of the noise terms")
    if diagnosis.findings:
        answer.append(findings_table(diagnosis.findings, "What the simulation gets wrong"))
    for finding in diagnosis.findings:
        answer.append(f"  {finding.text}" + (f" → {finding.consequence}" if finding.consequence else ""))
        if finding.gain is not None and (gain := gain_text(finding.gain)):
            answer.append(f"    {gain}")
        if finding.gain is not None and contradicted(finding):
            answer.append(f"    not confirmed: held out ({finding.gain.split}), data are less likely with it")
    if diagnosis.unexplained:
        answer.append(_unexplained_table(diagnosis.unexplained))
    answer += [f"  note: {note}" for note in diagnosis.notes]
    return answer


def _unexplained_table(unexplained: Sequence[Unexplained]) -> Table:
    """Return one row for each statistic of each axis that no finding explains."""
    table = Table(title="What no finding explains")
    for head in ("statistic", "channels", "shows most", "nats", "p", "position error without fixes"):
        table.add_column(head)
    for one in sorted(unexplained, key=lambda one: -one.nats):
        drift = [
            f"{after}: {seen:.3g} m, {model:.3g} m by the model" for after, (seen, model) in one.drift.items()
        ]
        size = f"{one.nats:.3g}" if one.nats else "–"
        p_value = f"{one.p_value:.1e}" if one.p_value > 0.0 else "< 1e-300"
        table.add_row(
            one.statistic, ", ".join(one.channels), one.place or "–", size, p_value, "\n".join(drift) or "–"
        )
    return table


def gain_text(gain: Gain) -> str:
    """Return the measures of a gain beside likelihood, before → after; empty where there are none."""
    parts = [
        f"{name} inside the band of replicas {100.0 * before:.0f} → {100.0 * after:.0f} %"
        for name, (before, after) in gain.coverage.items()
    ]
    for name, (before, after) in gain.user.items():
        quantity, _, unit = name.partition(" ")
        head = quantity.replace("_", " ")
        if quantity == "white_density" and min(before, after) < LEAST_WHITE_SHARE * max(before, after):
            continue
        pair = [amount(Coefficient(x, None, None, unit.strip("[]") or "1")) for x in (before, after)]
        if pair[0] != pair[1]:
            parts.append(f"{head} {' → '.join(pair)}")
    return "; ".join(parts)


def hidden_effect_lines(judged: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what was hidden in a simulated log and whether it was found, one line an effect."""
    lines = []
    for one in judged:
        where = f"{one['cause'].replace('_', ' ')} in {axes_text(one['channels'])}"
        verdict = "found" if one["found"] else "not found"
        if not one["found"] and one["named"]:
            verdict = f"detected, but named as {', '.join(one['named'])}"
        lines.append(f"{where} is hidden in it: {verdict}")
    return lines


def findings_table(findings: Sequence[Finding], title: str) -> Table:
    """Return one row a finding."""
    table = Table(title=title)
    for head in ("cause", "channels", "parameters (± 95 %)", "p", "what it is worth", "could also be"):
        table.add_column(head)
    for f in findings:
        table.add_row(
            f.cause,
            ", ".join(f.channels),
            "\n".join(line for pair in parameter_words(f.figures).items() for line in _lines(f, *pair)),
            f"{f.p_value:.1e}" if f.p_value > 0.0 else "< 1e-300",
            _worth(f),
            ", ".join(f"{a.cause} ({a.score:.2f})" for a in f.alternatives) or "–",
        )
    return table


def _lines(f: Finding, name: str, said: str) -> list[str]:
    """Return a parameter with its interval, of each channel where they differ."""
    return [f"{said} {amount(c)} in {axis}" for axis, c in f.of_each(name).items()] or [
        f"{said} {amount(f.parameters[name])}"
    ]


def _worth(f: Finding) -> str:
    """Return what a finding does to the position, and whether held-out data confirm it."""
    words = [drift_text(f.drift)] if f.drift else []
    if f.gain is not None and f.gain.nats != 0.0:
        words.append(f"{'predicts better' if f.gain.nats > 0.0 else 'predicts WORSE'} ({f.gain.split})")
    return "; ".join(words) or "–"
