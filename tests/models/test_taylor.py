"""Sine, cosine and the quaternion of a rotation vector by Taylor's series against numpy's functions."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from models import rotation, taylor

small = st.floats(-12.0, 0.0).map(lambda e: 10.0**e)


def test_series_are_sine_and_cosine_up_to_a_right_angle():
    x = np.linspace(-np.pi / 2, np.pi / 2, 10001)
    sine, cosine = taylor.sine_cosine(x)
    np.testing.assert_allclose(sine, np.sin(x), rtol=0, atol=1e-15)
    np.testing.assert_allclose(cosine, np.cos(x), rtol=0, atol=1e-15)


@given(arrays(float, 3, elements=st.floats(-1.8, 1.8)), small)
def test_exponential_is_the_quaternion_of_a_rotation_up_to_half_a_turn(a, size):
    np.testing.assert_allclose(
        taylor.exponential(tuple(size * a)), rotation.quat_from_rotvec(size * a), atol=3e-16
    )
