"""The error-state filter, readable: strapdown mechanisation, covariance and updates by filterpy.

::

    every sample        (Δθ, Δv) = A⁻¹ (measured − bias dt) → mechanisation
    every 0.1 s         P ← Φ P Φᵀ + Q,   parameters ← Φ parameters
    every fix           z = fix − prediction = H x + noise,   gates,   Kalman update of x, P
                        estimate ← estimate ⊕ x,   x ← 0                                  closed loop
    every constraint    the same with what a vehicle cannot do; always gated

Equations and signs are those of `models.strapdown`, `models.error_state` and `models.measurements`. Position and
velocity of one fix are gated each for itself and used together. `tuner.navigation.engine` is the same filter
compiled.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 14.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from filterpy.kalman import KalmanFilter

from models import rotation
from models.arrays import FloatArray
from models.error_state import Linearization, corrected, down_acceleration, middle, process_noise, transition
from models.imu_errors import Calibration, calibration
from models.measurements import (
    Measurement,
    non_holonomic,
    position_fix,
    velocity_fix,
    zero_rate,
    zero_velocity,
)
from models.strapdown import NavigationState, correct_increments, step
from tuner.navigation.data import (
    ABSENT,
    GATED,
    NON_HOLONOMIC,
    USED,
    WITHHELD,
    ZERO_VELOCITY,
    Constrained,
    Constraints,
    Fixes,
    Solution,
    Steps,
)
from tuner.navigation.settings import FilterSettings, chi2_gate, error_rows, total_bias
from tuner.types.records import velocity_known


@dataclass(frozen=True)
class SmootherStep:
    """Propagation of the errors from one fix to the next, and their update by that fix.

    Attributes
    ----------
    transition : ndarray, shape (n, n)
        Φ since the fix before, or since the start.
    before, after : ndarray, shape (n, n)
        P before and after the fix.
    H : ndarray, shape (m, n)
        Of position and, where there is one, velocity.
    gain : ndarray, shape (n, m)
        K; zero columns for what was not used.
    correction : ndarray, shape (n,)
        K z: what was added to the estimate.
    """

    transition: FloatArray
    before: FloatArray
    after: FloatArray
    H: FloatArray
    gain: FloatArray
    correction: FloatArray


@dataclass
class _Interval:
    """What has been summed since the covariance was last advanced."""

    start: NavigationState
    dt: float
    angle: FloatArray
    velocity_n: FloatArray


def run(
    settings: FilterSettings,
    start: NavigationState,
    steps: Steps,
    fixes: Fixes,
    *,
    parameters: FloatArray | None = None,
    covariance: FloatArray | None = None,
    constraints: Constraints | None = None,
) -> Solution:
    """Filter a stretch of data.

    Parameters
    ----------
    settings : FilterSettings
        States, prior, gate, lever arm.
    start : NavigationState
        Estimate at the beginning, arrays of shapes (3,), (3,), (4,).
    steps : Steps
        Increments.
    fixes : Fixes
        Fixes at the ends of steps.
    parameters, covariance : ndarray, shapes (n,), (n, n), optional
        Estimates of the other states and P at the beginning; by default zeros and P0.
    constraints : Constraints, optional
        What is known of the vehicle; after the fixes of the same instant.
    """
    return _run(settings, start, steps, fixes, parameters, covariance, constraints, None)


def run_for_smoother(
    settings: FilterSettings,
    start: NavigationState,
    steps: Steps,
    fixes: Fixes,
    *,
    parameters: FloatArray | None = None,
    covariance: FloatArray | None = None,
) -> tuple[Solution, tuple[SmootherStep, ...]]:
    """Filter a stretch of data and keep what a smoother needs of every fix."""
    kept: list[SmootherStep] = []
    return _run(settings, start, steps, fixes, parameters, covariance, None, kept), tuple(kept)


def _run(
    settings: FilterSettings,
    start: NavigationState,
    steps: Steps,
    fixes: Fixes,
    parameters: FloatArray | None,
    covariance: FloatArray | None,
    constraints: Constraints | None,
    kept: list[SmootherStep] | None,
) -> Solution:
    model, n = settings.model, settings.size
    kf = KalmanFilter(dim_x=n, dim_z=6)
    kf.P = np.diag(settings.initial_sd**2) if covariance is None else covariance.copy()
    x = np.zeros(n) if parameters is None else parameters.copy()
    state, sensor = start, calibration(model, x)
    now = _Interval(start, 0.0, np.zeros(3), np.zeros(3))
    at_fix, at_constraint = _by_step(fixes.after), _by_step([] if constraints is None else constraints.after)
    outcome: list[tuple[int, float]] = []
    rows: list[Any] = []
    sample, refused, since_fix = np.zeros(6), fixes.refused_since, np.eye(n)
    for k in range(len(steps.dt) + 1):
        if k > 0:
            dt = float(steps.dt[k - 1])
            last, sample = sample, np.linalg.solve(sensor.matrix, steps.increments[k - 1] - sensor.bias * dt)
            # The formulas of coning and sculling are for steps of one length.
            stretch = 2.0 * dt * dt / (steps.dt[k - 2] + dt) / steps.dt[k - 2] if k > 1 else 1.0
            downwards = settings.gravity_excess + down_acceleration(model, x)
            state, force_n = _advanced(state, sample, stretch * last if k > 1 else sample, dt, downwards)
            now.dt += dt
            now.angle += sample[:3]
            now.velocity_n += force_n * dt
        due = k in at_fix or k in at_constraint or k == len(steps.dt)
        if now.dt > 0.0 and (due or now.dt + 0.5 * steps.dt[k] > settings.covariance_step):
            at = middle(now.start, state, now.angle / now.dt, now.velocity_n / now.dt, sensor)
            phi = transition(model, at, now.dt)
            kf.predict(F=phi, Q=process_noise(model, at, now.dt))
            x[9:] = phi[9:, 9:] @ x[9:]
            if kept is not None:
                since_fix = phi @ since_fix
            sensor = calibration(model, x)
            now = _Interval(state, 0.0, np.zeros(3), np.zeros(3))
        for i in at_fix.get(k, ()):
            rates = sample / (steps.dt[k - 1] if k else 1.0)
            gated = (fixes.t[i] - refused < settings.patience) & ~fixes.trusted[i]
            limit = np.where(gated, chi2_gate(settings.gate, 3), np.inf)
            prior = kf.P
            state, row, used = _update(kf, settings, state, x, sensor, rates, fixes, i, limit)
            if kept is not None:
                kept.append(SmootherStep(since_fix, prior, kf.P, *used))
                since_fix = np.eye(n)
            use = row[-1]
            refused = np.where(
                use == GATED, np.minimum(refused, fixes.t[i]), np.where(use == ABSENT, refused, np.inf)
            )
            sensor = calibration(model, x)
            now = replace(now, start=state)
            rows.append(row)
        for i in at_constraint.get(k, ()):
            assert constraints is not None
            state, use, distance = _constrain(kf, settings, state, x, sensor, constraints, i)
            sensor = calibration(model, x)
            now = replace(now, start=state)
            outcome.append((use, distance))
    solution = _solution(fixes, rows, state, x, kf.P, int(np.count_nonzero(error_rows(model) >= 15)))
    if constraints is None:
        return solution
    uses = np.array([use for use, _ in outcome], dtype=np.int64)
    distances = np.array([distance for _, distance in outcome], dtype=float)
    return replace(solution, constrained=Constrained(constraints.kind, uses, distances))


def _advanced(
    state: NavigationState, sample: FloatArray, before: FloatArray, dt: float, downwards: float
) -> tuple[NavigationState, FloatArray]:
    """Return the state after increments `sample` of angle and velocity, (6,), and the mean specific force in n, m/s².

    `before` are the increments before them; `downwards` is an acceleration that the mechanisation does not know, m/s².
    """
    rotvec, force = correct_increments(
        *(tuple(part.tolist()) for part in (*np.split(sample, 2), *np.split(before, 2)))
    )
    pos, vel, quat, force_n = step(
        tuple(state.llh.tolist()),
        tuple(state.vel_n.tolist()),
        tuple(state.quat_nb.tolist()),
        rotvec,
        force,
        dt,
    )
    faster = np.array([0.0, 0.0, dt * downwards])
    moved = NavigationState(np.array(pos) - 0.5 * dt * faster, np.array(vel) + faster, np.array(quat))
    return moved, np.array(force_n)


def _by_step(after: Iterable[int]) -> dict[int, list[int]]:
    """Return which measurements come after so many steps."""
    found: dict[int, list[int]] = {}
    for i, k in enumerate(after):
        found.setdefault(int(k), []).append(i)
    return found


def _constrain(
    kf: KalmanFilter,
    settings: FilterSettings,
    state: NavigationState,
    x: FloatArray,
    sensor: Calibration,
    constraints: Constraints,
    i: int,
) -> tuple[NavigationState, int, float]:
    """Use constraint i; changes `kf` and `x`. Returns the corrected state, what became of it, zᵀ S⁻¹ z."""
    model = settings.model
    true = np.linalg.solve(sensor.matrix, constraints.rates[i] - sensor.bias)
    mat_nb = rotation.mat_from_quat(state.quat_nb)
    at = Linearization(state.llh, state.vel_n, mat_nb, true[:3], true[3:], sensor)
    measured: Measurement
    if constraints.kind[i] == NON_HOLONOMIC:
        measured = non_holonomic(model, at, x, mat_bv=constraints.mat_bv, lever_arm=constraints.slip)
    else:
        measured = zero_velocity(model, at) if constraints.kind[i] == ZERO_VELOCITY else zero_rate(model, at)
    z, h = measured.z, measured.H
    r = constraints.sd[i] ** 2 * np.eye(len(z))
    distance = float(z @ np.linalg.solve(h @ kf.P @ h.T + r, z))
    if distance > chi2_gate(settings.gate, 3):
        return state, GATED, distance
    kf.x = np.zeros((len(x), 1))
    kf.update(z[:, None], R=r, H=h)
    x[9:] += kf.x[9:, 0]
    return corrected(state, kf.x[:9, 0]), USED, distance


def _update(
    kf: KalmanFilter,
    settings: FilterSettings,
    state: NavigationState,
    x: FloatArray,
    sensor: Calibration,
    rates: FloatArray,
    fixes: Fixes,
    i: int,
    limit: FloatArray,
) -> tuple[NavigationState, tuple[Any, ...], tuple[FloatArray, FloatArray, FloatArray]]:
    """Use fix i; changes `kf` and `x`.

    Returns the corrected state, a row of the solution, and H, K, K z of the fix.
    """
    model = settings.model
    mat_nb = rotation.mat_from_quat(state.quat_nb)
    at = Linearization(state.llh, state.vel_n, mat_nb, rates[:3], rates[3:], sensor)
    parts = [position_fix(model, at, x, fixes.llh[i], lever_arm=settings.lever_arm)]
    if velocity_known(fixes.vel_n[i : i + 1]).all():
        parts.append(velocity_fix(model, at, x, fixes.vel_n[i], lever_arm=settings.lever_arm))
    z, h = np.concatenate([part.z for part in parts]), np.vstack([part.H for part in parts])
    missing = np.isnan(z)
    z, h = np.where(missing, 0.0, z), np.where(missing[:, None], 0.0, h)
    r = np.diag(np.where(missing, 1.0, fixes.sd[i, : len(z)] ** 2))
    s = h @ kf.P @ h.T + r
    use = np.full(2, ABSENT)
    for g in range(len(parts)):
        own = slice(3 * g, 3 * g + 3)
        far = z[own] @ np.linalg.solve(s[own, own], z[own]) > limit[g]
        use[g] = WITHHELD if fixes.withheld[i] else GATED if far else USED
    taken = np.repeat(use[: len(parts)] == USED, 3)
    gain, correction = np.zeros((len(x), len(z))), np.zeros(len(x))
    if taken.any():
        kf.x = np.zeros((len(x), 1))
        kf.update(z[taken, None], R=r[np.ix_(taken, taken)], H=h[taken])
        gain[:, taken], correction = kf.K, kf.x[:, 0].copy()
        state = corrected(state, correction[:9])
        x[9:] += correction[9:]
    innovation, spread = np.zeros(6), np.zeros((6, 6))
    innovation[: len(z)], spread[: len(z), : len(z)] = np.where(missing, np.nan, z), s
    m, further = total_bias(model), np.flatnonzero(error_rows(model) >= 15)
    own_covariance = kf.P[np.ix_(further, further)]
    row = (state, x.copy(), m @ kf.P @ m.T, innovation, spread, own_covariance, use)
    return state, row, (h, gain, correction)


def _solution(
    fixes: Fixes, rows: list[Any], state: NavigationState, x: FloatArray, p: FloatArray, further: int
) -> Solution:
    """Return the solution of rows as of `_update`; `further` is the number of further states."""

    def column(j: int, *shape: int) -> FloatArray:
        return np.array([row[j] for row in rows]).reshape(len(rows), *shape)

    states = NavigationState(
        np.array([row[0].llh for row in rows]).reshape(-1, 3),
        np.array([row[0].vel_n for row in rows]).reshape(-1, 3),
        np.array([row[0].quat_nb for row in rows]).reshape(-1, 4),
    )
    return Solution(
        fixes.t,
        states,
        column(1, len(x)),
        column(2, 15, 15),
        column(3, 6),
        column(4, 6, 6),
        column(6, 2).astype(np.int64),
        state,
        x,
        p,
        column(5, further, further),
    )
