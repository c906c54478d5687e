"""Diagnoses of static logs and of drives as JSON, schema ``tuner.diagnosis/1``.

A diagnosis of a drive also has ``inseparable``, ``gain``, ``credited``, ``demands`` (the estimates of noise scales),
``compensation``, and the configurations ``before`` and ``after``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from models.noise import NoiseModel
from tuner.formats.codec import dump, stored_form
from tuner.types import (
    Alternative,
    Coefficient,
    Compensation,
    Diagnosis,
    DriveDiagnosis,
    Enlargement,
    FilterConfig,
    Finding,
    Gain,
    Inseparable,
    NoiseScaleEstimate,
    Unexplained,
)

Schema = Literal["tuner.diagnosis/1"]


def diagnosis_json(diagnosis: Diagnosis | DriveDiagnosis) -> dict[str, Any]:
    """Return a diagnosis as plain values."""
    content: dict[str, Any] = dump(diagnosis)
    return content


def config_finding(finding: Finding) -> dict[str, Any]:
    """Return one finding as a configuration stores it: without its enlargements, which stand there on their own."""
    content: dict[str, Any] = dump(finding)
    return {key: entry for key, entry in content.items() if key != "inflations"}


@dataclass(frozen=True)
class _BeforeAfter:
    """A figure before and after."""

    before: float
    after: float


@stored_form(Gain)
@dataclass(frozen=True)
class _GainForm:
    """What an extension of the model is worth."""

    split: str
    held_out_log_likelihood_per_sample: _BeforeAfter
    nats: float
    coverage: Mapping[str, _BeforeAfter] = field(default_factory=dict)
    user: Mapping[str, _BeforeAfter] = field(default_factory=dict)

    @classmethod
    def of(cls, gain: Gain, /) -> Self:
        """Return the form of a gain."""
        return cls(
            gain.split,
            _BeforeAfter(gain.before, gain.after),
            gain.nats,
            {name: _BeforeAfter(*pair) for name, pair in gain.coverage.items()},
            {name: _BeforeAfter(*pair) for name, pair in gain.user.items()},
        )

    def restored(self) -> Gain:
        """Return the gain."""
        likelihood = self.held_out_log_likelihood_per_sample
        return Gain(
            self.split,
            likelihood.before,
            likelihood.after,
            self.nats,
            {name: (pair.before, pair.after) for name, pair in self.coverage.items()},
            {name: (pair.before, pair.after) for name, pair in self.user.items()},
        )


@dataclass(frozen=True)
class _StatisticForm:
    """The statistic that gave a cause away, and its value."""

    name: str
    value: float


@stored_form(Finding)
@dataclass(frozen=True)
class _FindingForm:
    """One cause."""

    cause: str
    channels: tuple[str, ...]
    statistic: _StatisticForm
    p_value: float
    parameters: Mapping[str, Coefficient]
    by_channel: Mapping[str, Mapping[str, Coefficient]]
    gain: Gain | None
    alternatives: tuple[Alternative, ...]
    text: str
    consequence: str = ""
    extension: Mapping[str, Any] = field(default_factory=dict)
    inflations: tuple[Enlargement, ...] = ()
    drift: Mapping[str, _BeforeAfter] = field(default_factory=dict)
    doubted: tuple[str, ...] = ()

    @classmethod
    def of(cls, finding: Finding, /) -> Self:
        """Return the form of a finding."""
        entries = dict(vars(finding))
        statistic = _StatisticForm(entries.pop("statistic"), entries.pop("value"))
        drift = {name: _BeforeAfter(*pair) for name, pair in entries.pop("drift").items()}
        return cls(statistic=statistic, drift=drift, **entries)

    def restored(self) -> Finding:
        """Return the finding."""
        entries = {**vars(self), "statistic": self.statistic.name, "value": self.statistic.value}
        entries["drift"] = {name: (pair.before, pair.after) for name, pair in self.drift.items()}
        return Finding(**entries)


@stored_form(Diagnosis)
@dataclass(frozen=True, kw_only=True)
class _DiagnosisForm:
    """The diagnosis of a static log."""

    schema: Schema = "tuner.diagnosis/1"
    quiet: bool
    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    notes: tuple[str, ...]
    models: Mapping[str, NoiseModel]
    base: Mapping[str, NoiseModel]
    parts: Mapping[str, tuple[float, float]]
    left_out: tuple[tuple[float, float], ...] = ()

    @classmethod
    def of(cls, diagnosis: Diagnosis, /) -> Self:
        """Return the form of a diagnosis."""
        return cls(quiet=diagnosis.quiet, **vars(diagnosis))


@dataclass(frozen=True)
class _StatedForm:
    """A stated noise, root mean square over the axes."""

    value: float | None
    unit: str


@dataclass(frozen=True)
class _SizeForm:
    """A noise with its interval."""

    value: float
    interval: tuple[float, float] | None


@stored_form(NoiseScaleEstimate)
@dataclass(frozen=True)
class _NoiseScaleForm:
    """The estimate of one noise setting from a drive; `asked` is the stated noise times the factor."""

    quantity: str
    stated: _StatedForm
    asked: _SizeForm | None
    factor: Coefficient
    factor_with_findings: Coefficient
    causes: tuple[str, ...]
    identifiable: bool
    text: str

    @classmethod
    def of(cls, one: NoiseScaleEstimate, /) -> Self:
        """Return the form of an estimate."""
        stated, factor = one.stated, one.plain
        size = None
        if stated is not None and factor.value is not None:
            ends = (
                None
                if factor.interval is None
                else (stated * factor.interval[0], stated * factor.interval[1])
            )
            size = _SizeForm(stated * factor.value, ends)
        return cls(
            one.setting,
            _StatedForm(stated, one.unit),
            size,
            factor,
            one.named,
            one.causes,
            one.identifiable,
            one.text,
        )


@stored_form(DriveDiagnosis)
@dataclass(frozen=True, kw_only=True)
class _DriveDiagnosisForm:
    """The diagnosis of a drive."""

    schema: Schema = "tuner.diagnosis/1"
    quiet: bool
    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    inseparable: tuple[Inseparable, ...]
    notes: tuple[str, ...]
    gain: Gain | None
    credited: bool
    demands: tuple[NoiseScaleEstimate, ...]
    compensation: Compensation
    before: FilterConfig
    after: FilterConfig

    @classmethod
    def of(cls, diagnosis: DriveDiagnosis, /) -> Self:
        """Return the form of a diagnosis."""
        entries = dict(vars(diagnosis))
        return cls(
            quiet=diagnosis.quiet,
            credited=diagnosis.credited,
            demands=entries.pop("noise_scales"),
            compensation=diagnosis.compensation,
            **entries,
        )
