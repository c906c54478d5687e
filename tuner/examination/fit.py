"""The model of a drive before any filter: readings right or wrong, windows in which the inertial unit holds or not.

In a window the unknowns x of `tuner.examination.windows` have a normal prior; its acceleration errors have the sd σ
where the inertial unit holds, and the sd of a motion of which it says nothing where it does not. A reading of a stream
is right with the probability 1 − q, with the sd s of each of its groups of components, else wrong with the sd S.
Variational Bayes (Bishop, Pattern Recognition and Machine Learning, ch. 10) finds x, the probabilities and q, s, S, σ
together: the rounds raise one lower bound of the log-likelihood, which pays for what it claims and so compares
transformed streams.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.special import digamma, gammaln

from models import rotation
from models.arrays import FloatArray, IntArray
from models.earth import metres_per_radian
from tuner.examination.streams import Stream, Streams, Velocities
from tuner.examination.windows import (
    ERRORS,
    KNOTS,
    TURN,
    UNKNOWNS,
    Motion,
    Sampled,
    Windows,
    averaged,
    motion_of,
    of_the_earth,
    sampled,
)
from tuner.types.clock import CERTAIN_SDS

MOST_ROUNDS = 12
"""Rounds after which a fit ends in any case."""
CONVERGED_GAIN = 0.1
"""Gain of a round below which the rounds end, nats."""
PRIOR = np.repeat([1e3, 3e2, 0.5, 0.3, 0.02], 3)
"""Sds of the start, m, m/s, of the rotation about the first guess, rad, and of the biases, m/s², rad/s."""
UNKNOWN_ACCELERATION = 3.0
"""Sd of the acceleration of a motion of which the inertial unit says nothing, m/s²."""
FIRST_ERRORS = (0.3, 0.1)
"""Sds of the acceleration errors, m/s², and of the rate of the slow error of positions, m/s, to begin from."""
ERROR_FREEDOM = 2.0
"""Degrees of freedom of the errors of a window: some windows have much larger ones than others."""
SHAPE = 0.5 * (ERROR_FREEDOM + 3 * KNOTS)
"""Shape of the distribution of their precision behind the readings of a window."""
FIRST_ROUNDS = 3
"""Rounds after which the likelier of two first guesses goes on."""
FITTED_RATE = 2.0
"""Readings of a stream a second that are fitted: errors of faster ones are much alike."""
LEAST_SD = 1e-3
"""Least sd of readings, in their unit."""
FIRST_WRONG = 0.05
"""Probability that a reading is wrong, before anything is known."""
WAHBA_ROUNDS = 5
"""Rounds after which the weights of a first rotation have settled."""
SCREENED_WINDOWS = 16
"""Windows on which everything is tried first."""
LEAST_READINGS = 4
"""Positions of a window from which it says anything."""


@dataclass(frozen=True)
class Noise:
    """Readings of a stream: the share q that is wrong, and sds of right and wrong ones by component."""

    wrong: float
    sd: FloatArray
    wrong_sd: FloatArray


@dataclass(frozen=True)
class Fit:
    """The model after the last round.

    Attributes
    ----------
    bound : ndarray, shape (w,)
        Lower bound of the log-likelihood of each window, nats.
    begin : ndarray, shape (w,)
        Start of each, s.
    noise : tuple of Noise
        Of each stream.
    unsound : ndarray, shape (w,)
        Probability that the inertial unit does not hold in a window.
    wrong : tuple of ndarray, each of shape (k,)
        Probability that a reading is wrong; NaN outside windows and of what is no reading.
    left : tuple of ndarray, each of shape (k, d)
        Readings less what was predicted; NaN likewise.
    worth : tuple of float
        What wrong readings of each stream add to the bound, nats.
    unsound_worth : float
        What windows in which the inertial unit does not hold add to it, nats.
    errors : ndarray, shape (2,)
        Sds of the acceleration error, m/s², and of the rate of the slow error of positions, m/s, over `KNOT_LENGTH`.
    lost : float
        Share of windows in which the inertial unit does not hold.
    attitude, unknowns : ndarray, shape (w, 3, 3), (w, u)
        From the axes of the unit to north, east, down, at the start of each window, and its unknowns, about which the
        last round was linear.
    solution : ndarray, shape (w, u)
        Unknowns after it, with the rotation from that attitude.
    precision : ndarray, shape (w, u)
        Prior precision of the unknowns of each window, where the inertial unit holds.
    """

    bound: FloatArray
    begin: FloatArray
    noise: tuple[Noise, ...]
    unsound: FloatArray
    wrong: tuple[FloatArray, ...]
    left: tuple[FloatArray, ...]
    worth: tuple[float, ...]
    unsound_worth: float
    errors: FloatArray
    lost: float
    attitude: FloatArray
    unknowns: FloatArray
    solution: FloatArray
    precision: FloatArray

    @property
    def total(self) -> float:
        """Bound of all windows, nats."""
        return float(self.bound.sum())

    def gains_over(self, other: Fit) -> FloatArray:
        """Return how much higher the bound of each window of another fit is here, nats; a window not here has 0."""
        gains = -other.bound.copy()
        _, own, its = np.intersect1d(self.begin, other.begin, return_indices=True)
        gains[its] += self.bound[own]
        return gains


def earned(gains: FloatArray) -> float:
    """Return the gain of all windows, nats, less what chance gives where errors are not as modelled.

    What undoes a fault loses in no window but by chance, and chance gains as often as it loses: the losses say how far
    a sum of both scatters.
    """
    return float(gains.sum() - CERTAIN_SDS * np.sqrt(2.0 * np.sum(np.minimum(gains, 0.0) ** 2)))


Start = tuple[FloatArray, Sequence[FloatArray]]
"""Where rounds begin: rotations, shape (w, 3, 3), and of each stream the probabilities of wrong readings, (w, n)."""


@dataclass(frozen=True)
class Placed:
    """Readings of a stream in windows, as a table of windows by readings, of which some places hold none."""

    stream: Stream
    row: IntArray  # (w, n) rows of the stream
    there: NDArray[np.bool_]  # (w, n) which places hold a reading
    local: FloatArray  # (w, n, d)
    at: Sampled  # of all places, one window behind the other

    def whole(self, table: FloatArray) -> FloatArray:
        """Return values of readings as those of all rows, NaN elsewhere."""
        out = np.full((len(self.stream.t), *table.shape[2:]), np.nan)
        out[self.row[self.there]] = table[self.there]
        return out

    def linear(self, found: Motion, x: FloatArray, more: FloatArray | None = None) -> Linear:
        """Return what readings say of the unknowns, linear about those of a motion, and of constants by `more`."""
        (w, n, d), (predicted, by) = self.local.shape, self.stream.seen(found)
        left = (self.local - predicted.reshape(w, n, d)).reshape(w, n * d)
        left = left + (by.reshape(w, n * d, x.shape[1]) @ x[..., None])[..., 0]
        by = by if more is None else np.concatenate([by, more], axis=-1)
        return Linear(left, by.reshape(w, n * d, by.shape[-1]), d)


@dataclass(frozen=True)
class Linear:
    """What readings of d components say of the unknowns of windows, shapes (w, n d) and (w, n d, u)."""

    left: FloatArray
    by: FloatArray
    d: int

    def equations(self, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of windows by weights (…, w, n, d), shapes (…, w, u, u) and (…, w, u)."""
        scaled = self.by * weight.reshape(*weight.shape[:-2], self.left.shape[1], 1)
        return scaled.swapaxes(-1, -2) @ self.by, (self.left[:, None] @ scaled)[..., 0, :]

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return readings less those by unknowns (…, w, u), shape (…, w, n, d)."""
        return self._readings(self.left - (self.by @ x[..., None])[..., 0])

    def variances(self, covariance: FloatArray) -> FloatArray:
        """Return the variances that unknowns give to readings, shape (…, w, n, d)."""
        return self._readings(np.einsum("...ku,...ku->...k", self.by @ covariance, self.by))

    def _readings(self, table: FloatArray) -> FloatArray:
        return table.reshape(*table.shape[:-1], table.shape[-1] // self.d, self.d)


def fit(
    streams: Streams,
    windows: Windows | None = None,
    rounds: int = MOST_ROUNDS,
    *,
    every: bool = False,
    near: Fit | None = None,
) -> Fit:
    """Return the likelier of two fits: from rotations by the velocities, and by the positions.

    Parameters
    ----------
    streams : Streams
        What was recorded.
    windows : Windows, optional
        Some windows of its inertial unit; by default all.
    rounds : int, optional
        Most rounds.
    every : bool, optional
        Whether every reading is judged, not only those that are fitted, `FITTED_RATE` a second.
    near : Fit, optional
        Of streams that differ little, from which the rounds begin where it has the same windows.
    """
    windows = averaged(streams.imu).windows if windows is None else windows
    problem = Problem.of(streams, windows)
    if near is not None and np.array_equal(near.begin, problem.windows.begin):
        found = problem.solved(problem.joined([near]), rounds, near, free=True)
    else:
        found = problem.likeliest(problem.first_guesses(), rounds)
    return problem.judged(streams, found) if every else found


def busiest(windows: Windows, now: Fit) -> IntArray:
    """Return the window of each sixteenth of a drive in which the unit moves most."""
    used = np.searchsorted(windows.begin, now.begin)
    first = windows.sums[used, :, :3] / np.maximum(windows.t[used], 1.0)[..., None]
    turned = np.linalg.norm(windows.attitude[used, -1] - np.eye(3), axis=(1, 2))
    activity = first.std(axis=1).sum(axis=1) * (0.1 + turned)
    groups = np.array_split(np.arange(len(used)), min(SCREENED_WINDOWS, len(used)))
    return np.array([used[g[np.argmax(activity[g])]] for g in groups])


@dataclass(frozen=True)
class Problem:
    """Windows with readings, before anything is estimated."""

    windows: Windows
    placed: tuple[Placed, ...]
    places: FloatArray
    speeds: FloatArray

    @staticmethod
    def of(streams: Streams, windows: Windows) -> Problem:
        """Return those of the windows that have positions, and the readings in them."""
        positions = streams.positions
        row, there = _table(positions, _fitted(positions), windows)
        used = there.sum(axis=1) >= LEAST_READINGS
        kept = windows if used.all() else windows.some(used)
        # medians: a start that is far off moves gravity by nothing
        places = np.column_stack([_median(x[row[used]], there[used]) for x in positions.values.T])
        speeds = np.zeros_like(places)
        if len(places) > 1:
            steps = np.gradient(places, axis=0) * metres_per_radian(places) / np.gradient(kept.begin)[:, None]
            speeds = np.clip(steps, -1e3, 1e3)
        placed = tuple(_placed(one, _fitted(one), kept, places, speeds) for one in streams.all)
        return Problem(kept, placed, places, speeds)

    def first_guesses(self) -> list[Start]:
        """Return rotations of the windows by a stream, and with which probability readings then begin as wrong."""
        known = [one for one in self.placed[1:] if isinstance(one.stream, Velocities) and one.there.any()]
        return [
            (
                self._wahba(one),
                [np.full(x.there.shape, FIRST_WRONG if x is one else 0.5) for x in self.placed],
            )
            for one in (self.placed[0], *known)
        ]

    def likeliest(self, guesses: Sequence[Start], rounds: int) -> Fit:
        """Return the likeliest of the fits that begin from first guesses."""
        tried = [(self.solved(first, FIRST_ROUNDS), first) for first in guesses]
        found, first = max(tried, key=lambda one: one[0].total)
        if rounds <= FIRST_ROUNDS:
            return found
        found = self.solved(first, rounds)
        # a window may have found a worse optimum
        again = [self.solved(one, FIRST_ROUNDS, found) for one in (*guesses, self.agreed(found))]
        return self.solved(self.joined([found, *again]), rounds, found, free=True)

    def agreed(self, found: Fit) -> Start:
        """Return the rotations that the likelier neighbours give to windows, and what most readings of each call wrong.

        The gyro turns a rotation from window to window; readings that are right lie as near to one of them as to all.
        """
        attitude, ends = self.joined([found])[0], self.windows.attitude[:, -1]
        before = np.append(-np.inf, found.bound[:-1]) > np.append(found.bound[1:], -np.inf)
        from_before, from_behind = attitude @ ends, attitude[1:] @ ends[:-1].swapaxes(-1, -2)
        carried = np.where(
            before[:, None, None],
            np.concatenate([attitude[:1], from_before[:-1]]),
            np.concatenate([from_behind, attitude[-1:]]),
        )
        wrong = []
        for one, left, noise in zip(self.placed, found.left, found.noise, strict=True):
            agreed = np.full(one.there.shape, FIRST_WRONG)
            if one.there.any():
                at, both = np.nan_to_num(left[one.row]), one.there[:, :, None] & one.there[:, None]
                likelihood, chance = _mixture((at[:, :, None] - at[:, None]) ** 2, noise)
                nearest = np.where(both, likelihood, 0.0).sum(axis=2)
                best = np.argmax(np.where(one.there, nearest, -np.inf), axis=1)
                agreed = np.where(one.there, chance[np.arange(len(best)), best], FIRST_WRONG)
            wrong.append(agreed)
        return carried, wrong

    def joined(self, fits: Sequence[Fit]) -> Start:
        """Return rotations and probabilities of wrong readings, for each window of the fit that is likeliest there."""
        best = np.argmax([one.bound for one in fits], axis=0)
        turned = [rotation.mat_from_rotvec(one.solution[:, TURN]) @ one.attitude for one in fits]
        attitude = np.stack(turned)[best, np.arange(len(best))]
        wrong = [
            # NaN: with the stamps of that fit it was no reading of these windows
            np.nan_to_num(np.stack([one.wrong[j] for one in fits])[best[:, None], x.row], nan=FIRST_WRONG)
            for j, x in enumerate(self.placed)
        ]
        return attitude, wrong

    def _wahba(self, one: Placed) -> FloatArray:
        """Return the rotations that bring sums of specific force to changes of velocity, or of mean velocity.

        Wahba's problem by singular values, with weights of a Cauchy distribution about the median misfit.
        """
        (w, n), velocity = one.there.shape, isinstance(one.stream, Velocities)
        g, tau, there = of_the_earth(self.places, self.speeds)[2], one.at.tau.reshape(w, n), one.there
        # a vertical velocity that is missing changes little beside gravity
        values = np.pad(one.local, ((0, 0), (0, 0), (0, 3 - one.local.shape[2])))
        own = one.at.vectors[..., 0 if velocity else 1].reshape(w, n, 3)
        gap = max(1, n // 5)
        if not velocity:
            gap = max(1, min(gap, (n - 1) // 2))
            lasted, there = tau[:, gap:] - tau[:, :-gap], there[:, gap:] & there[:, :-gap]
            own, values = (
                (x[:, gap:] - x[:, :-gap]) / np.where(there, lasted, 1.0)[..., None] for x in (own, values)
            )
            tau = 0.5 * (tau[:, gap:] + tau[:, :-gap])
        a, b = own[:, gap:] - own[:, :-gap], values[:, gap:] - values[:, :-gap]
        lasted, both = tau[:, gap:] - tau[:, :-gap], there[:, gap:] & there[:, :-gap]
        b = b - g[:, None, :] * lasted[..., None]
        miss, least = (
            np.linalg.norm(a, axis=-1) - np.linalg.norm(b, axis=-1),
            0.02 * _median(np.linalg.norm(a, axis=-1), both),
        )
        for _ in range(WAHBA_ROUNDS):
            weight = both / (1.0 + (miss / np.maximum(least, 1e-6)) ** 2)
            left, _, right = np.linalg.svd(np.einsum("wki,wkj,wk->wij", b, a, weight))
            sign = np.ones((w, 3))
            sign[:, 2] = np.linalg.det(left @ right)
            c = (left * sign[:, None, :]) @ right
            miss = np.linalg.norm(b - np.einsum("wij,wkj->wki", c, a), axis=-1)
            least = _median(miss, both)
        return np.asarray(c)

    def solved(self, first: Start, rounds: int, given: Fit | None = None, *, free: bool = False) -> Fit:
        """Return the fit after rounds from a start: with the noise of another fit, which holds unless it is free."""
        (attitude, chance), before = first, -np.inf
        w, noise = (
            len(self.windows.begin),
            [
                Noise(FIRST_WRONG, *(np.full(one.local.shape[2], sd) for sd in one.stream.usual))
                for one in self.placed
            ],
        )
        errors, lost, x = np.array(FIRST_ERRORS), 0.1, np.zeros((w, UNKNOWNS))
        scale = np.full((2, w, len(ERRORS)), SHAPE)
        if given is not None:
            noise, errors, lost = list(given.noise), given.errors, given.lost
            scale[0] *= np.square(FIRST_ERRORS / errors)  # no window begins as a sound one
        for number in range(rounds):
            seen = [one.linear(motion_of(one.at, attitude, x), x) for one in self.placed]
            both = self._branches(seen, chance, noise, errors, scale)
            scale, chance = both.scale, both.chance
            good, bad = both.bound
            total = np.logaddexp(np.log1p(-lost) + good, np.log(lost) + bad)
            unsound = np.exp(np.log(lost) + bad - total)
            share = np.stack([1.0 - unsound, unsound])[..., None]
            weight = [share * one.there for one in self.placed]
            if given is None or free:
                lost = float(np.clip((unsound.sum() + 0.5) / (w + 5.0), 1e-3, 0.99))
                noise = [
                    _noise(*each) for each in zip(self.placed, chance, weight, both.squares, strict=True)
                ]
                size, many = (share[0] * both.errors).sum(axis=1)
                likely = np.sqrt(size / np.maximum(many, 1e-9))
                errors = np.clip(likely, 0.1 * errors, 10.0 * errors).clip(LEAST_SD, UNKNOWN_ACCELERATION)
            if number == rounds - 1 or total.sum() - before < CONVERGED_GAIN:
                break
            before, x = float(total.sum()), both.x[0].copy()
            attitude = rotation.mat_from_rotvec(x[:, TURN]) @ attitude
            x[:, TURN] = 0.0
        parts = list(zip(self.placed, chance, weight, both.left, strict=True))
        return Fit(
            total,
            self.windows.begin,
            tuple(noise),
            unsound,
            tuple(one.whole((d * h).sum(axis=0)) for one, d, h, _ in parts),
            tuple(one.whole((h[..., None] * e).sum(axis=0)) for one, _, h, e in parts),
            tuple(_worth(s[0], h[0], n) for s, h, n in zip(both.squares, weight, noise, strict=True)),
            float((total - good).sum()),
            errors,
            lost,
            attitude,
            x,
            np.where(unsound[:, None] > 0.5, both.x[1], both.x[0]),
            both.precision[0],
        )

    def judged(self, streams: Streams, found: Fit) -> Fit:
        """Return a fit with the residuals of every reading, and which are wrong by the noise of all of them."""
        wrong, left, worth = [], [], []
        for one, noise in zip(streams.all, found.noise, strict=True):
            placed = _placed(one, one.readings, self.windows, self.places, self.speeds)
            linear = placed.linear(motion_of(placed.at, found.attitude, found.unknowns), found.unknowns)
            e = linear.residuals(found.solution)
            alike = placed.there.astype(float)
            of_all = _noise(placed, _mixture(e**2, noise)[1], alike, e**2)
            chance = _mixture(e**2, of_all)[1]
            worth.append(_worth(e**2, alike, of_all))
            wrong.append(placed.whole(chance))
            left.append(placed.whole(e))
        return replace(found, wrong=tuple(wrong), left=tuple(left), worth=tuple(worth))

    def eliminated(
        self,
        found: Fit,
        linear: Callable[[Placed], Linear],
        precision: FloatArray,
        many: int,
        *,
        gated: bool = True,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what windows say of constants c, with their own unknowns eliminated: A, b and squares.

        Shapes (w, many, many), (w, many) and (w,): the least weighted squares of a window are squares − 2 b'c + c'A c.

        `linear` returns what the readings of a stream say of the unknowns of windows, of this prior precision, shape
        (w, u), and of the constants. Unless it is gated, wrong readings count as much as right ones.
        """
        seen, weights, u = [linear(one) for one in self.placed], [], precision.shape[1]
        for one, noise, wrong in zip(self.placed, found.noise, found.wrong, strict=True):
            chance = np.where(one.there, wrong[one.row], 0.0)[..., None] * gated
            all_of = (
                noise.sd**2 if gated else (1.0 - noise.wrong) * noise.sd**2 + noise.wrong * noise.wrong_sd**2
            )
            sound = (1.0 - found.unsound)[:, None, None] * one.there[..., None]
            weights.append(sound * ((1.0 - chance) / all_of + chance / noise.wrong_sd**2))
        h, y = _normal(np.pad(precision, ((0, 0), (0, many))), seen, weights)
        parts = zip(seen, weights, strict=True)
        squares = np.sum([(one.left**2 * x.reshape(one.left.shape)).sum(axis=1) for one, x in parts], axis=0)
        inverse = np.linalg.inv(h[:, :u, :u])
        through, own = h[:, u:, :u] @ inverse, y[:, :u]
        squares = squares - np.einsum("wi,wij,wj->w", own, inverse, own)
        return h[:, u:, u:] - through @ h[:, :u, u:], y[:, u:] - (through @ own[..., None])[..., 0], squares

    def _branches(
        self,
        seen: Sequence[Linear],
        chance: Sequence[FloatArray],
        noise: Sequence[Noise],
        errors: FloatArray,
        scale: FloatArray,
    ) -> _Branches:
        """Return unknowns, probabilities and bound of all windows, where the inertial unit holds and where not.

        Errors have two sds; their precision in a window is one of a gamma distribution, so that they are multivariate
        Student, and `scale` holds the rates of the distributions that the round before left, shape (2, w, 2).
        """
        sds = np.array([errors, [max(UNKNOWN_ACCELERATION, 3.0 * errors[0]), errors[1]]])[:, None]
        factor, each = SHAPE / scale, 3 * KNOTS
        precision = np.concatenate(
            [np.broadcast_to(PRIOR**-2.0, (*scale.shape[:2], 15)), np.repeat(factor / sds**2, each, axis=-1)],
            axis=-1,
        )
        lengthened = digamma(SHAPE) - np.log(scale) - np.log(factor)
        bound = (0.5 * each * lengthened - _divergence(scale)).sum(axis=-1)
        weights = [
            np.where(one.there[..., None], (1.0 - d[..., None]) / n.sd**2 + d[..., None] / n.wrong_sd**2, 0.0)
            for one, d, n in zip(self.placed, chance, noise, strict=True)
        ]
        h, y = _normal(precision, seen, weights)
        covariance, log_determinant = _inverse(h)
        x = (covariance @ y[..., None])[..., 0]
        variances = np.diagonal(covariance, axis1=-2, axis2=-1)
        bound += 0.5 * (log_determinant + np.log(precision).sum(axis=-1) + UNKNOWNS)
        bound -= 0.5 * ((variances + x**2) * precision).sum(axis=-1)
        lefts = [one.residuals(x) for one in seen]
        squares = [e**2 + one.variances(covariance) for e, one in zip(lefts, seen, strict=True)]
        mixed = [_mixture(s, n) for s, n in zip(squares, noise, strict=True)]
        for one, (likelihood, _) in zip(self.placed, mixed, strict=True):
            scales = np.broadcast_to(one.stream.log_scale, len(one.stream.t))[one.row]
            bound += np.where(one.there, likelihood + scales, 0.0).sum(axis=-1)
        shape = (*scale.shape, each)
        known = each - (variances * precision)[..., 15:].reshape(shape).sum(axis=-1)
        sizes = (x[..., 15:] ** 2).reshape(shape).sum(axis=-1)
        # the fixed point of the variational update, by what the readings determine (MacKay 1992)
        scale = SHAPE * (ERROR_FREEDOM + sizes / sds**2) / (ERROR_FREEDOM + known)
        found = np.stack([factor * sizes, known], axis=1)
        return _Branches(x, bound, lefts, squares, [wrong for _, wrong in mixed], found[0], scale, precision)


@dataclass(frozen=True)
class _Branches:
    """Windows under both priors of their acceleration errors: fields of two, but for `errors` of the first."""

    x: FloatArray
    bound: FloatArray
    left: Sequence[FloatArray]
    squares: Sequence[FloatArray]
    chance: Sequence[FloatArray]
    errors: FloatArray  # (2, w, 2): of both errors their squares, and how many the readings determine
    scale: FloatArray  # (2, w, 2): rates of the distributions of their precision
    precision: FloatArray  # (2, w, u): prior precision of the unknowns


def _normal(
    precision: FloatArray, seen: Sequence[Linear], weights: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations of unknowns of a prior precision, (…, w, u), by readings and their weights."""
    h, y = precision[..., None] * np.eye(precision.shape[-1]), np.zeros_like(precision)
    for one, weight in zip(seen, weights, strict=True):
        matrix, vector = one.equations(weight)
        h += matrix
        y += vector
    return h, y


def _inverse(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the inverses of positive definite matrices and the logarithms of their determinants, by Cholesky."""
    flat = matrices.reshape(-1, *matrices.shape[-2:])
    out, diagonal = np.empty_like(flat), np.empty(flat.shape[:2])
    for k, each in enumerate(flat):
        root = dpotrf(each)[0]
        out[k], diagonal[k] = dpotri(root)[0], root.diagonal()  # the upper half
    whole = np.where(np.tri(flat.shape[1], k=-1, dtype=bool), out.swapaxes(-1, -2), out)
    log_determinant = -2.0 * np.log(diagonal).sum(axis=-1)
    return whole.reshape(matrices.shape), log_determinant.reshape(matrices.shape[:-2])


def _noise(one: Placed, chance: FloatArray, share: FloatArray, squares: FloatArray) -> Noise:
    """Return the share of wrong readings and both sds by group, from the probabilities of two branches."""
    wrong = chance * share
    right = (1.0 - chance) * share
    q = float(np.clip((wrong.sum() + 0.5) / (share.sum() + 10.0), 1e-4, 0.95))
    sd, wrong_sd = np.empty(squares.shape[-1]), np.empty(squares.shape[-1])
    for _, columns in one.stream.groups:
        each = squares[..., list(columns)].mean(axis=-1)
        s = np.sqrt(((right * each).sum() + 1e-6) / (right.sum() + 1e-6))
        sd[list(columns)] = max(s, LEAST_SD)
        far = np.sqrt(((wrong * each).sum() + 1e-6) / (wrong.sum() + 1e-6))
        wrong_sd[list(columns)] = max(far, 3.0 * sd[columns[0]])
    return Noise(q, sd, wrong_sd)


def _divergence(rate: FloatArray) -> FloatArray:
    """Return the Kullback–Leibler divergence of gamma distributions from the prior of a precision, nats."""
    first = 0.5 * ERROR_FREEDOM
    at_one = (SHAPE - first) * digamma(SHAPE) - gammaln(SHAPE) + gammaln(first)
    return np.asarray(at_one + first * np.log(rate / first) + SHAPE * (first / rate - 1.0))


def _mixture(squares: FloatArray, noise: Noise) -> tuple[FloatArray, FloatArray]:
    """Return the log density of readings of squared misfits, shape (m, d), and the probability that each is wrong."""
    right = np.log1p(-noise.wrong) - (np.log(noise.sd) + 0.5 * squares / noise.sd**2).sum(axis=-1)
    wrong = np.log(noise.wrong) - (np.log(noise.wrong_sd) + 0.5 * squares / noise.wrong_sd**2).sum(axis=-1)
    both = np.logaddexp(right, wrong)
    return both - 0.5 * np.log(2.0 * np.pi) * squares.shape[-1], np.exp(wrong - both)


def _worth(squares: FloatArray, share: FloatArray, noise: Noise) -> float:
    """Return what the wrong readings of a stream add to the log-likelihood of one sd, nats."""
    one = np.sqrt((share[..., None] * squares).sum(axis=(0, 1)) / share.sum().clip(1e-9)).clip(LEAST_SD)
    alone = Noise(1e-12, one, one)
    return float((share * (_mixture(squares, noise)[0] - _mixture(squares, alone)[0])).sum())


def _median(values: FloatArray, there: NDArray[np.bool_]) -> FloatArray:
    """Return the median of each row of those that are there, shape (w, 1), 1 where none is."""
    of_rows = np.ma.median(np.ma.array(values, mask=~there), axis=1)  # type: ignore[no-untyped-call]
    return np.asarray(of_rows.filled(1.0))[:, None]


def _fitted(one: Stream) -> NDArray[np.bool_]:
    """Return which readings of a stream are fitted, some `FITTED_RATE` a second: the same ones whatever its delay."""
    rows = np.flatnonzero(one.readings)
    many = max(round(1.0 / (FITTED_RATE * one.interval) - 1e-6), 1)  # the same of stamps that rounding moves
    kept = np.zeros(len(one.t), dtype=bool)
    kept[rows[::many]] = True
    return kept


def _table(one: Stream, which: NDArray[np.bool_], windows: Windows) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return the rows of those readings that lie in windows as a table of windows by readings, and where one is."""
    window = windows.found(np.where(which, one.t, -np.inf))
    rows = np.flatnonzero(window >= 0)
    of = window[rows]
    place = np.arange(len(rows)) - np.searchsorted(of, of)
    row = np.zeros((len(windows.begin), int(place.max(initial=-1)) + 1), dtype=int)
    there = np.zeros(row.shape, dtype=bool)
    row[of, place], there[of, place] = rows, True
    return row, there


def _placed(
    one: Stream, which: NDArray[np.bool_], windows: Windows, places: FloatArray, speeds: FloatArray
) -> Placed:
    """Return those readings of a stream that lie in windows."""
    row, there = _table(one, which, windows)
    window = np.repeat(np.arange(len(row)), row.shape[1])
    tau = np.where(there, one.t[row] - windows.begin[:, None], 0.0)
    of_row = np.zeros((len(one.t), 3))
    of_row[row[there]] = places[window[there.ravel()]]
    local = np.where(there[..., None], one.local(of_row)[row], 0.0)
    return Placed(one, row, there, local, sampled(windows, window, tau.ravel(), places, speeds))


def constants(
    streams: Streams,
    windows: Windows,
    found: Fit,
    columns: Callable[[Placed, Motion], FloatArray],
    prior: FloatArray,
    *,
    gated: bool,
) -> tuple[FloatArray, FloatArray]:
    """Return constants common to all windows, shape (c,), and their sds: one step of Gauss–Newton.

    The unknowns of each window are eliminated. Sds are by leaving out one block of windows after the other (jackknife,
    Künsch 1989), which holds where few windows decide and where errors are not as modelled: of blocks of 1, 2, 4, …
    windows the largest, that of errors that last, and none below the model's.

    Parameters
    ----------
    streams, windows : Streams, Windows
        Streams, and their inertial unit in windows.
    found : Fit
        Their fit in these.
    columns : callable
        Derivatives of what readings of a stream are, shape (m, d, c), from the predicted motion.
    prior : ndarray, shape (c,)
        Prior sds.
    gated : bool
        Whether wrong readings count less. Where a constant is far off, it is what makes them wrong.
    """
    problem = Problem.of(streams, windows)

    def linear(one: Placed) -> Linear:
        motion = motion_of(one.at, found.attitude, found.unknowns)
        return one.linear(motion, found.unknowns, columns(one, motion))

    information, score, _ = problem.eliminated(found, linear, found.precision, len(prior), gated=gated)
    total, sums = information.sum(axis=0) + np.diag(prior**-2.0), score.sum(axis=0)
    inverse = np.linalg.inv(total)
    value = inverse @ sums
    variance, many = np.diag(inverse), 1
    while 2 * many <= len(score):
        starts = np.arange(0, len(score), many)
        rest, left = total - np.add.reduceat(information, starts), sums - np.add.reduceat(score, starts)
        moved = np.linalg.solve(rest, left[..., None])[..., 0] - value
        variance, many = np.maximum(variance, (moved**2).sum(axis=0)), 2 * many
    return value, np.sqrt(variance)
