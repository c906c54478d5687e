"""A diagnosis in tables: all findings with their gains, and all rejected tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import amount, digits
from tuner.formats.parameter_words import parameter_words
from tuner.report.alike_sentences import alike_sentences
from tuner.report.finding_groups import LEAST_WHITE_SHARE, drift_text
from tuner.report.titled_table import titled_table
from tuner.types import Coefficient, Finding, Gain, Unexplained

CHANGE_INTERVAL = "_change_interval"
"""Ending of a measure of a gain that is the interval of the change of another."""
_MEASURES = {
    "nis": "NIS a row (1 where consistent)",
    "innovation_lag1_correlation": "correlation of one innovation with the next",
    "outage_30s_horizontal": "horizontal error after 30 s without fixes, rms",
    "outage_60s_horizontal": "horizontal error after 60 s without fixes, rms",
}
"""Measures of a gain in words, where their names are none."""


def finding_tables(findings: Sequence[Finding], title: str) -> list[Table | str]:
    """Return one row a finding, and beneath it what each is and means, once for those that differ in numbers only."""
    rows = (
        (
            f.cause,
            ", ".join(f.channels),
            "\n".join(
                line for name, said in parameter_words(f.figures).items() for line in _lines(f, name, said)
            ),
            _p_text(f.p_value),
            _worth(f),
            ", ".join(f"{a.cause} ({a.score:.2f})" for a in f.alternatives) or "–",
        )
        for f in findings
    )
    heads = ("cause", "channels", "parameters (± 95 %)", "p", "what it is worth", "could also be")
    words = ((f"{f.cause}: {_in_words(f)}", axis) for f in findings for axis in f.channels)
    return [
        *titled_table(title, heads, rows, words=len(heads)),
        *(f"  {line}" for line in alike_sentences(words)),
    ]


def _in_words(f: Finding) -> str:
    """Return what a finding is and what it means, without its axes."""
    said = f.text.partition(": ")[2] or f.text
    return f"{said} → {f.consequence}" if f.consequence else said


def _lines(f: Finding, name: str, said: str) -> list[str]:
    """Return a parameter with its interval, of each channel where they differ."""
    return [f"{said} {amount(c)} in {axis}" for axis, c in f.of_each(name).items()] or [
        f"{said} {amount(f.parameters[name])}"
    ]


def _worth(f: Finding) -> str:
    """Return what a finding does to the position, whether held-out data confirm it, and other measures of it."""
    words = [drift_text(f.drift)]
    if f.gain is not None and f.gain.nats != 0.0:
        words.append(f"{'predicts better' if f.gain.nats > 0.0 else 'predicts WORSE'} ({f.gain.split})")
    if f.gain is not None:
        words.append(gain_text(f.gain))
    return "; ".join(filter(None, words)) or "–"


def _p_text(p_value: float) -> str:
    return f"{p_value:.1e}" if p_value > 0.0 else "< 1e-300"


def gain_text(gain: Gain) -> str:
    """Return the measures of a gain beside likelihood, before → after; empty where there are none."""
    parts = [
        f"{name} inside the band of replicas {100.0 * before:.0f} → {100.0 * after:.0f} %"
        for name, (before, after) in gain.coverage.items()
    ]
    for name, (before, after) in gain.user.items():
        quantity, _, unit = name.partition(" ")
        pair = [amount(Coefficient(x, None, None, unit.strip("[]") or "1")) for x in (before, after)]
        elsewhere = quantity == "white_density" and min(before, after) < LEAST_WHITE_SHARE * max(
            before, after
        )
        if quantity.endswith(CHANGE_INTERVAL) or elsewhere or pair[0] == pair[1]:
            continue
        text = f"{_MEASURES.get(quantity, quantity.replace('_', ' '))} {' → '.join(pair)}"
        if change := gain.user.get(f"{quantity}{CHANGE_INTERVAL} {unit}".strip()):
            text += f" (change {' … '.join(map(digits, change))} with 95 %)"
        parts.append(text)
    return "; ".join(parts)


def unexplained_table(unexplained: Sequence[Unexplained]) -> list[Table]:
    """Return one row for each statistic of each axis that no finding explains."""
    rows = (
        (
            one.statistic,
            ", ".join(one.channels),
            one.place or "–",
            f"{one.nats:.3g}" if one.nats else "–",
            _p_text(one.p_value),
            "\n".join(
                f"{at}: {seen:.3g} m, {model:.3g} m by the model" for at, (seen, model) in one.drift.items()
            )
            or "–",
        )
        for one in sorted(unexplained, key=lambda one: -one.nats)
    )
    heads = ("statistic", "channels", "shows most", "nats", "p", "position error without fixes")
    return titled_table("What no finding explains", heads, rows, words=len(heads))


def hidden_effect_lines(judged: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what was hidden in a simulated log and whether it was found, one line an effect."""
    return [
        f"{one['cause'].replace('_', ' ')} in {axes_text(one['channels'])} is hidden in it: {_judged(one)}"
        for one in judged
    ]


def _judged(hidden: Mapping[str, Any]) -> str:
    """Return whether a hidden effect was found, and by which names."""
    if hidden["found"]:
        return "found"
    return f"detected, but named as {', '.join(hidden['named'])}" if hidden["named"] else "not found"
