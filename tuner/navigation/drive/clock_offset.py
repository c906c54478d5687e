"""Offset of the clocks of receiver and inertial unit, from the motion alone: no noise of a configuration enters.

`clock_regression` gives for every segment of the drive the weighted residuals r and their derivatives A by the common
parameters φ: delays of positions and velocities, lever arm, scale factors, gyro biases. With Λ the prior of all but the
delays::

    B = Σ AᵀA + Λ        φ = B⁻¹ Σ Aᵀr        cov φ = B⁻¹ (Σ uuᵀ + Λ) B⁻¹        u = (1 − AᵀA B⁻¹)⁻¹ Aᵀ(r − A φ)

The covariance is that of the scatter of whole segments, each left out once [1]_: noise that is correlated, or larger in
some parts of the drive, is in it. Zero delays are the hypothesis to be beaten, by a test of F with as many degrees of
freedom as segments take part.

References
----------
.. [1] R. M. Bell, D. F. McCaffrey, Bias reduction in standard errors for linear regression with multi-stage samples,
       Survey Methodology 28 (2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.probability import fisher_beyond, student_quantile
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import (
    MIN_STATIONARY_POOR_GYROS,
    SUFFICIENT_STATIONARY,
    stationary_until,
)
from tuner.navigation.drive.clock_regression import (
    COMMON_PARAMETERS,
    DELAYS,
    MAX_RESIDUAL,
    MIN_SEGMENT_FIXES,
    SCALE_FACTOR_SD,
    SEGMENT_DURATION,
    Rows,
    Segment,
    regression,
    residuals_by_delay,
    reweighted,
    segments,
    unweighted,
)
from tuner.navigation.drive.integrated_increments import IntegratedIncrements, integrate_increments
from tuner.navigation.drive.steady_rest import steady_steps
from tuner.navigation.drive.thinning import irregular_rows
from tuner.stages import counted, stage, task
from tuner.types.records import Gnss

MAX_CLOCK_OFFSET = 3.0
"""Largest offset that is searched, to both sides, s."""
COARSE_STEP = 0.1
"""Spacing of the offsets that are tried first, s: a quarter of a swing of a walker's step."""
COARSE_FIXES = 40
"""Fixes of a segment that the coarse search uses."""
MIN_MOVING_SEGMENTS = 12
"""Segments that the motion is cut into at least: their scatter is the noise of the offset."""
CORRELATION_TIME = 5.0
"""Time after which fixes of the coarse search count as independent, s: receivers smooth over seconds."""
MIN_COARSE_GAIN = 10.0
"""Nats by which an offset of the coarse search must beat clocks that agree: half of the χ²₁ that the
largest of 61 exceeds with a probability of `FALSE_OFFSET_PROBABILITY`, 9.3, rounded up."""
MAX_COARSE_SEGMENTS = 24
"""Segments that the coarse search uses, those with the largest accelerations."""
MAX_STEPS = 12
"""Most steps of Gauss–Newton."""
STEP_SHARE = 0.6
"""Share of the work that seems to be left after each of them, for those who watch: mostly there are four."""
MAX_STEP = 0.5
"""Longest of them, s."""
MIN_STEP = 0.05
"""Step, in sds, below which it ends."""
FALSE_OFFSET_PROBABILITY = 1e-3
"""Probability with which clocks that agree are said to differ."""
KNOWN_ARM_SD, UNKNOWN_ARM_SD = 0.1, 1.0
"""Prior sd of a lever arm that was measured, and of one that nobody gave, m: the size of a car."""
MAX_DELAY_SD, GYRO_BIAS_SD = 1e3, 0.1
"""Prior sds of the delays, s, which says nothing, and of the gyro biases, rad/s: beyond those of consumer sensors."""
COMMON_PRIOR_SD = np.array(
    [MAX_DELAY_SD] * 2 + [UNKNOWN_ARM_SD] * 3 + [SCALE_FACTOR_SD] * 6 + [GYRO_BIAS_SD] * 3
)
"""Prior sds of the common parameters."""
BIAS_SEGMENTS = (5.0, 5.0, 10.0, 20.0)
"""Lengths of the segments from which the gyro biases are found one after another, s: what is left of a bias must turn
the unit by less than a radian."""
MAX_BIAS_ROUNDS = 6
"""Times that the gyro biases are found again with stamps that are put right."""
NEGLIGIBLE_BIAS = 2e-3
"""Change of the gyro biases, rad/s, that turns a segment by two degrees: a smaller one acts linearly."""
FIRST_SDS = (1.0, 2.0, 0.1, 0.2)
"""Scatter of positions (h, v), m, and velocities (h, v), m/s, to begin with."""
FIRST_REWEIGHTINGS = 3
"""Times that the weights are found anew at the first step; they settle fast."""
MIN_FREEDOM = 1.0
"""Least degrees of freedom of a covariance."""


@dataclass(frozen=True)
class ClockOffset:
    """Delays of the stamps of positions and velocities against the clock of the inertial unit.

    Attributes
    ----------
    delay : ndarray, shape (2,)
        Of positions and velocities, s; positive where stamps are late. NaN without such fixes.
    covariance : ndarray, shape (2, 2)
        s².
    freedom : float
        Degrees of freedom of the covariance.
    p_value : float
        Of clocks that agree.
    at_bound : bool
        Whether its interval reaches the end of the search: then it is a bound, and not applied.
    """

    delay: FloatArray
    covariance: FloatArray
    freedom: float
    p_value: float
    at_bound: bool

    @property
    def significant(self) -> bool:
        """Whether clocks that agree are refuted."""
        return not self.at_bound and self.p_value < FALSE_OFFSET_PROBABILITY

    @property
    def sd(self) -> FloatArray:
        """Sds of both delays, s."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def quantile(self) -> float:
        """Return the half width of a 95 % interval in sds."""
        return student_quantile(0.975, self.freedom)

    def beside_lag(self, lag: float) -> ClockOffset:
        """Return what remains beside a lag of velocities behind positions that is known, s."""
        delay = self.delay - np.array([0.0, lag])
        which = np.flatnonzero(np.isfinite(delay))
        p_value = _agreement(delay[which], self.covariance[np.ix_(which, which)], self.freedom)
        return replace(self, delay=delay, p_value=1.0 if self.p_value == 1.0 else p_value)


@task()
def estimate_clock_offset(steps: Steps, gnss: Gnss, lever_arm: Sequence[float] | None) -> ClockOffset | None:
    """Measure the delays of positions and velocities; None where the drive has no motion that could show them.

    Parameters
    ----------
    steps : Steps
        Increments, in the axes in which the lever arm is given.
    gnss : Gnss
        Fixes, as stamped.
    lever_arm : sequence of 3 floats, optional
        From the inertial unit to the antenna, m; None: not known.
    """
    inside = (gnss.t > steps.start + MAX_CLOCK_OFFSET) & (gnss.t < float(steps.ends()[-1]) - MAX_CLOCK_OFFSET)
    gnss = gnss.rows(inside)
    if len(gnss) < 20:
        return None
    moving = float(gnss.t[-1]) - stationary_until(gnss)
    shortest = MIN_SEGMENT_FIXES * float(np.median(np.diff(gnss.t)))
    parts = segments(gnss, max(shortest, min(SEGMENT_DURATION, moving / MIN_MOVING_SEGMENTS)))
    if len(parts) < 2:
        return None
    arm = np.zeros(3) if lever_arm is None else np.asarray(lever_arm, dtype=float)
    stage("", 0.5)
    bias = _gyro_bias(steps, gnss, arm)
    increments = integrate_increments(steps, bias)
    prior_sd = COMMON_PRIOR_SD.copy()
    if lever_arm is not None:
        prior_sd[2:5] = KNOWN_ARM_SD
    stage("", 0.6)
    first, at_bound = _coarse(increments, parts, arm)
    stage("", 0.9)
    found, change = _gauss_newton(increments, parts, arm, prior_sd, first, at_bound)
    stage("", 1.0)
    for _ in range(MAX_BIAS_ROUNDS):
        if found is None or not found.significant or np.abs(change).max() < NEGLIGIBLE_BIAS:
            break
        # Biases that were fitted with stamps that are late are those of stamps that are not.
        delay = float(np.nanmean(found.delay))
        bias = bias + change
        found, change = _gauss_newton(
            integrate_increments(steps, bias), parts, arm, prior_sd, delay, at_bound
        )
    return found


def _gyro_bias(steps: Steps, gnss: Gnss, arm: FloatArray) -> FloatArray:
    """Return the mean gyro biases: at rest where the drive begins so, then such that the segments agree."""
    ends, bias = steps.ends(), np.zeros(3)
    rest = steady_steps(steps, slice(*np.searchsorted(ends, [gnss.t[0], stationary_until(gnss)]).tolist()))
    time = float(steps.dt[rest].sum())
    if time > MIN_STATIONARY_POOR_GYROS:
        bias = steps.increments[rest, :3].sum(axis=0) / time
    if time > SUFFICIENT_STATIONARY:
        return bias
    shortest = MIN_SEGMENT_FIXES * float(np.median(np.diff(gnss.t)))
    prior, free = np.diag(COMMON_PRIOR_SD**-2), np.zeros(COMMON_PARAMETERS, dtype=bool)
    free[-3:] = True
    for duration in counted(BIAS_SEGMENTS):
        parts = segments(gnss, max(duration, shortest))
        increments = integrate_increments(steps, bias)
        weights = [unweighted(part, FIRST_SDS) for part in parts]
        for _ in range(2):
            rows = [
                regression(increments, part, w, (0.0, 0.0), arm)
                for part, w in zip(parts, weights, strict=True)
            ]
            weights = [reweighted(part, one) for part, one in zip(parts, rows, strict=True)]
        rows = [
            regression(increments, part, w, (0.0, 0.0), arm) for part, w in zip(parts, weights, strict=True)
        ]
        bias = bias + _solve(rows, prior, free).value[-3:]
    return bias


def _coarse(
    increments: IntegratedIncrements, parts: Sequence[Segment], arm: FloatArray
) -> tuple[float, bool]:
    """Return the common delay with the largest likelihood, variances profiled, and whether it is the last tried."""
    level = [_activity(increments, part) for part in parts]
    chosen = [_thinned(parts[i]) for i in np.argsort(level)[::-1][:MAX_COARSE_SEGMENTS]]
    grid = np.arange(-MAX_CLOCK_OFFSET, MAX_CLOCK_OFFSET + 1e-9, COARSE_STEP)
    sd = FIRST_SDS
    for _ in range(2):
        left = [residuals_by_delay(increments, part, sd, grid, arm) for part in chosen]
        cost = _scatters(left)
        north, down, along, fall = np.maximum(np.nan_to_num(cost.min(axis=0), nan=1.0), 1e-3).tolist()
        sd = (north, down, along, fall)
    independent = sum(float(part.since[-1]) for part in chosen) / CORRELATION_TIME
    nats = independent * np.nan_to_num(np.log(cost)) @ np.array([2.0, 1.0, 2.0, 1.0])
    best, near = int(np.argmin(nats)), np.flatnonzero(np.abs(grid) < 1.5 * COARSE_STEP)
    if nats[near].min() - nats[best] < MIN_COARSE_GAIN:
        return float(grid[near[np.argmin(nats[near])]]), False
    return float(grid[best]), best in (0, len(grid) - 1)


def _thinned(part: Segment) -> Segment:
    """Return a segment with fewer fixes, at irregular distances: a receiver may alternate its solutions."""
    rows = irregular_rows(len(part.t), COARSE_FIXES)
    return Segment(part.t[rows], part.since[rows], part.position[rows], part.velocity[rows])


def _activity(increments: IntegratedIncrements, part: Segment) -> float:
    """Return the spread of the specific force within a segment, m/s²."""
    at = np.searchsorted(increments.t, part.t)
    at = np.clip(at, 0, len(increments.t) - 1)
    change = np.diff(increments.velocity[at], axis=0) / np.diff(increments.t[at])[:, None].clip(1e-3)
    return float(np.linalg.norm(np.std(change, axis=0))) if len(change) else 0.0


def _scatters(left: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return the pooled sds of positions (h, v) and velocities (h, v) for d delays, outliers limited, (d, 4)."""
    out = []
    for kind in (0, 1):
        raw = np.concatenate([one[kind] for one in left], axis=1)
        raw = raw[:, np.isfinite(raw[0]).all(axis=1)]
        for columns in ([0, 1], [2]):
            part = np.abs(raw[:, :, columns]).reshape(len(raw), -1)
            if not part.shape[1]:
                out.append(np.full(len(raw), np.nan))
                continue
            limit = MAX_RESIDUAL * np.median(part, axis=1, keepdims=True) + 1e-9
            out.append(np.sqrt(np.mean(np.minimum(part, limit) ** 2, axis=1)))
    return np.stack(out, axis=-1)


@task()
def _gauss_newton(
    increments: IntegratedIncrements,
    parts: Sequence[Segment],
    arm: FloatArray,
    prior_sd: FloatArray,
    first: float,
    at_bound: bool,
) -> tuple[ClockOffset | None, FloatArray]:
    """Refine the delays with weights by the scatter of every segment, and test them; what the gyro biases change by."""
    prior = np.diag(prior_sd**-2)
    delay, weights = np.array([first, first]), [unweighted(part, FIRST_SDS) for part in parts]
    kinds = [
        bool(np.isfinite(np.concatenate([getattr(part, name) for part in parts])).any()) for name in DELAYS
    ]
    free = np.array([*kinds, *[True] * (COMMON_PARAMETERS - 2)])
    if not np.any(free[:2]):
        return None, np.zeros(3)

    def linearized() -> list[Rows]:
        both = (float(delay[0]), float(delay[1]))
        return [regression(increments, part, w, both, arm) for part, w in zip(parts, weights, strict=True)]

    before = np.zeros(2)
    for step in range(MAX_STEPS):
        stage("", 1.0 - STEP_SHARE ** (step + 1))
        for _ in range(FIRST_REWEIGHTINGS if step == 0 else 1):
            rows = linearized()
            own = [reweighted(part, one) for part, one in zip(parts, rows, strict=True)]
            usual = np.median([w.sd for w in own], axis=0).tolist()
            weights = [reweighted(part, one, usual) for part, one in zip(parts, rows, strict=True)]
        found = _solve(linearized(), prior, free)
        change = found.value[:2]
        if np.all(np.abs(change[free[:2]]) < MIN_STEP * found.sd[:2][free[:2]]):
            break
        change = change * np.where(change * before < 0.0, 0.5, 1.0)  # it overshot
        before = change
        delay = delay + change * min(1.0, MAX_STEP / max(float(np.max(np.abs(change))), 1e-12))
        delay = np.clip(delay, -MAX_CLOCK_OFFSET, MAX_CLOCK_OFFSET)
    reach = np.abs(delay) + student_quantile(0.975, found.freedom) * found.sd[:2]
    at_bound = at_bound or bool(np.any(reach[free[:2]] > MAX_CLOCK_OFFSET))
    delay = np.where(free[:2], delay, np.nan)
    covariance = np.where(np.outer(free[:2], free[:2]), found.covariance[:2, :2], np.nan)
    which = np.flatnonzero(free[:2])
    d, c = delay[which], covariance[np.ix_(which, which)]
    p_value = _agreement(d, c, found.freedom)
    if p_value < FALSE_OFFSET_PROBABILITY:
        full = [unweighted(part, w.sd) for part, w in zip(parts, weights, strict=True)]
        none, some = (
            _left(
                [regression(increments, part, w, both, arm) for part, w in zip(parts, full, strict=True)],
                prior,
                free,
            )
            for both in ((0.0, 0.0), (float(np.nan_to_num(delay[0])), float(np.nan_to_num(delay[1]))))
        )
        if some >= none:  # where motion is faster than the steps, they may end at a delay that fits worse
            p_value = 1.0
    return ClockOffset(delay, covariance, found.freedom, p_value, at_bound), found.value[-3:]


def _agreement(delay: FloatArray, covariance: FloatArray, freedom: float) -> float:
    """Return the p-value of delays that are zero."""
    statistic = float(delay @ np.linalg.solve(covariance, delay)) / len(delay)
    return fisher_beyond(statistic, len(delay), freedom)


def _left(rows: Sequence[Rows], prior: FloatArray, free: NDArray[np.bool_]) -> float:
    """Return the sum of squares that regressions leave with the delays about which they are linearised."""
    others = free.copy()
    others[: len(DELAYS)] = False
    value = _solve(rows, prior, others).value
    return sum(
        float(np.sum(np.minimum((one.residual - one.design @ value) ** 2, MAX_RESIDUAL**2))) for one in rows
    )


@dataclass(frozen=True)
class _Solution:
    """Values (14,), their covariance, and its degrees of freedom for the first free parameter."""

    value: FloatArray
    covariance: FloatArray
    freedom: float

    @property
    def sd(self) -> FloatArray:
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def _solve(rows: Sequence[Rows], prior: FloatArray, free: NDArray[np.bool_]) -> _Solution:
    """Solve for the common parameters that are free, with the covariance by whole segments."""
    size, use = len(prior), np.flatnonzero(free)
    at = np.ix_(use, use)
    information = np.array([one.design.T @ one.design for one in rows])[:, use][:, :, use]
    scores = np.array([one.design.T @ one.residual for one in rows])[:, use]
    inverse = np.linalg.inv(information.sum(axis=0) + prior[at])
    value = inverse @ scores.sum(axis=0)
    left = scores - information @ value
    left = np.linalg.solve(np.eye(len(use)) - information @ inverse, left[..., None])[..., 0]
    covariance = inverse @ (left.T @ left + prior[at]) @ inverse
    # Scatter by chance smaller than that of independent rows is not accepted.
    widened = np.sqrt(np.maximum(np.diag(inverse) / np.diag(covariance), 1.0))
    covariance = covariance * np.outer(widened, widened)
    share = np.einsum("i,kij,j->k", inverse[0], information, inverse[0])
    freedom = max(float(share.sum() ** 2 / np.sum(share**2)) - 1.0, MIN_FREEDOM)
    whole_value, whole = np.zeros(size), np.zeros((size, size))
    whole_value[use], whole[at] = value, covariance
    return _Solution(whole_value, whole, freedom)
