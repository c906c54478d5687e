"""Results as plain values ready for JSON: numbers, lists and null, never NaN or infinity.

A coefficient is ``{"value", "interval", "upper", "unit"}`` in SI, with the ``reason`` where there is
one. A null value with ``upper`` is a bound. The five base terms of a channel are always there;
Gauss–Markov is a list.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tuner.formats.files import plain
from tuner.formats.findings import coefficient_json
from tuner.identification.estimates import BASE
from tuner.types import (
    AllanCurve,
    ArmaFit,
    ChannelIdentification,
    Coefficient,
    Correlogram,
    Identification,
    Spectrum,
    TermEstimate,
)


def identification_json(identification: Identification) -> dict[str, Any]:
    """Return an identification in the form ``tuner.identification/1``."""
    return {
        "schema": "tuner.identification/1",
        "source": plain(identification.source),
        "channels": {axis: _channel(channel) for axis, channel in identification.channels.items()},
        "notes": list(identification.notes),
    }


def curve_json(curve: AllanCurve | Spectrum | Correlogram) -> dict[str, Any]:
    """Return the channels of one curve, by axis."""
    common: dict[str, Any]
    if isinstance(curve, Spectrum):
        lower, upper = curve.interval()
        columns = {"density": curve.density, "lower": lower, "upper": upper}
        common = {"unit": curve.unit, "estimator": "psd", "frequency": curve.frequency, "dof": curve.dof}
    elif isinstance(curve, Correlogram):
        columns = {"value": curve.value}
        common = {"unit": "1", "estimator": curve.statistic, "lag": curve.lag, "band": curve.band}
    else:
        lower, upper = curve.interval()
        columns = {"deviation": curve.deviation(), "lower": lower, "upper": upper, "dof": curve.dof}
        common = {"unit": curve.unit, "estimator": curve.estimator, "tau": curve.tau}
        if curve.notes:
            common["notes"] = curve.notes
    return {
        axis: plain({**common, **{name: values[:, j] for name, values in columns.items()}})
        for j, axis in enumerate(curve.axes)
    }


def curves_json(curves: Sequence[AllanCurve | Spectrum | Correlogram]) -> dict[str, Any]:
    """Return the curves of all sensors of a log in the form ``tuner.curve/1``."""
    channels = {axis: channel for curve in curves for axis, channel in curve_json(curve).items()}
    return {"schema": "tuner.curve/1", "channels": channels}


def _channel(channel: ChannelIdentification) -> dict[str, Any]:
    return {
        "unit": channel.unit,
        "rate_hz": plain(1.0 / channel.interval) if channel.interval > 0 else None,
        "span_s": plain(channel.span),
        "method": channel.method,
        "terms": _terms(channel),
        "parameters": list(channel.parameters),
        "log_covariance": plain(channel.covariance),
        "mean": coefficient_json(channel.mean),
        "sigma_10s": coefficient_json(channel.sigma_10s),
        "minimum": {**coefficient_json(channel.minimum), "tau": plain(channel.minimum_tau)},
        "floor": coefficient_json(channel.floor),
        "allan": {
            "tau": plain(channel.allan.tau),
            "deviation": plain(channel.allan.deviation()[:, 0]),
            "dof": plain(channel.allan.dof[:, 0]),
        },
        "arma": None if channel.arma is None else _arma(channel.arma),
        "candidates": [
            {"terms": list(c.terms), "score": plain(c.score), "note": c.note} for c in channel.candidates
        ],
        "warnings": list(channel.warnings),
    }


def _terms(channel: ChannelIdentification) -> dict[str, Any]:
    """Return the base terms as one mapping each, every other kind of term as a list."""
    terms: dict[str, Any] = {}
    for kind in BASE.values():
        found = channel.term(kind.name)
        unknown = dict(zip(kind.PARAMETERS, kind.units(channel.unit), strict=True))
        terms[kind.name] = (
            {name: coefficient_json(Coefficient(None, None, None, unit)) for name, unit in unknown.items()}
            if found is None
            else _coefficients(found)
        )
    terms["gauss_markov"] = []
    for estimate in channel.terms:
        if estimate.name not in BASE:
            terms.setdefault(estimate.name, []).append(_coefficients(estimate))
    return terms


def _coefficients(estimate: TermEstimate) -> dict[str, Any]:
    return {name: coefficient_json(c) for name, c in estimate.coefficients.items()}


def _arma(fit: ArmaFit) -> dict[str, Any]:
    return {
        "p": len(fit.ar),
        "q": len(fit.ma),
        "ar": [plain(c.value) for c in fit.ar],
        "ma": [plain(c.value) for c in fit.ma],
        "ar_interval": [plain(c.interval) for c in fit.ar],
        "ma_interval": [plain(c.interval) for c in fit.ma],
        "variance": plain(fit.variance),
        "interval_s": plain(fit.interval),
        "unit": fit.unit,
        "criterion": fit.criterion,
        "white": fit.white,
        "scores": [{"p": p, "q": q, "score": plain(score)} for (p, q), score in fit.scores.items()],
        "steps": list(fit.steps),
    }
