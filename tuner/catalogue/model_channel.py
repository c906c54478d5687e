"""The identification of one axis without data: its figures are those of a noise model."""

from __future__ import annotations

import math

import numpy as np

from models.noise.bias_instability import ALLAN_FLOOR
from tuner.formats.noise_terms import noise_model
from tuner.types import AllanCurve, ChannelIdentification, Coefficient, TermEstimate

LONGEST_TAU = 1e4
"""Longest cluster time at which the smallest Allan deviation is looked for, s: that of a record of some days."""
MINIMUM_TOLERANCE = 1.01
"""The minimum is where the deviation first comes so near to its smallest value: flicker has none at a finite time."""


def channel_of_terms(
    axis: str,
    unit: str,
    terms: tuple[TermEstimate, ...],
    *,
    interval: float,
    method: str,
    shortest_tau: float,
    reason: str,
) -> ChannelIdentification:
    """Return an axis whose figures are those of the sum of its terms.

    Parameters
    ----------
    axis, unit : str
        Channel and unit of its samples.
    terms : tuple of TermEstimate
        The terms.
    interval : float
        Sampling interval, s.
    method : str
        Where the terms come from, such as ``datasheet``.
    shortest_tau : float
        Shortest cluster time at which the smallest Allan deviation is looked for, s.
    reason : str
        Why the mean is not known.
    """
    model = noise_model(terms)
    tau = np.geomspace(shortest_tau, LONGEST_TAU, 201)
    deviation = np.sqrt(model.allan_variance(tau)) if model.terms else np.zeros(0)
    first = int(np.argmax(deviation <= MINIMUM_TOLERANCE * deviation.min())) if model.terms else 0
    unknown = Coefficient(None, None, None, unit, reason)

    def figure(value: float) -> Coefficient:
        return Coefficient(value, None, None, unit, "of the model, not of data")

    return ChannelIdentification(
        axis=axis,
        unit=unit,
        interval=interval,
        span=0.0,
        method=method,
        model=model,
        terms=terms,
        parameters=(),
        covariance=np.zeros((0, 0)),
        mean=unknown,
        sigma_10s=figure(math.sqrt(float(model.allan_variance(10.0)))) if model.terms else unknown,
        minimum=figure(float(deviation[first])) if model.terms else unknown,
        floor=figure(float(deviation[first]) / ALLAN_FLOOR) if model.terms else unknown,
        minimum_tau=float(tau[first]),
        allan=AllanCurve("none", np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1)), unit, (axis,)),
    )
