"""The diagnosis of a drive for terminal and page: its answer, findings, explained inflation, what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table

from tuner.diagnosis.drive.noise_scale_estimates import UNKNOWN_CAUSE, factor_text, listed, may_be_one
from tuner.formats.customary_units import amount, customary_unit, digits, in_customary, pretty
from tuner.formats.reference_words import reference_line
from tuner.judgement import judge_drive
from tuner.limits import SHOWN_FINDINGS
from tuner.report.document import Document, document
from tuner.report.drive_answer import found_text
from tuner.report.static_diagnosis_tables import findings_table
from tuner.types import DriveDiagnosis, Finding, Gain, NoiseScaleEstimate

NOISE_CAUSES = {"vibration", "gnss_noise_scale", "imu_noise_scale"}
"""Causes of larger noise that stays with all findings in the filter."""
_STAYING_CAUSES = {"correlated_gnss": "position", "correlated_velocity": "velocity"}
"""Causes that take the errors that stay out of a setting, which is that of white ones then."""


def drive_diagnosis_answer(found: DriveDiagnosis) -> Document:
    """Return what the filter gets wrong on a drive, the factors that its noise needs, and what is left."""
    lines = [f"{found_text(one)} → {one.consequence}" for one in found.findings]
    left = [f"Not explained: {one.statistic}" for one in found.unexplained]
    noise = noise_lines(found.noise_scales, found.findings)
    gain = [] if found.gain is None or not found.findings else [whole_gain_text(found.gain)]
    harm = [] if found.credited else [harm_text(found.gain)]
    rest = [f"Missing: {one}" for one in missing(found)] + [f"Note: {one}" for one in found.notes]
    verdict = [f"Verdict: {judge_drive(found).text}", *reference_line(found.notes)]
    first = [*verdict, *left, *harm, *lines[:SHOWN_FINDINGS], *noise, *gain]
    said, more = (
        [f"{text[:1].upper()}{text[1:]}" for text in texts]
        for texts in (first, [*lines[SHOWN_FINDINGS:], *rest])
    )
    return document(said, more, beyond="every finding and test")


def noise_lines(estimates: Sequence[NoiseScaleEstimate], findings: Sequence[Finding] = ()) -> list[str]:
    """Return in words the noise that a drive shows otherwise than stated: of no named cause, of one, or explained.

    Beside errors of the fixes that stay, which are among `findings`, a factor is that of the white part alone.
    """
    staying = _staying(findings)
    shown = [
        one for one in estimates if one.stated is not None and one.identifiable and not may_be_one(one.plain)
    ]
    left = [one for one in shown if not may_be_one(one.named)]
    known = [one for one in left if one.named.determined]
    named = [one for one in known if UNKNOWN_CAUSE not in one.causes and NOISE_CAUSES & {*one.causes}]
    unnamed = [one for one in known if one not in named]
    explained = [SHORT_NAMES[one.setting] for one in shown if one not in left]
    lines = []
    if unnamed:
        lines.append(
            f"Noise of no known cause, true ÷ stated: {'; '.join(_factor_left(one, staying) for one in unnamed)}"
        )
    if named:
        lines.append(f"Noise, true ÷ stated: {'; '.join(_factor_left(one, staying) for one in named)}")
    if explained:
        lines.append(f"As stated once the findings are in the filter: {', '.join(explained)}")
    return lines


def _factor_left(one: NoiseScaleEstimate, staying: Mapping[str, str]) -> str:
    """Return the factor on a setting that is left with all findings in the filter, and what accounts for it."""
    causes = [cause.replace("_", " ") for cause in one.causes if cause in NOISE_CAUSES]
    by = f" ({listed(causes)})" if causes else ""
    beside = f" beside errors that stay, sd {staying[one.setting]}" if one.setting in staying else ""
    return f"{_name_left(one, staying)} × {factor_text(one.named)}{beside}{by}"


def _name_left(one: NoiseScaleEstimate, staying: Mapping[str, str]) -> str:
    name = SHORT_NAMES[one.setting]
    return f"white part of {name}" if one.setting in staying else name


def _staying(findings: Sequence[Finding]) -> dict[str, str]:
    """Return the sds of errors of the fixes that stay, in words by the setting of their white part."""
    sds: dict[str, str] = {}
    for one in findings:
        if (setting := _STAYING_CAUSES.get(one.cause)) is not None:
            level, down = (one.figures.get(name) for name in ("sd", "sd_vertical"))
            words = [amount(level)] if level is not None else []
            words += [f"vertically {amount(down)}"] if down is not None else []
            sds[setting] = ", ".join(words)
    return sds


def drive_tables(found: DriveDiagnosis) -> list[Table | str]:
    """Return findings with their words, the gain, the inflations with their causes, and what stays open."""
    answer: list[Table | str] = []
    answer.append(f"  Verdict: {judge_drive(found).text}")
    if found.findings:
        answer.append(findings_table(found.findings, "What the navigation simulation gets wrong"))
    for finding in found.findings:
        answer.append(f"  {finding.text} → {finding.consequence}")
    if found.gain is not None:
        answer.append(f"  {whole_gain_text(found.gain)}")
    if not found.credited:
        answer.append(f"  {harm_text(found.gain)}")
    answer += [f"  {one.text}" for one in found.inseparable]
    answer += [
        f"  unexplained: {u.statistic}, p = {u.p_value:.1e}: the findings do not account for it"
        for u in found.unexplained
    ]
    if found.noise_scales:
        answer += noise_scale_tables(found.noise_scales, found.findings)
    answer += [f"  missing: {line}" for line in missing(found)]
    return answer + [f"  note: {note}" for note in found.notes]


def missing(found: DriveDiagnosis) -> list[str]:
    """Return what a better recording would have to contain."""
    lines = []
    if found.findings and found.gain is None:
        lines.append(
            "no gain is measured: too few fixes in motion before or after 60 % of the drive; drive longer"
        )
    if found.unexplained:
        lines.append(
            "what is left unexplained has no cause in the catalogue; a reference solution would show when it acts"
        )
    if hidden := [SHORT_NAMES[one.setting] for one in found.noise_scales if not one.identifiable]:
        lines.append(
            f"{', '.join(hidden)}: not identifiable on this drive; a static log shows the unit's own noise, better "
            "fixes or times without fixes show what it is in motion"
        )
    if not found.noise_scales:
        lines.append(
            "too few fixes count after the filter has settled, or they are too far off, to judge the noise settings"
        )
    return lines


def whole_gain_text(gain: Gain) -> str:
    """Return the gain of all findings together on the held-out part of the drive, in words."""
    parts = [
        "fixes are predicted " + ("better" if gain.nats > 0.0 else "worse" if gain.nats < 0.0 else "as well")
    ]
    for name, (before, after) in gain.user.items():
        quantity, _, unit = name.partition(" ")
        if quantity.endswith(CHANGE_INTERVAL):
            continue
        head = _PLAIN.get(quantity, quantity.replace("_", " "))
        text = f"{head} {digits(before)} → {digits(after)} {unit.strip('[]')}".strip()
        change = gain.user.get(f"{quantity}{CHANGE_INTERVAL} {unit}".strip())
        if change is not None:
            text += f" (change {digits(change[0])} … {digits(change[1])} with 95 %)"
        parts.append(text)
    part = "the last 40 %, parameters from the first 60 %" if gain.split == "60/40" else gain.split
    return f"all findings together, on {part}: {'; '.join(parts)}"


def harm_text(gain: Gain | None) -> str:
    """Return why findings do not enter a configuration as they are, in words."""
    lost = gain is not None and gain.nats < 0.0
    why = "lose likelihood" if lost else "gain likelihood, but errors of outages grow"
    return (
        f"trial of the findings alone: on the part held out they {why}: this does harm, so take the names as hints; "
        "`tuner tune` writes them only where its own trial, of whole configurations, keeps them"
    )


def noise_scale_tables(
    estimates: Sequence[NoiseScaleEstimate], findings: Sequence[Finding] = ()
) -> list[Table | str]:
    """Return one row a noise setting: the stated value, the scale estimated from the drive, and its causes."""
    table = Table(title="Noise settings: stated, and estimated from the drive (95 % intervals)")
    for head in ("setting", "stated", "estimated", "factor", "with all findings", "accounted for by"):
        table.add_column(head)
    for one in estimates:
        table.add_row(SHORT_NAMES[one.setting], *_cells(one))
    beside = [
        f"  with all findings, the factor on {SHORT_NAMES[name]} is that of its white part, beside errors that stay, "
        f"sd {sds}"
        for name, sds in _staying(findings).items()
        if name in {one.setting for one in estimates if one.causes}
    ]
    return [table, *(f"  {one.text}" for one in estimates if one.causes), *beside]


def _cells(one: NoiseScaleEstimate) -> tuple[str, ...]:
    quantity, si = _CUSTOMARY[one.setting]
    unit = pretty(customary_unit(quantity, si)) if quantity else one.unit

    def shown(factor: float) -> str:
        assert one.stated is not None
        value = factor * one.stated
        return digits(in_customary(value, quantity, si) if quantity else value)

    if one.stated is None:
        return "–", "–", "–", "–", "not in the filter"
    stated = f"{shown(1.0)} {unit}"
    if not one.identifiable:
        return stated, "–", "–", "–", "not identifiable on this drive"
    estimated = "–"
    if one.plain.value is not None and one.plain.interval is not None:
        low, high = (shown(end) for end in one.plain.interval)
        estimated = f"{shown(one.plain.value)} ({low} … {high}) {unit}"
    elif one.plain.upper is not None:
        estimated = f"below {shown(one.plain.upper)} {unit}"
    why = ", ".join(cause.replace("_", " ") for cause in one.causes)
    nothing = "nothing to account for" if may_be_one(one.plain) else "the findings"
    return stated, estimated, factor_text(one.plain), factor_text(one.named), why or nothing


CHANGE_INTERVAL = "_change_interval"
"""Ending of a figure that is the interval of the change of another."""
_PLAIN = {
    "nis": "NIS a row (1 where consistent)",
    "innovation_lag1_correlation": "correlation of one innovation with the next",
    "outage_30s_horizontal": "horizontal error after 30 s without fixes, rms",
    "outage_60s_horizontal": "horizontal error after 60 s without fixes, rms",
}
SHORT_NAMES = {
    "gyro_white": "gyro white",
    "accel_white": "accel white",
    "gyro_bias": "gyro bias",
    "accel_bias": "accel bias",
    "position": "R position",
    "velocity": "R velocity",
}
"""Settings as a table names them."""
_CUSTOMARY = {
    "gyro_white": ("white.density", "rad/s"),
    "accel_white": ("white.density", "m/s^2"),
    "gyro_bias": ("random_walk.density", "rad/s"),
    "accel_bias": ("random_walk.density", "m/s^2"),
    "position": ("", ""),
    "velocity": ("", ""),
}
"""Customary quantity and sensor unit of a setting."""
