"""Empirical curves as JSON, schema ``tuner.curve/1``: one entry a channel.

Allan curves carry the deviation, spectra the two-sided density, correlograms the correlation; ``lower`` and ``upper``
are 95 % limits made of value and degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from tuner.formats.codec import dump
from tuner.types import AllanCurve, Correlogram, Spectrum

Curve: TypeAlias = AllanCurve | Spectrum | Correlogram


def curves_json(curves: Sequence[Curve]) -> dict[str, Any]:
    """Return the curves of all sensors of a log as plain values."""
    channels = {axis: dump(_axis(curve, j)) for curve in curves for j, axis in enumerate(curve.axes)}
    return {"schema": "tuner.curve/1", "channels": channels}


def _axis(curve: Curve, column: int) -> dict[str, Any]:
    """Return one axis of a curve."""
    if isinstance(curve, Correlogram):
        value = curve.value[:, column]
        return {
            "unit": "1",
            "estimator": curve.statistic,
            "lag": curve.lag,
            "band": curve.band,
            "value": value,
        }
    lower, upper = (limit[:, column] for limit in curve.interval())
    limits = {"lower": lower, "upper": upper}
    if isinstance(curve, Spectrum):
        head = {"unit": curve.unit, "estimator": "psd", "frequency": curve.frequency, "dof": curve.dof}
        return {**head, "density": curve.density[:, column], **limits}
    deviation, dof = curve.deviation()[:, column], curve.dof[:, column]
    head = {"unit": curve.unit, "estimator": curve.estimator, "tau": curve.tau, "deviation": deviation}
    return {**head, **limits, "dof": dof, "notes": curve.notes}
