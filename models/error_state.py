"""Error dynamics of a strapdown system in the local north-east-down frame.

Every state is *truth minus estimate*, and a correction is added to the estimate::

    δr_N = (M+h) δL     δr_E = (N+h) cos L δλ     δr_D = −δh          metres
    C_true = exp([φ×]) C                                               attitude: the φ-angle in n

With the sensor model of `models.imu_errors`, A (ω, f) = measured − b − w, the errors obey::

    δr' = F_rr δr + δv
    δv' = F_vr δr + F_vv δv − f_n × φ + C δf + e_D δγ
    φ'  = F_φr δr + F_φv δv − ω_in × φ + C δω                 (δω, δf) = −A⁻¹ (S x + w)
    b'  = −b/T + driving noise

where S is the derivative of measured rates and forces by the states.

Discretisation (`transition`, `process_noise`). Sensor errors are constant during a step, as the mechanisation
holds its bias estimates and as a sampled sensor delivers its noise, and the rows are advanced in the order of
the mechanisation, each with the mean of its driver over the step::

    φ⁺ = φ  + dt (F_φr δr + F_φv δv − ω_in × φ + C δω)
    v⁺ = δv + dt (F_vr δr + F_vv δv − f_n × ½(φ + φ⁺) + C δf + e_D δγ)
    r⁺ = δr + dt (F_rr δr + ½(δv + v⁺))
    b⁺ = e^{−dt/T} b                      exact, with variance q² T/2 (1 − e^{−2dt/T}), or q² dt for T = ∞
    Qd = Γ diag(N²/dt) Γᵀ                 Γ: answer of the same step to a constant sensor error

C and f_n belong to the middle of the step. Against the continuous equations, after n steps: the chain bias →
attitude → velocity → position has the relative error 1/n²; terms with the Earth or transport rate 1/n of
their own, small, size; and since the drive of a bias acts from the next step on, its share of the variance is
smaller by 3/(2n) at most. A stationary Gauss–Markov bias integrates to a variance larger by (dt/T)²/12.

The covariance may therefore be advanced in longer steps than the mechanisation, about their `middle`: in
steps of 0.1 s every standard deviation of an aided filter stays within 2e-4 of that at the sensors' rate on
the city drive and the slalom of `models.trajectory.catalogue`.

References
----------
.. [1] E.-H. Shin, Estimation techniques for low-cost inertial navigation, UCGE Report
       20219 (2005), ch. 2 (φ-angle).
.. [2] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 14.
.. [3] J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017 (truth = estimate ⊕ error).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from models import rotation
from models.arrays import FloatArray
from models.earth import (
    EARTH_RATE,
    earth_rate,
    gravity_gradient,
    llh_displaced,
    ned_between,
    radii,
    radii_gradient,
    transport_rate,
)
from models.imu_errors import IDEAL_SENSORS, Calibration, sensor_jacobian
from models.state_layout import ErrorModel
from models.strapdown import NavigationState, mean_attitude
from models.taylor import sine_cosine
from models.vector3 import Mat, Vec, add


def coupling(pos: Vec, vel: Vec) -> tuple[Mat, Mat, Mat, Mat, Mat, Vec]:
    """Return F_rr, F_vr, F_vv, F_φr, F_φv and ω_in of the module equations.

    Exact derivatives of `models.strapdown.rates`, those of the radii of curvature included.

    Parameters
    ----------
    pos, vel : triples
        Latitude, longitude (rad), height (m); velocity north, east, down, m/s.
    """
    (sin_lat, cos_lat), height = sine_cosine(pos[0]), pos[2]
    tan_lat = sin_lat / cos_lat
    north, east, down = vel
    meridian, normal = radii(sin_lat)
    m, n = meridian + height, normal + height
    by_lat_m, by_lat_n = radii_gradient(sin_lat, cos_lat)
    dm, dn = by_lat_m / m, by_lat_n / m  # by a metre to the north
    e, p = east / n, north / m

    f_rr = (
        (-down / m, 0.0, p),
        (e * tan_lat, -(north * tan_lat + down) / n, e),
        (0.0, 0.0, 0.0),
    )
    # Derivatives of ω_ie and ω_en by δr_N and δr_D (δh = −δr_D), and of ω_en by δv_N and δv_E.
    ie_r = (-EARTH_RATE * sin_lat / m, 0.0, -EARTH_RATE * cos_lat / m)
    en_r = (-e * dn / n, p * dm / m, -e / (cos_lat * cos_lat * m) + e * dn / n * tan_lat)
    en_h = (e / n, -p / m, -e * tan_lat / n)
    en_vn, en_ve = -1.0 / m, 1.0 / n
    f_ar = (
        (-ie_r[0] - en_r[0], 0.0, -en_h[0]),
        (-ie_r[1] - en_r[1], 0.0, -en_h[1]),
        (-ie_r[2] - en_r[2], 0.0, -en_h[2]),
    )
    f_av = ((0.0, -en_ve, 0.0), (-en_vn, 0.0, 0.0), (0.0, en_ve * tan_lat, 0.0))

    # δ[−(2 ω_ie + ω_en) × v] = −(2 ω_ie + ω_en) × δv + v × (2 δω_ie + δω_en).
    of_earth = earth_rate(sin_lat, cos_lat)
    of_frame = add(of_earth, transport_rate(sin_lat, cos_lat, height, vel))
    c = add(of_earth, of_frame)
    ar = (2.0 * ie_r[0] + en_r[0], 2.0 * ie_r[1] + en_r[1], 2.0 * ie_r[2] + en_r[2])
    by_lat, by_height = gravity_gradient(sin_lat, cos_lat, height)
    f_vr = (
        (east * ar[2] - down * ar[1], 0.0, east * en_h[2] - down * en_h[1]),
        (down * ar[0] - north * ar[2], 0.0, down * en_h[0] - north * en_h[2]),
        (north * ar[1] - east * ar[0] + by_lat / m, 0.0, north * en_h[1] - east * en_h[0] - by_height),
    )
    f_vv = (
        (-down * en_vn, c[2] - east * en_ve * tan_lat, -c[1]),
        (-c[2], (down + north * tan_lat) * en_ve, c[0]),
        (c[1] + north * en_vn, -c[0] - east * en_ve, 0.0),
    )
    return f_rr, f_vr, f_vv, f_ar, f_av, of_frame


KERNELS = (coupling,)


@dataclass(frozen=True)
class Linearization:
    """Where the error dynamics are taken.

    Attributes
    ----------
    llh, vel_n : ndarray, shape (3,)
        Position (rad, rad, m) and velocity, m/s.
    mat_nb : ndarray, shape (3, 3)
        Attitude; of the middle of the step where a step is discretised.
    omega_b, force_b : ndarray, shape (3,)
        Calibrated angular rate, rad/s, and specific force, m/s².
    calibration : Calibration
        Sensor errors as estimated.
    """

    llh: FloatArray
    vel_n: FloatArray
    mat_nb: FloatArray
    omega_b: FloatArray
    force_b: FloatArray
    calibration: Calibration = IDEAL_SENSORS

    def coupling(self) -> tuple[FloatArray, ...]:
        """Return the arrays F_rr, F_vr, F_vv, F_φr, F_φv and ω_in."""
        lat, lon, height = self.llh
        north, east, down = self.vel_n
        return tuple(
            np.array(block, dtype=float) for block in coupling((lat, lon, height), (north, east, down))
        )

    def sensor_response(self) -> tuple[FloatArray, FloatArray]:
        """Return C times the rows of −A⁻¹ for the angular rate and for the force, each (3, 6)."""
        inverse = -np.linalg.inv(self.calibration.matrix)
        return self.mat_nb @ inverse[:3], self.mat_nb @ inverse[3:]


def middle(
    start: NavigationState,
    end: NavigationState,
    omega_b: ArrayLike,
    force_n: ArrayLike,
    calibration: Calibration = IDEAL_SENSORS,
) -> Linearization:
    """Return the place of `transition` and `process_noise` for a step of one or more sensor samples.

    Parameters
    ----------
    start, end : NavigationState
        At both ends of the step, arrays of shapes (3,), (3,), (4,).
    omega_b, force_n : array_like, shape (3,)
        Means over the step of the calibrated angular rate in b, rad/s, and of the specific force in n, m/s².
    calibration : Calibration
        Sensor errors as estimated.
    """
    w, x, y, z = start.quat_nb
    w_end, x_end, y_end, z_end = end.quat_nb
    mat_nb: FloatArray = np.array(mean_attitude((w, x, y, z), (w_end, x_end, y_end, z_end)))
    llh, vel_n = 0.5 * (start.llh + end.llh), 0.5 * (start.vel_n + end.vel_n)
    return Linearization(llh, vel_n, mat_nb, np.asarray(omega_b), mat_nb.T @ np.asarray(force_n), calibration)


def down_acceleration(model: ErrorModel, parameters: ArrayLike) -> float:
    """Return the acceleration down in a vector of states (n,) that gravity and force do not account for, m/s²."""
    own = model.down_couplings
    return float(own.factor @ np.asarray(parameters, dtype=float)[own.state])


def dynamics(model: ErrorModel, at: Linearization) -> FloatArray:
    """Return the continuous F with x' = F x + noise; shape (n, n)."""
    f_rr, f_vr, f_vv, f_ar, f_av, omega_in = at.coupling()
    turn, push = at.sensor_response()
    s = sensor_jacobian(model, at.omega_b, at.force_b)
    layout = model.layout
    r, v, a = layout["position"], layout["velocity"], layout["attitude"]
    f = np.diag(-1.0 / model.time_constant)
    f[v], f[a] = push @ s, turn @ s
    f[r, r], f[r, v] = f_rr, np.eye(3)
    f[v, r], f[v, v], f[v, a] = f_vr, f_vv, -rotation.skew(at.mat_nb @ at.force_b)
    f[a, r], f[a, v], f[a, a] = f_ar, f_av, -rotation.skew(omega_in)
    down, sloping = model.down_couplings, np.flatnonzero(model.slopes >= 0)
    np.add.at(f[v.stop - 1], down.state, down.factor)
    f[sloping, model.slopes[sloping]] = 1.0
    return f


def transition(model: ErrorModel, at: Linearization, dt: float) -> FloatArray:
    """Return Φ of one step of length dt, s; shape (n, n). See the module for the scheme and its error."""
    f_rr, f_vr, f_vv, f_ar, f_av, omega_in = at.coupling()
    turn, push = at.sensor_response()
    s = sensor_jacobian(model, at.omega_b, at.force_b)
    layout = model.layout
    r, v, a = layout["position"], layout["velocity"], layout["attitude"]
    eye = np.eye(layout.size)
    phi = np.diag(np.exp(-dt / model.time_constant))
    phi[a] = eye[a] + dt * (f_ar @ eye[r] + f_av @ eye[v] - rotation.skew(omega_in) @ eye[a] + turn @ s)
    tilt = 0.5 * (eye[a] + phi[a])
    force = rotation.skew(at.mat_nb @ at.force_b)
    phi[v] = eye[v] + dt * (f_vr @ eye[r] + f_vv @ eye[v] - force @ tilt + push @ s)
    down, sloping = model.down_couplings, np.flatnonzero(model.slopes >= 0)
    np.add.at(phi[v.stop - 1], down.state, dt * down.factor)
    phi[r] = eye[r] + dt * (f_rr @ eye[r] + 0.5 * (eye[v] + phi[v]))
    phi[sloping, model.slopes[sloping]] = dt
    return phi


def process_noise(model: ErrorModel, at: Linearization, dt: float) -> FloatArray:
    """Return Qd of one step of length dt, s, consistent with `transition`; shape (n, n)."""
    turn, push = at.sensor_response()
    layout = model.layout
    gamma = np.zeros((layout.size, 6))
    r, v, a = layout["position"], layout["velocity"], layout["attitude"]
    gamma[a] = dt * turn
    gamma[v] = dt * (push - 0.5 * rotation.skew(at.mat_nb @ at.force_b) @ gamma[a])
    gamma[r] = 0.5 * dt * gamma[v]
    white = np.concatenate([model.gyro_density, model.accel_density]) ** 2 / dt
    return np.asarray((gamma * white) @ gamma.T + np.diag(process_noise_variance(model, dt)))


def process_noise_variance(model: ErrorModel, dt: float) -> FloatArray:
    """Return the variance that drives each state in a step, q² T/2 (1 − e^{−2dt/T}) → q² dt; shape (n,)."""
    u = 2.0 * dt / model.time_constant
    decay = np.where(u > 0.0, -np.expm1(-u) / np.where(u > 0.0, u, 1.0), 1.0)
    return np.asarray(model.driving_density**2 * dt * decay)


def navigation_error(truth: NavigationState, estimate: NavigationState) -> FloatArray:
    """Return truth minus estimate as position, velocity and attitude states; shape (..., 9)."""
    turn = rotation.quat_multiply(truth.quat_nb, rotation.quat_conjugate(estimate.quat_nb))
    position = ned_between(truth.llh, estimate.llh)
    return np.concatenate([position, truth.vel_n - estimate.vel_n, rotation.rotvec_from_quat(turn)], axis=-1)


def corrected(estimate: NavigationState, error: ArrayLike) -> NavigationState:
    """Return the estimate with its error (..., 9) added: the inverse of `navigation_error`."""
    x = np.asarray(error, dtype=float)
    return NavigationState(
        llh_displaced(estimate.llh, x[..., :3]),
        estimate.vel_n + x[..., 3:6],
        rotation.quat_multiply(rotation.quat_from_rotvec(x[..., 6:9]), estimate.quat_nb),
    )
