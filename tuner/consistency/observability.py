"""Which states of a filter a trajectory shows, and which it does not distinguish.

From the filter's own covariance P after its last fix and P₀ at the start, both of the states with a physical meaning
(position, velocity, attitude, total biases, constants)::

    left_i = √(P_ii / P₀_ii)                     1: no information gained; above 1: less certain than at the start
    C = D⁻¹ P D⁻¹,  D = diag √P_ii               C v = λ v

Uncorrelated states have λ = 1. An eigenvector with λ well above 1 is a weak direction: its states move together,
and what the fixes see is only another sum of them.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from models.filter_states import FILTER_STATES
from tuner.navigation.settings import FilterSettings, further_states, total_bias
from tuner.types.consistency import Observability, WeakDirection

MIN_EIGENVALUE = 1.7
"""Eigenvalue from which states count as not distinguished: 1 + ρ of two states with correlation ρ = 0.7."""
MIN_PART = 0.35
"""Least part of a state that is named in a weak direction: a tenth of its squared length (0.35² = 0.12)."""
POORLY_OBSERVED, HARDLY_OBSERVED = 0.3, 0.7
"""Final ÷ initial sd from which a state counts as poorly, or hardly, observed: variance down to a tenth, to a half."""

NAMES = (
    *(f"{what} {axis}" for what in ("position", "velocity") for axis in ("north", "east", "down")),
    "tilt about north",
    "tilt about east",
    "heading",
    *(f"{sensor} bias {axis}" for sensor in ("gyro", "accelerometer") for axis in "xyz"),
)
"""Position, velocity, attitude and total biases, in the order of the errors of a simulated run."""


def observability(settings: FilterSettings, final: FloatArray) -> Observability:
    """Return the final ÷ initial sds of the states of a filter, and the directions that stay weak.

    Parameters
    ----------
    settings : FilterSettings
        States and prior.
    final : ndarray, shape (n, n)
        P after the last fix.
    """
    names, m = physical_states(settings)
    after, before = m @ final @ m.T, m**2 @ settings.initial_sd**2
    sd = np.sqrt(np.diag(after))
    left = dict(zip(names, (sd / np.where(before > 0.0, np.sqrt(before), np.inf)).tolist(), strict=True))
    known = sd > 0.0
    labels = [name for name, good in zip(names, known, strict=True) if good]
    correlation = (after / np.outer(np.where(known, sd, 1.0), np.where(known, sd, 1.0)))[np.ix_(known, known)]
    values, vectors = np.linalg.eigh(correlation)
    weak = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        order = [int(i) for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > MIN_PART]
        if value < MIN_EIGENVALUE or len(order) < 2 or max(left[labels[i]] for i in order) < POORLY_OBSERVED:
            continue
        sign = np.sign(vector[order[0]])
        weak.append(
            WeakDirection(
                tuple(labels[i] for i in order), tuple(float(sign * vector[i]) for i in order), float(value)
            )
        )
    return Observability(left, tuple(weak))


def physical_states(settings: FilterSettings) -> tuple[list[str], FloatArray]:
    """Return names of the physical states, in the order of the errors of a simulated run, and the matrix to them.

    The matrix, shape (15 + r, n), takes the states of the filter to position, velocity, attitude, total biases and
    the r further states.
    """
    model = settings.model
    names, rows = list(NAMES), [total_bias(model)]
    for name in further_states(model):
        rows.append(np.eye(settings.size)[model.layout[name]])
        names += FILTER_STATES[name].labels
    return names, np.vstack(rows)
