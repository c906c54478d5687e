"""Reading coefficients off the slopes of the Allan deviation, as the five-segment construction does by hand.

Where the log–log curve runs parallel to the line of a term, that line is read at one τ::

    quantization      slope −1     Q = σ(√3)
    white             slope −1/2   N = σ(1)
    bias instability  slope 0      B = σ_floor / √(2 ln 2/π) = σ_floor / 0.664
    random walk       slope +1/2   K = σ(3)
    ramp              slope +1     R = σ(√2)

The reading takes the curve of the sum for the curve of one term: it runs high by the share of its neighbours
(B by 4 … 27 %) and needs a stretch where one term rules. It is a start and a picture, not an estimate. Terms follow
one another as their slopes do: what lies flat before the white noise, as behind a low-pass filter, is no floor.

References
----------
.. [1] IEEE Std 952-1997, Annex C.
.. [2] N. El-Sheimy, H. Hou, X. Niu, Analysis and modeling of inertial sensors using Allan variance, IEEE
   Trans. Instrum. Meas. 57, 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.noise.bias_instability import ALLAN_FLOOR
from models.probability import chi2_quantile
from tuner.types import LEVEL

_SLOPE_LINES = (
    ("quantization", -1.0, np.sqrt(3.0)),
    ("white", -0.5, 1.0),
    ("bias_instability", 0.0, None),
    ("random_walk", 0.5, 3.0),
    ("ramp", 1.0, np.sqrt(2.0)),
)
"""Term, slope of its Allan deviation, τ where the line shows its coefficient."""

_SLOPE_TOLERANCE = 0.2
"""Deviation from the slope of a term within which the curve counts as parallel to it."""

_MIN_SEGMENT_RATIO = 2.0
"""Least ratio of the ends of a segment, and of the window in which a local slope is taken."""

_MIN_DOF = 4.0
"""Points with fewer degrees of freedom are not read."""


@dataclass(frozen=True)
class Segment:
    """A stretch of the curve that runs parallel to one term.

    Attributes
    ----------
    term : str
        ``quantization white bias_instability random_walk ramp``.
    slope : float
        Slope of the term's Allan deviation.
    tau : (float, float)
        Where the stretch begins and ends, s.
    value : float
        Coefficient read off.
    interval : (float, float)
        95 % limits by the best point of the stretch; the share of other terms is not in them.
    """

    term: str
    slope: float
    tau: tuple[float, float]
    value: float
    interval: tuple[float, float]


def read_segments(tau: FloatArray, deviation: FloatArray, dof: FloatArray) -> tuple[Segment, ...]:
    """Find the segments of an Allan deviation and read a coefficient off each.

    Parameters
    ----------
    tau, deviation, dof : ndarray, shape (k,)
        Cluster times, s, rising; Allan deviations; equivalent degrees of freedom.

    Returns
    -------
    tuple of Segment
        At most one a term (its longest), in the order of the slopes; a term without a segment is absent.
    """
    usable = (dof >= _MIN_DOF) & (deviation > 0)
    x, y, v = np.log(tau[usable]), np.log(deviation[usable]), dof[usable]
    if len(x) < 3:
        return ()
    slope = _local_slope(x, y, v)
    found: list[Segment] = []
    for term, wanted, read_at in _SLOPE_LINES:
        later = x >= (np.log(found[-1].tau[1]) if found else -np.inf)
        run = _longest_run(later & (np.abs(slope - wanted) <= _SLOPE_TOLERANCE), x)
        if run is None:
            continue
        weight = v[run] / np.sum(v[run])
        line = float(weight @ (y[run] - wanted * x[run]))
        value = (
            float(np.exp(line)) / ALLAN_FLOOR
            if read_at is None
            else float(np.exp(line + wanted * np.log(read_at)))
        )
        best = float(np.max(v[run]))
        tail = 0.5 * (1.0 - LEVEL)
        low, high = (float(value * np.sqrt(best / chi2_quantile(p, best))) for p in (1.0 - tail, tail))
        ends = (float(np.exp(x[run][0])), float(np.exp(x[run][-1])))
        found.append(Segment(term, wanted, ends, value, (low, high)))
    return tuple(found)


def _local_slope(x: FloatArray, y: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the slope of the weighted line through the points within a factor `_MIN_SEGMENT_RATIO` of each."""
    slope = np.empty(len(x))
    for i in range(len(x)):
        near = np.abs(x - x[i]) <= np.log(_MIN_SEGMENT_RATIO) + 1e-9
        near[[max(i - 1, 0), min(i + 1, len(x) - 1)]] = True
        w = weight[near] / weight[near].sum()
        dx = x[near] - w @ x[near]
        slope[i] = (w * dx) @ y[near] / ((w * dx) @ dx)
    return slope


def _longest_run(inside: NDArray[np.bool_], x: FloatArray) -> slice | None:
    """Return the run of True that spans the largest range of x, or None where none is wide enough."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
    runs = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    wide = [run for run in runs if x[run][-1] - x[run][0] >= np.log(_MIN_SEGMENT_RATIO) - 1e-9]
    return max(wide, key=lambda run: x[run][-1] - x[run][0], default=None)
