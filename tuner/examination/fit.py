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
from scipy.special import digamma, gammaln

from models import rotation
from models.arrays import FloatArray, IntArray
from models.earth import metres_per_radian
from tuner.examination.streams import Positions, Stream, Streams, Velocities
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
    windows_of,
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
    errors : tuple of 2 floats
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
    errors: tuple[float, float]
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


@dataclass(frozen=True)
class _Start:
    """Where rounds begin: rotations, shape (w, 3, 3), and of each stream the probabilities of wrong readings."""

    attitude: FloatArray
    wrong: tuple[FloatArray, ...]


@dataclass(frozen=True)
class Placed:
    """Readings of a stream in windows, as a table of windows by readings."""

    stream: Stream
    row: IntArray  # (m,) rows of the stream
    window: IntArray  # (m,)
    place: IntArray  # (m,) number within its window
    tau: FloatArray  # (m,)
    local: FloatArray  # (m, d)
    at: Sampled

    def spread(self, values: FloatArray, count: int) -> FloatArray:
        """Return values of readings as a table, shape (w, most, ...), zeros where there is none."""
        table = np.zeros((count, int(self.place.max(initial=-1)) + 1, *values.shape[1:]))
        table[self.window, self.place] = values
        return table

    def whole(self, values: FloatArray) -> FloatArray:
        """Return values of readings as those of all rows, NaN elsewhere."""
        out = np.full((len(self.stream.t), *values.shape[1:]), np.nan)
        out[self.row] = values
        return out

    def linear(self, found: Motion, x: FloatArray, more: FloatArray | None = None) -> Linear:
        """Return what readings say of the unknowns, linear about those of a motion, and of constants by `more`."""
        predicted, by = self.stream.seen(found)
        left = self.local - predicted + (by @ x[self.window][..., None])[..., 0]
        by = by if more is None else np.concatenate([by, more], axis=-1)
        w = len(x)
        return Linear(self, _rows(self.spread(left, w)), _rows(self.spread(by, w)))


@dataclass(frozen=True)
class Linear:
    """What readings say of the unknowns of windows, as tables, shapes (w, k) and (w, k, u), zeros where none is."""

    of: Placed
    left: FloatArray
    by: FloatArray

    def equations(self, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of each window by weights of shape (m, d), shapes (w, u, u) and (w, u)."""
        scaled = self.by * _rows(self.of.spread(weight, len(self.by)))[..., None]
        return scaled.swapaxes(-1, -2) @ self.by, (self.left[:, None] @ scaled)[:, 0]

    def readings(self, table: FloatArray) -> FloatArray:
        """Return the rows of a table of shape (w, k) as readings, shape (m, d)."""
        w, k = table.shape
        d = self.of.local.shape[1]
        return table.reshape(w, k // d, d)[self.of.window, self.of.place]

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return readings less those by unknowns, shape (m, d)."""
        return self.readings(self.left - (self.by @ x[..., None])[..., 0])

    def variances(self, covariance: FloatArray) -> FloatArray:
        """Return the variances that unknowns give to readings, shape (m, d)."""
        return self.readings(((self.by @ covariance) * self.by).sum(axis=-1))


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
    windows = windows_of(averaged(streams.imu)) if windows is None else windows
    problem = Problem.of(streams, windows)
    if near is not None and np.array_equal(near.begin, problem.windows.begin):
        found = problem.solved(problem.joined([near]), rounds, near, free=True)
    else:
        found = problem.likeliest(problem.first_guesses(), rounds)
    return problem.judged(streams, found) if every else found


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
        window = np.where(_fitted(positions), windows.found(positions.t), -1)
        count = np.bincount(window[window >= 0], minlength=len(windows.begin))
        used = count >= LEAST_READINGS
        kept = windows.some(used)
        window = kept.found(np.where(window >= 0, positions.t, -np.inf))
        w = len(kept.begin)
        places, speeds = np.zeros((2, w, 3))
        for k in range(w):  # medians: a start that is far off moves gravity by nothing
            rows = np.flatnonzero(window == k)
            places[k] = np.median(positions.values[rows], axis=0)
        if w > 1:
            steps = np.gradient(places, axis=0) * metres_per_radian(places) / np.gradient(kept.begin)[:, None]
            speeds = np.clip(steps, -1e3, 1e3)
        placed = tuple(_placed(one, _fitted(one), kept, places, speeds) for one in streams.all)
        return Problem(kept, placed, places, speeds)

    def first_guesses(self) -> list[_Start]:
        """Return rotations of the windows by a stream, and with which probability readings then begin as wrong."""
        found = []
        for one in self.placed:
            if isinstance(one.stream, Positions | Velocities) and (len(one.row) or one is self.placed[0]):
                wrong = (np.full(len(x.row), FIRST_WRONG if x is one else 0.5) for x in self.placed)
                found.append(_Start(self._wahba(one), tuple(wrong)))
        return found

    def likeliest(self, guesses: Sequence[_Start], rounds: int) -> Fit:
        """Return the likeliest of the fits that begin from first guesses."""
        tried = [(self.solved(first, FIRST_ROUNDS), first) for first in guesses]
        found, first = max(tried, key=lambda one: one[0].total)
        if rounds <= FIRST_ROUNDS:
            return found
        found = self.solved(first, rounds)
        # a window may have found a worse optimum
        again = [self.solved(one, FIRST_ROUNDS, found) for one in guesses]
        return self.solved(self.joined([found, *again]), rounds, found, free=True)

    def joined(self, fits: Sequence[Fit]) -> _Start:
        """Return rotations and probabilities of wrong readings, for each window of the fit that is likeliest there."""
        best = np.argmax([one.bound for one in fits], axis=0)
        turned = [rotation.mat_from_rotvec(one.solution[:, TURN]) @ one.attitude for one in fits]
        attitude = np.stack(turned)[best, np.arange(len(best))]
        wrong = tuple(
            # NaN: with the stamps of that fit it was no reading of these windows
            np.nan_to_num(np.stack([one.wrong[j] for one in fits])[best[x.window], x.row], nan=FIRST_WRONG)
            for j, x in enumerate(self.placed)
        )
        return _Start(attitude, wrong)

    def _wahba(self, one: Placed) -> FloatArray:
        """Return the rotations that bring sums of specific force to changes of velocity, or of mean velocity.

        Wahba's problem by singular values, with weights of a Cauchy distribution about the median misfit.
        """
        w, velocity = len(self.windows.begin), isinstance(one.stream, Velocities)
        g = of_the_earth(self.places, self.speeds)[2]
        tau, there = one.spread(one.tau, w), one.spread(np.ones(len(one.tau)), w)
        # a vertical velocity that is missing changes little beside gravity
        values = one.spread(np.pad(one.local, ((0, 0), (0, 3 - one.local.shape[1]))), w)
        own = one.spread(one.at.vectors[..., 0 if velocity else 1], w)
        gap = max(1, tau.shape[1] // 5)
        if not velocity:
            gap = max(1, min(gap, (tau.shape[1] - 1) // 2))
            lasted, there = tau[:, gap:] - tau[:, :-gap], there[:, gap:] * there[:, :-gap]
            own, values = (
                (x[:, gap:] - x[:, :-gap]) / np.where(there, lasted, 1.0)[..., None] for x in (own, values)
            )
            tau = 0.5 * (tau[:, gap:] + tau[:, :-gap])
        a, b = own[:, gap:] - own[:, :-gap], values[:, gap:] - values[:, :-gap]
        lasted, both = tau[:, gap:] - tau[:, :-gap], there[:, gap:] * there[:, :-gap]
        b = b - g[:, None, :] * lasted[..., None]
        long, other = np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1)
        weight = both / (1.0 + ((long - other) / (0.02 * _usual(long, both) + 1e-9)) ** 2)
        for _ in range(5):
            left, _, right = np.linalg.svd(np.einsum("wki,wkj,wk->wij", b, a, weight))
            sign = np.ones((w, 3))
            sign[:, 2] = np.linalg.det(left @ right)
            c = (left * sign[:, None, :]) @ right
            miss = np.linalg.norm(b - np.einsum("wij,wkj->wki", c, a), axis=-1)
            weight = both / (1.0 + (miss / np.maximum(_usual(miss, both), 1e-6)) ** 2)
        return np.asarray(c)

    def solved(self, first: _Start, rounds: int, given: Fit | None = None, *, free: bool = False) -> Fit:
        """Return the fit after rounds from a start: with the noise of another fit, which holds unless it is free."""
        attitude = first.attitude
        w, before = len(self.windows.begin), -np.inf
        noise = [
            Noise(
                FIRST_WRONG,
                np.full(one.local.shape[1], one.stream.usual[0]),
                np.full(one.local.shape[1], one.stream.usual[1]),
            )
            for one in self.placed
        ]
        errors, unsound, lost = FIRST_ERRORS, np.full(w, 0.1), 0.1
        scale = np.full((2, len(ERRORS), w), SHAPE)
        if given is not None:
            noise, errors, lost = list(given.noise), given.errors, given.lost
            scale[0] *= np.square(np.array(FIRST_ERRORS) / errors)[:, None]  # no window begins as a sound one
        chance = [np.stack([x, x]) for x in first.wrong]
        x = np.zeros((w, UNKNOWNS))
        for number in range(rounds):
            seen = [one.linear(motion_of(one.at, attitude, x), x) for one in self.placed]
            branches = [
                self._branch(seen, [d[b] for d in chance], noise, (sd, errors[1]), scale[b])
                for b, sd in enumerate((errors[0], max(UNKNOWN_ACCELERATION, 3.0 * errors[0])))
            ]
            good, bad = (b.bound for b in branches)
            total = np.logaddexp(np.log1p(-lost) + good, np.log(lost) + bad)
            unsound = np.exp(np.log(lost) + bad - total)
            scale = np.stack([b.scale for b in branches])
            chance = [np.stack([b.chance[j] for b in branches]) for j in range(len(self.placed))]
            weight = [np.stack([(1.0 - unsound)[one.window], unsound[one.window]]) for one in self.placed]
            if given is None or free:
                lost = float(np.clip((unsound.sum() + 0.5) / (w + 5.0), 1e-3, 0.99))
                noise = [
                    self._noise(one, d, h, np.stack([b.squares[j] for b in branches]))
                    for j, (one, d, h) in enumerate(zip(self.placed, chance, weight, strict=True))
                ]
                size, many = (branches[0].errors @ (1.0 - unsound)).T
                likely = np.sqrt(size / np.maximum(many, 1e-9))
                low, high = 0.1 * np.array(errors), 10.0 * np.array(errors)
                a, b = np.clip(likely, low, high).clip(LEAST_SD, UNKNOWN_ACCELERATION)
                errors = float(a), float(b)
            if number == rounds - 1 or total.sum() - before < CONVERGED_GAIN:
                break
            before = float(total.sum())
            x = branches[0].x.copy()
            attitude = rotation.mat_from_rotvec(x[:, TURN]) @ attitude
            x[:, TURN] = 0.0
        last = np.where(unsound[:, None] > 0.5, branches[1].x, branches[0].x)
        wrong = [(d * h).sum(axis=0) for d, h in zip(chance, weight, strict=True)]
        left = [
            (h[0, :, None] * branches[0].left[j] + h[1, :, None] * branches[1].left[j])
            for j, h in enumerate(weight)
        ]
        worth = tuple(_worth(branches[0].squares[j], weight[j][0], n) for j, n in enumerate(noise))
        return Fit(
            total,
            self.windows.begin,
            tuple(noise),
            unsound,
            tuple(one.whole(x) for x, one in zip(wrong, self.placed, strict=True)),
            tuple(one.whole(x) for x, one in zip(left, self.placed, strict=True)),
            worth,
            float((total - good).sum()),
            errors,
            lost,
            attitude,
            x,
            last,
            branches[0].precision,
        )

    def judged(self, streams: Streams, found: Fit) -> Fit:
        """Return a fit with the residuals of every reading, and which are wrong by the noise of all of them."""
        wrong, left, worth = [], [], []
        for one, noise in zip(streams.all, found.noise, strict=True):
            placed = _placed(one, one.readings, self.windows, self.places, self.speeds)
            linear = placed.linear(motion_of(placed.at, found.attitude, found.unknowns), found.unknowns)
            e = linear.residuals(found.solution)
            alike = np.ones(len(e))
            of_all = self._noise(placed, _mixture(e**2, noise)[1], alike, e**2)
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
        w, u = precision.shape
        h = np.zeros((w, u + many, u + many))
        diagonal = np.arange(u)
        h[:, diagonal, diagonal] = precision
        y = np.zeros((w, u + many))
        squares = np.zeros(w)
        for one, noise, wrong in zip(self.placed, found.noise, found.wrong, strict=True):
            chance, sound = wrong[one.row, None], 1.0 - found.unsound[one.window, None]
            chance = chance if gated else np.zeros_like(chance)
            all_of = (
                noise.sd**2 if gated else (1.0 - noise.wrong) * noise.sd**2 + noise.wrong * noise.wrong_sd**2
            )
            weight = sound * ((1.0 - chance) / all_of + chance / noise.wrong_sd**2)
            seen = linear(one)
            matrix, vector = seen.equations(weight)
            h, y = h + matrix, y + vector
            squares += (seen.left**2 * _rows(one.spread(weight, w))).sum(axis=1)
        inverse = np.linalg.inv(h[:, :u, :u])
        through, own = h[:, u:, :u] @ inverse, y[:, :u]
        squares -= np.einsum("wi,wij,wj->w", own, inverse, own)
        return h[:, u:, u:] - through @ h[:, :u, u:], y[:, u:] - (through @ own[..., None])[..., 0], squares

    def _branch(
        self,
        seen: Sequence[Linear],
        chance: Sequence[FloatArray],
        noise: Sequence[Noise],
        errors: tuple[float, float],
        scale: FloatArray,
    ) -> _Branch:
        """Return unknowns, probabilities and bound of all windows.

        Errors have two sds; their precision in a window is one of a gamma distribution, so that they are multivariate
        Student, and `scale` holds the rates of the distributions that the round before left, shape (2, w).
        """
        w, u, each = scale.shape[1], UNKNOWNS, 3 * KNOTS
        factor, log_factor = SHAPE / scale, digamma(SHAPE) - np.log(scale)
        precision = np.tile(_precision(errors), (w, 1))
        bound = np.zeros(w)
        for k, columns in enumerate(ERRORS):
            precision[:, columns] *= factor[k, :, None]
            bound += 0.5 * each * (log_factor[k] - np.log(factor[k])) - _divergence(scale[k])
        h = np.zeros((w, u, u))
        diagonal = np.arange(u)
        h[:, diagonal, diagonal] = precision
        y = np.zeros((w, u))
        for one, d, n in zip(seen, chance, noise, strict=True):
            matrix, vector = one.equations((1.0 - d)[:, None] / n.sd**2 + d[:, None] / n.wrong_sd**2)
            h, y = h + matrix, y + vector
        covariance = np.asarray(np.linalg.inv(h), dtype=float)
        x = (covariance @ y[..., None])[..., 0]
        variances = covariance[:, diagonal, diagonal]
        size = variances + x**2
        bound += 0.5 * (np.linalg.slogdet(covariance)[1] + np.log(precision).sum(axis=1) + u)
        bound -= 0.5 * (size * precision).sum(axis=1)
        lefts, squares, chances = [], [], []
        for one, n in zip(seen, noise, strict=True):
            e, of = one.residuals(x), one.of
            s = e**2 + one.variances(covariance)
            likelihood, wrong = _mixture(s, n)
            scales = np.broadcast_to(of.stream.log_scale, len(of.stream.t))
            np.add.at(bound, of.window, likelihood + scales[of.row])
            lefts.append(e)
            squares.append(s)
            chances.append(wrong)
        unknown = variances * precision
        known = each - np.stack([unknown[:, k].sum(axis=1) for k in ERRORS])
        sizes = np.stack([(x[:, k] ** 2).sum(axis=1) for k in ERRORS])
        # the fixed point of the variational update, by what the readings determine (MacKay 1992)
        scale = SHAPE * (ERROR_FREEDOM + sizes / np.square(errors)[:, None]) / (ERROR_FREEDOM + known)
        return _Branch(
            x,
            bound,
            tuple(lefts),
            tuple(squares),
            tuple(chances),
            np.stack([factor * sizes, known], axis=1),
            scale,
            precision,
        )

    def _noise(self, one: Placed, chance: FloatArray, share: FloatArray, squares: FloatArray) -> Noise:
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


@dataclass(frozen=True)
class _Branch:
    """Windows under one of the two priors of their acceleration errors."""

    x: FloatArray
    bound: FloatArray
    left: tuple[FloatArray, ...]
    squares: tuple[FloatArray, ...]
    chance: tuple[FloatArray, ...]
    errors: FloatArray  # (2, 2, w): of both errors their squares, and how many the readings determine
    scale: FloatArray  # (2, w): rates of the distributions of their precision
    precision: FloatArray  # (w, u): prior precision of the unknowns


def _precision(errors: tuple[float, float]) -> FloatArray:
    """Return the prior precision of the unknowns of a window, shape (u,)."""
    sd = np.concatenate([PRIOR, np.zeros(UNKNOWNS - 15)])
    for columns, one in zip(ERRORS, errors, strict=True):
        sd[columns] = one
    return np.asarray(sd**-2.0)


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
    one = np.sqrt((share[:, None] * squares).sum(axis=0) / share.sum().clip(1e-9)).clip(LEAST_SD)
    alone = Noise(1e-12, one, one)
    return float((share * (_mixture(squares, noise)[0] - _mixture(squares, alone)[0])).sum())


def _rows(table: FloatArray) -> FloatArray:
    """Return a table of windows by readings by components, shape (w, n, d, …), as one of shape (w, n d, …)."""
    w, n, d = table.shape[:3]
    return table.reshape(w, n * d, *table.shape[3:])


def _usual(values: FloatArray, there: FloatArray) -> FloatArray:
    """Return the median of each row of those that are there, shape (w, 1), 1 where none is."""
    rows = zip(values, there > 0, strict=True)
    return np.array([[np.median(x[m]) if m.any() else 1.0] for x, m in rows])


def _fitted(one: Stream) -> NDArray[np.bool_]:
    """Return which readings of a stream are fitted, some `FITTED_RATE` a second: the same ones whatever its delay."""
    rows = np.flatnonzero(one.readings)
    many = max(round(1.0 / (FITTED_RATE * one.interval) - 1e-6), 1)  # the same of stamps that rounding moves
    kept = np.zeros(len(one.t), dtype=bool)
    kept[rows[::many]] = True
    return kept


def _placed(
    one: Stream, which: NDArray[np.bool_], windows: Windows, places: FloatArray, speeds: FloatArray
) -> Placed:
    """Return those readings of a stream that lie in windows."""
    window = np.where(which, windows.found(one.t), -1)
    rows = np.flatnonzero(window >= 0)
    of = window[rows]
    tau = one.t[rows] - windows.begin[of]
    place = np.arange(len(rows)) - np.searchsorted(of, of)
    local = one.local(places[np.maximum(window, 0)])[rows] if len(places) else one.values[rows]
    return Placed(one, rows, of, place, tau, local, sampled(windows, of, tau, places, speeds))


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
