"""Linearisation of a filter run over a drive: Φ, Q and B between fixes, H and D at the fixes.

The filter runs as it is; `error_propagation` follows it a second time and leaves Φ, Q and B, the fixes give H and D::

    position = llh ⊕ C l             velocity = v + ω_eb × C l          H: their derivatives by the states
    D: time_offset  −v, −a (clock_drift: times t − t₀)
       velocity_lag  0, −a                lever_arm  C, [ω_eb ×] C
       gnss_frame   0, [· ×] v       velocity_scale  0, v
       vertical_velocity  0, e_D     all others act on the sensors: B

with a the mean acceleration around the fix. Candidate constants are in the axes of the filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import earth_rate, gravity, transport_rate
from models.error_state import navigation_error
from models.strapdown import NavigationState
from tuner.diagnosis.drive.causes.base import (
    FixGeometry,
    constant_causes,
    constant_parameters,
    sensor_errors,
)
from tuner.diagnosis.drive.linear_model.error_propagation import PropagatedErrors, propagate
from tuner.diagnosis.drive.linear_model.propagation_kernels import Columns
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.navigation.data import ABSENT, USED, Solution
from tuner.navigation.drive.run import Stretch
from tuner.navigation.engine.compilation import compiling
from tuner.navigation.engine.layout import layout_of
from tuner.navigation.engine.state import ESTIMATE, new_state
from tuner.navigation.settings import FilterSettings
from tuner.types import Parameter


def columns(parameters: tuple[Parameter, ...]) -> Columns:
    """Return how candidate constants act on the sensors and on the error model."""
    causes = constant_causes()
    return Columns(
        sensor_errors(parameters), np.array([causes[p.cause].down_acceleration for p in parameters])
    )


def linearize(
    settings: FilterSettings,
    stretches: Sequence[Stretch],
    solutions: Sequence[Solution],
    covariance: FloatArray,
    starts: Sequence[FloatArray],
    reported: Sequence[FloatArray],
    middle: float = 0.0,
) -> LinearizedRun:
    """Return the linear model of a filter run.

    Parameters
    ----------
    settings : FilterSettings
        The filter; none of the candidates may be a state of it.
    stretches, solutions : sequences
        What was filtered, and the outcome.
    covariance : ndarray, shape (n, n)
        P at the start of the first stretch.
    starts : sequence of ndarray, shape (n,)
        Estimates of the other states at the start of every stretch.
    reported : sequence of ndarray, shape (k, 6)
        Sds that the receiver reports, those of the configuration where it does not.
    middle : float
        Time halfway between the first and the last fix of the drive, s.
    """
    parts = [
        _part(settings, *each, first=i == 0, middle=middle)
        for i, each in enumerate(zip(stretches, solutions, starts, reported, strict=True))
    ]

    def joined(name: str) -> FloatArray:
        return _joined([np.asarray(getattr(part, name)) for part in parts])

    groups = parts[0].noise
    return LinearizedRun(
        joined("t"),
        joined("transition"),
        {g: _joined([part.noise[g] for part in parts]) for g in groups},
        joined("H"),
        joined("innovation"),
        joined("sd"),
        joined("reported_sd"),
        joined("available").astype(bool),
        joined("used").astype(bool),
        joined("correction"),
        covariance,
        parts[0].parameters,
        joined("B"),
        joined("D"),
        joined("starts").astype(bool),
        joined("scored").astype(bool),
        joined("solution"),
    )


def _joined(parts: list[FloatArray]) -> FloatArray:
    """Return the parts of a run joined, without a copy where there is one."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _part(
    settings: FilterSettings,
    stretch: Stretch,
    solution: Solution,
    x_start: FloatArray,
    reported: FloatArray,
    *,
    first: bool,
    middle: float,
) -> LinearizedRun:
    """Return the linear model of one stretch."""
    parameters = constant_parameters()
    k, n, p = len(solution.t), settings.size, len(parameters)
    own = columns(parameters)
    out = PropagatedErrors(
        np.empty((k, n, n)),
        np.empty((2, k, 9, 9)),
        np.empty((3, k, n, n)),
        np.empty((k, 9, p)),
        np.empty((k, 10)),
        np.empty((k, n)),
        np.empty((k, 6)),
        np.empty((k, 2, 3)),
    )
    states = np.hstack([solution.state.llh, solution.state.vel_n, solution.state.quat_nb])
    start = np.concatenate([stretch.start.llh, stretch.start.vel_n, stretch.start.quat_nb])
    lay = layout_of(settings)
    m = new_state(lay, 1)
    m.rows[:10, 0], m.states[ESTIMATE, :n, 0] = start, x_start
    with compiling(propagate):
        propagate(
            lay,
            own,
            m.memory,
            m.covariance,
            m.inputs,
            np.ascontiguousarray(stretch.steps.dt, dtype=float),
            np.ascontiguousarray(stretch.steps.increments, dtype=float),
            stretch.fixes.after,
            states,
            np.ascontiguousarray(solution.parameters),
            out,
        )
    white = np.zeros((2, k, n, n))
    white[:, :, :9, :9] = out.white
    noise = {
        "gyro_white": white[0],
        "accel_white": white[1],
        "gyro_bias": out.slow[0],
        "accel_bias": out.slow[1],
    }
    if any(name in settings.model.layout for name in ("gnss_position", "correlated_velocity")):
        noise["gnss_position"] = out.slow[2]
    b = np.zeros((k, n, p))
    b[:, :9] = out.constants
    if first:
        b[0] += out.phi[0] @ _start(settings, stretch, own)
    before = NavigationState(out.prior[:, :3], out.prior[:, 3:6], out.prior[:, 6:])
    correction = solution.parameters - out.x
    correction[:, :9] = navigation_error(solution.state, before)
    h, d = _jacobians(settings, out, solution.t - middle)
    there = np.isfinite(solution.innovation)
    use = np.where(there, np.repeat(solution.use, 3, axis=1), ABSENT)
    return LinearizedRun(
        solution.t,
        out.phi,
        noise,
        h,
        np.nan_to_num(solution.innovation),
        stretch.fixes.sd,
        reported,
        use != ABSENT,
        use == USED,
        correction,
        np.zeros((0, 0)),
        parameters,
        b,
        d,
        np.arange(k) == 0,
        solution.t >= stretch.settled,
        stretch.solution,
    )


def _start(settings: FilterSettings, stretch: Stretch, own: Columns) -> FloatArray:
    """Return what constants do to the errors at the start, (n, p): standing still takes them for biases and tilt.

    With the mean force f there, u = f/|f|, and the error M (0, f) of the sensors by a constant: the gyro bias is
    read from their mean, that of the accelerometers along u from |f| − γ, the tilt from the direction of f.
    """
    at, v = settings.model.layout, np.zeros((settings.size, len(own.down)))
    if stretch.alignment.still <= 0.0:
        return v
    mat = rotation.mat_from_quat(stretch.start.quat_nb)
    size = float(gravity(np.sin(stretch.start.llh[0]), stretch.start.llh[2]))
    u = -mat[2]
    sensor_error = own.mix @ np.concatenate([np.zeros(3), size * u])
    v[at["gyro_bias"]] = -sensor_error[:, :3].T
    along = sensor_error[:, 3:] @ u + own.down
    v[at["accel_bias"]] = -np.outer(u, along)
    across = (sensor_error[:, 3:] - np.outer(sensor_error[:, 3:] @ u, u)) @ mat.T / size
    v[6], v[7] = across[:, 1], -across[:, 0]
    return v


def _jacobians(
    settings: FilterSettings, out: PropagatedErrors, since: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return H (k, 6, n) and D (k, 6, p); `since` (k,) are the seconds since the middle of the drive."""
    at, k, n = settings.model.layout, len(out.x), settings.size
    llh, vel = out.prior[:, :3], out.prior[:, 3:6]
    mat = rotation.mat_from_quat(out.prior[:, 6:])
    arm = np.array(settings.lever_arm) + (
        out.x[:, at["lever_arm"]] if "lever_arm" in at else np.zeros((k, 3))
    )
    u = (mat @ arm[..., None])[..., 0]
    sin_lat, cos_lat = np.sin(llh[:, 0]), np.cos(llh[:, 0])
    of_earth = np.stack(earth_rate(sin_lat, cos_lat), axis=-1)
    omega = (mat @ out.rates[:, :3, None])[..., 0]
    relative = omega - of_earth
    h = np.zeros((k, 6, n))
    h[:, :3, :3] = h[:, 3:, 3:6] = np.eye(3)
    h[:, :3, 6:9] = -rotation.skew(u)
    h[:, 3:, 6:9] = rotation.skew(of_earth) @ rotation.skew(u) - rotation.skew(np.cross(omega, u))
    h[:, 3:, at["gyro_bias"]] = rotation.skew(u) @ mat
    if "gyro_markov" in at:
        h[:, 3:, at["gyro_markov"]] = (rotation.skew(u) @ mat)[:, :, list(settings.model.gyro_markov_axes)]
    if "lever_arm" in at:
        h[:, :3, at["lever_arm"]], h[:, 3:, at["lever_arm"]] = mat, rotation.skew(relative) @ mat
    if "gnss_position" in at:
        errors = at["gnss_position"]
        h[:, :3, errors] = np.tile(np.eye(3), (errors.stop - errors.start) // 3)
    if "correlated_velocity" in at:
        h[:, 3:, at["correlated_velocity"]] = np.eye(3)
    antenna = vel + np.cross(relative, u)
    frame = np.stack(transport_rate(sin_lat, cos_lat, llh[:, 2], tuple(vel.T)), axis=-1)
    acc = out.force.mean(axis=1) - np.cross(2.0 * of_earth + frame, vel)
    acc[:, 2] += gravity(sin_lat, llh[:, 2])
    geometry = FixGeometry(mat, antenna, acc, relative, since)
    parts = []
    for cause in constant_causes().values():
        part = cause.fix_sensitivity(geometry)
        parts.append(np.zeros((k, 6, len(cause.units))) if part is None else part)
    d = np.concatenate(parts, axis=2)
    return h, d
