"""The diagnosis of a drive for terminal and page: its answer, findings, explained inflation, what is missing."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.diagnosis.drive.noise_scale_estimates import factor_text, listed, may_be_one
from tuner.formats.customary_units import amount
from tuner.formats.reference_words import reference_line
from tuner.judgement import judge_drive
from tuner.limits import SHOWN_FINDINGS
from tuner.report.document import Document, document
from tuner.report.drive_answer import found_text
from tuner.report.static_diagnosis_tables import finding_tables, gain_text, unexplained_table
from tuner.report.titled_table import titled_table
from tuner.types import Coefficient, DriveDiagnosis, Finding, Gain, NoiseScaleEstimate
from tuner.types.coefficient import times
from tuner.types.named_cause import separated

SHORT_NAMES = {
    "gyro_white": "gyro white",
    "accel_white": "accel white",
    "gyro_bias": "gyro bias",
    "accel_bias": "accel bias",
    "position": "R position",
    "velocity": "R velocity",
}
"""Settings as a table names them."""


def drive_diagnosis_answer(found: DriveDiagnosis) -> Document:
    """Return what the filter gets wrong on a drive, the factors that its noise needs, and what is left."""
    lines = [f"{found_text(one)} → {one.consequence}" for one in found.findings]
    causes, others = separated(found.notes)
    return document(
        [
            f"Verdict: {judge_drive(found).text}",
            *reference_line(found.notes),
            *causes,
            *(f"Not explained: {one.statistic}" for one in found.unexplained),
            "" if found.credited else harm_text(found.gain),
            *lines[:SHOWN_FINDINGS],
            unnamed_noise(found.noise_scales, found.findings),
            "" if found.gain is None or not found.findings else whole_gain_text(found.gain),
        ],
        [
            *lines[SHOWN_FINDINGS:],
            *(f"Missing: {one}" for one in missing(found)),
            *(f"Note: {one}" for one in others),
        ],
        more=[
            *finding_tables(found.findings, "What the navigation simulation gets wrong"),
            *(f"  {one.text}" for one in found.inseparable),
            *unexplained_table(found.unexplained),
            *titled_table(
                "Noise settings: stated, and estimated from the drive (95 % intervals)",
                ("setting", "stated", "estimated", "factor", "with all findings", "accounted for by"),
                ((SHORT_NAMES[one.setting], *_cells(one)) for one in found.noise_scales),
                words=6,
            ),
            *(f"  {one.text}" for one in found.noise_scales if one.causes),
        ],
        beyond="every finding and test",
    )


def unnamed_noise(estimates: Sequence[NoiseScaleEstimate], findings: Sequence[Finding]) -> str:
    """Return in words the noise that a drive shows otherwise than stated, and that none of the findings is."""
    named = {one.cause for one in findings}
    texts = [
        f"{SHORT_NAMES[one.setting]} × {factor_text(one.named)} ({listed([c.replace('_', ' ') for c in one.causes])})"
        for one in estimates
        if one.stated is not None and one.identifiable and one.named.determined
        if not (may_be_one(one.named) or named >= {*one.causes})
    ]
    return f"Noise, true ÷ stated: {'; '.join(texts)}" if texts else ""


def missing(found: DriveDiagnosis) -> list[str]:
    """Return what a better recording would have to contain."""
    hidden = ", ".join(SHORT_NAMES[one.setting] for one in found.noise_scales if not one.identifiable)
    lacking = {
        "no gain is measured: too few fixes in motion before or after 60 % of the drive; drive longer": (
            found.findings and found.gain is None
        ),
        "what is left unexplained has no cause in the catalogue; a reference solution would show when it acts": (
            found.unexplained
        ),
        f"{hidden}: not identifiable on this drive; a static log shows the unit's own noise, better fixes or times "
        "without fixes show what it is in motion": hidden,
        "too few fixes count after the filter has settled, or they are too far off, to judge the noise settings": (
            not found.noise_scales
        ),
    }
    return [text for text, lacks in lacking.items() if lacks]


def whole_gain_text(gain: Gain) -> str:
    """Return the gain of all findings together on the held-out part of the drive, in words."""
    how = "better" if gain.nats > 0.0 else "worse" if gain.nats < 0.0 else "as well"
    part = "the last 40 %, parameters from the first 60 %" if gain.split == "60/40" else gain.split
    measures = f"; {text}" if (text := gain_text(gain)) else ""
    return f"All findings together, on {part}: fixes are predicted {how}{measures}"


def harm_text(gain: Gain | None) -> str:
    """Return why findings do not enter a configuration as they are, in words."""
    lost = gain is not None and gain.nats < 0.0
    why = (
        "lose likelihood"
        if lost
        else "gain likelihood, but an error with fixes, without them or against the reference grows"
    )
    return (
        f"Trial of the findings alone: on the part held out they {why}: this does harm, so take the names as hints; "
        "`tuner tune` writes them only where its own trial, of whole configurations, keeps them"
    )


def _cells(one: NoiseScaleEstimate) -> tuple[str, ...]:
    """Return the stated value of a setting, the scale estimated from the drive, and its causes."""
    if one.stated is None:
        return "–", "–", "–", "–", "not in the filter"
    stated = amount(Coefficient(one.stated, None, None, one.unit))
    if not one.identifiable:
        return stated, "–", "–", "–", "not identifiable on this drive"
    estimated = amount(times(one.plain, one.stated, one.unit))
    nothing = "nothing to account for" if may_be_one(one.plain) else "the findings"
    why = ", ".join(cause.replace("_", " ") for cause in one.causes) or nothing
    return stated, estimated, factor_text(one.plain), factor_text(one.named), why
