"""The extended filter of robot_localization, written from its documentation, and vehicles that move as it assumes.

Fifteen states: x, y, z, roll, pitch, yaw, velocity and angular rate in axes of the body, acceleration; east-north-up
and forward-left-up axes. Velocity, rate and acceleration stay as they are but for their process noise, so that a truth
that is drawn from the same model makes the filter consistent. A receiver measures x, y, z once a second, wheels vx,
vy, vz ten times, an IMU the angular rates twenty times. Many runs are filtered side by side.

T. Moore, D. Stouch, A generalized extended Kalman filter implementation for the Robot Operating System (2014);
docs.ros.org/en/noetic/api/robot_localization (State Estimation Nodes). Equal to its src/ekf.cpp, compiled, to 1e-9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STEP, WHEEL_STEPS, FIX_STEPS = 0.05, 2, 20
PLACE, ANGLES, SPEED, RATE = (slice(3 * i, 3 * i + 3) for i in range(4))
PROCESS = np.array([1e-6, 1e-6, 1e-6, 2.5e-5, 2.5e-5, 1e-4, 0.04, 0.04, 0.04, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0])
"""`process_noise_covariance`, its diagonal: added each second."""
START = np.array([0.3] * 3 + [0.02, 0.02, 0.05] + [0.1] * 3 + [1e-6, 1e-6, 0.02] + [1e-6] * 3) ** 2
"""`initial_estimate_covariance`, its diagonal."""
SPREAD = np.repeat([1.0, 0.02, 0.2, 0.02, 0.2], 3)
"""Sds of a start that is known roughly: m, rad, m/s, rad/s, m/s²."""
FIX_SD, WHEEL_SD, GYRO_SD = 0.3, 0.05, 0.02  # m, m/s, rad/s


@dataclass(frozen=True)
class Runs:
    """What m runs state and what was true at the fixes and half-way between: (k,), (m, k, 15), (m, k, 15, 15)."""

    t: np.ndarray
    state: np.ndarray
    covariance: np.ndarray
    truth: np.ndarray


def matrix(angles):
    """Body to world, (m, 3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles).T, np.cos(angles).T
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def rates_of_angles(angles):
    """Rates of roll, pitch, yaw of the rates about the axes of the body, (m, 3, 3)."""
    (sr, sp, _), (cr, cp, _) = np.sin(angles).T, np.cos(angles).T
    zero = np.zeros_like(sr)
    rows = ((zero + 1.0, sr * sp / cp, cr * sp / cp), (zero, cr, -sr), (zero, sr / cp, cr / cp))
    return np.stack([np.stack(row, -1) for row in rows], -2)


def moved(x, dt=STEP):
    """The state a step later."""
    new = x.copy()
    way = x[:, SPEED] * dt + 0.5 * x[:, 12:] * dt**2
    new[:, PLACE] += np.einsum("mij,mj->mi", matrix(x[:, ANGLES]), way)
    new[:, ANGLES] += np.einsum("mij,mj->mi", rates_of_angles(x[:, ANGLES]), x[:, RATE]) * dt
    new[:, SPEED] += x[:, 12:] * dt
    return new


def transition(x, dt=STEP):
    """Its derivative by the state, (m, 15, 15)."""
    j = np.tile(np.eye(15), (len(x), 1, 1))
    mat, e = matrix(x[:, ANGLES]), rates_of_angles(x[:, ANGLES])
    j[:, PLACE, SPEED], j[:, PLACE, 12:] = mat * dt, 0.5 * mat * dt**2
    j[:, ANGLES, RATE], j[:, SPEED, 12:] = e * dt, np.eye(3) * dt
    for i in (3, 4, 5):  # derivatives by angles: complex step
        turned = x[:, ANGLES].astype(complex)
        turned[:, i - 3] += 1e-20j
        way = x[:, SPEED] * dt + 0.5 * x[:, 12:] * dt**2
        j[:, PLACE, i] += np.einsum("mij,mj->mi", matrix(turned), way).imag / 1e-20
        j[:, ANGLES, i] += np.einsum("mij,mj->mi", rates_of_angles(turned), x[:, RATE]).imag / 1e-20 * dt
    return j


def corrected(x, p, own, z, r):
    """State and covariance after a measurement of some components, in Joseph form."""
    gain = np.swapaxes(np.linalg.solve(p[:, own, own] + r, p[:, own, :]), -1, -2)
    rest = np.tile(np.eye(15), (len(x), 1, 1))
    rest[:, :, own] -= gain
    p = rest @ p @ np.swapaxes(rest, -1, -2) + gain @ r @ np.swapaxes(gain, -1, -2)
    return x + np.einsum("mij,mj->mi", gain, z - x[:, own]), p


DEFAULT_PROCESS = np.array(
    [0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015]
)
"""`process_noise_covariance` where it is not set: src/filter_base.cpp, reset."""
MEASURED = {"rate": RATE, "speed": SPEED, "place": PLACE}
LEAST_VARIANCE = 1e-9
"""What stands for a variance that is declared smaller: src/ekf.cpp, correct."""


def filtered(x, readings, process, variances, dt):
    """Filter m recordings of k steps: readings (m, k, 3) by the names of `MEASURED`, NaN where there are none.

    `x` (m, 15) is the start, of the sds `SPREAD`, and `variances` (3,) belong to each of the readings. Returns
    (m, k, 15), (m, k, 15, 15).
    """
    p, states, spreads = np.tile(np.diag(SPREAD**2), (len(x), 1, 1)), [], []
    own = {part: np.maximum(one, LEAST_VARIANCE) * np.eye(3) for part, one in variances.items()}
    for k in range(next(iter(readings.values())).shape[1]):
        j = transition(x, dt)
        x, p = moved(x, dt), j @ p @ np.swapaxes(j, -1, -2) + np.diag(process) * dt
        for part, z in readings.items():
            if np.isfinite(z[:, k]).all():
                x, p = corrected(x, p, MEASURED[part], z[:, k], own[part])
        states.append(x)
        spreads.append(p)
    return np.stack(states, 1), np.stack(spreads, 1)


def run(duration, runs, rng, *, q=1.0, r=1.0, delay=0.0, lever_arm=(0.0, 0.0, 0.0)):
    """Filter m drives; `q`, `r` multiply the covariances that the filter assumes of its process, fixes and wheels."""
    truth = np.zeros((runs, 15))
    truth[:, 3:6] = rng.uniform(-1.0, 1.0, (runs, 3)) * [0.02, 0.02, 3.0]
    truth[:, 6], truth[:, 11] = 3.0, rng.uniform(-0.1, 0.1, runs)
    x = truth + rng.standard_normal((runs, 15)) * np.sqrt(START)
    p = np.tile(np.diag(START), (runs, 1, 1))
    arm = np.asarray(lever_arm, dtype=float)
    late = round(delay / STEP)
    past, kept = [truth], []
    eye = np.eye(3)
    for k in range(1, round(duration / STEP) + 1):
        truth = moved(truth) + rng.standard_normal((runs, 15)) * np.sqrt(PROCESS * STEP)
        past = [*past, truth][-late - 1 :]
        j = transition(x)
        x, p = moved(x), j @ p @ np.swapaxes(j, -1, -2) + q * np.diag(PROCESS) * STEP
        noise = rng.standard_normal((3, runs, 3))
        x, p = corrected(x, p, RATE, truth[:, RATE] + GYRO_SD * noise[0], GYRO_SD**2 * eye)
        if k % WHEEL_STEPS == 0:
            x, p = corrected(x, p, SPEED, truth[:, SPEED] + WHEEL_SD * noise[1], r * WHEEL_SD**2 * eye)
        if k % FIX_STEPS == 0:
            place = past[0][:, PLACE] + matrix(past[0][:, ANGLES]) @ arm
            x, p = corrected(x, p, PLACE, place + FIX_SD * noise[2], r * FIX_SD**2 * eye)
        if k % (FIX_STEPS // 2) == 0:
            kept.append((k * STEP, x, p, truth))
    t, state, covariance, true = zip(*kept, strict=True)
    return Runs(np.array(t), np.stack(state, 1), np.stack(covariance, 1), np.stack(true, 1))
