"""The offset of the clocks of estimate and truth: by how much the stamps of an estimate are late.

Late by τ, an estimate errs by velocity · τ in position, acceleration · τ in velocity and turn rate · τ in attitude.
Errors of a filter stay for some time: those of each state are differenced by their own correlation ρ from one epoch to
the next, as are the derivatives [1]_, which also takes out what does not move. The scatter of the parts of a record
gives the interval, by the jackknife. What the truth leaves open between its rows repeats with the motion: what it is
in time widens the interval.

References
----------
.. [1] D. Cochrane, G. H. Orcutt, Application of least squares regression to relationships containing auto-correlated
       error terms, J. American Statistical Association 44 (1949).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.consistency.constants import by_leaving_out
from tuner.consistency.output_errors import RECORD_PARTS, OutputErrors
from tuner.consistency.trajectory_alignment import MAX_GAP_INTERVALS, interpolation_variance, velocity_of
from tuner.types.filter_output import FilterOutput
from tuner.types.output_score import TimeOffset

COARSE_OFFSET_STEP = 0.05
"""Step of the search for a time offset, s: motion of vehicles is linear over it."""
MAX_COARSE_STEPS = 1 << 20
"""Largest number of steps of that search: records of hours have longer ones."""
AS_GOOD_RATIO = 1.5
"""Mean square difference of speeds ÷ the least one up to which an offset nearer to 0 goes before."""
MIN_MISFIT_RATIO = 4.0
"""Mean square difference of speeds ÷ what the truth leaves open half-way between rows: below it nothing is sought."""
FIT_ROUNDS = 3
"""Times that offset and correlation are fitted in turn."""


def clock_offset(runs: Sequence[OutputErrors], taken_out: Sequence[float]) -> TimeOffset | None:
    """Return the delay of the stamps of estimates; None where nothing moves.

    Parameters
    ----------
    runs : sequence of OutputErrors
        Errors.
    taken_out : sequence of float
        What was subtracted from the stamps of each beforehand, s.
    """
    sums, opens = [], []
    for run, first in zip(runs, taken_out, strict=True):
        parts = max(4, RECORD_PARTS // len(runs))
        own = np.zeros((2, parts))
        slope = run.rate[:, :9]
        variance = np.einsum("kii->ki", run.covariance)[:, :9]
        for j in range(9):
            rows = np.flatnonzero(np.isfinite(run.error[:, j]) & np.isfinite(slope[:, j]))
            if len(rows) < parts:
                continue
            sd = np.sqrt(np.where(variance[rows, j] > 0.0, variance[rows, j], np.nan))
            e, x = run.error[rows, j], slope[rows, j]
            sd = sd if np.isfinite(sd).all() else np.full(len(rows), max(float(np.std(e)), 1e-12))
            found = _squares(e / sd, x / sd, parts)
            own += found
            if x.any():
                unknown = float(np.mean(run.between[rows, j]) / np.mean(x**2))
                opens.append((float(found[1].sum()), unknown))
        sums.append([own[0] + first * own[1], own[1]])
    above, below = np.concatenate(sums, axis=1)
    solved = by_leaving_out(below[:, None, None], above[:, None])
    if solved is None:
        return None
    value, scatter, sds = float(solved[0][0]), math.sqrt(solved[1][0, 0]), solved[2]
    weights, unknown = np.array(opens).T
    wide = scatter * sds + math.sqrt(float(np.average(unknown, weights=weights)))
    return TimeOffset(value, (value - wide, value + wide), removed=False)


def _squares(e: FloatArray, x: FloatArray, parts: int) -> FloatArray:
    """Return sums by parts, weighed as independent: of errors times derivatives, of squares of these; (2, parts)."""
    rho, value = 0.0, 0.0
    for _ in range(FIT_ROUNDS):
        later, earlier = e[1:] - rho * e[:-1], x[1:] - rho * x[:-1]
        value = float(later @ earlier) / max(float(earlier @ earlier), 1e-300)
        rest = e - value * x
        rho = float(np.clip(rest[1:] @ rest[:-1] / max(float(rest @ rest), 1e-300), 0.0, 0.999))
    later, earlier = e[1:] - rho * e[:-1], x[1:] - rho * x[:-1]
    noise = float(np.mean((later - value * earlier) ** 2))
    if noise == 0.0:
        return np.zeros((2, parts))
    cut = np.array_split(np.arange(len(later)), parts)
    return np.array([[one[i] @ earlier[i] for i in cut] for one in (later, earlier)]) / noise


def find_time_offset(estimate: FilterOutput, truth: FilterOutput) -> float | None:
    """Return the delay of the stamps of an estimate, s; None where nothing moves, or between rows of the truth.

    The offset with the least squared difference of speeds, which do not depend on the frame, at any lag at which the
    two share half of the shorter one; of several that are as good the smallest, as where a course repeats.
    """
    a, b = (np.linalg.norm(velocity_of(one), axis=1) for one in (estimate, truth))
    good_a, good_b = np.isfinite(a), np.isfinite(b)
    if np.count_nonzero(good_a) < 10 or np.count_nonzero(good_b) < 10 or np.nanstd(b) < 1e-3:
        return None
    ta, tb, a, b = estimate.t[good_a], truth.t[good_b], a[good_a], b[good_b]

    def misfit(offset: float) -> float:
        there = _at(ta - offset, tb, b)
        return float(np.mean((a - there)[np.isfinite(there)] ** 2)) if np.isfinite(there).any() else np.inf

    between = interpolation_variance(truth, 0.5 * (truth.t[1:] + truth.t[:-1]))[:, 3:6].sum(axis=1)
    if misfit(0.0) < MIN_MISFIT_RATIO * float(np.mean(between)):
        return None
    step = max(COARSE_OFFSET_STEP, (max(ta[-1], tb[-1]) - min(ta[0], tb[0])) / MAX_COARSE_STEPS)
    first = min(ta[0], tb[0])
    grid = first + step * np.arange(int((max(ta[-1], tb[-1]) - first) / step) + 1)
    lags, values = _misfits(_at(grid, ta, a), _at(grid, tb, b))
    if not len(lags):
        return None
    likely = np.flatnonzero(values <= AS_GOOD_RATIO * values.min())
    best = step * float(lags[likely[np.argmin(np.abs(lags[likely]))]])
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    near = minimize_scalar(
        misfit, bounds=(best - 2.0 * step, best + 2.0 * step), method="bounded", options={"xatol": 1e-4}
    )
    return float(near.x)


def _at(t: FloatArray, rows: FloatArray, values: FloatArray) -> FloatArray:
    """Return values between rows, NaN outside of them and in their gaps; shape of `t`."""
    after = np.clip(np.searchsorted(rows, t), 1, len(rows) - 1)
    usual = MAX_GAP_INTERVALS * float(np.median(np.diff(rows)))
    lost = (rows[after] - rows[after - 1] > usual) | (t < rows[0]) | (t > rows[-1])
    return np.where(lost, np.nan, np.interp(t, rows, values))


def _misfits(a: FloatArray, b: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """Return lags of a behind b, steps, at which half of the shorter is shared, and mean squares of a − b there."""
    size = 1 << (2 * len(a) - 1).bit_length()

    def product(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(np.fft.irfft(np.fft.rfft(x, size) * np.fft.rfft(y, size).conj(), size))

    known_a, known_b = (np.isfinite(x).astype(float) for x in (a, b))
    a, b = np.nan_to_num(a), np.nan_to_num(b)
    shared = product(known_a, known_b)
    enough = np.flatnonzero(shared > 0.5 * min(known_a.sum(), known_b.sum()))
    square = product(a**2, known_b) + product(known_a, b**2) - 2.0 * product(a, b)
    lags = np.where(enough < size // 2, enough, enough - size)
    return lags, np.maximum(square[enough] / shared[enough], 0.0)
