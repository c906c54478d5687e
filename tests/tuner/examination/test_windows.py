"""Integrals of windows: they navigate, and their derivatives are those of the prediction."""

from __future__ import annotations

import numpy as np
import pytest

from models import rotation
from models.earth import gravity
from tuner.examination.windows import (
    ACCEL_BIAS,
    ERRORS,
    GYRO_BIAS,
    POSITION,
    TURN,
    UNKNOWNS,
    Inertial,
    motion_of,
    sampled,
    windows_of,
)

RNG = np.random.default_rng(5)
PLACE = np.array([[0.9, 0.2, 100.0]])
TAU = np.array([0.013, 1.0, 4.321, 9.9])


def imu(rate: float = 100.0, *, gyro: float = 0.0, accel: float = 0.0) -> Inertial:
    """Return smooth motion of eleven seconds, with biases added."""
    t = np.arange(0.0, 11.0, 1.0 / rate)
    phase = np.arange(6) + 1.0
    rates = np.sin(0.7 * t[:, None] * phase / 3.0 + phase) * [0.3, 0.2, 0.4, 2.0, 2.0, 1.0]
    rates[:, 5] -= 9.8
    return Inertial(t, rates + np.repeat([gyro, accel], 3))


def predicted(unit: Inertial, attitude: np.ndarray, speed: float = 0.0):
    """Return the motion of a window at `TAU`."""
    windows = windows_of(unit)
    x = np.zeros((1, UNKNOWNS))
    x[:, 4] = speed
    at = sampled(windows, np.zeros(len(TAU), dtype=int), TAU, PLACE, np.array([[0.0, speed, 0.0]]))
    return motion_of(at, attitude[None], x)


def test_a_unit_at_rest_on_the_turning_earth_stays_where_it_is() -> None:
    """Its force is −γ, its rate that of the Earth: position and velocity stay zero (Groves, section 5.4)."""
    attitude = rotation.mat_from_rpy(np.array([0.3, -0.2, 1.1]))
    lat = PLACE[0, 0]
    earth = 7.292115e-5 * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    t = np.arange(0.0, 11.0, 0.01)
    still = np.concatenate([attitude.T @ earth, attitude.T @ [0.0, 0.0, -gravity(np.sin(lat), 100.0)]])
    motion = predicted(Inertial(t, np.tile(still, (len(t), 1))), attitude)
    assert np.abs(motion.velocity).max() < 2e-5  # second order of the rotation of the Earth in ten seconds
    assert np.abs(motion.position).max() < 2e-4


def test_a_fast_aircraft_feels_coriolis() -> None:
    """East at 250 m/s: without force beside −γ it is turned by 2 ω × v and the transport rate, 0.02 to 0.05 m/s²."""
    lat, speed = PLACE[0, 0], 250.0
    t = np.arange(0.0, 11.0, 0.01)
    rates = np.zeros((len(t), 6))
    rates[:, 5] = -gravity(np.sin(lat), 100.0)
    # a gyro that turns with the local frame
    spin = 7.292115e-5 * np.array([np.cos(lat), 0.0, -np.sin(lat)]) + speed / 6.38e6 * np.array(
        [1.0, 0.0, -np.tan(lat)]
    )
    rates[:, :3] = spin
    motion = predicted(Inertial(t, rates), np.eye(3), speed)
    south = 2.0 * 7.292115e-5 * np.sin(lat) * speed + speed**2 / 6.38e6 * np.tan(lat)
    assert motion.velocity[-1, 0] == pytest.approx(-south * TAU[-1], rel=0.02)


def test_positions_are_read_with_a_slow_error_that_velocities_have_not() -> None:
    motion = predicted(imu(), np.eye(3))
    rates = motion.by_position[..., ERRORS[1]].reshape(len(TAU), 3, -1, 3)
    assert np.allclose(rates.sum(axis=2), TAU[:, None, None] * np.eye(3))  # one rate all the time
    assert not motion.by_velocity[..., ERRORS[1]].any()
    assert not motion.by_velocity[..., POSITION].any()


@pytest.mark.parametrize(("columns", "kind"), [(ACCEL_BIAS, "accel"), (GYRO_BIAS, "gyro"), (TURN, "turn")])
def test_derivatives_are_those_of_the_prediction(columns: slice, kind: str) -> None:
    attitude = rotation.mat_from_rpy(np.array([0.3, -0.2, 1.1]))
    small = 1e-5
    before = predicted(imu(), attitude)
    if kind == "turn":
        after = predicted(imu(), rotation.mat_from_rotvec(np.full(3, small)) @ attitude)
    else:  # what is added to the samples is the bias, which the prediction takes out
        after = predicted(imu(**{kind: -small}), attitude)
    for name in ("position", "velocity"):
        change = (getattr(after, name) - getattr(before, name)) / small
        stated = getattr(before, f"by_{name}")[..., columns].sum(axis=-1)
        assert np.allclose(change, stated, atol=2e-2 * np.abs(stated).max())
