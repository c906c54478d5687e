"""The error-state filter, readable: strapdown mechanisation, covariance and updates by filterpy.

::

    every sample        (Δθ, Δv) = A⁻¹ (measured − bias dt) → mechanisation
    every 0.1 s         P ← Φ P Φᵀ + Q,   parameters ← Φ parameters
    every fix           z = fix − prediction = H x + noise,   gates,   Kalman update of x, P
                        estimate ← estimate ⊕ x,   x ← 0                                  closed loop

Equations and signs are those of `models.strapdown`, `models.errorstate` and `models.gnss`. Position and
velocity of one fix are gated each for itself and used together. `tuner.navigation.engine` is the same filter
compiled.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 14.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from models import rotation
from models.calibration import Calibration, calibration
from models.errorstate import Linearization, corrected, middle, process_noise, transition
from models.gnss import position_fix, velocity_fix
from models.strapdown import NavigationState, correct_increments, step
from tuner.navigation.inputs import ABSENT, GATED, USED, WITHHELD, Fixes, Solution, Steps
from tuner.navigation.settings import FilterSettings, chi2_gate, total_bias

FloatArray = NDArray[np.float64]


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
    """
    model, n = settings.model, settings.size
    kf = KalmanFilter(dim_x=n, dim_z=6)
    kf.P = np.diag(settings.initial_sd**2) if covariance is None else covariance.copy()
    x = np.zeros(n) if parameters is None else parameters.copy()
    state, sensor = start, calibration(model, x)
    now = _Interval(start, 0.0, np.zeros(3), np.zeros(3))
    before: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    at_fix = {int(k): [] for k in fixes.after} if len(fixes) else {}  # type: dict[int, list[int]]
    for i, k in enumerate(fixes.after):
        at_fix[int(k)].append(i)
    rows: list[Any] = []
    sample, refused = np.zeros(6), np.inf
    for k in range(len(steps.dt) + 1):
        if k > 0:
            dt = float(steps.dt[k - 1])
            sample = np.linalg.solve(sensor.matrix, steps.increments[k - 1] - sensor.bias * dt)
            angle, velocity = tuple(sample[:3].tolist()), tuple(sample[3:].tolist())
            if before is None:
                before_angle, before_velocity = angle, velocity
            else:
                # The formulas of coning and sculling are for steps of one length.
                stretch = 2.0 * dt * dt / (steps.dt[k - 2] + dt) / steps.dt[k - 2]
                before_angle, before_velocity = (tuple(stretch * c for c in part) for part in before)
            before = angle, velocity
            rotvec, force = correct_increments(angle, velocity, before_angle, before_velocity)
            pos, vel, quat, force_n = step(
                tuple(state.llh.tolist()),
                tuple(state.vel_n.tolist()),
                tuple(state.quat_nb.tolist()),
                rotvec,
                force,
                dt,
            )
            state = NavigationState(np.array(pos), np.array(vel), np.array(quat))
            now.dt += dt
            now.angle += sample[:3]
            now.velocity_n += np.array(force_n) * dt
        due = k in at_fix or k == len(steps.dt)
        if now.dt > 0.0 and (due or now.dt + 0.5 * steps.dt[k] > settings.covariance_step):
            at = middle(now.start, state, now.angle / now.dt, now.velocity_n / now.dt, sensor)
            phi = transition(model, at, now.dt)
            kf.predict(F=phi, Q=process_noise(model, at, now.dt))
            x[9:] = phi[9:, 9:] @ x[9:]
            sensor = calibration(model, x)
            now = _Interval(state, 0.0, np.zeros(3), np.zeros(3))
        for i in at_fix.get(k, ()):
            rates = sample / (steps.dt[k - 1] if k else 1.0)
            gated = not fixes.trusted[i] and fixes.t[i] - refused < settings.patience
            limit = chi2_gate(settings.gate, 3) if gated else np.inf
            state, row = _update(kf, settings, state, x, sensor, rates, fixes, i, limit)
            refused = min(refused, fixes.t[i]) if GATED in row[-1] and USED not in row[-1] else np.inf
            sensor = calibration(model, x)
            now = replace(now, start=state)
            rows.append(row)
    return _solution(fixes, rows, state, x, kf.P)


def _update(
    kf: KalmanFilter,
    settings: FilterSettings,
    state: NavigationState,
    x: FloatArray,
    sensor: Calibration,
    rates: FloatArray,
    fixes: Fixes,
    i: int,
    limit: float,
) -> tuple[NavigationState, tuple[Any, ...]]:
    """Use fix i; changes `kf` and `x`, returns the corrected state and a row of the solution."""
    model = settings.model
    mat_nb = rotation.mat_from_quat(state.quat_nb)
    at = Linearization(state.llh, state.vel_n, mat_nb, rates[:3], rates[3:], sensor)
    parts = [position_fix(model, at, x, fixes.llh[i], lever_arm=settings.lever_arm)]
    if np.isfinite(fixes.vel_n[i]).all():
        parts.append(velocity_fix(model, at, x, fixes.vel_n[i], lever_arm=settings.lever_arm))
    z, h = np.concatenate([part.z for part in parts]), np.vstack([part.H for part in parts])
    r = np.diag(fixes.sd[i, : len(z)] ** 2)
    s = h @ kf.P @ h.T + r
    use = np.full(2, ABSENT)
    for g in range(len(parts)):
        own = slice(3 * g, 3 * g + 3)
        far = z[own] @ np.linalg.solve(s[own, own], z[own]) > limit
        use[g] = WITHHELD if fixes.withheld[i] else GATED if far else USED
    taken = np.repeat(use[: len(parts)] == USED, 3)
    if taken.any():
        kf.x = np.zeros((len(x), 1))
        kf.update(z[taken, None], R=r[np.ix_(taken, taken)], H=h[taken])
        correction = kf.x[:, 0]
        state = corrected(state, correction[:9])
        x[9:] += correction[9:]
    innovation, spread = np.zeros(6), np.zeros((6, 6))
    innovation[: len(z)], spread[: len(z), : len(z)] = z, s
    m = total_bias(model)
    return state, (state, x.copy(), m @ kf.P @ m.T, innovation, spread, use)


def _solution(
    fixes: Fixes, rows: list[Any], state: NavigationState, x: FloatArray, p: FloatArray
) -> Solution:
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
        column(5, 2).astype(np.int64),
        state,
        x,
        p,
    )
