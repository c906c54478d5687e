"""Strapdown mechanisation: returns to the trajectory that made its samples; corrections do what theory says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numba import njit
from numba.extending import register_jitable

from models import earth, rotation, strapdown, taylor
from models import vector3 as triples
from models.strapdown import NavigationState, correct_increments, step
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from tests.mechanisation import mechanize

for kernel in (*triples.KERNELS, *taylor.KERNELS, *earth.KERNELS, *strapdown.KERNELS):
    register_jitable(kernel)


@njit
def _run(pos, vel, quat, dtheta, dvel, dt, out):
    for k in range(len(dtheta)):
        j = max(k - 1, 0)
        a, u = (dtheta[k, 0], dtheta[k, 1], dtheta[k, 2]), (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        b, w = (dtheta[j, 0], dtheta[j, 1], dtheta[j, 2]), (dvel[j, 0], dvel[j, 1], dvel[j, 2])
        rotvec, force = correct_increments(a, u, b, w)
        pos, vel, quat, _ = step(pos, vel, quat, rotvec, force, dt)
        for i in range(3):
            out[k, i], out[k, 3 + i] = pos[i], vel[i]
        for i in range(4):
            out[k, 6 + i] = quat[i]


def _compiled(start, dtheta, dvel, dt):
    out = np.empty((len(dtheta), 10))
    _run(tuple(start.llh), tuple(start.vel_n), tuple(start.quat_nb), dtheta, dvel, dt, out)
    return NavigationState(out[:, :3], out[:, 3:6], out[:, 6:])


def _errors(name, duration, interval):
    motion = TRAJECTORIES[name](duration)
    dtheta, dvel = imu_increments(motion, interval)
    truth = motion.evaluate(interval * np.arange(1, len(dtheta) + 1))
    end = _compiled(motion.evaluate([0.0]).at(0), dtheta, dvel, interval)
    np.testing.assert_allclose(np.linalg.norm(end.quat_nb, axis=1), 1.0, atol=1e-14)
    turn = np.swapaxes(truth.mat_nb, -1, -2) @ rotation.mat_from_quat(end.quat_nb)
    return (
        np.abs(earth.ned_between(end.llh, truth.llh)).max(),
        np.abs(end.vel_n - truth.vel_n).max(),
        np.abs(rotation.rotvec_from_mat(turn)).max(),
    )


@pytest.mark.parametrize(
    ("name", "rate"), [*((name, 100.0) for name in sorted(TRAJECTORIES)), ("city", 200.0)]
)
def test_perfect_increments_lead_back_to_the_truth(name, rate):
    position, velocity, attitude = _errors(name, 600.0, 1.0 / rate)
    assert position < 2e-4  # m in 10 min
    assert velocity < 1e-6
    assert attitude < 1e-9


def test_turned_is_the_matrix_times_the_vector():
    rng = np.random.default_rng(5)
    for q, a in zip(
        rng.standard_normal((50, 4)).tolist(), rng.standard_normal((50, 3)).tolist(), strict=True
    ):
        expected = triples.transform(triples.matrix(q), a)
        np.testing.assert_allclose(triples.turned(q, a), expected, rtol=0, atol=1e-14)


def test_error_is_of_second_order():
    coarse, fine = (_errors("s_turns", 100.0, dt)[0] for dt in (0.02, 0.01))
    assert 3.0 < coarse / fine < 6.0


def test_still_unit_stays_for_an_hour():
    position, velocity, attitude = _errors("static", 3600.0, 0.01)
    assert position < 1e-3
    assert velocity < 1e-6
    assert attitude < 1e-10


def test_readable_and_compiled_agree():
    motion = TRAJECTORIES["city"](30.0)
    dtheta, dvel = imu_increments(motion, 0.01)
    start = motion.evaluate([0.0]).at(0)
    plain, compiled = mechanize(start, dtheta, dvel, 0.01), _compiled(start, dtheta, dvel, 0.01)
    np.testing.assert_allclose(plain.llh[1:], compiled.llh, rtol=1e-14)
    np.testing.assert_allclose(plain.vel_n[1:], compiled.vel_n, atol=1e-11)
    np.testing.assert_allclose(plain.quat_nb[1:], compiled.quat_nb, atol=1e-13)
    np.testing.assert_array_equal(plain.llh[0], start.llh)


CONE, PULSE = 0.01, 2.0 * np.pi * 5.0  # half angle, rad; angular frequency, rad/s


def _coning_drift(dt, correct):
    """Drift about z, rad/s, of a unit that cones about z: its true mean rate is zero.

    Attitude exp(a (cos Ωt, sin Ωt, 0)): rate in b from the right Jacobian, integrated to rounding.
    """
    n = round(2.0 / dt)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    t = dt * (np.arange(-1, n)[:, None] + 0.5 * (1.0 + nodes))
    rotvec = CONE * np.stack([np.cos(PULSE * t), np.sin(PULSE * t), 0 * t], axis=-1)
    rotvec_dot = CONE * PULSE * np.stack([-np.sin(PULSE * t), np.cos(PULSE * t), 0 * t], axis=-1)
    omega = (rotation.left_jacobian(-rotvec) @ rotvec_dot[..., None])[..., 0]
    dtheta = 0.5 * dt * np.einsum("kij,i->kj", omega, weights)
    steps = dtheta[1:]
    if correct:
        steps = np.stack(correct_increments(steps.T, steps.T, dtheta[:-1].T, dtheta[:-1].T)[0], axis=-1)
    q = rotation.quat_from_rotvec([CONE, 0.0, 0.0])
    for rotation_vector in steps:
        q = rotation.quat_multiply(q, rotation.quat_from_rotvec(rotation_vector))
    end = rotation.mat_from_rotvec([CONE * np.cos(PULSE * n * dt), CONE * np.sin(PULSE * n * dt), 0.0])
    return rotation.rotvec_from_mat(rotation.mat_from_quat(q) @ end.T)[2] / (n * dt)


def test_coning_correction_gains_the_theoretical_factor():
    """Drift without correction: −½ a² Ω (1 − sin x/x), x = Ω dt; with it the terms below x⁴ vanish.

    A pure cone has Δθ₋ × Δθ = 4 a² sin²(x/2) sin x about z in every step, so what is left is
    ½ a² Ω [(1 − sin x/x) − (2/3) sin²(x/2) sin x/x] = a² Ω x⁴ (1/60 + …): a factor of x²/5.
    """
    for dt in (0.01, 0.005):
        x = PULSE * dt
        raw = 0.5 * CONE**2 * PULSE * (1.0 - np.sin(x) / x)
        left = raw - 0.5 * CONE**2 * PULSE * (2.0 / 3.0) * np.sin(0.5 * x) ** 2 * np.sin(x) / x
        np.testing.assert_allclose(abs(_coning_drift(dt, correct=False)), raw, rtol=1e-3)
        np.testing.assert_allclose(abs(_coning_drift(dt, correct=True)), left, rtol=1e-2)
        np.testing.assert_allclose(left / raw, x**2 / 5.0, rtol=0.1)


def test_sculling_and_rotation_against_the_integral():
    """Velocity increment in the starting body frame, rate and force linear in time: fourth-order error."""
    rate, slope = np.array([0.3, -0.2, 0.5]), np.array([-0.4, 0.6, 0.2])
    force, jolt = np.array([1.0, 2.0, -9.0]), np.array([3.0, -1.0, 2.0])

    def error(dt):
        def increments(a, b):
            return rate * (b - a) + slope * (b**2 - a**2) / 2, force * (b - a) + jolt * (b**2 - a**2) / 2

        (before_a, before_v), (now_a, now_v) = increments(-dt, 0.0), increments(0.0, dt)
        _, predicted = correct_increments(now_a, now_v, before_a, before_v)
        edges = np.linspace(0.0, dt, 4001)
        attitude, total = np.eye(3), np.zeros(3)
        for a, b in pairwise(edges):
            angle, velocity = increments(a, b)
            half = rotation.mat_from_rotvec(0.5 * angle)
            total += attitude @ half @ velocity
            attitude = attitude @ half @ half
        return np.linalg.norm(predicted - total)

    coarse, fine = error(0.04), error(0.02)
    assert fine < 1e-6
    assert coarse / fine > 12.0


def test_mean_attitude_is_half_way():
    for axis in np.eye(3):
        for angle in (0.3, np.pi):
            a = rotation.quat_from_rotvec(angle * axis)
            b = rotation.quat_multiply(a, rotation.quat_from_rotvec([0.2, -0.1, 0.3]))
            half = rotation.mat_from_quat(a) @ rotation.mat_from_rotvec([0.1, -0.05, 0.15])
            for sign in (1.0, -1.0):
                np.testing.assert_allclose(
                    strapdown.mean_attitude(tuple(a), tuple(sign * b)), half, atol=1e-15
                )
