"""Standard deviations that a receiver reports: how they stand to the truth, by class of fix and as a function.

Fixes fall into classes where the reported sd jumps, as between fixed, float and single solutions: gaps of its logarithm
in the sorted values. Of position and of velocity, four laws compete, the likelihood less ½ ln n a parameter deciding::

    factor     a r                  one number for all: the base
    classes    a_c r                one for each class
    power      a r̄ (r/r̄)^b         r̄ the geometric mean of r
    floor      √(a² r² + b²)
    constant   a r̄                 the report says nothing

Each but the base is tested against it by the likelihood ratio: χ² of the numbers it adds; against a constant, which
has as many numbers as the base, by the penalised gain alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tuner.diagnosis.drives.fitting import Fit, maximise
from tuner.diagnosis.drives.likelihood import Belief, Gradient
from tuner.diagnosis.drives.scales import BLOCKS, Scales
from tuner.results import Coefficient

FloatArray = NDArray[np.float64]
Derivatives = list[FloatArray]
Law = Callable[[FloatArray, FloatArray], tuple[FloatArray, Derivatives]]
"""(reported sds (k, 3), parameters (q,)) → logs of the sds (k, 3) and their derivatives, q times (k, 3)."""

JUMP = np.log(2.0)
"""Gap of the log of the reported sd that parts two classes."""
SMALLEST = 0.03
"""Least share of the fixes in a class."""
FEWEST = 30
"""Least number of fixes in a class."""
VARIES = 1.2
"""Ratio of the 95 % to the 5 % quantile of the reported sd from which its law can be asked for."""


@dataclass(frozen=True)
class ReportedLaw:
    """How the sds of a receiver stand to the truth.

    Attributes
    ----------
    block : str
        ``position`` or ``velocity``.
    law : str
        Name of the best law.
    fits : mapping of str to Fit
        Of every law that was tried.
    gain : float
        Penalised log likelihood of the best law over the base, nats.
    p_value : float
        Chance of so much against the base; 1 for the base itself and for ``constant``.
    classes : ndarray of int, shape (k,)
        Class of every fix, by rising sd.
    """

    block: str
    law: str
    fits: dict[str, Fit]
    gain: float
    p_value: float
    classes: NDArray[np.int64]

    @property
    def parameters(self) -> dict[str, Coefficient]:
        """Numbers of the best law with intervals: factors, and the exponent itself."""
        fit, out = self.fits[self.law], {}
        for j, name in enumerate(fit.scales.names):
            if name == "exponent":
                value, half = 1.0 + float(fit.estimate[j]), 1.96 * float(np.sqrt(fit.covariance[j, j]))
                out[name] = Coefficient.known(value, value - half, value + half, "1")
            else:
                out[name] = fit.coefficient(name)
        return out


def fix_classes(reported: FloatArray) -> NDArray[np.int64]:
    """Return the class of every fix, by rising reported sd (k,), NaN allowed (class 0); shape (k,)."""
    good = np.isfinite(reported) & (reported > 0.0)
    logs = np.log(np.where(good, reported, 1.0))
    order = np.sort(logs[good])
    if not len(order):
        return np.zeros(len(reported), dtype=np.int64)
    least = max(FEWEST, int(SMALLEST * len(order)))
    edges, start = [], 0
    for i in np.flatnonzero(np.diff(order) > JUMP).tolist():
        if i + 1 - start >= least and len(order) - i - 1 >= least:
            edges.append(0.5 * (order[i] + order[i + 1]))
            start = i + 1
    return np.where(good, np.searchsorted(np.array(edges), logs), 0).astype(np.int64)


def reported_law(belief: Belief, block: str) -> ReportedLaw | None:
    """Choose the law of the reported sds of a block; None where they do not vary, or are not there.

    Parameters
    ----------
    belief : Belief
        What is believed so far; the laws take the place of its sds where the receiver reports one.
    block : str
        ``position`` or ``velocity``.
    """
    columns = list(BLOCKS[block])
    reported = belief.record.reported_sd[:, columns]
    whole = belief.counted[:, columns] & np.isfinite(reported) & (reported > 0.0)
    counted: NDArray[np.bool_] = np.count_nonzero(whole, axis=1) == len(columns)
    if np.count_nonzero(counted) < 2 * FEWEST:
        return None
    level = np.sqrt(np.mean(reported[:, :2] ** 2, axis=1))
    low, high = np.quantile(level[counted], (0.05, 0.95))
    if high < VARIES * low:
        return None
    classes = fix_classes(np.where(counted, level, np.nan))
    tried = _laws(reported[counted], classes[counted])
    fits = {
        name: maximise(belief, _scales(names, law, columns, counted)) for name, (names, law) in tried.items()
    }
    price = 0.5 * float(np.log(3 * np.count_nonzero(counted)))
    score = {name: fit.log_likelihood - price * len(fit.estimate) for name, fit in fits.items()}
    best = max(score, key=lambda name: score[name])
    more = len(fits[best].estimate) - len(fits["factor"].estimate)
    ratio = max(0.0, 2.0 * (fits[best].log_likelihood - fits["factor"].log_likelihood))
    p_value = float(chi2.sf(ratio, more)) if more else 1.0
    return ReportedLaw(block, best, fits, score[best] - score["factor"], p_value, classes)


def _scales(names: tuple[str, ...], law: Law, columns: list[int], rows: NDArray[np.bool_]) -> Scales:
    """Return a law as parameters of a fit."""
    at = (np.flatnonzero(rows)[:, None], np.array(columns))

    def change(belief: Belief, x: FloatArray) -> Belief:
        sd = belief.sd.copy()
        sd[at] = np.exp(law(belief.record.reported_sd[at], x)[0])
        return replace(belief, sd=sd)

    def slopes(belief: Belief, x: FloatArray, gradient: Gradient) -> FloatArray:
        own = gradient.by_sd[at]
        return np.array([float(np.sum(own * d)) for d in law(belief.record.reported_sd[at], x)[1]])

    return Scales(names, change, slopes)


def _laws(reported: FloatArray, classes: NDArray[np.int64]) -> dict[str, tuple[tuple[str, ...], Law]]:
    """Return the laws by name, each with the names of its parameters."""
    mean = np.log(reported).mean(axis=0)
    ones = np.ones_like(reported)

    def factor(r: FloatArray, x: FloatArray) -> tuple[FloatArray, Derivatives]:
        return np.log(r) + x[0], [ones]

    def power(r: FloatArray, x: FloatArray) -> tuple[FloatArray, Derivatives]:
        away = np.log(r) - mean
        return mean + x[0] + (1.0 + x[1]) * away, [ones, away]

    def constant(r: FloatArray, x: FloatArray) -> tuple[FloatArray, Derivatives]:
        return mean + x[0] + 0.0 * r, [ones]

    def floor(r: FloatArray, x: FloatArray) -> tuple[FloatArray, Derivatives]:
        own, least = np.exp(2.0 * x[0]) * r**2, np.exp(2.0 * (mean + x[1])) * ones
        return 0.5 * np.log(own + least), [own / (own + least), least / (own + least)]

    present = np.unique(classes)

    def by_class(r: FloatArray, x: FloatArray) -> tuple[FloatArray, Derivatives]:
        inside = [np.where((classes == c)[:, None], 1.0, 0.0) * ones for c in present]
        logs = np.log(r)
        for value, one in zip(x, inside, strict=True):
            logs = logs + value * one
        return logs, inside

    laws: dict[str, tuple[tuple[str, ...], Law]] = {
        "factor": (("factor",), factor),
        "power": (("factor", "exponent"), power),
        "floor": (("factor", "floor"), floor),
        "constant": (("factor",), constant),
    }
    if len(present) > 1:
        laws["classes"] = (tuple(f"class_{c}" for c in present.tolist()), by_class)
    return laws
