"""Straight-line functions do in compiled code what they do outside it, with numbers and with lanes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from tuner.navigation.engine.simd import WIDTH, aligned, as_lanes, as_numbers
from tuner.navigation.engine.tracing import cosine, sine, straight


@straight
def _bent(x):
    """Two conditions, one of them within the other's outcome."""
    if x < 1.0:
        return (0.5 if x < 0.0 else x * x), 1.0 - x
    return math.sqrt(x), -x / 3.0


@straight
def _summed(x, y):
    a, b = _bent(x)
    return a + 2.0 * b + np.copysign(y, -x)


@straight
def _set(out, i, x):
    for k in range(2):
        out[i + k] = sine(x) if k == 0 else cosine(x)


@njit
def _of_numbers(x, out):
    number = as_numbers(out)
    for i in range(len(x)):
        number[i] = _summed(x[i], 2.0)


@njit
def _of_lanes(x, out):
    values, lanes = as_lanes(x), as_lanes(out)
    for i in range(len(values)):
        lanes[i] = _summed(values[i], values[i] * 0.5) + 1.0
    _set(lanes, len(values), values[0])


X = np.array([-2.0, -0.5, 0.0, 0.3, 1.0, 2.0, 9.0])


def test_every_outcome_of_conditions_is_there():
    out = aligned(len(X), 1)
    _of_numbers(X, out)
    np.testing.assert_allclose(out[:, 0], [_summed(x, 2.0) for x in X], rtol=1e-14)


def test_vectors_give_what_their_numbers_give_one_by_one():
    spread = np.linspace(1.0, 1.1, WIDTH)
    x, out = X[:, None] * spread, aligned(len(X) + 2, WIDTH)
    _of_lanes(x, out)
    for i in (0, 1, 3, 5, 6):  # where all lanes have the same outcome
        np.testing.assert_allclose(out[i], [_summed(v, 0.5 * v) + 1.0 for v in x[i]], rtol=1e-14)
    np.testing.assert_allclose(out[-2:], [np.sin(x[0]), np.cos(x[0])], rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("x", [0.0, 1.0, -3.0, 40.0])
def test_sine_and_cosine(x):
    assert sine(x) == pytest.approx(math.sin(x), abs=1e-14)
    assert cosine(x) == pytest.approx(math.cos(x), abs=1e-14)
