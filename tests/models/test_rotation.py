"""Rotations: every representation and back, and the laws of exponential and logarithm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from models import rotation

finite = st.floats(-10.0, 10.0, allow_nan=False)
vectors = arrays(float, (4, 3), elements=finite)
small = st.floats(-12.0, 0.4).map(lambda e: 10.0**e)


@given(vectors)
def test_exponential_of_the_cross_product_matrix(a):
    for rotvec, mat in zip(a, rotation.mat_from_rotvec(a), strict=True):
        np.testing.assert_allclose(mat, expm(rotation.skew(rotvec)), atol=1e-12)


@given(vectors)
def test_quaternion_and_matrix_exponentials_agree(a):
    np.testing.assert_allclose(
        rotation.mat_from_quat(rotation.quat_from_rotvec(a)), rotation.mat_from_rotvec(a), atol=1e-14
    )


@given(arrays(float, 3, elements=st.floats(-1.0, 1.0)), small)
def test_logarithm_inverts_exponential_at_every_size(direction, angle):
    length = np.linalg.norm(direction)
    if length < 0.1:
        return
    rotvec = angle * direction / length
    for back in (
        rotation.rotvec_from_quat(rotation.quat_from_rotvec(rotvec)),
        rotation.rotvec_from_quat(-rotation.quat_from_rotvec(rotvec)),
    ):
        np.testing.assert_allclose(back, rotvec, rtol=0, atol=1e-15 * (1 + angle) + 1e-14 * angle)
    np.testing.assert_allclose(rotation.rotvec_from_mat(rotation.mat_from_rotvec(rotvec)), rotvec, atol=1e-14)


def test_half_turns_and_no_turn():
    for rotvec in np.vstack([np.zeros(3), np.pi * np.eye(3)]):
        back = rotation.rotvec_from_mat(rotation.mat_from_rotvec(rotvec))
        np.testing.assert_allclose(
            rotation.mat_from_rotvec(back), rotation.mat_from_rotvec(rotvec), atol=1e-15
        )
        np.testing.assert_allclose(np.linalg.norm(back), np.linalg.norm(rotvec), atol=1e-15)


@given(vectors)
def test_matrix_quaternion_round_trip(a):
    mat = rotation.mat_from_rotvec(a)
    q = rotation.quat_from_mat(mat)
    assert np.all(q[:, 0] >= 0.0)
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-15)
    np.testing.assert_allclose(rotation.mat_from_quat(q), mat, atol=1e-14)


@given(arrays(float, 3, elements=st.floats(-3.1, 3.1)))
def test_euler_round_trip(rpy):
    rpy[1] /= 2.0
    if abs(rpy[1]) > 1.5707:
        return
    np.testing.assert_allclose(rotation.rpy_from_mat(rotation.mat_from_rpy(rpy)), rpy, atol=1e-11)
    np.testing.assert_allclose(rotation.rpy_from_quat(rotation.quat_from_rpy(rpy)), rpy, atol=1e-11)


@pytest.mark.parametrize("pitch", [-np.pi / 2, np.pi / 2])
def test_euler_at_the_singularity_gives_the_right_matrix(pitch):
    mat = rotation.mat_from_rpy([0.4, pitch, -1.0])
    np.testing.assert_allclose(rotation.mat_from_rpy(rotation.rpy_from_mat(mat)), mat, atol=1e-15)


def test_euler_angles_turn_as_named():
    # Yaw turns north to east, pitch raises the nose, roll lowers the right wing.
    forward, right = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(rotation.mat_from_rpy([0, 0, np.pi / 2]) @ forward, [0, 1, 0], atol=1e-15)
    assert (rotation.mat_from_rpy([0, 0.1, 0]) @ forward)[2] < 0
    assert (rotation.mat_from_rpy([0.1, 0, 0]) @ right)[2] > 0


@given(vectors, vectors)
def test_product_of_quaternions_is_product_of_matrices(a, b):
    p, q = rotation.quat_from_rotvec(a), rotation.quat_from_rotvec(b)
    product = rotation.mat_from_quat(rotation.quat_multiply(p, q))
    np.testing.assert_allclose(product, rotation.mat_from_quat(p) @ rotation.mat_from_quat(q), atol=1e-14)
    np.testing.assert_allclose(
        rotation.quat_multiply(p, rotation.quat_conjugate(p)), np.tile([1.0, 0, 0, 0], (4, 1)), atol=1e-15
    )


@given(arrays(float, 3, elements=st.floats(-2.0, 2.0)), small)
def test_left_jacobian_against_finite_difference(a, size):
    a = size * a
    step = 1e-6
    columns = []
    for e in np.eye(3):
        ahead, behind = rotation.mat_from_rotvec(a + step * e), rotation.mat_from_rotvec(a - step * e)
        columns.append(rotation.rotvec_from_mat(ahead @ behind.T) / (2 * step))
    np.testing.assert_allclose(rotation.left_jacobian(a), np.stack(columns, axis=-1), atol=1e-8)


@pytest.mark.parametrize("length", [1e-9, 0.1, 0.49, 0.51, 3.0])
def test_left_jacobian_is_its_power_series(length):
    """J = Σ [a ×]ᵏ/(k + 1)!"""
    k = rotation.skew(length * np.array([0.6, -0.64, 0.48]))
    term, total = np.eye(3), np.eye(3)
    for i in range(1, 40):
        term = term @ k / (i + 1)
        total = total + term
    np.testing.assert_allclose(
        rotation.left_jacobian(length * np.array([0.6, -0.64, 0.48])), total, atol=2e-15
    )


@settings(max_examples=30)
@given(arrays(float, 3, elements=st.floats(-1.4, 1.4)), arrays(float, 3, elements=st.floats(-3.0, 3.0)))
def test_rate_from_euler_rates_against_finite_difference(rpy, rpy_dot):
    step = 1e-6
    ahead, behind = rotation.mat_from_rpy(rpy + step * rpy_dot), rotation.mat_from_rpy(rpy - step * rpy_dot)
    measured = rotation.rotvec_from_mat(behind.T @ ahead) / (2 * step)
    np.testing.assert_allclose(rotation.rate_from_rpy(rpy, rpy_dot), measured, atol=1e-7)


@given(vectors, st.integers(0, 99))
def test_the_nearest_rotation_fits_turned_vectors(a, seed):
    mat = rotation.mat_from_rotvec(a[0])
    x = np.random.default_rng(seed).standard_normal((9, 3))
    np.testing.assert_allclose(rotation.nearest_rotation((x @ mat.T).T @ x), mat, atol=1e-9)
    found = rotation.nearest_rotation(np.diag([1.0, 1.0, -1.0]))  # no reflection
    assert np.linalg.det(found) == pytest.approx(1.0)
