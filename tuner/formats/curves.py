"""Empirical curves as JSON, schema ``tuner.curve/1``, and back: one entry a channel.

Allan curves carry the deviation, spectra the two-sided density, correlograms the correlation; ``lower`` and ``upper``
are 95 % limits made of value and degrees of freedom, and are not read back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from models.arrays import FloatArray
from tuner.formats.codec import dump, load, store, structured
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
    notes: tuple[str, ...] = ()

    def restored(self, axis: str) -> AllanCurve:
        variance = self.deviation[:, None] ** 2
        return AllanCurve(
            self.estimator, self.tau, variance, self.dof[:, None], self.unit, (axis,), self.notes
        )


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

    def restored(self, axis: str) -> Spectrum:
        return Spectrum(self.frequency, self.density[:, None], self.dof, self.unit, (axis,))


@dataclass(frozen=True)
class _CorrelogramForm:
    """One axis of a correlogram."""

    unit: str
    estimator: str
    lag: FloatArray
    band: float
    value: FloatArray

    def restored(self, axis: str) -> Correlogram:
        return Correlogram(self.estimator, self.lag, self.value[:, None], self.band, (axis,))


_Form: TypeAlias = _AllanForm | _SpectrumForm | _CorrelogramForm


def curves_json(curves: Sequence[Curve]) -> dict[str, Any]:
    """Return the curves of all sensors of a log as plain values."""
    channels = {axis: dump(_form(curve, j)) for curve in curves for j, axis in enumerate(curve.axes)}
    return {"schema": "tuner.curve/1", "channels": channels}


def load_curves(content: object, *, source: str) -> dict[str, Curve]:
    """Return the curve of every channel, each with one axis.

    Raises
    ------
    DataError
        One line: file, place, expected, found, what to do.
    """
    advice = "write the file anew with 'tuner curve LOG --json FILE'"
    found = load(content, _CurvesForm, source=source, advice=advice)
    return {axis: form.restored(axis) for axis, form in found.channels.items()}


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


@dataclass(frozen=True)
class _CurvesForm:
    """All channels of one log."""

    schema: Literal["tuner.curve/1"]
    channels: Mapping[str, _Channel]


@dataclass(frozen=True)
class _Channel:
    """The form of one channel, whichever its estimator."""

    form: _Form

    def restored(self, axis: str) -> Curve:
        return self.form.restored(axis)


def _load_channel(content: object) -> _Channel:
    estimator = structured(content, _Estimator).estimator
    kinds: dict[str, type[_Form]] = {"psd": _SpectrumForm, "acf": _CorrelogramForm, "pacf": _CorrelogramForm}
    return _Channel(structured(content, kinds.get(estimator, _AllanForm)))


@dataclass(frozen=True)
class _Estimator:
    """The entry that tells which kind of curve a channel is."""

    estimator: str


store(_Channel, load=_load_channel)
