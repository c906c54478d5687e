"""Strapdown mechanisation in the local north-east-down frame.

The equations, with C = mat_nb, ω the Earth, transport and body rates and f the specific force::

    L' = v_N/(M+h)     λ' = v_E/((N+h) cos L)     h' = −v_D
    v' = C f + γ e_D − (2 ω_ie + ω_en) × v
    C' = C [ω_ib ×] − [(ω_ie + ω_en) ×] C

One step of length dt takes the increments of an inertial unit, Δθ = ∫ω_ib dt and Δv = ∫f dt in b:

1. `correct_increments` removes what is lost because b turns inside the interval::

       φ  = Δθ + (Δθ₋ × Δθ)/12                                                    coning
       Δu = Δv + ½ Δθ × Δv + Δθ × (Δθ × Δv)/6 + (Δθ₋ × Δv + Δv₋ × Δθ)/12          rotation, sculling

   with the increments Δθ₋, Δv₋ of the step before: exact to third order for rate and force linear in time.
2. `step` evaluates gravity and the frame rates at the middle of the step, ζ = (ω_ie + ω_en) dt, and sets::

       v⁺ = v + (I − ½ ζ×) C Δu + [γ e_D − (2 ω_ie + ω_en) × v] dt       p⁺ = p + ½ (v + v⁺) dt
       q⁺ = exp(−ζ) q exp(φ)

The global error is O(dt²) in smooth motion: below 0.2 mm in 10 min at 100 Hz for every built-in trajectory.
Attitude is a quaternion of b in n; increments, forces and rates are `triples`.

References
----------
.. [1] P. G. Savage, Strapdown inertial navigation integration algorithm design, parts 1 and 2,
       J. Guidance, Control, and Dynamics 21 (1998).
.. [2] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.earth import SEMI_MAJOR_AXIS, earth_rate, gravity, radii, transport_rate
from models.taylor import exponential, sine_cosine
from models.vector3 import (
    Mat,
    Quat,
    Scalar,
    Vec,
    add,
    cross,
    matrix,
    product,
    scale,
    transform,
    turned,
)


def correct_increments(dtheta: Vec, dvel: Vec, dtheta_before: Vec, dvel_before: Vec) -> tuple[Vec, Vec]:
    """Return the rotation vector and the velocity increment in the body frame at the start of the step.

    Parameters
    ----------
    dtheta, dvel : triples
        Increments of this step, rad and m/s.
    dtheta_before, dvel_before : triples
        Increments of the step before; for the first step the same as `dtheta` and `dvel`, which makes the
        coning and sculling terms zero.
    """
    coning = cross(dtheta_before, dtheta)
    turned = cross(dtheta, dvel)
    turned_twice = cross(dtheta, turned)
    sculling = add(cross(dtheta_before, dvel), cross(dvel_before, dtheta))
    rotvec = add(dtheta, scale(1.0 / 12.0, coning))
    force = add(
        add(dvel, scale(0.5, turned)), add(scale(1.0 / 6.0, turned_twice), scale(1.0 / 12.0, sculling))
    )
    return rotvec, force


def step(pos: Vec, vel: Vec, quat: Quat, rotvec: Vec, dvel: Vec, dt: Scalar) -> tuple[Vec, Vec, Quat, Vec]:
    """Advance position, velocity and attitude by one step.

    Parameters
    ----------
    pos : triple
        Latitude and longitude, rad, and height, m.
    vel : triple
        Velocity north, east, down, m/s.
    quat : tuple of 4
        Attitude of b in n.
    rotvec, dvel : triples
        From `correct_increments`, rad and m/s.
    dt : float
        Length of the step, s.

    Returns
    -------
    pos, vel, quat
        At the end of the step.
    force_n : triple
        Mean specific force of the step in n, m/s²: what the error dynamics need.
    """
    push = turned(quat, dvel)

    # Middle of the step. For the latitude the semi-major axis is near enough to the radius of curvature.
    lat = pos[0] + 0.5 * dt * vel[0] / SEMI_MAJOR_AXIS
    height = pos[2] - 0.5 * dt * vel[2]
    sin_lat, cos_lat = sine_cosine(lat)
    meridian, normal = radii(sin_lat)
    down = gravity(sin_lat, height) * dt
    of_earth = earth_rate(sin_lat, cos_lat)
    middle = (vel[0] + 0.5 * push[0], vel[1] + 0.5 * push[1], vel[2] + 0.5 * (push[2] + down))
    doubled = add(scale(2.0, of_earth), transport_rate(sin_lat, cos_lat, height, middle))
    middle = add(middle, scale(-0.5 * dt, cross(doubled, middle)))
    of_frame = add(of_earth, transport_rate(sin_lat, cos_lat, height, middle))

    force = add(push, scale(-0.5 * dt, cross(of_frame, push)))
    change = add(force, scale(-dt, cross(add(of_earth, of_frame), middle)))
    vel_new = (vel[0] + change[0], vel[1] + change[1], vel[2] + change[2] + down)

    pos_new = (
        pos[0] + 0.5 * dt * (vel[0] + vel_new[0]) / (meridian + height),
        pos[1] + 0.5 * dt * (vel[1] + vel_new[1]) / ((normal + height) * cos_lat),
        pos[2] - 0.5 * dt * (vel[2] + vel_new[2]),
    )
    frame = exponential(scale(-dt, of_frame))
    q = product(frame, product(quat, exponential(rotvec)))
    # One Newton step towards unit length: exact to rounding, since q is off by rounding alone.
    c = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return pos_new, vel_new, (c * q[0], c * q[1], c * q[2], c * q[3]), scale(1.0 / dt, force)


def mean_attitude(before: Quat, after: Quat) -> Mat:
    """Return mat_nb half way between two attitudes less than half a turn apart, of either sign."""
    s = before[0] * after[0] + before[1] * after[1] + before[2] * after[2] + before[3] * after[3]
    c = np.copysign(1.0, s)
    return matrix(
        (
            before[0] + c * after[0],
            before[1] + c * after[1],
            before[2] + c * after[2],
            before[3] + c * after[3],
        )
    )


def rates(pos: Vec, vel: Vec, mat_nb: Mat, omega_ib: Vec, force_b: Vec) -> tuple[Vec, Vec, Vec]:
    """Return the derivatives (L', λ', h'), v' and the rate ω_nb in n, of which C' = [ω_nb ×] C.

    The continuous equations that `step` integrates, and whose Jacobians `models.error_state` holds.
    """
    (sin_lat, cos_lat), height = sine_cosine(pos[0]), pos[2]
    meridian, normal = radii(sin_lat)
    of_earth = earth_rate(sin_lat, cos_lat)
    of_frame = add(of_earth, transport_rate(sin_lat, cos_lat, height, vel))
    force = transform(mat_nb, force_b)
    coriolis = cross(add(of_earth, of_frame), vel)
    pos_dot = (vel[0] / (meridian + height), vel[1] / ((normal + height) * cos_lat), -vel[2])
    vel_dot = (
        force[0] - coriolis[0],
        force[1] - coriolis[1],
        force[2] - coriolis[2] + gravity(sin_lat, height),
    )
    return pos_dot, vel_dot, add(transform(mat_nb, omega_ib), scale(-1.0, of_frame))


KERNELS = (correct_increments, step, mean_attitude, rates)


@dataclass(frozen=True)
class NavigationState:
    """Where a vehicle is, how fast and how oriented.

    Attributes
    ----------
    llh : ndarray, shape (..., 3)
        Latitude, longitude (rad) and height (m).
    vel_n : ndarray, shape (..., 3)
        Velocity north, east, down, m/s.
    quat_nb : ndarray, shape (..., 4)
        Attitude.
    """

    llh: FloatArray
    vel_n: FloatArray
    quat_nb: FloatArray
