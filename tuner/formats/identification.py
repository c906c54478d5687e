"""Identifications as JSON, schema ``tuner.identification/1``, and back.

The five base terms of a channel are always there, one mapping of coefficients each, null where nothing is known; every
other kind of term is a list. `log_covariance` is the covariance of the logarithms of `parameters`. ``deviation`` of the
Allan curve is exact; the variance made of it is within rounding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np

from models.arrays import FloatArray
from models.noise import POWER_LAW, TERMS, NoiseModel
from tuner.formats.codec import dump, load, store, stored_form, structured
from tuner.formats.document_errors import Mismatch, refuse
from tuner.formats.grouping import gathered
from tuner.formats.noise_terms import noise_model, require_declared, require_possible_terms
from tuner.types import (
    AllanCurve,
    ArmaFit,
    Candidate,
    ChannelIdentification,
    Coefficient,
    Identification,
    SeriesTest,
    TermEstimate,
)
from tuner.types.number_ranges import Positive

BASE_TERMS = tuple(kind.name for kind in POWER_LAW)
"""Terms that are one mapping each and always there."""


def identification_json(identification: Identification) -> dict[str, Any]:
    """Return an identification as plain values."""
    content: dict[str, Any] = dump(identification)
    return content


def load_identification(content: object, *, source: str) -> Identification:
    """Return the identification of plain values.

    Raises
    ------
    DataError
        One line: file, place, expected, found, what to do.
    """
    return load(
        content,
        Identification,
        source=source,
        advice="write the file anew with 'tuner identify LOG --json FILE'",
    )


@dataclass(frozen=True)
class _MinimumForm(Coefficient):
    """Smallest Allan deviation and its cluster time, s."""

    tau: float = math.nan


@dataclass(frozen=True)
class _AllanForm:
    """Allan curve of one axis."""

    tau: FloatArray
    deviation: FloatArray
    dof: FloatArray
    estimator: str = "oadev"
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _TermForm:
    """Terms of one kind: one mapping of coefficients for a base term, a list of them for another kind."""

    base: bool
    estimates: tuple[Mapping[str, Coefficient], ...]


@dataclass(frozen=True)
class _OrderScore:
    """Score of one order (p, q)."""

    p: int
    q: int
    score: float


@stored_form(ArmaFit)
@dataclass(frozen=True)
class _ArmaForm:
    """ARMA(p, q); its coefficients have no unit."""

    p: int
    q: int
    ar: tuple[float, ...]
    ma: tuple[float, ...]
    ar_interval: tuple[tuple[float, float] | None, ...]
    ma_interval: tuple[tuple[float, float] | None, ...]
    variance: float
    interval_s: float
    unit: str
    criterion: str
    white: bool
    scores: tuple[_OrderScore, ...]
    steps: tuple[str, ...]
    samples: int = 0
    tests: tuple[SeriesTest, ...] = ()

    @classmethod
    def of(cls, fit: ArmaFit, /) -> Self:
        """Return the form of a fit."""
        return cls(
            p=len(fit.ar),
            q=len(fit.ma),
            ar=tuple(math.nan if c.value is None else c.value for c in fit.ar),
            ma=tuple(math.nan if c.value is None else c.value for c in fit.ma),
            ar_interval=tuple(c.interval for c in fit.ar),
            ma_interval=tuple(c.interval for c in fit.ma),
            variance=fit.variance,
            interval_s=fit.interval,
            unit=fit.unit,
            criterion=fit.criterion,
            white=fit.white,
            scores=tuple(_OrderScore(p, q, score) for (p, q), score in fit.scores.items()),
            steps=fit.steps,
            samples=fit.samples,
            tests=fit.tests,
        )

    def restored(self) -> ArmaFit:
        """Return the fit."""
        return ArmaFit(
            ar=_dimensionless(self.ar, self.ar_interval),
            ma=_dimensionless(self.ma, self.ma_interval),
            variance=self.variance,
            interval=self.interval_s,
            unit=self.unit,
            criterion=self.criterion,
            scores={(one.p, one.q): one.score for one in self.scores},
            white=self.white,
            steps=self.steps,
            samples=self.samples,
            tests=self.tests,
        )


@dataclass(frozen=True)
class _ChannelForm:
    """One axis, whose name is its key."""

    unit: str
    rate_hz: Positive | None
    span_s: float
    method: str
    terms: Mapping[str, _TermForm]
    mean: Coefficient
    sigma_10s: Coefficient
    minimum: _MinimumForm
    floor: Coefficient
    allan: _AllanForm
    parameters: tuple[str, ...] = ()
    log_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    arma: ArmaFit | None = None
    candidates: tuple[Candidate, ...] = ()
    warnings: tuple[str, ...] = ()
    interval_s: float | None = None
    model: NoiseModel | None = None

    @classmethod
    def of(cls, channel: ChannelIdentification, /) -> Self:
        """Return the form of one axis."""
        curve = channel.allan
        return cls(
            unit=channel.unit,
            rate_hz=1.0 / channel.interval if channel.interval > 0.0 else None,
            span_s=channel.span,
            method=channel.method,
            terms=_by_name(channel),
            mean=channel.mean,
            sigma_10s=channel.sigma_10s,
            minimum=_MinimumForm(**vars(channel.minimum), tau=channel.minimum_tau),
            floor=channel.floor,
            allan=_AllanForm(
                curve.tau, curve.deviation()[:, 0], curve.dof[:, 0], curve.estimator, curve.notes
            ),
            parameters=channel.parameters,
            log_covariance=channel.covariance,
            arma=channel.arma,
            candidates=channel.candidates,
            warnings=channel.warnings,
            interval_s=channel.interval,
            model=channel.model,
        )

    def restored(self, axis: str) -> ChannelIdentification:
        """Return the axis; what an older document lacks follows from the rest."""
        for name, form in self.terms.items():
            for coefficients in form.estimates:
                require_declared(name, coefficients, "terms")
                require_possible_terms(coefficients, "terms", name)
        terms = tuple(
            TermEstimate(name, coefficients)
            for name, form in self.terms.items()
            for coefficients in form.estimates
            if any(c != _unknown(c.unit) for c in coefficients.values())
        )
        count = len(self.parameters)
        if self.log_covariance.size != count**2:
            refuse(f"{count} × {count} numbers", f"{self.log_covariance.size}", "log_covariance")
        minimum = vars(self.minimum).copy()
        minimum_tau = minimum.pop("tau")
        interval = self.interval_s
        if interval is None:
            interval = 0.0 if self.rate_hz is None else 1.0 / self.rate_hz
        curve = self.allan
        return ChannelIdentification(
            axis=axis,
            unit=self.unit,
            interval=interval,
            span=self.span_s,
            method=self.method,
            model=noise_model(terms) if self.model is None else self.model,
            terms=terms,
            parameters=self.parameters,
            covariance=self.log_covariance.reshape(count, count),
            mean=self.mean,
            sigma_10s=self.sigma_10s,
            minimum=Coefficient(**minimum),
            floor=self.floor,
            minimum_tau=minimum_tau,
            allan=AllanCurve(
                curve.estimator,
                curve.tau,
                curve.deviation[:, None] ** 2,
                curve.dof[:, None],
                self.unit,
                (axis,),
                curve.notes,
            ),
            candidates=self.candidates,
            arma=self.arma,
            warnings=self.warnings,
        )


@stored_form(Identification)
@dataclass(frozen=True)
class _IdentificationForm:
    """All axes of one or more logs."""

    source: Mapping[str, Any]
    channels: Mapping[str, _ChannelForm]
    notes: tuple[str, ...] = ()
    schema: Literal["tuner.identification/1"] = "tuner.identification/1"

    @classmethod
    def of(cls, identification: Identification, /) -> Self:
        """Return the form of an identification."""
        channels = {axis: _ChannelForm.of(channel) for axis, channel in identification.channels.items()}
        return cls(identification.source, channels, identification.notes)

    def restored(self) -> Identification:
        """Return the identification."""
        channels = {}
        for axis, form in self.channels.items():
            try:
                channels[axis] = form.restored(axis)
            except Mismatch as error:
                place = ("channels", axis)
                raise error.within(*place) from None
        return Identification(self.source, channels, self.notes)


def _by_name(channel: ChannelIdentification) -> dict[str, _TermForm]:
    """Return the estimates of every kind of term, in their order; base terms that are not there are unknown."""
    found = gathered((term.name, term.coefficients) for term in channel.terms)
    for name in BASE_TERMS:
        if name not in found:
            names = TERMS[name].PARAMETERS
            units = TERMS[name](**dict.fromkeys(names, 1.0)).units(channel.unit)
            found[name] = [{n: _unknown(unit) for n, unit in zip(names, units, strict=True)}]
    found.setdefault("gauss_markov", [])
    return {name: _TermForm(name in BASE_TERMS, tuple(each)) for name, each in found.items()}


def _unknown(unit: str) -> Coefficient:
    return Coefficient(None, None, None, unit)


def _dimensionless(
    values: tuple[float, ...], intervals: tuple[tuple[float, float] | None, ...]
) -> tuple[Coefficient, ...]:
    return tuple(
        Coefficient(None if math.isnan(value) else value, interval, None, "1")
        for value, interval in zip(values, intervals, strict=True)
    )


def _dump_terms(form: _TermForm) -> Any:
    return form.estimates[0] if form.base and len(form.estimates) == 1 else form.estimates


def _load_terms(content: object) -> _TermForm:
    if isinstance(content, list):
        return _TermForm(False, structured(content, tuple[Mapping[str, Coefficient], ...]))
    return _TermForm(True, (structured(content, Mapping[str, Coefficient]),))


store(_TermForm, dump=_dump_terms, load=_load_terms)
