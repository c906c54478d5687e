"""Coefficients, findings and gains in the plain form in which files carry them: numbers, lists and null."""

from __future__ import annotations

from typing import Any

from tuner.formats.files import plain
from tuner.types import Coefficient, Enlargement, Finding, Gain


def coefficient_json(coefficient: Coefficient) -> dict[str, Any]:
    """Return a number with its interval or bound."""
    answer = {
        "value": plain(coefficient.value),
        "interval": plain(coefficient.interval),
        "upper": plain(coefficient.upper),
        "unit": coefficient.unit,
    }
    return answer if coefficient.reason is None else {**answer, "reason": coefficient.reason}


def finding_json(finding: Finding) -> dict[str, Any]:
    """Return one finding."""
    return {
        "cause": finding.cause,
        "channels": list(finding.channels),
        "statistic": {"name": finding.statistic, "value": plain(float(finding.value))},
        "p_value": plain(float(finding.p_value)),
        "parameters": {name: coefficient_json(value) for name, value in finding.parameters.items()},
        "by_channel": {
            axis: {name: coefficient_json(value) for name, value in values.items()}
            for axis, values in finding.by_channel.items()
        },
        "gain": None if finding.gain is None else gain_json(finding.gain),
        "alternatives": [{"cause": a.cause, "score": plain(a.score)} for a in finding.alternatives],
        "text": finding.text,
        "consequence": finding.consequence,
        "extension": plain(dict(finding.extension)),
        "inflations": [_enlargement(one) for one in finding.inflations],
    }


def _enlargement(one: Enlargement) -> dict[str, Any]:
    """Return a factor on a setting; `interval` is null, as only a drive estimates one."""
    return {**vars(one), "quantity": str(one.quantity), "interval": None}


def carried(finding: Finding) -> dict[str, Any]:
    """Return one finding as a configuration carries it: its inflations stand there by themselves."""
    told = finding_json(finding)
    told.pop("inflations")
    return told


def gain_json(gain: Gain) -> dict[str, Any]:
    """Return a gain."""
    return {
        "split": gain.split,
        "held_out_log_likelihood_per_sample": {"before": plain(gain.before), "after": plain(gain.after)},
        "nats": plain(gain.nats),
        "coverage": {name: {"before": a, "after": b} for name, (a, b) in gain.coverage.items()},
        "user": {name: {"before": plain(a), "after": plain(b)} for name, (a, b) in gain.user.items()},
    }
