"""A mount that tilts during a part of a record: gravity moves into an axis across it.

Between two times the mount turns evenly by a small angle φ about a horizontal axis. An accelerometer axis that reads
f at rest then moves to f + φ √(g² − f²), and one along gravity does not move to first order. On the axis this is::

    0 before the begin, rising evenly, 1 after the end

Statistic: likelihood ratio of the best such course, the noise refitted. Courses between the knots of a coarse grid
are sums of the pieces between neighbouring knots: one Gram matrix of the pieces scores all of them. The chance
is Davies' bound along the record, summed over the durations that are tried.
One axis cannot separate a tilt from a bias that moves and settles; with three, `stretched` tests whether the length of
the specific force is kept, as it is where it only turns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.effects.static.attitude import Attitude
from models.probability import chi2_beyond
from models.units import STANDARD_GRAVITY
from tuner.diagnosis.static.causes.attitude import triad
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import REGION_NATS, SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.profile_likelihood import first_column, track_without
from tuner.diagnosis.static.model.score_scan import MIN_SQUARE_SCORE
from tuner.diagnosis.static.outcome import ALTERNATIVE_NATS, NO_GAIN, TestResult
from tuner.types import Unexplained

MAX_GRAVITY_SHARE = 0.9
"""Largest share of gravity on an axis in which a tilt shows: √(1 − 0.9²) = 0.44 of its angle to first order."""
GRID_CELLS = 48
"""Cells of the coarse grid of begins and ends; chosen so that a course between knots keeps most of its likelihood."""
DURATIONS = (1, 2, 3, 4, 6, 8, 11, 16, 22, 32, 44)
"""Durations tried, in cells: in ratios of about √2, from one cell to nearly the record."""
FINE_PLACES = 13
"""Begins, and ends, tried about the best of the coarse grid; a sixth of a cell apart."""
DIRECTION_SD = 0.02
"""Sd of the direction of gravity in the axes of a triad, rad: a bias of 0.02 g moves it by that much."""
NAME = "likelihood ratio of a level that moves and settles"
"""Name of the statistic in results."""


@dataclass(frozen=True)
class MountTilt(Extension):
    """A course from 0 to 1 between `begin` and `end`, in blocks."""

    cause = "attitude"
    effect = Attitude
    group = "slow part"
    tests = 2
    contained_in = ("telegraph",)
    repeats = 2
    meaning = (
        "the mount tilts for a while: gravity moves into an axis across it "
        "(in one axis alone, a bias that moves and settles looks the same)"
    )
    consequence = (
        "fix the mount; keep this stretch out of the fit, "
        "or the drift of its level is taken for that of the sensor"
    )
    begin: float
    end: float

    def columns(self, channel: Channel) -> FloatArray:
        """Return the course on the blocks, shape (M, 1)."""
        return _course(channel, self.begin, self.end)[:, None]

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:  # noqa: ARG002
        """Return zeros: elsewhere the level moves otherwise."""
        return np.zeros_like(self.columns(channel))

    def refit(self, fitted: FittedChannel, index: int) -> MountTilt:
        """Place begin and end again, with the noise that is left beside the course."""
        better = _placed(fitted, track_without(fitted, index).columns, self.begin, self.end)
        same = abs(better.begin - self.begin) + abs(better.end - self.end) < 1e-6 * fitted.channel.blocks
        return self if same else better

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> MountTilt:
        """Take the angle from the joint fit, its place from the grid of likely ones."""
        placed = _placed(fitted, track_without(fitted, index).columns, self.begin, self.end)
        factor = fitted.channel.scale / lever(fitted.channel)
        tilt = Value(factor * size.value, factor * size.lower, factor * size.upper, "rad")
        return replace(self, values={**placed.values, "tilt": tilt})

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Search an accelerometer axis for a level that moves and settles; None for other channels."""
        if lever(fitted.channel) == 0.0:
            return None
        blocks = fitted.channel.blocks
        knots = np.linspace(0.0, blocks, GRID_CELLS + 1)[1:-1]
        courses = _courses(fitted, fitted.track.columns, knots)
        best, crossings = (0.0, 0, 1), 0.0
        for duration in DURATIONS:
            p = np.arange(len(knots) - duration)
            square = courses.score[p, p + duration] ** 2
            at = int(np.argmax(square))
            best = max(best, (float(square[at]), at, at + duration))
            norm = np.sqrt(courses.product(p, p + duration, 0))
            with np.errstate(
                divide="ignore", invalid="ignore"
            ):  # courses within a stretch of motion are nothing
                beside = courses.product(p[:-1], p[:-1] + duration, 1) / (norm[:-1] * norm[1:])
            crossings += float(np.sum(np.arccos(np.clip(beside, -1.0, 1.0)))) / np.pi
        if best[0] < MIN_SQUARE_SCORE:
            return TestResult("attitude", 1.0, NO_GAIN, best[0], NAME)
        placed = _placed(fitted, fitted.track.columns, float(knots[best[1]]), float(knots[best[2]]))
        template = block_transform(placed.columns(fitted.channel), fitted.cleaned, fitted.track.singles)
        ratio = max(0.0, 2.0 * (fitted.refit(template).log_likelihood - fitted.fit.log_likelihood))
        chance = float(
            len(DURATIONS) * chi2_beyond(SLOW_RATIO_FACTOR * ratio, 1)
            + crossings * np.exp(-0.5 * SLOW_RATIO_FACTOR * ratio)
        )
        gain = 0.5 * ratio - float(np.log(blocks / 8.0)) - ALTERNATIVE_NATS - 0.25 * float(np.log(blocks))
        return TestResult("attitude", min(1.0, chance), gain, ratio, NAME, lambda: (placed,))


@dataclass(frozen=True)
class _Courses:
    """Scores of all courses between knots.

    Attributes
    ----------
    score : ndarray, shape (k, k)
        Normal deviate of the course from knot p to knot q > p; 0 elsewhere.
    covariance : ndarray, shape (k, k)
        Summed Gram matrix of the pieces.
    """

    score: FloatArray
    covariance: FloatArray

    def product(self, p: NDArray[np.intp], q: NDArray[np.intp], shift: int) -> FloatArray:
        """Return the inner products of courses p to q and (p, q) + `shift`, whitened."""
        c = self.covariance
        return np.asarray(c[q, q + shift] - c[p, q + shift] - c[q, p + shift] + c[p, p + shift])


def lever(channel: Channel) -> float:
    """Return how an axis at rest changes with a tilt, m/s² per rad; 0 where not to first order, or no accelerometer."""
    if channel.unit != "m/s^2" or abs(channel.level) > MAX_GRAVITY_SHARE * STANDARD_GRAVITY:
        return 0.0
    return float(np.sqrt(STANDARD_GRAVITY**2 - channel.level**2))


def _course(channel: Channel, begin: float, end: float) -> FloatArray:
    """Return the course between two places, in blocks, shape (M,)."""
    middle = np.arange(channel.blocks) + 0.5
    return np.asarray(np.clip((middle - begin) / max(end - begin, 1e-9), 0.0, 1.0))


def _courses(fitted: FittedChannel, known: FloatArray, knots: FloatArray) -> _Courses:
    """Score the courses between all knots, in blocks, beside known templates (K, q), at the noise as fitted."""
    channel, singles = fitted.channel, fitted.track.singles
    pieces = np.stack([(b - a) * _course(channel, a, b) for a, b in pairwise(knots)], axis=1)
    root = 1.0 / np.sqrt(fitted.fit.expected[:singles])
    basis, _ = np.linalg.qr(known * root[:, None])
    white = block_transform(pieces, fitted.cleaned, singles) * root[:, None]
    white = white - basis @ (basis.T @ white)
    target = fitted.track.grid.amplitude[:singles] * root
    total = np.concatenate(([0.0], np.cumsum(white.T @ (target - basis @ (basis.T @ target)))))
    covariance = np.pad(np.cumsum(np.cumsum(white.T @ white, axis=0), axis=1), ((1, 0), (1, 0)))
    p, q = np.triu_indices(len(knots), 1)
    score = np.zeros((len(knots), len(knots)))
    courses = _Courses(score, covariance)
    variance = courses.product(p, q, 0)
    usable = variance > 1e-4 * variance.max()
    score[p, q] = np.where(usable, (total[q] - total[p]) / np.sqrt(np.where(usable, variance, 1.0)), 0.0)
    return courses


def _placed(fitted: FittedChannel, known: FloatArray, begin: float, end: float) -> MountTilt:
    """Return the best course about one, with the begins and durations that lose less than χ²₂ at 95 %."""
    channel = fitted.channel
    cell = min(channel.blocks / GRID_CELLS, 0.5 * (end - begin)) + 1.0
    near = cell * np.linspace(-1.0, 1.0, FINE_PLACES)
    places = np.concatenate((begin + near, end + near))
    knots = np.unique(np.clip(places, 1.0, channel.blocks - 1.0))
    square = _courses(fitted, known, knots).score ** 2
    p, q = np.unravel_index(int(np.argmax(square)), square.shape)
    likely = np.nonzero(square > square[p, q] - 2.0 * REGION_NATS)
    step = 2.0 * cell / (FINE_PLACES - 1)
    first, duration = knots[likely[0]], knots[likely[1]] - knots[likely[0]]
    begun = channel.block * float(knots[p])
    ends = (channel.block * float(end) for end in (first.min() - step, first.max() + step))
    lengths = (knots[q] - knots[p], max(0.0, duration.min() - step), duration.max() + step)
    lasted = [channel.time(begun + channel.block * float(length)) - channel.time(begun) for length in lengths]
    values = {
        "start": Value.moment(channel, begun, *ends),
        "duration": Value(lasted[0], lasted[1], lasted[2], "s"),
    }
    return MountTilt(float(knots[p]), float(knots[q]), values=values)


def stretched(finals: Mapping[str, FittedChannel], limit: float) -> tuple[Unexplained, ...]:
    """Test against a tilt: whether the specific force of a triad changes its length where an axis shows one.

    The changes d of all three axes over the clearest course, each with its deviation s, must be across the mean
    force f: f·d/|f| is normal about −d²/2|f|. The direction of f is known as well as the biases are small.

    Parameters
    ----------
    finals : mapping of str to FittedChannel
        Final residuals by axis.
    limit : float
        Chance below which the length is not kept.
    """
    rest = triad(finals)
    tilts = [x for found in finals.values() for x in found.extensions if isinstance(x, MountTilt)]
    if rest is None or not tilts:
        return ()
    axes, level, norm = rest
    clearest = max(tilts, key=lambda x: abs(x.values["tilt"].value))
    moved = np.array([_moved(finals[axis], clearest) for axis in axes])
    along = level / norm
    change = float(np.linalg.norm(moved[:, 0]))
    longer = float(along @ moved[:, 0]) + 0.5 * change**2 / norm
    spread = float(np.hypot(np.linalg.norm(along * moved[:, 1]), DIRECTION_SD * change))
    chance = chi2_beyond((longer / spread) ** 2, 1)
    if chance >= limit:
        return ()
    start, duration = (clearest.values[k].value for k in ("start", "duration"))
    name = f"the level moves from {start:.6g} s on for {duration:.4g} s, and the specific force changes its length"
    return (Unexplained(name, tuple(axes), chance, about="slow part"),)


def _moved(fitted: FittedChannel, course: MountTilt) -> tuple[float, float]:
    """Return how far an axis moves over a course, its own if it has one, and the deviation, m/s².

    Twice the deviation of the fit: the slow noise that it rests on is itself an estimate.
    """
    own = next((i for i, x in enumerate(fitted.extensions) if isinstance(x, MountTilt)), None)
    fit, at = fitted.fit, -1
    if own is None:
        columns = course.columns(fitted.channel)
        fit = fitted.refit(block_transform(columns, fitted.cleaned, fitted.track.singles))
    else:
        at = first_column(fitted, own)
    sd = float(np.sqrt(fit.beta_covariance[at, at]))
    return float(fit.beta[at]) * fitted.channel.scale, 2.0 * sd * fitted.channel.scale
