"""Empirical curves as JSON, schema ``tuner.curve/1``: one entry a channel.

Allan curves carry the deviation, spectra the two-sided density, correlograms the correlation; ``lower`` and ``upper``
are 95 % limits made of value and degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from models.arrays import FloatArray
from tuner.formats.codec import dump
from tuner.types import AllanCurve, Correlogram, Spectrum

Curve: TypeAlias = AllanCurve | Spectrum | Correlogram


@dataclass(frozen=True)
class _AllanForm:
    """One axis of a curve of the Allan family."""

    unit: str
    estimator: str
    tau: FloatArray
    deviation: FloatArray
    lower: FloatArray
    upper: FloatArray
    dof: FloatArray
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _SpectrumForm:
    """One axis of a spectrum."""

    unit: str
    estimator: str
    frequency: FloatArray
    dof: FloatArray
    density: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class _CorrelogramForm:
    """One axis of a correlogram."""

    unit: str
    estimator: str
    lag: FloatArray
    band: float
    value: FloatArray


_Form: TypeAlias = _AllanForm | _SpectrumForm | _CorrelogramForm


def curves_json(curves: Sequence[Curve]) -> dict[str, Any]:
    """Return the curves of all sensors of a log as plain values."""
    channels = {axis: dump(_form(curve, j)) for curve in curves for j, axis in enumerate(curve.axes)}
    return {"schema": "tuner.curve/1", "channels": channels}


def _form(curve: Curve, column: int) -> _Form:
    if isinstance(curve, Correlogram):
        return _CorrelogramForm("1", curve.statistic, curve.lag, curve.band, curve.value[:, column])
    lower, upper = (limit[:, column] for limit in curve.interval())
    if isinstance(curve, Spectrum):
        return _SpectrumForm(
            curve.unit, "psd", curve.frequency, curve.dof, curve.density[:, column], lower, upper
        )
    deviation, dof = curve.deviation()[:, column], curve.dof[:, column]
    return _AllanForm(curve.unit, curve.estimator, curve.tau, deviation, lower, upper, dof, curve.notes)
