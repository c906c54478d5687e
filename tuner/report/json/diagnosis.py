"""A diagnosis as plain values ready for JSON, schema ``tuner.diagnosis/1``."""

from __future__ import annotations

from typing import Any

from tuner.formats.files import plain
from tuner.formats.findings import coefficient_json, finding_json, gain_json
from tuner.types import Diagnosis, DriveDiagnosis, NoiseScaleEstimate, Unexplained


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis; numbers are SI, NaN and infinity become null."""
    return {
        "schema": "tuner.diagnosis/1",
        "quiet": diagnosis.quiet,
        "findings": [finding_json(finding) for finding in diagnosis.findings],
        "unexplained": [_unexplained(one) for one in diagnosis.unexplained],
        "notes": list(diagnosis.notes),
        "models": {axis: plain(model.as_dict()) for axis, model in diagnosis.models.items()},
    }


def drive_diagnosis_json(diagnosis: DriveDiagnosis) -> dict[str, Any]:
    """Return the diagnosis of a drive: besides, what cannot be told apart, and what each noise setting is asked."""
    return {
        "schema": "tuner.diagnosis/1",
        "quiet": diagnosis.quiet,
        "findings": [finding_json(finding) for finding in diagnosis.findings],
        "unexplained": [_unexplained(one) for one in diagnosis.unexplained],
        "inseparable": [{"causes": list(i.causes), "text": i.text} for i in diagnosis.inseparable],
        "notes": list(diagnosis.notes),
        "gain": None if diagnosis.gain is None else gain_json(diagnosis.gain),
        "credited": diagnosis.credited,
        "demands": [noise_scale_json(one) for one in diagnosis.noise_scales],
        "compensation": plain(diagnosis.compensation.as_text()),
    }


def noise_scale_json(one: NoiseScaleEstimate) -> dict[str, Any]:
    """Return the estimate of one noise setting from a drive."""
    stated, factor = one.stated, one.plain
    asked: dict[str, Any] | None = None
    if stated is not None and factor.value is not None:
        interval = None if factor.interval is None else [stated * end for end in factor.interval]
        asked = {"value": stated * factor.value, "interval": interval}
    return {
        "quantity": one.setting,
        "stated": {"value": plain(one.stated), "unit": one.unit},
        "asked": plain(asked),
        "factor": coefficient_json(one.plain),
        "factor_with_findings": coefficient_json(one.named),
        "causes": list(one.causes),
        "identifiable": one.identifiable,
        "text": one.text,
    }


def _unexplained(one: Unexplained) -> dict[str, Any]:
    return {"statistic": one.statistic, "channels": list(one.channels), "p_value": plain(float(one.p_value))}
