"""Settings for a filter with fewer bias states than the model: white noise and a random walk.

The filter predicts with two numbers an axis; what it then errs follows from the whole model. Both are linear, so that
the covariance of the filter and that of its true errors are exact, without a simulation. One axis is a chain: the bias
is integrated to an angle (gyro) and, through gravity, or directly (accelerometer) to velocity and position, of which
the filter gets fixes as its usual aiding has them. Chosen are the two numbers whose predictions have the best expected
log score,

    J = Σ ln s + (e/s)²/2,    s predicted, e true sd,

over angle, velocity and position with fixes and position after 10 and 60 s without: a proper score (Gneiting and
Raftery 2007, section 4), among settings whose errors, geometric mean, are within `WORST_ERROR` of the smallest.
No number is zero, by which filters divide.

Sources: Anderson and Moore (1979), section 6.7, for the Riccati equation by
doubling; Gelb (1974), section 7.2, for true errors of a filter with fewer states.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import GaussMarkov
from models.statespace import StateSpace, discretize
from models.units import STANDARD_GRAVITY, unit_of_samples
from tuner.formats.grouping import gathered
from tuner.types import ChannelNoise
from tuner.types.records import DataError

HORIZONS = 10.0, 60.0
"""Times without fixes after which the position is scored, s: outages that filters are compared by."""
STILL_TIME, STILL_SHARE = 1000.0, 0.01
"""A bias that never moved gets a random walk that adds this share to the variance of the angle after the time, s."""
WORST_ERROR = 1.25
"""Error ÷ the smallest that two numbers reach up to which they are compared by their score."""
_SEARCH_PASSES, _SEARCH_POINTS = 6, 17
"""Grid search in ln N and ln K: each pass spans two steps of the one before to either side."""
_LEAST_SHARE = 1e-6
"""Share of what all states could be, in N², below which it is not looked for."""
_MAX_DOUBLINGS, _SETTLED_SHARE = 50, 1e-12
"""Doublings that reach every steady state, 2⁵⁰ fixes, and what is left of the start when they end."""


@dataclass(frozen=True)
class Aiding:
    """Fixes that a filter usually gets.

    Attributes
    ----------
    words : str
        What they are of, as exports name it.
    interval : float
        Time between fixes, s.
    position, velocity, angle : float
        Sds of a fix, m, m/s, rad; infinite for what is not observed.
    """

    words: str
    interval: float
    position: float
    velocity: float = math.inf
    angle: float = math.inf


GNSS = Aiding("GNSS positions at 1 Hz, 1.5 m", 1.0, 1.5)
RTK = Aiding("RTK positions at 1 Hz, 2 cm", 1.0, 0.02)
AUTOPILOT = Aiding("GNSS at 5 Hz, 0.5 m and 0.3 m/s", 0.2, 0.5, 0.3)
CAMERA = Aiding("a camera at 20 Hz, 5 mm and 2 mrad", 0.05, 0.005, angle=0.002)
LIDAR = Aiding("a lidar at 10 Hz, 5 cm and 5 mrad", 0.1, 0.05, angle=0.005)


@dataclass(frozen=True)
class Projected:
    """Two numbers in place of white noise, states and a random walk.

    Attributes
    ----------
    white_density : float
        N, unit/√Hz.
    bias : float
        K of a random walk, unit/√s; never 0.
    """

    white_density: float
    bias: float


@dataclass(frozen=True)
class BiasModel:
    """The noise of an axis as it is configured: integrals that are followed, N², K² and Gauss–Markov states.

    A gyro is followed to angle, velocity and position, an accelerometer to velocity and position.
    """

    integrals: int
    noise: tuple[float, float]
    states: tuple[GaussMarkov, ...]

    @classmethod
    def of(cls, channel: ChannelNoise) -> BiasModel:
        """Return the model of an axis."""
        squares = channel.white_density**2, channel.random_walk_density**2
        return cls(3 if channel.axis.startswith("gyro") else 2, squares, channel.markov)


def projected(channel: ChannelNoise, aiding: Aiding) -> Projected:
    """Return the two numbers with which a filter without other states predicts best.

    Parameters
    ----------
    channel : ChannelNoise
        Settings of the axis.
    aiding : Aiding
        Fixes that the filter gets.
    """
    least = channel.random_walk_density or still_walk(channel)
    if not channel.markov:
        return Projected(channel.white_density, least)
    try:
        white, walk = _searched(BiasModel.of(channel), aiding, least)
    except (ArithmeticError, np.linalg.LinAlgError):
        raise DataError(
            f"{channel.axis}: white noise of {channel.white_density:g} {unit_of_samples(channel.axis)}/√Hz: expected "
            f"one with which a filter of {aiding.words} has a finite covariance: enter the unit's own, or its sheet's"
        ) from None
    return Projected(white, walk)


def pooled(channels: tuple[ChannelNoise, ...]) -> ChannelNoise:
    """Return one channel with the mean noise power of several.

    Variances are linear in noise powers, so that its pair has the best total score of all channels with one pair.
    """

    def root(values: Iterable[float]) -> float:
        return math.sqrt(sum(value * value for value in values) / len(channels))

    states = gathered((state.time_constant, state.sd) for channel in channels for state in channel.markov)
    return ChannelNoise(
        channels[0].axis.partition("_")[0],
        channels[0].unit,
        root(channel.white_density for channel in channels),
        tuple(GaussMarkov(root(sds), time) for time, sds in states.items()),
        root(channel.random_walk_density for channel in channels),
        root(channel.constant_sd for channel in channels),
    )


def still_walk(channel: ChannelNoise) -> float:
    """Return the random walk of a bias that never moved, unit/√s."""
    return math.sqrt(3.0 * STILL_SHARE) * channel.white_density / STILL_TIME


def errors_by_prediction(channel: ChannelNoise, aiding: Aiding, pair: Projected) -> dict[str, float]:
    """Return true ÷ predicted sd of each quantity of a filter with two numbers, by its name."""
    model, squares = BiasModel.of(channel), np.array([[pair.white_density**2, pair.bias**2]])
    predicted, true = variances(model, aiding, squares)
    later = (f"position {time:g} s after the last fix" for time in HORIZONS)
    names = [*("position", "velocity", "angle")[: model.integrals], *later]
    return dict(zip(names, np.sqrt(true / predicted)[0].tolist(), strict=True))


@functools.lru_cache(maxsize=256)
def _searched(model: BiasModel, aiding: Aiding, least: float) -> tuple[float, float]:
    """Return N and the density of the drive of the bias with the best score; `ArithmeticError` where none is finite."""
    (white, walk), times = model.noise, [state.time_constant for state in model.states]
    sizes = 2.0 * np.array([state.sd for state in model.states]) ** 2
    # A state acts as white noise within the times that are scored, and as a walk before it fades.
    slow = float(sizes @ np.minimum(times, HORIZONS[-1]))
    walk += float(sizes @ np.reciprocal(times)) + least**2
    low = least_logs = 0.5 * np.log([max(white, _LEAST_SHARE * slow), least**2])
    high = most_logs = 0.5 * np.log([white + slow, walk])
    for _ in range(_SEARCH_PASSES):
        grid = np.meshgrid(*np.linspace(low, high, _SEARCH_POINTS, axis=-1), indexing="ij")
        tried = np.stack([one.ravel() for one in grid], axis=-1)
        # The variances of a pair that makes no filter are not finite.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            predicted, true = variances(model, aiding, np.exp(2.0 * tried))
            score = (np.log(predicted) + true / predicted).sum(axis=1)
            error = np.log(true).mean(axis=1)
        score, error = (np.where(np.isfinite(score), x, np.inf) for x in (score, error))
        allowed = error <= error.min() + 2.0 * math.log(WORST_ERROR)
        best = tried[int(np.argmin(np.where(allowed, score, np.inf)))]
        step = 2.0 * (high - low) / (_SEARCH_POINTS - 1)
        low, high = np.maximum(best - step, least_logs), np.minimum(best + step, most_logs)
    found = np.exp(best)
    with np.errstate(all="ignore"):
        if not np.isfinite(variances(model, aiding, found[None] ** 2)).all():
            raise ArithmeticError
    return float(found[0]), float(found[1])


def variances(model: BiasModel, aiding: Aiding, squares: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return predicted and true variances of all quantities in the steady state, shape (b, q).

    `squares` are N² and the squared density that drives the bias, shape (b, 2). The errors of the filter are position,
    velocity, angle and bias; its estimate of the bias stays between fixes, so that the bias error moves as the bias.
    """
    chain, n = model.integrals, model.integrals + 1
    times = tuple(state.time_constant for state in model.states)
    density = np.array([*model.noise, *(state.driving_density**2 for state in model.states)])
    whole, own = _steps(chain, times, aiding.interval), _steps(chain, (), aiding.interval)
    sds = np.array([aiding.position, aiding.velocity, aiding.angle])[:chain]
    seen = np.eye(n)[:chain][np.isfinite(sds)]
    r = np.diag(sds[np.isfinite(sds)] ** 2)
    prior = _steady(own[0], seen, np.tensordot(squares, own[1], 1), r)
    gain = np.zeros((len(squares), n + len(times), len(r)))
    gain[:, :n] = prior @ seen.T @ np.linalg.inv(seen @ prior @ seen.T + r)
    update = np.tile(np.eye(n + len(times)), (len(squares), 1, 1))
    update[:, :, :n] -= gain @ seen
    of_fixes, kept = gain @ r @ gain.swapaxes(1, 2), update[:, :n, :n]
    expected = kept @ prior @ kept.swapaxes(1, 2) + of_fixes[:, :n, :n]
    true = update @ np.tensordot(density, whole[1], 1) @ update.swapaxes(1, 2) + of_fixes
    move = update @ whole[0]
    for _ in range(_MAX_DOUBLINGS):
        true, move = true + move @ true @ move.swapaxes(1, 2), move @ move
        if np.abs(move).max() < _SETTLED_SHARE:
            break
    columns = np.arange(chain)
    sizes, errors = [expected[:, columns, columns]], [true[:, columns, columns]]
    for horizon in HORIZONS:
        (f, q), (g, d) = _steps(chain, (), horizon), _steps(chain, times, horizon)
        sizes.append((expected @ f[0] @ f[0] + squares @ q[:, 0, 0])[:, None])
        errors.append((true @ g[0] @ g[0] + density @ d[:, 0, 0])[:, None])
    return np.hstack(sizes), np.hstack(errors)


@functools.lru_cache(maxsize=256)
def _steps(chain: int, times: tuple[float, ...], length: float) -> tuple[FloatArray, FloatArray]:
    """Return the transition over a time, shape (s, s), and the noise of unit drives, shape (d, s, s).

    Drives are white noise, a random walk of the bias and one for each state, which enters the bias as well.
    """
    n, many = chain + 1, len(times)
    a = np.zeros((n + many, n + many))
    into = np.eye(n + many)[chain - 1 :]
    a[np.arange(chain), np.arange(1, n)] = 1.0
    if chain > 2:
        a[1, 2] = STANDARD_GRAVITY
    for i, time in enumerate(times):
        a[[chain, n + i], n + i] = -1.0 / time
        into[2 + i, chain] = 1.0
    none = np.zeros_like(a)
    systems = (StateSpace(a, drive[:, None], none, np.eye(1), none) for drive in into)
    moves, noise = zip(*(discretize(one, length) for one in systems), strict=True)
    return moves[0], np.stack(noise)


def _steady(f: FloatArray, h: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
    """Return the steady covariance before an update of filters that differ in q, shape (b, s, s), by doubling."""
    a, p = np.broadcast_to(f.T, q.shape), q.copy()
    g = np.broadcast_to(h.T @ np.linalg.inv(r) @ h, q.shape)
    for _ in range(_MAX_DOUBLINGS):
        between = np.linalg.inv(np.eye(len(f)) + g @ p)
        a_t, through = a.swapaxes(1, 2), a @ between
        p, g, a = p + a_t @ p @ between @ a, g + through @ g @ a_t, through @ a
        p = 0.5 * (p + p.swapaxes(1, 2))
        if np.abs(a).max() < _SETTLED_SHARE:
            break
    return np.asarray(p)
