"""Two filters that share no code with the project, on drives of their own: an unscented and an invariant one.

A vehicle on a flat Earth, north-east-down, with a MEMS unit and a receiver of positions and velocities at 1 Hz.
The truth obeys the discrete equations of the filters exactly. Many runs are filtered side by side.

- UKF on the manifold R³ × R³ × SO(3) × R⁶: E. A. Wan, R. van der Merwe (2000); J.-J. Brossard, A. Barrau,
  S. Bonnabel (2020).
- Right-invariant EKF on SE₂(3) with biases: A. Barrau, S. Bonnabel, The invariant extended Kalman filter as a stable
  observer, IEEE T-AC 62 (2017); R. Hartley et al. (2020) for the biases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GRAVITY = np.array([0.0, 0.0, 9.80665])
ARW, VRW = 2e-4, 3e-3  # rad/√s, m/s/√s
GYRO_BIAS, ACCEL_BIAS, BIAS_TIME = 1e-3, 2e-2, 400.0  # rad/s, m/s², s
FIX_SD, FIX_VELOCITY_SD = 1.0, 0.08  # m, m/s
START_SD = np.concatenate(
    [np.full(3, 1.0), np.full(3, 0.1), [0.01, 0.01, 0.03], np.full(3, 1e-3), np.full(3, 2e-2)]
)
STEP, FIX_STEPS = 0.05, 20


@dataclass(frozen=True)
class Truth:
    """Motion at the steps: time, position, velocity, attitude; increments between them."""

    t: np.ndarray
    p: np.ndarray
    v: np.ndarray
    c: np.ndarray
    omega: np.ndarray
    f: np.ndarray


@dataclass(frozen=True)
class Output:
    """What m runs of a filter state at the fixes: (m, k, …), and innovations with S."""

    t: np.ndarray
    p: np.ndarray
    v: np.ndarray
    c: np.ndarray
    bias: np.ndarray
    covariance: np.ndarray
    innovation: np.ndarray
    innovation_covariance: np.ndarray
    true_bias: np.ndarray
    truth: Truth


def skew(a):
    z = np.zeros(a.shape[:-1])
    rows = [[z, -a[..., 2], a[..., 1]], [a[..., 2], z, -a[..., 0]], [-a[..., 1], a[..., 0], z]]
    return np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)


def expm(a):
    x = np.linalg.norm(a, axis=-1)[..., None, None]
    k = skew(a)
    return np.eye(3) + np.sinc(x / np.pi) * k + 0.5 * np.sinc(x / (2 * np.pi)) ** 2 * (k @ k)


def logm(c):
    cos = np.clip((np.trace(c, axis1=-2, axis2=-1) - 1.0) / 2.0, -1.0, 1.0)
    angle = np.arccos(cos)
    axis = np.stack(
        [c[..., 2, 1] - c[..., 1, 2], c[..., 0, 2] - c[..., 2, 0], c[..., 1, 0] - c[..., 0, 1]], axis=-1
    )
    return axis * (0.5 / np.sinc(angle / np.pi))[..., None]


def left_jacobian(a):
    x = np.linalg.norm(a, axis=-1)[..., None, None]
    k = skew(a)
    return np.eye(3) + 0.5 * np.sinc(x / (2 * np.pi)) ** 2 * k + (1.0 / 6.0 - x**2 / 120.0) * (k @ k)


def drive(duration, rng):
    """A drive with bends, changes of speed, stops and slopes."""
    t = np.arange(round(duration / STEP) + 1) * STEP
    phase = rng.uniform(0.0, 2 * np.pi, 6)
    speed = (
        9.0 + 5.0 * np.sin(2 * np.pi * t / 47.0 + phase[0]) + 3.0 * np.sin(2 * np.pi * t / 21.0 + phase[1])
    )
    speed = np.maximum(speed, 0.0)
    speed = np.convolve(np.pad(speed, 20, mode="edge"), np.hanning(41) / np.hanning(41).sum(), mode="valid")
    yaw = 1.2 * np.sin(2 * np.pi * t / 61.0 + phase[2]) + 2.2 * np.sin(2 * np.pi * t / 173.0 + phase[3])
    pitch = 0.04 * np.sin(2 * np.pi * t / 37.0 + phase[4])
    roll = 0.03 * np.sin(2 * np.pi * t / 29.0 + phase[5])
    cy, sy, cp, sp, cr, sr = (
        np.cos(yaw),
        np.sin(yaw),
        np.cos(pitch),
        np.sin(pitch),
        np.cos(roll),
        np.sin(roll),
    )
    c = np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], -1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], -1),
            np.stack([-sp, cp * sr, cp * cr], -1),
        ],
        -2,
    )
    v = c[:, :, 0] * speed[:, None]
    p = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (v[1:] + v[:-1]) * STEP, axis=0)])
    omega = logm(np.swapaxes(c[:-1], -1, -2) @ c[1:]) / STEP
    f = np.einsum("nji,nj->ni", c[:-1], np.diff(v, axis=0) / STEP - GRAVITY)
    return Truth(t, p, v, c, omega, f)


def measured(truth, runs, rng, *, delay=0.0, lever_arm=(0.0, 0.0, 0.0)):
    """Samples of the unit, fixes and biases of m runs; fixes are `delay` late and of an antenna at `lever_arm`."""
    n = len(truth.omega)
    a = np.exp(-STEP / BIAS_TIME)
    sd = np.repeat([GYRO_BIAS, ACCEL_BIAS], 3)
    bias = np.empty((runs, n + 1, 6))
    bias[:, 0] = rng.standard_normal((runs, 6)) * sd
    for k in range(n):
        bias[:, k + 1] = a * bias[:, k] + np.sqrt(1 - a * a) * sd * rng.standard_normal((runs, 6))
    noise = rng.standard_normal((runs, n, 6)) * np.repeat([ARW, VRW], 3) / np.sqrt(STEP)
    samples = np.hstack([truth.omega, truth.f]) + bias[:, :-1] + noise
    at = np.arange(FIX_STEPS, n + 1, FIX_STEPS)
    when = truth.t[at] - delay
    low = np.clip(np.floor(when / STEP + 1e-9).astype(int), 0, n - 1)
    u = (when / STEP - low)[:, None]
    arm = np.asarray(lever_arm, dtype=float)
    p = truth.p + truth.c @ arm
    rate = np.concatenate([truth.omega, truth.omega[-1:]])
    v = truth.v + np.einsum("nij,nj->ni", truth.c, np.cross(rate, arm))
    fix = np.concatenate([(1 - u) * p[low] + u * p[low + 1], (1 - u) * v[low] + u * v[low + 1]], axis=1)
    errors = rng.standard_normal((runs, len(at), 6)) * np.repeat([FIX_SD, FIX_VELOCITY_SD], 3)
    return samples, fix + errors, at, bias


def start(truth, bias, runs, rng):
    e = rng.standard_normal((runs, 9)) * START_SD[:9]
    p, v = truth.p[0] - e[:, :3], truth.v[0] - e[:, 3:6]
    return p, v, expm(-e[:, 6:9]) @ truth.c[0]


def noise_over(dt, c, q):
    """Discrete process noise over dt of position, velocity, attitude, biases: white noise and driven biases."""
    m = len(c)
    out = np.zeros((m, 15, 15))
    eye = np.eye(3)
    drive2 = 2.0 / BIAS_TIME
    out[:, 0:3, 0:3] = VRW**2 * dt**3 / 3 * eye
    out[:, 0:3, 3:6] = out[:, 3:6, 0:3] = VRW**2 * dt**2 / 2 * eye
    out[:, 3:6, 3:6] = VRW**2 * dt * eye
    out[:, 6:9, 6:9] = ARW**2 * dt * eye
    out[:, 9:12, 9:12] = GYRO_BIAS**2 * drive2 * dt * eye
    out[:, 12:15, 12:15] = ACCEL_BIAS**2 * drive2 * dt * eye
    return q * out


def mechanise(p, v, c, sample, bias):
    """One step of the strapdown equations; leading axes are free."""
    f = np.einsum("...ij,...j->...i", c, sample[..., 3:] - bias[..., 3:])
    new = v + (f + GRAVITY) * STEP
    turned = c @ expm((sample[..., :3] - bias[..., :3]) * STEP)
    return p + 0.5 * (v + new) * STEP, new, turned


def run_ukf(truth, runs, rng, *, q=1.0, r=1.0, **faults):
    """Unscented filter; `q`, `r` multiply the variances that it assumes."""
    samples, fixes, at, bias = measured(truth, runs, rng, **faults)
    p, v, c = start(truth, bias, runs, rng)
    b = np.zeros((runs, 6))
    cov = np.tile(np.diag(START_SD**2), (runs, 1, 1))
    n, kappa = 15, 1.0
    scale = np.sqrt(n + kappa)
    weight = np.full(2 * n + 1, 0.5 / (n + kappa))
    weight[0] = kappa / (n + kappa)
    h = np.zeros((6, 15))
    h[:, :6] = np.eye(6)
    noise = r * np.diag(np.repeat([FIX_SD**2, FIX_VELOCITY_SD**2], 3))
    kept, k0 = [], 0
    for j, k1 in enumerate(at):
        root = np.linalg.cholesky(cov) * scale
        x = np.concatenate(
            [np.zeros((runs, 1, n)), np.swapaxes(root, 1, 2), -np.swapaxes(root, 1, 2)], axis=1
        )
        sp, sv = p[:, None] + x[..., :3], v[:, None] + x[..., 3:6]
        sc, sb = expm(x[..., 6:9]) @ c[:, None], b[:, None] + x[..., 9:]
        for k in range(k0, k1):
            sp, sv, sc = mechanise(sp, sv, sc, samples[:, k, None], sb)
        sb = sb * np.exp(-(k1 - k0) * STEP / BIAS_TIME)
        middle = sc[:, 0]
        e = np.concatenate(
            [sp - sp[:, :1], sv - sv[:, :1], logm(sc @ np.swapaxes(middle, -1, -2)[:, None]), sb - sb[:, :1]],
            -1,
        )
        mean = np.einsum("s,msi->mi", weight, e)
        d = e - mean[:, None]
        cov = np.einsum("s,msi,msj->mij", weight, d, d) + noise_over((k1 - k0) * STEP, middle, q)
        p, v = sp[:, 0] + mean[:, :3], sv[:, 0] + mean[:, 3:6]
        c, b = expm(mean[:, 6:9]) @ middle, sb[:, 0] + mean[:, 9:]
        z = fixes[:, j] - np.concatenate([p, v], axis=1)
        s = cov[:, :6, :6] + noise
        gain = np.swapaxes(np.linalg.solve(s, cov[:, :6, :]), -1, -2)
        x = np.einsum("mij,mj->mi", gain, z)
        p, v, c, b = p + x[:, :3], v + x[:, 3:6], expm(x[:, 6:9]) @ c, b + x[:, 9:]
        cov = cov - gain @ s @ np.swapaxes(gain, -1, -2)
        cov = 0.5 * (cov + np.swapaxes(cov, -1, -2))
        kept.append((p, v, c, b, cov, z, s))
        k0 = k1
    return _output(truth, at, bias, kept)


def run_invariant(truth, runs, rng, *, q=1.0, r=1.0, **faults):
    """Right-invariant extended filter; its covariance is stated in the usual errors."""
    samples, fixes, at, bias = measured(truth, runs, rng, **faults)
    p, v, c = start(truth, bias, runs, rng)
    b = np.zeros((runs, 6))
    origin = p.copy()  # positions relative to here keep the numbers small
    cov = (
        _to_invariant(p - origin, v)
        @ np.diag(START_SD**2)
        @ np.swapaxes(_to_invariant(p - origin, v), -1, -2)
    )
    noise = r * np.diag(np.repeat([FIX_SD**2, FIX_VELOCITY_SD**2], 3))
    kept, k0 = [], 0
    decay = np.exp(-STEP / BIAS_TIME)
    eye = np.eye(15)
    for j, k1 in enumerate(at):
        for k in range(k0, k1, 5):
            phi = np.tile(eye, (runs, 1, 1))
            dt = STEP * 5
            a = np.zeros((runs, 15, 15))
            a[:, 0:3, 3:6] = np.eye(3)
            a[:, 3:6, 6:9] = skew(GRAVITY)
            rel = p - origin
            a[:, 0:3, 9:12] = -skew(rel) @ c
            a[:, 3:6, 9:12] = -skew(v) @ c
            a[:, 6:9, 9:12] = -c
            a[:, 3:6, 12:15] = -c
            step = a * dt
            phi = eye + step + 0.5 * step @ step + step @ step @ step / 6.0
            phi[:, 9:, 9:] = np.eye(6) * decay**5
            usual = _to_invariant(rel, v)
            noise_in = usual @ noise_over(dt, c, q) @ np.swapaxes(usual, -1, -2)
            cov = phi @ cov @ np.swapaxes(phi, -1, -2) + noise_in
            for i in range(k, k + 5):
                p, v, c = mechanise(p, v, c, samples[:, i], b)
            b = b * decay**5
        rel = p - origin
        back = np.linalg.inv(_to_invariant(rel, v))
        h = back[:, :6]
        z = fixes[:, j] - np.concatenate([p, v], axis=1)
        s = h @ cov @ np.swapaxes(h, -1, -2) + noise
        gain = np.swapaxes(np.linalg.solve(s, h @ cov), -1, -2)
        x = np.einsum("mij,mj->mi", gain, z)
        turn, jac = expm(x[:, 6:9]), left_jacobian(x[:, 6:9])
        p = origin + np.einsum("mij,mj->mi", turn, rel) + np.einsum("mij,mj->mi", jac, x[:, :3])
        v = np.einsum("mij,mj->mi", turn, v) + np.einsum("mij,mj->mi", jac, x[:, 3:6])
        c, b = turn @ c, b + x[:, 9:]
        cov = (eye - gain @ h) @ cov
        cov = 0.5 * (cov + np.swapaxes(cov, -1, -2))
        back = np.linalg.inv(_to_invariant(p - origin, v))
        kept.append((p, v, c, b, back @ cov @ np.swapaxes(back, -1, -2), z, s))
        k0 = k1
    return _output(truth, at, bias, kept)


def _to_invariant(p, v):
    """Usual errors (p, v, φ) to invariant ones: ξ_p = δp + [p ×] φ … to first order."""
    m = len(p)
    t = np.tile(np.eye(15), (m, 1, 1))
    t[:, 0:3, 6:9] = skew(p)
    t[:, 3:6, 6:9] = skew(v)
    return t


def _output(truth, at, bias, kept):
    p, v, c, b, cov, z, s = (np.stack(x, axis=1) for x in zip(*kept, strict=True))
    return Output(truth.t[at], p, v, c, b, cov, z, s, bias[:, at], truth)
