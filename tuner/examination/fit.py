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

from models import rotation
from models.arrays import FloatArray, IntArray
from models.earth import metres_per_radian
from tuner.examination.streams import Stream, Streams
from tuner.examination.windows import (
    TURN,
    Motion,
    Sampled,
    Windows,
    averaged,
    motion_of,
    of_the_earth,
    sampled,
    windows_of,
)

MOST_ROUNDS = 12
"""Rounds after which a fit ends in any case."""
CONVERGED_GAIN = 0.1
"""Gain of a round below which the rounds end, nats."""
PRIOR = np.repeat([1e3, 3e2, 0.5, 0.3, 0.02], 3)
"""Sds of the start, m, m/s, of the rotation about the first guess, rad, and of the biases, m/s², rad/s."""
UNKNOWN_ACCELERATION = 3.0
"""Sd of the acceleration of a motion of which the inertial unit says nothing, m/s²."""
FIRST_ROUNDS = 3
"""Rounds after which the likelier of two first guesses goes on."""
FITTED_RATE = 2.0
"""Readings of a stream a second that are fitted: errors of faster ones are much alike."""
LEAST_SD = 1e-3
"""Least sd of readings, in their unit."""
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
    error : float
        Sd of the acceleration error over `KNOT_LENGTH`, m/s².
    lost : float
        Share of windows in which the inertial unit does not hold.
    attitude : ndarray, shape (w, 3, 3)
        From the axes of the unit to north, east, down, at the start of each window.
    unknowns : ndarray, shape (w, u)
        Of each window, about which the last round was linear.
    """

    bound: FloatArray
    begin: FloatArray
    noise: tuple[Noise, ...]
    unsound: FloatArray
    wrong: tuple[FloatArray, ...]
    left: tuple[FloatArray, ...]
    worth: tuple[float, ...]
    unsound_worth: float
    error: float
    lost: float
    attitude: FloatArray
    unknowns: FloatArray

    @property
    def total(self) -> float:
        """Bound of all windows, nats."""
        return float(self.bound.sum())


@dataclass(frozen=True)
class _Start:
    """Where rounds begin: rotations, shape (w, 3, 3), and of each stream the probabilities of wrong readings."""

    attitude: FloatArray
    wrong: tuple[FloatArray, ...]


@dataclass(frozen=True)
class _Placed:
    """Readings of a stream in windows, as a table of windows by readings."""

    stream: Stream
    rows: int
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

    def about(self, found: Motion, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what readings say of all unknowns, linear about those of a motion, and the derivatives."""
        predicted, by = self.stream.seen(found)
        return self.local - predicted + (by @ x[self.window][..., None])[..., 0], by

    def equations(
        self, by: FloatArray, left: FloatArray, weight: FloatArray, count: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of readings in each window, shapes (w, u, u) and (w, u)."""
        u = by.shape[-1]
        rows = self.spread(by, count).reshape(count, -1, u)
        scaled = self.spread(by * weight[..., None], count).reshape(count, -1, u)
        return scaled.swapaxes(-1, -2) @ rows, (self.spread(left, count).reshape(count, 1, -1) @ scaled)[:, 0]


def fit(
    streams: Streams, windows: Windows | None = None, rounds: int = MOST_ROUNDS, *, every: bool = False
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
    """
    windows = windows_of(averaged(streams.imu)) if windows is None else windows
    problem = _Problem.of(streams, windows)
    guesses = problem.first_guesses()
    if not guesses:
        return problem.nothing()
    tried = [(problem.solved(first, FIRST_ROUNDS), first) for first in guesses]
    found, first = max(tried, key=lambda one: one[0].total)
    if rounds > FIRST_ROUNDS:
        found = problem.solved(first, rounds)
        # a window may have found a worse optimum
        again = [problem.solved(one, FIRST_ROUNDS, found) for one in guesses]
        found = problem.solved(problem.joined([found, *again]), rounds, found, free=True)
    return problem.judged(streams, found) if every else found


@dataclass(frozen=True)
class _Problem:
    """Windows with readings, before anything is estimated."""

    windows: Windows
    placed: tuple[_Placed, ...]
    rows: tuple[int, ...]
    places: FloatArray
    speeds: FloatArray

    @staticmethod
    def of(streams: Streams, windows: Windows) -> _Problem:
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
        return _Problem(kept, placed, tuple(len(one.t) for one in streams.all), places, speeds)

    def nothing(self) -> Fit:
        """Return a fit of no window."""
        none, u = np.zeros(0), self.windows.unknowns
        kinds = [(one.stream, k) for one, k in zip(self.placed, self.rows, strict=True)]
        noise = tuple(Noise(0.0, *np.full((2, x.values.shape[1]), np.inf)) for x, _ in kinds)
        wrong, left = (tuple(np.full((k, x.values.shape[1])[:d], np.nan) for x, k in kinds) for d in (1, 2))
        worth = tuple(0.0 for _ in kinds)
        return Fit(
            none, none, noise, none, wrong, left, worth, 0.0, 0.0, 0.0, np.zeros((0, 3, 3)), np.zeros((0, u))
        )

    def first_guesses(self) -> list[_Start]:
        """Return rotations of the windows by a stream, and with which probability readings then begin as wrong."""
        found = []
        for j, one in enumerate(self.placed):
            if one.stream.unit in ("m/s", "m") and one.local.shape[1] == 3 and len(one.row):
                attitude = self._wahba(one, velocity=one.stream.unit == "m/s")
                wrong = (np.full(len(x.row), 0.05 if i == j else 0.5) for i, x in enumerate(self.placed))
                found.append(_Start(attitude, tuple(wrong)))
        return found

    def joined(self, fits: Sequence[Fit]) -> _Start:
        """Return rotations and probabilities of wrong readings, for each window of the fit that is likeliest there."""
        best = np.argmax([one.bound for one in fits], axis=0)
        attitude = np.stack([one.attitude for one in fits])[best, np.arange(len(best))]
        wrong = tuple(
            np.stack([one.wrong[j] for one in fits])[best[x.window], x.row] for j, x in enumerate(self.placed)
        )
        return _Start(attitude, wrong)

    def _wahba(self, one: _Placed, *, velocity: bool) -> FloatArray:
        """Return the rotations that bring sums of specific force to changes of velocity, or of mean velocity.

        Wahba's problem by singular values, with weights of a Cauchy distribution about the median misfit.
        """
        w = len(self.windows.begin)
        g = of_the_earth(self.places, self.speeds)[2]
        tau, there = one.spread(one.tau, w), one.spread(np.ones(len(one.tau)), w)
        values = one.spread(one.local, w)
        own = one.spread(one.at.vectors[..., 0 if velocity else 1], w)
        most = tau.shape[1]
        gap = max(1, most // 5)
        if velocity:
            a, b = own[:, gap:] - own[:, :-gap], values[:, gap:] - values[:, :-gap]
            lasted = tau[:, gap:] - tau[:, :-gap]
            both = there[:, gap:] * there[:, :-gap]
        else:
            gap = max(1, min(gap, (most - 1) // 2))
            first, second = tau[:, gap:-gap] - tau[:, : -2 * gap], tau[:, 2 * gap :] - tau[:, gap:-gap]
            both = there[:, 2 * gap :] * there[:, gap:-gap] * there[:, : -2 * gap]
            first, second = np.where(both, first, 1.0), np.where(both, second, 1.0)

            def change(x: FloatArray) -> FloatArray:
                ahead = (x[:, 2 * gap :] - x[:, gap:-gap]) / second[..., None]
                return np.asarray(ahead - (x[:, gap:-gap] - x[:, : -2 * gap]) / first[..., None])

            a, b = change(own), change(values)
            lasted = 0.5 * (first + second)
        b = b - g[:, None, :] * lasted[..., None]
        long, other = np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1)
        usual = np.array(
            [np.median(x[m > 0]) if (m > 0).any() else 1.0 for x, m in zip(long, both, strict=True)]
        )
        weight = both / (1.0 + ((long - other) / (0.02 * usual + 1e-9)[:, None]) ** 2)
        for _ in range(5):
            left, _, right = np.linalg.svd(np.einsum("wki,wkj,wk->wij", b, a, weight))
            sign = np.ones((w, 3))
            sign[:, 2] = np.linalg.det(left @ right)
            c = (left * sign[:, None, :]) @ right
            miss = np.linalg.norm(b - np.einsum("wij,wkj->wki", c, a), axis=-1)
            scale = np.array(
                [np.median(x[m > 0]) if (m > 0).any() else 1.0 for x, m in zip(miss, both, strict=True)]
            )
            weight = both / (1.0 + (miss / np.maximum(scale, 1e-6)[:, None]) ** 2)
        return np.asarray(c)

    def solved(self, first: _Start, rounds: int, given: Fit | None = None, *, free: bool = False) -> Fit:
        """Return the fit after rounds from a start: with the noise of another fit, which holds unless it is free."""
        attitude = first.attitude
        w, u, before = len(self.windows.begin), self.windows.unknowns, -np.inf
        noise = [
            Noise(
                0.05,
                np.full(one.local.shape[1], one.stream.usual[0]),
                np.full(one.local.shape[1], one.stream.usual[1]),
            )
            for one in self.placed
        ]
        error, unsound, lost = 0.3, np.full(w, 0.1), 0.1
        if given is not None:
            noise, error, lost = list(given.noise), given.error, given.lost
        chance = [np.stack([x, x]) for x in first.wrong]
        x = np.zeros((w, u))
        for number in range(rounds):
            seen = [(*one.about(motion_of(one.at, attitude, x), x), one) for one in self.placed]
            branches = [
                self._branch(seen, [d[b] for d in chance], noise, sd, w, u)
                for b, sd in enumerate((error, max(UNKNOWN_ACCELERATION, 3.0 * error)))
            ]
            good, bad = (b.bound for b in branches)
            total = np.logaddexp(np.log1p(-lost) + good, np.log(lost) + bad)
            unsound = np.exp(np.log(lost) + bad - total)
            chance = [np.stack([b.chance[j] for b in branches]) for j in range(len(self.placed))]
            weight = [np.stack([(1.0 - unsound)[one.window], unsound[one.window]]) for one in self.placed]
            if given is None or free:
                lost = float(np.clip((unsound.sum() + 0.5) / (w + 5.0), 1e-3, 0.99))
                noise = [
                    self._noise(one, d, h, np.stack([b.squares[j] for b in branches]))
                    for j, (one, d, h) in enumerate(zip(self.placed, chance, weight, strict=True))
                ]
                size, many = branches[0].error @ (1.0 - unsound)
                likely = np.sqrt(size / max(many, 1e-9))
                error = float(np.clip(likely, 0.1 * error, 10.0 * error).clip(LEAST_SD, UNKNOWN_ACCELERATION))
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
            tuple(_whole(x, one.row, k) for x, one, k in zip(wrong, self.placed, self.rows, strict=True)),
            tuple(_whole(x, one.row, k) for x, one, k in zip(left, self.placed, self.rows, strict=True)),
            worth,
            float((total - good).sum()),
            error,
            lost,
            rotation.mat_from_rotvec(last[:, TURN]) @ attitude,
            np.where(np.isin(np.arange(u), [6, 7, 8]), 0.0, last),
        )

    def judged(self, streams: Streams, found: Fit) -> Fit:
        """Return a fit with the residuals and probabilities of every reading."""
        wrong, left = [], []
        for one, noise in zip(streams.all, found.noise, strict=True):
            placed = _placed(one, one.readings, self.windows, self.places, self.speeds)
            predicted, _ = one.seen(motion_of(placed.at, found.attitude, found.unknowns))
            e = placed.local - predicted
            chance = _mixture(e**2, noise)[1]
            wrong.append(_whole(chance, placed.row, len(one.t)))
            left.append(_whole(e, placed.row, len(one.t)))
        return replace(found, wrong=tuple(wrong), left=tuple(left))

    def _branch(
        self,
        seen: Sequence[tuple[FloatArray, FloatArray, _Placed]],
        chance: Sequence[FloatArray],
        noise: Sequence[Noise],
        error: float,
        w: int,
        u: int,
    ) -> _Branch:
        """Return unknowns, probabilities and bound of all windows, with acceleration errors of an sd."""
        precision = np.concatenate([PRIOR, np.full(u - 15, error)]) ** -2
        h = np.zeros((w, u, u))
        h[:, np.arange(u), np.arange(u)] = precision
        y = np.zeros((w, u))
        for (left, by, one), d, n in zip(seen, chance, noise, strict=True):
            weight = (1.0 - d)[:, None] / n.sd**2 + d[:, None] / n.wrong_sd**2
            matrix, vector = one.equations(by, left, weight, w)
            h, y = h + matrix, y + vector
        covariance = np.linalg.inv(h)
        x = (covariance @ y[..., None])[..., 0]
        bound = 0.5 * (np.linalg.slogdet(covariance)[1] + np.log(precision).sum() + u)
        bound -= 0.5 * ((covariance[:, np.arange(u), np.arange(u)] + x**2) * precision).sum(axis=1)
        lefts, squares, chances = [], [], []
        for (left, by, one), n in zip(seen, noise, strict=True):
            e = left - (by @ x[one.window][..., None])[..., 0]
            s = e**2 + ((by @ covariance[one.window]) * by).sum(axis=-1)
            likelihood, wrong = _mixture(s, n)
            np.add.at(
                bound, one.window, likelihood + np.broadcast_to(one.stream.log_scale, one.rows)[one.row]
            )
            lefts.append(e)
            squares.append(s)
            chances.append(wrong)
        seen_of = (1.0 - covariance[:, np.arange(15, u), np.arange(15, u)] / error**2).sum(axis=1)
        known = np.stack([(x[:, 15:] ** 2).sum(axis=1), seen_of])
        return _Branch(x, bound, tuple(lefts), tuple(squares), tuple(chances), known)

    def _noise(self, one: _Placed, chance: FloatArray, share: FloatArray, squares: FloatArray) -> Noise:
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
    error: FloatArray  # (2, w): squares of acceleration errors, and how many the readings determine


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


def _whole(values: FloatArray, rows: IntArray, count: int) -> FloatArray:
    """Return values of some rows as values of all, NaN elsewhere."""
    out = np.full((count, *values.shape[1:]), np.nan)
    out[rows] = values
    return out


def _fitted(one: Stream) -> NDArray[np.bool_]:
    """Return which readings of a stream are fitted: at most `FITTED_RATE` a second."""
    rows = np.flatnonzero(one.readings)
    if not len(rows):
        return one.readings
    slot = np.floor(one.t[rows] * FITTED_RATE + 1e-6)
    kept = np.zeros(len(one.t), dtype=bool)
    kept[rows[np.append(True, np.diff(slot) > 0.0)]] = True
    return kept


def _placed(
    one: Stream, which: NDArray[np.bool_], windows: Windows, places: FloatArray, speeds: FloatArray
) -> _Placed:
    """Return those readings of a stream that lie in windows."""
    window = np.where(which, windows.found(one.t), -1)
    rows = np.flatnonzero(window >= 0)
    of = window[rows]
    tau = one.t[rows] - windows.begin[of]
    place = np.arange(len(rows)) - np.searchsorted(of, of)
    local = one.local(places[np.maximum(window, 0)])[rows] if len(places) else one.values[rows]
    return _Placed(one, len(one.t), rows, of, place, tau, local, sampled(windows, of, tau, places, speeds))


@dataclass(frozen=True)
class Constants:
    """Constants of the installation by the readings.

    Attributes
    ----------
    value, sd : ndarray, shape (c,)
        Estimates, and their sds by the scatter of the windows (sandwich estimator, White 1982).
    """

    value: FloatArray
    sd: FloatArray


def constants(
    streams: Streams,
    windows: Windows,
    found: Fit,
    columns: Callable[[Stream, Motion], FloatArray],
    prior: FloatArray,
    *,
    gated: bool,
) -> Constants:
    """Return constants common to all windows, with the unknowns of each window eliminated (one step of Gauss–Newton).

    Parameters
    ----------
    streams, windows : Streams, Windows
        Streams, and their inertial unit in windows.
    found : Fit
        Their fit in these.
    columns : callable
        Derivatives of what a stream reads, shape (m, d, c), from the predicted motion.
    prior : ndarray, shape (c,)
        Prior sds.
    gated : bool
        Whether wrong readings count less. Where a constant is far off, it is what makes them wrong.
    """
    problem = _Problem.of(streams, windows)
    w, u, c = len(problem.windows.begin), problem.windows.unknowns, len(prior)
    h = np.zeros((w, u + c, u + c))
    diagonal = np.arange(u)
    h[:, diagonal, diagonal] = np.concatenate([PRIOR, np.full(u - 15, found.error)]) ** -2
    y = np.zeros((w, u + c))
    for one, noise, wrong in zip(problem.placed, found.noise, found.wrong, strict=True):
        motion = motion_of(one.at, found.attitude, found.unknowns)
        left, by = one.about(motion, found.unknowns)
        chance, sound = wrong[one.row, None], 1.0 - found.unsound[one.window, None]
        chance = chance if gated else np.zeros_like(chance)
        all_of = noise.sd**2 if gated else (1.0 - noise.wrong) * noise.sd**2 + noise.wrong * noise.wrong_sd**2
        weight = sound * ((1.0 - chance) / all_of + chance / noise.wrong_sd**2)
        both = np.concatenate([by, columns(one.stream, motion)], axis=-1)
        matrix, vector = one.equations(both, left, weight, w)
        h, y = h + matrix, y + vector
    through = h[:, u:, :u] @ np.linalg.inv(h[:, :u, :u])
    information = h[:, u:, u:] - through @ h[:, :u, u:]
    score = y[:, u:] - (through @ y[:, :u, None])[..., 0]
    inverse = np.linalg.inv(information.sum(axis=0) + np.diag(prior**-2.0))
    value = inverse @ score.sum(axis=0)
    scatter = score - information @ value
    covariance = inverse @ (scatter.T @ scatter) @ inverse + inverse * np.diag(prior**-2.0) @ inverse
    sd = np.sqrt(np.maximum(np.diag(covariance), np.diag(inverse)))
    return Constants(value, sd)
