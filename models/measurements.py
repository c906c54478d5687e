"""Measurements of a navigation filter: satellite fixes and the constraints of a vehicle.

Each function returns z and H of ::

    z = measured − predicted = H x + noise          x truth minus estimate, as in `models.error_state`

With the antenna at l in b, u = C l, ω_eb = C ω_ib − ω_ie in n, a = v' and the receiver's delay d::

    v_antenna = v + ω_eb × u
    position = llh ⊕ (u − v_antenna d + ½ a d²) + its error        velocity = v_antenna − a d + its error
    non-holonomic: lateral and vertical parts of Rᵀ (Cᵀ v + Cᵀ ω_eb × l) vanish        R = exp([m ×]) R₀
    zero velocity: v = 0                           zero rate: ω_ib = Cᵀ ω_ie

The errors of a fix are the states that add to it (`models.filter_states`), such as a correlated error of the receiver.
The angular acceleration of the lever arm is left out of a, and the change of ω_ie over a position error
(1e-11 l) out of H. R₀ is the mounting (`mat_bv` rotates vehicle axes into b), m its error state.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 14 (lever arm), 15 (constraints).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from models import rotation
from models.arrays import FloatArray
from models.earth import earth_rate, llh_displaced, ned_between
from models.error_state import Linearization, down_acceleration, dynamics
from models.imu_errors import sensor_jacobian
from models.state_layout import ErrorModel
from models.strapdown import rates
from models.trajectory.motion import Motion, MotionState


@dataclass(frozen=True)
class Measurement:
    """A linearised measurement: z, shape (m,), and H, shape (m, n)."""

    z: FloatArray
    H: FloatArray


def antenna(state: MotionState, lever_arm: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return position (n, 3) and velocity (n, 3) of the antenna at `lever_arm` (3,), m in b."""
    arm = np.asarray(lever_arm, dtype=float)
    u = state.mat_nb @ arm
    lat = state.llh[:, 0]
    of_earth = np.stack(earth_rate(np.sin(lat), np.cos(lat)), axis=-1)
    omega_eb_n = (state.mat_nb @ state.omega_ib_b[..., None])[..., 0] - of_earth
    return llh_displaced(state.llh, u), state.vel_n + np.cross(omega_eb_n, u)


def perfect_fixes(
    motion: Motion, t: ArrayLike, *, lever_arm: ArrayLike = (0.0, 0.0, 0.0), delay: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity, (n, 3) each, that an error-free receiver reports with the stamps t, s.

    They are those of t − delay. Before the start of the motion the values of its start are reported.
    """
    times = np.clip(np.asarray(t, dtype=float) - delay, 0.0, motion.duration)
    return antenna(motion.evaluate(times), lever_arm)


def position_fix(
    model: ErrorModel, at: Linearization, parameters: ArrayLike, llh: ArrayLike, *, lever_arm: ArrayLike
) -> Measurement:
    """Measure the position of the antenna, metres north, east, down.

    Parameters
    ----------
    model : ErrorModel
        The states.
    at : Linearization
        The estimate at the time of the fix.
    parameters : array_like, shape (n,)
        Estimates of all states (position, velocity and attitude are not used).
    llh : array_like, shape (3,)
        The fix, rad, rad, m.
    lever_arm : array_like, shape (3,)
        Nominal lever arm in b, m; a `lever_arm` state is added to it.
    """
    x, layout = np.asarray(parameters, dtype=float), model.layout
    arm = _lever_arm(model, x, lever_arm)
    u = at.mat_nb @ arm
    vel, h_vel = _antenna_velocity(model, at, arm)
    h = np.zeros((3, layout.size))
    h[:, layout["position"]] = np.eye(3)
    h[:, layout["attitude"]] = -rotation.skew(u)
    if "lever_arm" in layout:
        h[:, layout["lever_arm"]] = at.mat_nb
    shift = np.zeros(3)
    if "time_offset" in layout:
        delay, acc = x[layout["time_offset"]][0], _acceleration(model, at, x)
        shift = -delay * vel + 0.5 * delay**2 * acc
        h += -delay * h_vel + 0.5 * delay**2 * dynamics(model, at)[layout["velocity"]]
        h[:, layout["time_offset"]] = (delay * acc - vel)[:, None]
    of_receiver, h_receiver = _receiver_errors(model, x)
    return Measurement(ned_between(llh, at.llh) - u - (shift + of_receiver[:3]), h + h_receiver[:3])


def velocity_fix(
    model: ErrorModel, at: Linearization, parameters: ArrayLike, vel_n: ArrayLike, *, lever_arm: ArrayLike
) -> Measurement:
    """Measure the velocity of the antenna, m/s; arguments as in `position_fix`, the fix is `vel_n` (3,)."""
    x, layout = np.asarray(parameters, dtype=float), model.layout
    vel, h = _antenna_velocity(model, at, _lever_arm(model, x, lever_arm))
    if "time_offset" in layout:
        delay, acc = x[layout["time_offset"]][0], _acceleration(model, at, x)
        vel = vel - delay * acc
        h -= delay * dynamics(model, at)[layout["velocity"]]
        h[:, layout["time_offset"]] = -acc[:, None]
    of_receiver, h_receiver = _receiver_errors(model, x)
    return Measurement(np.asarray(vel_n, dtype=float) - (vel + of_receiver[3:]), h + h_receiver[3:])


def non_holonomic(
    model: ErrorModel, at: Linearization, parameters: ArrayLike, *, mat_bv: ArrayLike, lever_arm: ArrayLike
) -> Measurement:
    """Non-holonomic constraint: a wheeled vehicle does not slip, lateral and vertical velocity, m/s, are zero.

    Parameters
    ----------
    model, at, parameters
        As in `position_fix`.
    mat_bv : array_like, shape (3, 3)
        Nominal mounting; a `mounting` state turns it.
    lever_arm : array_like, shape (3,)
        From the inertial unit to the point that does not slip (the middle of the rear axle), in b, m.
    """
    x, layout = np.asarray(parameters, dtype=float), model.layout
    arm = np.asarray(lever_arm, dtype=float)
    to_body = at.mat_nb.T
    of_earth = _earth_rate(at)
    vel = to_body @ at.vel_n + np.cross(at.omega_b - to_body @ of_earth, arm)
    h = np.zeros((3, layout.size))
    turn = np.linalg.inv(at.calibration.matrix)[:3]
    h += rotation.skew(arm) @ turn @ sensor_jacobian(model, at.omega_b, at.force_b)
    h[:, layout["velocity"]] = to_body
    h[:, layout["attitude"]] = to_body @ rotation.skew(at.vel_n)
    h[:, layout["attitude"]] += rotation.skew(arm) @ to_body @ rotation.skew(of_earth)
    mounting = np.asarray(mat_bv, dtype=float)
    if "mounting" in layout:
        m = x[layout["mounting"]]
        mounting = rotation.mat_from_rotvec(m) @ mounting
        h[:, layout["mounting"]] = rotation.skew(vel) @ rotation.left_jacobian(m)
    return Measurement(-(mounting.T @ vel)[1:], (mounting.T @ h)[1:])


def zero_velocity(model: ErrorModel, at: Linearization) -> Measurement:
    """Zero-velocity update: the vehicle is stationary, m/s."""
    h = np.zeros((3, model.layout.size))
    h[:, model.layout["velocity"]] = np.eye(3)
    return Measurement(-at.vel_n, h)


def zero_rate(model: ErrorModel, at: Linearization) -> Measurement:
    """Zero-angular-rate update: the calibrated gyros measure the rotation of the Earth alone, rad/s.

    `at.omega_b` should be averaged over the still time; the noise is that of the average.
    """
    of_earth, to_body = _earth_rate(at), at.mat_nb.T
    turn = np.linalg.inv(at.calibration.matrix)[:3]
    h = turn @ sensor_jacobian(model, at.omega_b, at.force_b)
    h[:, model.layout["attitude"]] = to_body @ rotation.skew(of_earth)
    return Measurement(at.omega_b - to_body @ of_earth, h)


def _lever_arm(model: ErrorModel, x: FloatArray, nominal: ArrayLike) -> FloatArray:
    arm = np.asarray(nominal, dtype=float)
    return arm + x[model.layout["lever_arm"]] if "lever_arm" in model.layout else arm


def _earth_rate(at: Linearization) -> FloatArray:
    return np.array(earth_rate(np.sin(at.llh[0]), np.cos(at.llh[0])))


def _acceleration(model: ErrorModel, at: Linearization, x: FloatArray) -> FloatArray:
    """Return the derivative of the velocity, m/s²."""
    acc = np.array(
        rates(tuple(at.llh), tuple(at.vel_n), tuple(at.mat_nb), tuple(at.omega_b), tuple(at.force_b))[1]
    )
    acc[2] += down_acceleration(model, x)
    return acc


def _receiver_errors(model: ErrorModel, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the errors of a fix in the states, m and m/s, (6,), and their derivative by the states, (6, n)."""
    state, row, _, factor = model.fix_couplings
    errors, h = np.zeros(6), np.zeros((6, model.layout.size))
    np.add.at(errors, row, factor * x[state])
    np.add.at(h, (row, state), factor)
    return errors, h


def _antenna_velocity(model: ErrorModel, at: Linearization, arm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the velocity of the antenna, (3,), and its derivative by the states, (3, n)."""
    layout, of_earth = model.layout, _earth_rate(at)
    u, omega = at.mat_nb @ arm, at.mat_nb @ at.omega_b
    turn, _ = at.sensor_response()
    h = -rotation.skew(u) @ turn @ sensor_jacobian(model, at.omega_b, at.force_b)
    h[:, layout["velocity"]] = np.eye(3)
    h[:, layout["attitude"]] = rotation.skew(of_earth) @ rotation.skew(u) - rotation.skew(np.cross(omega, u))
    if "lever_arm" in layout:
        h[:, layout["lever_arm"]] = rotation.skew(omega - of_earth) @ at.mat_nb
    return at.vel_n + np.cross(omega - of_earth, u), h
