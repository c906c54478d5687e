"""Whether a drive determines a constant of the installation: a lever arm, a delay, a scale factor, a mounting."""

from __future__ import annotations

import numpy as np

from models.arrays import BoolArray, FloatArray
from tuner.limits import PRIOR_SHARE
from tuner.navigation.data import Solution
from tuner.navigation.settings import FilterSettings, further_states

HALF_INTERVAL = 1.96
"""Half of a 95 % interval, in sds."""


def determined_by_halves(
    first: tuple[FloatArray, FloatArray],
    second: tuple[FloatArray, FloatArray],
    whole_sd: FloatArray,
    prior_sd: float | FloatArray,
) -> BoolArray:
    """Return of which components both halves of a drive agree, and the whole knows more than the prior; shape (p,).

    Parameters
    ----------
    first, second : tuple of ndarray and ndarray, shape (p,)
        Components by each half, and their sds, SI.
    whole_sd : ndarray, shape (p,)
        Sds by the whole drive.
    prior_sd : float or ndarray, shape (p,)
        Sd of each component before the drive.
    """
    known = whole_sd <= PRIOR_SHARE * prior_sd
    agree = np.abs(first[0] - second[0]) <= HALF_INTERVAL * (first[1] + second[1])
    return np.asarray(known & agree)


def determined_state(solution: Solution, settings: FilterSettings, name: str) -> BoolArray:
    """Return which components of one of its constant states a filter's run determines, shape (p,).

    Its estimate in the middle of the run is that of the first half; what the second half adds in information is the
    estimate of the second.
    """
    at, rows = settings.model.layout[name], further_states(settings.model)[name]
    middle = len(solution.t) // 2
    x1, x2 = solution.parameters[middle, at], solution.final_parameters[at]
    v1 = np.diag(solution.further_covariance[middle])[rows]
    v2 = np.diag(solution.final_covariance)[at]
    added = np.maximum(1.0 / v2 - 1.0 / v1, np.finfo(float).tiny)
    second = (x2 / v2 - x1 / v1) / added
    prior = float(np.max(settings.initial_sd[at]))
    return determined_by_halves((x1, np.sqrt(v1)), (second, np.sqrt(1.0 / added)), np.sqrt(v2), prior)
