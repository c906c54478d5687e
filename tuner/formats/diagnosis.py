"""Diagnoses of static logs and of drives as JSON, schema ``tuner.diagnosis/1``.

A diagnosis of a drive also has ``inseparable``, ``gain``, ``credited``, ``demands`` (the estimates of noise scales),
``compensation``, and the configurations ``before`` and ``after``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tuner.formats.codec import dump, store
from tuner.types import (
    Diagnosis,
    DriveDiagnosis,
    Finding,
    Gain,
    NoiseScaleEstimate,
)


def diagnosis_json(diagnosis: Diagnosis | DriveDiagnosis) -> dict[str, Any]:
    """Return a diagnosis as plain values."""
    content: dict[str, Any] = dump(diagnosis)
    return content


def config_finding(finding: Finding) -> dict[str, Any]:
    """Return one finding as a configuration stores it: without its enlargements, which stand there on their own."""
    content: dict[str, Any] = dump(finding)
    return {key: entry for key, entry in content.items() if key != "inflations"}


def _before_after(pairs: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"before": before, "after": after} for name, (before, after) in pairs.items()}


def _gain(gain: Gain) -> dict[str, Any]:
    """Return what an extension of the model is worth."""
    return {
        "split": gain.split,
        "held_out_log_likelihood_per_sample": {"before": gain.before, "after": gain.after},
        "nats": gain.nats,
        "coverage": _before_after(gain.coverage),
        "user": _before_after(gain.user),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    """Return one cause, and the statistic that gave it away."""
    entries = dict(vars(finding))
    statistic = {"name": entries.pop("statistic"), "value": entries.pop("value")}
    drift = _before_after(entries.pop("drift"))
    cause, channels = entries.pop("cause"), entries.pop("channels")
    return {"cause": cause, "channels": channels, "statistic": statistic, **entries, "drift": drift}


def _noise_scale(one: NoiseScaleEstimate) -> dict[str, Any]:
    """Return the estimate of one noise setting from a drive; `asked` is the stated noise times the factor."""
    stated, factor = one.stated, one.plain
    size = None
    if stated is not None and factor.value is not None:
        ends = factor.interval and [stated * end for end in factor.interval]
        size = {"value": stated * factor.value, "interval": ends}
    return {
        "quantity": one.setting,
        "stated": {"value": stated, "unit": one.unit},
        "asked": size,
        "factor": factor,
        "factor_with_findings": one.named,
        "causes": one.causes,
        "identifiable": one.identifiable,
        "text": one.text,
    }


def _diagnosis(found: Diagnosis | DriveDiagnosis) -> dict[str, Any]:
    """Return the diagnosis of a static log or of a drive."""
    return {"schema": "tuner.diagnosis/1", "quiet": found.quiet, **vars(found)}


def _of_drive(found: DriveDiagnosis) -> dict[str, Any]:
    entries = _diagnosis(found)
    configurations = {name: entries.pop(name) for name in ("before", "after")}
    entries |= {"credited": found.credited, "demands": entries.pop("noise_scales")}
    return entries | {"compensation": found.compensation, **configurations}


for _kind, _entries in (
    (Gain, _gain),
    (Finding, _finding),
    (NoiseScaleEstimate, _noise_scale),
    (Diagnosis, _diagnosis),
    (DriveDiagnosis, _of_drive),
):
    store(_kind, dump=_entries)
