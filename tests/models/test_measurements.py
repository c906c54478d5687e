"""Measurement models: zero at the truth, and every H equals the finite difference of its measurement."""

from __future__ import annotations

import numpy as np
import pytest

from models import earth, rotation
from models.error_state import Linearization, corrected
from models.filter_states import named_states
from models.imu_errors import calibration
from models.measurements import (
    antenna,
    non_holonomic,
    perfect_fixes,
    position_fix,
    velocity_fix,
    zero_rate,
    zero_velocity,
)
from models.noise import GaussMarkov
from models.state_layout import AxisNoise, error_model
from models.strapdown import NavigationState
from models.trajectory.catalogue import TRAJECTORIES

ARM = np.array([0.4, -0.7, -1.2])
LADDER = (GaussMarkov(1e-5, 3.0),)
FULL = error_model(
    [AxisNoise(3e-5, markov=LADDER)] * 3,
    [AxisNoise(1e-3, markov=LADDER)] * 3,
    gnss_markov=(GaussMarkov(1.0, 60.0), GaussMarkov(0.3, 600.0)),
    constants=named_states(),
)
BASE = error_model([AxisNoise(3e-5)] * 3, [AxisNoise(1e-3)] * 3)
MOUNTING = rotation.mat_from_rpy([0.1, -0.05, 0.2])


@pytest.fixture(params=[BASE, FULL], ids=["base", "full"])
def case(request):
    """A model, parameters, an estimate and raw sensor readings."""
    model = request.param
    x = 0.01 * np.random.default_rng(11).standard_normal(model.layout.size)
    x[:9] = 0.0
    state = NavigationState(
        np.array([0.7, 0.2, 300.0]), np.array([12.0, -9.0, 0.5]), rotation.quat_from_rpy([0.1, -0.2, 2.0])
    )
    return model, x, state, np.array([0.1, -0.2, 0.3, 1.0, -0.5, -9.5])


def _place(model, x, state, measured):
    sensors = calibration(model, x)
    true = sensors.true_rates(measured)
    return Linearization(
        state.llh, state.vel_n, rotation.mat_from_quat(state.quat_nb), true[:3], true[3:], sensors
    )


FIX = np.array([0.7 + 2e-7, 0.2 - 1e-7, 303.0])
MEASUREMENTS = {
    "position": lambda model, at, x: position_fix(model, at, x, FIX, lever_arm=ARM),
    "velocity": lambda model, at, x: velocity_fix(model, at, x, [11.0, -9.0, 0.0], lever_arm=ARM),
    "non_holonomic": lambda model, at, x: non_holonomic(model, at, x, mat_bv=MOUNTING, lever_arm=ARM),
    "zero_velocity": lambda model, at, x: zero_velocity(model, at),
    "zero_rate": lambda model, at, x: zero_rate(model, at),
}


@pytest.mark.parametrize("name", sorted(MEASUREMENTS))
def test_jacobian_against_finite_difference(case, name):
    """z = measured − predicted falls by H δ where the estimate moves by δ towards the truth."""
    model, x, state, measured = case
    measure = MEASUREMENTS[name]
    h = measure(model, _place(model, x, state, measured), x).H
    size = np.full(len(x), 1e-4)
    size[:3], size[3:6] = 10.0, 0.1
    for k in range(len(x)):
        e = size[k] * np.eye(len(x))[k]
        ahead, behind = (
            measure(model, _place(model, x + d, corrected(state, d[:9]), measured), x + d).z for d in (e, -e)
        )
        numeric = -(ahead - behind) / (2 * size[k])
        np.testing.assert_allclose(h[:, k], numeric, atol=3e-5 if k >= 3 else 3e-6, err_msg=f"state {k}")


def test_perfect_fixes_agree_with_the_perfect_estimate():
    """With the true lever arm, delay and correlated error z vanishes (to third order in the delay)."""
    motion = TRAJECTORIES["s_turns"](60.0)
    t, delay = np.linspace(5.0, 55.0, 26), 0.05
    llh, vel = perfect_fixes(motion, t, lever_arm=ARM, delay=delay)
    state = motion.evaluate(t)
    x = np.zeros(FULL.layout.size)
    x[FULL.layout["lever_arm"]] = ARM
    x[FULL.layout["time_offset"]] = delay
    offset = FULL.layout["gnss_position"]
    x[offset] = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]
    shifted = earth.llh_displaced(llh, [1.1, 2.2, 3.3])
    for k in range(len(t)):
        at = Linearization(state.llh[k], state.vel_n[k], state.mat_nb[k], state.omega_ib_b[k], state.f_b[k])
        position = position_fix(FULL, at, x, shifted[k], lever_arm=np.zeros(3))
        velocity = velocity_fix(FULL, at, x, vel[k], lever_arm=np.zeros(3))
        # Left: jerk d³/6 and the acceleration of the lever arm, below 1 m/s² here.
        np.testing.assert_allclose(position.z, 0.0, atol=0.5 * delay**2 * 1.0 + delay**3)
        np.testing.assert_allclose(velocity.z, 0.0, atol=delay * 1.0)
        plain = position_fix(
            BASE, at, np.zeros(15), earth.llh_displaced(state.llh[k], state.mat_nb[k] @ ARM), lever_arm=ARM
        )
        np.testing.assert_allclose(plain.z, 0.0, atol=1e-5)


def test_vehicle_constraints_hold_on_the_exact_motion():
    motion = TRAJECTORIES["city"](120.0)
    state = motion.evaluate(np.linspace(0.0, 120.0, 61))
    for k in range(61):
        at = Linearization(state.llh[k], state.vel_n[k], state.mat_nb[k], state.omega_ib_b[k], state.f_b[k])
        z = non_holonomic(BASE, at, np.zeros(15), mat_bv=np.eye(3), lever_arm=np.zeros(3)).z
        np.testing.assert_allclose(z, 0.0, atol=1e-12)
    at = Linearization(state.llh[0], state.vel_n[0], state.mat_nb[0], state.omega_ib_b[0], state.f_b[0])
    np.testing.assert_allclose(zero_velocity(BASE, at).z, 0.0, atol=1e-15)
    np.testing.assert_allclose(zero_rate(BASE, at).z, 0.0, atol=1e-18)


def test_turned_unit_sees_the_vehicle_through_its_mounting():
    """v_sensor = R v_vehicle with R = mat_bv: a unit turned by R feels no slip where R is known."""
    motion = TRAJECTORIES["figure_eight"](60.0)
    state = motion.evaluate([20.0])
    mat_nb = state.mat_nb[0] @ MOUNTING.T
    at = Linearization(
        state.llh[0], state.vel_n[0], mat_nb, MOUNTING @ state.omega_ib_b[0], MOUNTING @ state.f_b[0]
    )
    known = non_holonomic(BASE, at, np.zeros(15), mat_bv=MOUNTING, lever_arm=np.zeros(3))
    assumed = non_holonomic(BASE, at, np.zeros(15), mat_bv=np.eye(3), lever_arm=np.zeros(3))
    np.testing.assert_allclose(known.z, 0.0, atol=1e-12)
    assert np.abs(assumed.z).max() > 1.0


def test_antenna_on_a_circle_moves_on_its_own_circle():
    """An antenna a to the right of the turn's centre side rides on radius R − a at speed v (R − a)/R."""
    speed, radius, arm = 15.0, 100.0, 2.0
    motion = TRAJECTORIES["circle"](20.0)
    state = motion.evaluate(np.linspace(0.0, 20.0, 21))
    _, vel = antenna(state, [0.0, arm * np.cos(0.02), -arm * np.sin(0.02)])
    np.testing.assert_allclose(np.linalg.norm(vel, axis=1), speed * (radius - arm) / radius, rtol=1e-5)


def test_an_antenna_at_rest_on_the_turning_earth_stands_still():
    """Gyros at rest feel the rotation of the Earth, the antenna does not move whatever its lever arm."""
    motion = TRAJECTORIES["static"](10.0)
    _, velocity = perfect_fixes(motion, np.array([1.0, 5.0]), lever_arm=(300.0, -200.0, 100.0))
    np.testing.assert_allclose(velocity, 0.0, atol=1e-9)
