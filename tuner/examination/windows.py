"""Windows of a drive in which the inertial unit predicts position, velocity and attitude, without any filter.

In a window samples are integrated once in the axes of the unit at its start (R attitude, f specific force, ω rate)::

    U = ∫R f      W = ∫U      X = ∫W      U₁ = ∫τ R f      W₁ = ∫U₁      A = ∫R      B = ∫[R f]× A

Position and velocity at τ after the start are then linear in the start (p₀, v₀), a small rotation φ of the attitude C
at the start, biases of the accelerometer b_a and of the gyro b_g, and an acceleration error that is constant over each
`KNOT_LENGTH` seconds; positions are read with a slow error whose rate is constant likewise::

    v(τ) = v₀ + C U + γ τ − ω_in × C U₁ − (2 ω_ie + ω_en) × (p(τ) − p₀) + C u − [C (U + u)]× φ + a(τ)
    u = B b_g − A b_a

Coordinates are curvilinear north, east, down from the first position of the window, so that velocities are their rates
(Groves, 2nd ed., section 5.4; increments as in section 5.5.4 without coning, which ten seconds do not show).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from models import earth, rotation
from models.arrays import FloatArray, IntArray

WINDOW_LENGTH = 10.0
"""Length, s: the accelerations of a vehicle show its heading in it, and biases stay constant."""
KNOT_LENGTH = 2.0
"""Time over which the acceleration error of a window is constant, s."""
MAX_RATE = 50.0
"""Samples a second that are integrated, Hz: faster ones are averaged before."""
LONGEST_STEP = 0.2
"""Time between samples from which a window has a gap, s, or three usual ones where these are longer."""
POSITION, VELOCITY, TURN, ACCEL_BIAS, GYRO_BIAS = (slice(i, i + 3) for i in range(0, 15, 3))
"""Columns of the unknowns of a window."""
BIASES = slice(ACCEL_BIAS.start, GYRO_BIAS.stop)
"""Columns of both biases."""
KNOTS = int(WINDOW_LENGTH / KNOT_LENGTH)
"""Spans of a window in which errors are constant."""
ERRORS = slice(15, 15 + 3 * KNOTS), slice(15 + 3 * KNOTS, 15 + 6 * KNOTS)
"""Columns behind them: acceleration errors, and rates of the slow error of positions."""
UNKNOWNS = 15 + 6 * KNOTS
"""How many unknowns a window has."""


@dataclass(frozen=True)
class Inertial:
    """Samples of an inertial unit.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Stamps, s; a sample is the mean since the one before.
    rates : ndarray, shape (n, 6)
        Angular rates, rad/s, and specific forces, m/s².
    many : int
        Samples of the unit whose mean one is.
    """

    t: FloatArray
    rates: FloatArray
    many: int = 1

    @property
    def interval(self) -> float:
        """Time from one sample of the unit to the next, s."""
        return float(np.median(np.diff(self.t))) / self.many

    @cached_property
    def windows(self) -> Windows:
        """All samples in windows."""
        return windows_of(self)


@dataclass(frozen=True)
class Windows:
    """Samples of a drive, integrated in windows.

    Attributes
    ----------
    begin : ndarray, shape (w,)
        Start of each, s.
    t : ndarray, shape (w, n)
        Times since the start, s; the first is 0.
    rate : ndarray, shape (w, n, 3)
        ω, rad/s.
    attitude : ndarray, shape (w, n, 3, 3)
        R.
    sums : ndarray, shape (w, n, 15 + 36)
        U, W, X, U₁, W₁ (3 each), A, ∫A, B, ∫B (9 each).
    """

    begin: FloatArray
    t: FloatArray
    rate: FloatArray
    attitude: FloatArray
    sums: FloatArray

    def some(self, which: IntArray | NDArray[np.bool_]) -> Windows:
        """Return some of the windows."""
        return Windows(
            self.begin[which], self.t[which], self.rate[which], self.attitude[which], self.sums[which]
        )

    def found(self, t: FloatArray) -> IntArray:
        """Return the window that holds each time, −1 where none does."""
        at = np.searchsorted(self.begin, t, side="right") - 1
        # NaN before the first
        begin, length = (np.append(x, np.nan)[at] for x in (self.begin, self.t[:, -1]))
        return np.where(t - begin < length, at, -1)


def averaged(imu: Inertial, rate: float = MAX_RATE) -> Inertial:
    """Return samples at most as fast as a rate, Hz: means of neighbours."""
    many = round(1.0 / (rate * float(np.median(np.diff(imu.t)))))
    if many < 2:
        return imu
    n = len(imu.t) // many
    rates = imu.rates[: n * many].reshape(n, many, 6).mean(axis=1)
    return Inertial(imu.t[many - 1 : n * many : many], rates, many * imu.many)


def longest_step(steps: FloatArray) -> float:
    """Return the time between samples from which there is a gap, s."""
    return max(LONGEST_STEP, 3.0 * float(np.median(steps)))


def windows_of(imu: Inertial, only: IntArray | slice = slice(None)) -> Windows:
    """Cut samples into windows without gaps, all or only some by their number, and integrate them."""
    usual = float(np.median(np.diff(imu.t)))
    n = round(WINDOW_LENGTH / usual)
    first = np.arange(0, len(imu.t) - n, n)
    rows = first[:, None] + np.arange(n + 1)
    t = imu.t[rows]
    whole = np.flatnonzero(np.diff(t, axis=1).max(axis=1, initial=0.0) < longest_step(np.diff(imu.t)))[only]
    t, rates = t[whole], imu.rates[rows[whole]]
    begin = t[:, 0]
    t = t - begin[:, None]
    step = np.diff(t, axis=1)[..., None]
    turn = rotation.mat_from_rotvec(rates[:, 1:, :3] * step)
    half = rotation.mat_from_rotvec(rates[:, 1:, :3] * (0.5 * step))
    still = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    attitude = np.stack(list(accumulate(turn.swapaxes(0, 1), np.matmul, initial=still)), axis=1)
    middle = attitude[:, :-1] @ half
    gained = np.einsum("wkij,wkj->wki", middle, rates[:, 1:, 3:]) * step
    integral = partial(cumulative_trapezoid, x=t[..., None], axis=1, initial=0)
    u = _summed(gained)
    w = integral(u)
    u1 = _summed(gained * (t[:, 1:, None] - 0.5 * step))
    by_bias = _summed(middle.reshape(*middle.shape[:2], 9) * step)
    arm = 0.5 * (by_bias[:, 1:] + by_bias[:, :-1]).reshape(middle.shape)
    by_turn = _summed((rotation.skew(gained) @ arm).reshape(*gained.shape[:2], 9))
    parts = (u, w, integral(w), u1, integral(u1), by_bias, integral(by_bias), by_turn, integral(by_turn))
    return Windows(begin, t, rates[..., :3], attitude, np.concatenate(parts, axis=-1))


def _summed(steps: FloatArray) -> FloatArray:
    """Return running sums along axis 1 that begin with 0."""
    return np.concatenate([np.zeros_like(steps[:, :1]), np.cumsum(steps, axis=1)], axis=1)


@dataclass(frozen=True)
class Motion:
    """What the inertial unit predicts at m times of windows, and its derivatives by the u unknowns of a window.

    Attributes
    ----------
    position, velocity : ndarray, shape (m, 3)
        North, east, down from the place of the window, m, m/s; the position as it is read, with its slow error.
    attitude : ndarray, shape (m, 3, 3)
        From the axes of the unit to north, east, down.
    rate, rate_change : ndarray, shape (m, 3)
        Angular rate in the axes of the unit, rad/s, and its derivative by time.
    acceleration : ndarray, shape (m, 3)
        Of the unit, m/s², by differences of the prediction.
    by_position, by_velocity : ndarray, shape (m, 3, u)
        Derivatives of position and velocity.
    """

    position: FloatArray
    velocity: FloatArray
    attitude: FloatArray
    rate: FloatArray
    rate_change: FloatArray
    acceleration: FloatArray
    by_position: FloatArray
    by_velocity: FloatArray


@dataclass(frozen=True)
class Sampled:
    """What the motion of m times needs of their windows, before any attitude is known.

    Attributes
    ----------
    window, tau : ndarray, shape (m,)
        Window of each time, and the time since its start, s.
    rate, rate_change, force : ndarray, shape (m, 3)
        ω, rad/s, its derivative by time, rad/s², and R f, m/s².
    attitude : ndarray, shape (m, 3, 3)
        R.
    vectors : ndarray, shape (m, 3, 5)
        U, W, X, U₁, W₁.
    matrices : ndarray, shape (m, 3, 12)
        A, ∫A, B, ∫B.
    by_velocity, by_position : ndarray, shape (m, 3, u)
        Derivatives that no attitude changes; zeros elsewhere.
    earth : tuple of ndarray, each of shape (m, 3)
        ω_in, 2 ω_ie + ω_en, gravity.
    """

    window: IntArray
    tau: FloatArray
    rate: FloatArray
    rate_change: FloatArray
    force: FloatArray
    attitude: FloatArray
    vectors: FloatArray
    matrices: FloatArray
    by_velocity: FloatArray
    by_position: FloatArray
    earth: tuple[FloatArray, FloatArray, FloatArray]


def sampled(
    windows: Windows, window: IntArray, tau: FloatArray, places: FloatArray, speeds: FloatArray
) -> Sampled:
    """Return the integrals at times of windows.

    Parameters
    ----------
    windows : Windows
        Integrated samples.
    window, tau : ndarray, shape (m,)
        Window of each time, and the time since its start, s.
    places, speeds : ndarray, shape (w, 3)
        Latitude, longitude, height and velocity of each window, as good as the Earth's rotation and the transport
        rate need them.
    """
    m, u = len(tau), UNKNOWNS
    last = windows.t.shape[1] - 1
    right = np.clip((tau / (WINDOW_LENGTH / last)).astype(int) + 1, 1, last)
    for _ in range(3):  # stamps are even but for their scatter
        right = np.where(windows.t[window, right] < tau, np.minimum(right + 1, last), right)
        right = np.where(windows.t[window, right - 1] > tau, np.maximum(right - 1, 1), right)
    left_t, right_t = windows.t[window, right - 1], windows.t[window, right]
    length = (right_t - left_t)[:, None]
    share = (tau - left_t)[:, None] / length
    left, later = windows.sums[window, right - 1], windows.sums[window, right]
    sums = left + share * (later - left)
    turns, carried, gravity = (x[window] for x in of_the_earth(places, speeds))
    by_velocity, by_position = np.zeros((2, m, 3, u))
    one, s = np.eye(3), tau[:, None, None]
    pull = rotation.skew(carried)
    by_velocity[..., VELOCITY], by_position[..., VELOCITY] = one - pull * s, one * s - pull * (0.5 * s**2)
    by_position[..., POSITION] = one
    for j in range(KNOTS):
        since = np.clip(s - j * KNOT_LENGTH, 0.0, None)
        lasted = np.minimum(since, KNOT_LENGTH)
        error, drift = (slice(x.start + 3 * j, x.start + 3 * j + 3) for x in ERRORS)
        by_velocity[..., error], by_position[..., error] = (
            one * lasted,
            one * (lasted * (since - 0.5 * lasted)),
        )
        by_position[..., drift] = one * lasted
    vectors = np.ascontiguousarray(sums[:, :15].reshape(m, 5, 3).swapaxes(1, 2))
    matrices = np.ascontiguousarray(sums[:, 15:].reshape(m, 4, 3, 3).swapaxes(1, 2).reshape(m, 3, 12))
    force = (later[:, :3] - left[:, :3]) / length
    attitude = windows.attitude[window, right - 1]
    before, at, behind = (windows.rate[window, np.clip(right + k, 1, last)] for k in (-1, 0, 1))
    change = 0.5 * (
        behind - before
    )  # a sample is the mean rate between two stamps, of which both ends are means
    return Sampled(
        window,
        tau,
        0.5 * (before + at) + share * change,
        change / length,
        force,
        attitude,
        vectors,
        matrices,
        by_velocity,
        by_position,
        (turns, carried, gravity),
    )


def motion_of(at: Sampled, attitude: FloatArray, x: FloatArray) -> Motion:
    """Return the predicted motion.

    Parameters
    ----------
    at : Sampled
        Where.
    attitude : ndarray, shape (w, 3, 3)
        C of each window.
    x : ndarray, shape (w, u)
        Unknowns of each window, the rotation φ zero.
    """
    c = attitude[at.window]
    v, p, long, v1, p1 = np.moveaxis(c @ at.vectors, -1, 0)
    a, a1, b, b1 = (m.squeeze(2) for m in np.split((c @ at.matrices).reshape(-1, 3, 4, 3), 4, axis=2))
    turns, carried, g = at.earth
    s = at.tau[:, None]
    travelled = p + 0.5 * g * s**2
    velocity = v + g * s - np.cross(turns, v1) - np.cross(carried, travelled)
    position = travelled - np.cross(turns, p1) - np.cross(carried, long + g * s**3 / 6.0)
    by_velocity, by_position = at.by_velocity.copy(), at.by_position.copy()
    by_velocity[..., ACCEL_BIAS], by_position[..., ACCEL_BIAS] = -a, -a1
    by_velocity[..., GYRO_BIAS], by_position[..., GYRO_BIAS] = b, b1
    biases = x[at.window, BIASES][..., None]
    by_velocity[..., TURN], by_position[..., TURN] = (  # what biases add turns with the attitude
        -rotation.skew(own + (by[..., BIASES] @ biases)[..., 0])
        for own, by in ((v, by_velocity), (p, by_position))
    )
    forced = (c @ at.force[..., None])[..., 0]
    each = x[at.window][..., None]
    position, velocity = position + (by_position @ each)[..., 0], velocity + (by_velocity @ each)[..., 0]
    return Motion(
        position, velocity, c @ at.attitude, at.rate, at.rate_change, forced + g, by_position, by_velocity
    )


def of_the_earth(places: FloatArray, speeds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ω_in, 2 ω_ie + ω_en and gravity in north, east, down; shape (w, 3) each."""
    sin_lat, cos_lat = np.sin(places[:, 0]), np.cos(places[:, 0])
    turns = np.stack(earth.earth_rate(sin_lat, cos_lat), axis=-1)
    carried = np.stack(earth.transport_rate(sin_lat, cos_lat, places[:, 2], tuple(speeds.T)), axis=-1)
    gravity = np.zeros_like(speeds)
    gravity[:, 2] = earth.gravity(sin_lat, places[:, 2])
    return turns + carried, 2.0 * turns + carried, gravity
