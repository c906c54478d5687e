"""Closed-form motions: states agree with their own derivatives and with simple geometry."""

from __future__ import annotations

import numpy as np
import pytest

from models import earth, rotation
from models.trajectory.catalogue import BESSEL_ZERO, TRAJECTORIES, circle, figure_eight, static
from models.trajectory.motion import imu_increments
from models.trajectory.profiles import Profile, Step, Wave

DURATION = 240.0


@pytest.fixture(params=sorted(TRAJECTORIES))
def motion(request):
    return TRAJECTORIES[request.param](DURATION)


def _derivative(function, t, step):
    """Fourth-order central difference."""
    near, far = function(t + step) - function(t - step), function(t + 2 * step) - function(t - 2 * step)
    return (8 * near - far) / (12 * step)


TIMES = np.linspace(1.0, DURATION - 1.0, 173)


def test_profile_derivative():
    p = Profile(1.0, 0.2, (Step(2.0, 5.0, 3.0), Step(7.0, 1.0, -4.0)), (Wave(0.3, 0.7, 0.1),))
    t = np.linspace(0.1, 10.0, 500)
    np.testing.assert_allclose(p.derivative(t), _derivative(p, t, 1e-3), atol=1e-6)
    assert p(0.0) == pytest.approx(1.0 + 0.3 * np.sin(0.1))
    assert p(20.0) == pytest.approx(1.0 + 4.0 - 1.0 + 0.3 * np.sin(2 * np.pi * 14.0 + 0.1))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Step(0.0, 0.0, 1.0),
        lambda: Wave(1.0, 0.0),
        lambda: Profile(steps=(Step(0.0, 2.0, 1.0), Step(1.0, 1.0, 1.0))),
        lambda: static(0.0),
        lambda: static(10.0).evaluate([11.0]),
        lambda: imu_increments(static(10.0), 20.0),
    ],
)
def test_impossible_values_are_refused(make):
    with pytest.raises(ValueError, match="'"):
        make()


def test_velocity_is_the_derivative_of_position(motion):
    # The Earth-fixed position turned into the local axes, so that no radius of curvature is assumed.
    position = lambda t: earth.ecef_from_llh(motion.position(t))  # noqa: E731
    state = motion.evaluate(TIMES)
    axes = np.swapaxes(earth.mat_en(state.llh[:, 0], state.llh[:, 1]), -1, -2)
    measured = (axes @ _derivative(position, TIMES, 0.02)[..., None])[..., 0]
    np.testing.assert_allclose(state.vel_n, measured, atol=2e-6)


def test_acceleration_is_the_derivative_of_velocity(motion):
    state = motion.evaluate(TIMES)
    measured = _derivative(motion.velocity, TIMES, 1e-3)
    np.testing.assert_allclose(state.acc_n, measured, atol=1e-8)


def test_body_velocity_is_along_x(motion):
    state = motion.evaluate(TIMES)
    body = (np.swapaxes(state.mat_nb, -1, -2) @ state.vel_n[..., None])[..., 0]
    np.testing.assert_allclose(body[:, 0], motion.speed(TIMES), atol=1e-12)
    np.testing.assert_allclose(body[:, 1:], 0.0, atol=1e-13)


def test_inertial_sensors_feel_the_motion_in_inertial_space(motion):
    """Force and rate from scratch: inertial position twice differentiated, inertial attitude once."""

    def turned(t):
        angle = earth.EARTH_RATE * t
        zero = np.zeros_like(angle)
        return rotation.mat_from_rotvec(np.stack([zero, zero, angle], axis=-1))

    def position(t):
        return (turned(t) @ earth.ecef_from_llh(motion.position(t))[..., None])[..., 0]

    def attitude(t):
        state = motion.evaluate(t)
        return turned(t) @ earth.mat_en(state.llh[:, 0], state.llh[:, 1]) @ state.mat_nb

    t, state = TIMES, motion.evaluate(TIMES)
    step = 0.1
    near, far = position(t + step) + position(t - step), position(t + 2 * step) + position(t - 2 * step)
    second = (16 * near - far - 30 * position(t)) / (12 * step**2)
    # Gravity is gravitation and the centrifugal acceleration.
    x = earth.ecef_from_llh(state.llh)
    down = earth.mat_en(state.llh[:, 0], state.llh[:, 1])[..., 2]
    plumb = earth.gravity(np.sin(state.llh[:, 0]), state.llh[:, 2])[:, None] * down
    gravitation = plumb - earth.EARTH_RATE**2 * x * [1.0, 1.0, 0.0]
    force_i = second - (turned(t) @ gravitation[..., None])[..., 0]
    mat_ib = attitude(t)
    force_b = (np.swapaxes(mat_ib, -1, -2) @ force_i[..., None])[..., 0]
    np.testing.assert_allclose(state.f_b, force_b, atol=1e-4)  # differences across the joints of `city`

    step = 1e-3
    turn = np.swapaxes(attitude(t - step), -1, -2) @ attitude(t + step)
    np.testing.assert_allclose(state.omega_ib_b, rotation.rotvec_from_mat(turn) / (2 * step), atol=1e-7)


def test_increments_are_integrals(motion):
    coarse, fine = (imu_increments(motion, dt) for dt in (0.02, 0.005))
    for a, b in zip(coarse, fine, strict=True):
        np.testing.assert_allclose(a, b.reshape(-1, 4, 3).sum(axis=1), atol=1e-12)


def test_circle_has_the_radius_speed_over_rate():
    speed, radius = 15.0, 100.0
    state = circle(DURATION, speed=speed, radius=radius).evaluate(TIMES)
    ned = earth.ned_between(state.llh, state.llh[0])
    # The centre lies one radius to the right of the first course.
    course = state.rpy[0, 2]
    centre = radius * np.array([-np.sin(course), np.cos(course)])
    np.testing.assert_allclose(np.hypot(*(ned[:, :2] - centre).T), radius, rtol=1e-3)  # the Earth is round
    level = np.hypot(state.acc_n[:, 0], state.acc_n[:, 1])
    np.testing.assert_allclose(level, speed**2 / radius, rtol=1e-12)


def test_figure_eight_closes():
    period = 80.0
    motion = figure_eight(DURATION, period=period)
    ends = motion.position(np.array([0.0, period, 2 * period]))
    np.testing.assert_allclose(earth.ned_between(ends, ends[0]), 0.0, atol=0.05)  # the Earth is round
    x, w = np.polynomial.legendre.leggauss(60)
    assert abs(np.sum(w * np.cos(BESSEL_ZERO * np.sin(np.pi * x)))) < 1e-12


def test_still_unit_feels_gravity_and_earth_rate():
    state = static(100.0).evaluate([0.0, 50.0, 100.0])
    lat, _, height = state.llh[0]
    np.testing.assert_allclose(
        np.linalg.norm(state.f_b, axis=1), earth.gravity(np.sin(lat), height), rtol=1e-15
    )
    np.testing.assert_allclose(np.linalg.norm(state.omega_ib_b, axis=1), earth.EARTH_RATE, rtol=1e-14)


def test_long_motion_keeps_city_rounds_apart():
    speeds = TRAJECTORIES["city"](1200.0).speed(np.arange(0.0, 1200.0, 120.0))
    np.testing.assert_allclose(speeds, 0.0, atol=1e-12)
