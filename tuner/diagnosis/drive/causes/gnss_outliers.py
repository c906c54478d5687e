"""Outliers among GNSS fixes: wrong positions (`gnss_outliers`) and velocities that contradict them (`gnss_velocity`).

A block is the position or the velocity of one fix. Its deleted residual, the difference from what all other rows
before and after it predict, corrected for all accepted constants, shows which of several neighbours is wrong; its
square is q ~ χ²₃. Dividing by a robust scale, median q ÷ median χ², keeps a wrong R from causing a detection.

*Masking.* Velocities far from what positions and inertial unit alone predict are left out first, since there may be
more wrong than right ones; then all blocks with n P(χ² > q) < `EXPECTED_FALSE_OUTLIERS` at once. Blocks that agree
with the rest once they are left out are taken back, and in each round the worst remaining block of every
neighbourhood follows.

*Test.* On the blocks of one kind, the outliers of the other kind left out: the largest q, exact for n blocks, and the
count beyond the 10⁻³ quantile, Poisson; twice the smaller probability.

*Gain.* Likelihood of the mixture (1−ε) N(0, S) + ε N(0, κ² S), with ε and κ from the blocks left out, over that of
the hypothesis without outliers on the same rows; less ln n for ε and κ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.stats import beta, chi2, poisson

from models.arrays import BoolArray, FloatArray
from models.effects.drive.gnss import GnssOutliers as OutlierEffect
from models.effects.drive.gnss_velocity import GnssVelocity as VelocityEffect
from tuner.diagnosis.drive.cause_test import CauseTest, not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate, evaluate_with_gradient
from tuner.linear_run.linearized_run import LinearizedRun
from tuner.types import Coefficient

ROWS_OF_CAUSE = {"gnss_outliers": slice(0, 3), "gnss_velocity": slice(3, 6)}
"""Rows of a block, by the cause that its outliers have."""
UNITS = {"gnss_outliers": "m", "gnss_velocity": "m/s"}
"""SI unit of the error of a block."""
EXPECTED_FALSE_OUTLIERS = 0.05
"""Expected number of good blocks that are left out; chosen so that 19 of 20 clean drives keep all."""
TAIL_PROBABILITY = 1e-3
"""P-value of a block below which blocks are counted: of thousands of good blocks a few lie beyond."""
NEIGHBOUR_FIXES = 5
"""Fixes on either side among which only the worst block is left out in one round.

An outlier enlarges the deleted residuals of its neighbours; chosen so that these are judged without it.
"""
MAX_ROUNDS = 12
"""Largest number of rounds of leaving blocks out; chosen to bound the time."""


@dataclass(frozen=True)
class Mask:
    """Blocks that are left out, and the deleted residuals of all.

    Attributes
    ----------
    out : ndarray of bool, shape (k, 2)
        Position and velocity blocks that are left out.
    deleted : ndarray, shape (k, 6)
        Deleted residual of every row, given all rows that are left, by its sd.
    left : NoiseHypothesis
        Without the blocks that are left out.
    """

    out: BoolArray
    deleted: FloatArray
    left: NoiseHypothesis

    def rows(self, noise: NoiseHypothesis) -> BoolArray:
        """Return the rows that are left, shape (k, 6)."""
        return noise.rows & ~np.repeat(self.out, 3, axis=1)


def mask(noise: NoiseHypothesis) -> Mask:
    """Return which blocks are outliers, as the module describes."""
    linearized = noise.linearized
    tried = _testable_rows(noise)
    whole = replace(noise, rows=noise.rows | tried, linearized=_all_fixes_scored(linearized))
    out = np.zeros((len(linearized.t), 2), dtype=bool)
    limit = np.log(EXPECTED_FALSE_OUTLIERS / max(int(np.count_nonzero(tried[:, ::3])), 1))
    alone = whole.rows.copy()
    alone[:, 3:] = False
    if alone[:, :3].any():
        deleted = _deleted_residuals(replace(whole, rows=alone))
        out[:, 1] = log_p_values(deleted, tried, 1, scaled=False) < limit
    deleted = _deleted_residuals(_without(whole, out))
    for n in range(MAX_ROUNDS):
        chance = np.stack([log_p_values(deleted, tried, block) for block in range(2)], axis=1)
        again = chance < limit
        if n:
            worst = minimum_filter1d(np.where(out, 0.0, chance).min(axis=1), 2 * NEIGHBOUR_FIXES + 1)
            again &= out | (chance <= worst[:, None])
        if np.array_equal(again, out):
            break
        out = again
        deleted = _deleted_residuals(_without(whole, out))
    return Mask(out, deleted, _without(replace(noise, rows=noise.rows | tried), out))


def _without(noise: NoiseHypothesis, out: BoolArray) -> NoiseHypothesis:
    """Return the hypothesis without blocks (k, 2)."""
    return replace(noise, rows=noise.rows & ~np.repeat(out, 3, axis=1))


def _deleted_residuals(noise: NoiseHypothesis) -> FloatArray:
    """Return the residual of every row given all others, by its sd, shape (k, 6)."""
    return evaluate_with_gradient(noise)[1].deleted


def _all_fixes_scored(linearized: LinearizedRun) -> LinearizedRun:
    return replace(linearized, scored=np.ones(len(linearized.t), dtype=bool))


def _testable_rows(noise: NoiseHypothesis) -> BoolArray:
    """Return the rows that may be outliers: all that count, and those that the filter itself rejected."""
    linearized = noise.linearized
    return linearized.available & linearized.scored[:, None] & (noise.rows | ~linearized.used)


def log_p_values(deleted: FloatArray, tried: BoolArray, block: int, *, scaled: bool = True) -> FloatArray:
    """Return ln P(χ² > q) of all blocks of a kind, q divided by its robust scale where `scaled`, shape (k,).

    Parameters
    ----------
    deleted : ndarray, shape (k, 6)
        Deleted residuals by their sds.
    tried : ndarray of bool, shape (k, 6)
        Rows that count.
    block : int
        0 position, 1 velocity.
    scaled : bool
        Whether to divide by the robust scale.
    """
    at = slice(3 * block, 3 * block + 3)
    q = np.sum(np.where(tried[:, at], deleted[:, at], 0.0) ** 2, axis=1)
    freedom = np.count_nonzero(tried[:, at], axis=1)
    have = freedom > 0
    if not have.any():
        return np.zeros(len(q))
    scale = float(np.median(q[have] / chi2.median(freedom[have]))) if scaled else 1.0
    return np.where(have, chi2.logsf(q / scale, np.maximum(freedom, 1)), 0.0)


def outliers(noise: NoiseHypothesis, masked: Mask, cause: str) -> CauseTest:
    """Test the blocks of one kind for outliers.

    Parameters
    ----------
    noise : NoiseHypothesis
        Before the test.
    masked : Mask
        Of this hypothesis.
    cause : str
        ``gnss_outliers`` or ``gnss_velocity``.
    """
    title = "least chance of a fix" if cause == "gnss_outliers" else "least chance of a velocity fix"
    block = list(ROWS_OF_CAUSE).index(cause)
    tried = _testable_rows(noise)
    n = int(np.count_nonzero(tried[:, 3 * block]))
    if not n:
        return not_significant(cause, noise, 1.0, 1.0, title)
    deleted = masked.deleted
    if masked.out[:, block].any():
        others = masked.out.copy()
        others[:, block] = False
        whole = replace(noise, rows=noise.rows | tried, linearized=_all_fixes_scored(noise.linearized))
        deleted = _deleted_residuals(_without(whole, others))
    chance = np.exp(log_p_values(deleted, tried, block))
    least = float(chance.min())
    count = int(np.count_nonzero(chance < TAIL_PROBABILITY))
    p_value = min(
        1.0, 2.0 * min(-np.expm1(n * np.log1p(-min(least, 0.5))), poisson.sf(count - 1, n * TAIL_PROBABILITY))
    )
    out = masked.out[:, block]
    if not out.any():
        return not_significant(cause, noise, p_value, least, title)
    rows = noise.rows.copy()
    rows[:, ROWS_OF_CAUSE[cause]] &= ~out[:, None]
    without = replace(noise, rows=rows)
    dropped = noise.counted & ~without.counted
    gain = contamination(noise, without, dropped) if dropped.any() else 0.0
    result = TestResult(cause, float(p_value), gain, least, title)
    return CauseTest(result, without, lambda: _coefficients(masked, cause, n))


def contamination(noise: NoiseHypothesis, others: NoiseHypothesis, deleted: BoolArray) -> float:
    """Return the log likelihood gain of the mixture over one normal distribution, nats, less ln n.

    Parameters
    ----------
    noise, others : NoiseHypothesis
        With all rows, and without the outliers.
    deleted : ndarray of bool, shape (k, 6)
        Rows of the outliers.
    """
    likelihood = evaluate(others)
    n, m = int(np.count_nonzero(noise.counted)) / 3.0, int(np.count_nonzero(deleted)) / 3.0
    square = float(np.sum(likelihood.white[deleted] ** 2))
    spread = square / (3.0 * m)
    outside = -0.5 * float(np.sum(np.log(2.0 * np.pi * spread * likelihood.variance[deleted]))) - 1.5 * m
    share = m * np.log(m / n) + (n - m) * np.log1p(-m / n) if m < n else 0.0
    return likelihood.value + outside + float(share) - evaluate(noise).value - float(np.log(n))


def _coefficients(masked: Mask, cause: str, n: int) -> Mapping[str, Coefficient]:
    block = list(ROWS_OF_CAUSE).index(cause)
    out = masked.out[:, block]
    m = int(np.count_nonzero(out))
    low = float(beta.ppf(0.025, m, n - m + 1)) if m else 0.0
    high = float(beta.ppf(0.975, m + 1, n - m)) if m < n else 1.0
    fraction = Coefficient.known(m / n, low, high, "1")
    runs = int(np.count_nonzero(np.diff(out.astype(int), prepend=0) == 1))
    length = Coefficient(m / max(runs, 1), None, None, "1", "fixes in a row")
    deleted = evaluate(masked.left).innovation[out, ROWS_OF_CAUSE[cause]]
    rms = float(np.sqrt(np.mean(np.sum(np.nan_to_num(deleted) ** 2, axis=1)))) if m else 0.0
    spread = np.sqrt(3.0 * m / chi2.ppf((0.975, 0.025), max(3 * m, 1)))
    size = Coefficient.known(rms, rms * float(spread[0]), rms * float(spread[1]), UNITS[cause])
    return {"fraction": fraction, "rms": size, "run_length": length}


class SingleFixCause(NoiseCause):
    """A cause of wrong positions or velocities of single fixes."""

    channels = ("gnss",)
    of_single_fixes = True

    @classmethod
    def accepted(cls, run: FilterRun, test: CauseTest) -> Hypothesis:
        """Return the hypothesis of a run without the fixes that are outliers."""
        linearized, noise, was = run.linearized, test.noise, run.hypothesis
        dropped = linearized.available & linearized.scored[:, None] & ~noise.rows
        position, velocity = was.position_out.copy(), was.velocity_out.copy()
        position[run.index[dropped[:, :3].any(axis=1)]] = True
        velocity[run.index[dropped[:, 3:].any(axis=1)]] = True
        return replace(super().accepted(run, test), position_out=position, velocity_out=velocity)


class GnssOutliers(SingleFixCause):
    """Positions that are far off."""

    cause = "gnss_outliers"
    effect = OutlierEffect
    meaning = "some positions are far off, a share of {fraction}, by {rms}"
    consequence = "keep the gate; leave these fixes out"
    view = "positions"

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:  # noqa: ARG003
        """Test positions and velocities; where both are significant they share one noise hypothesis."""
        linearized = noise.linearized
        every = replace(noise, rows=noise.rows | (linearized.available & linearized.scored[:, None]))
        masked = mask(every)
        tests = tuple(outliers(every, masked, cause) for cause in ROWS_OF_CAUSE)
        if all(one.is_significant(threshold) for one in tests):
            both = replace(every, rows=masked.rows(every))
            tests = tuple(replace(one, noise=both) for one in tests)
        return tests

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis with the positions of the first one."""
        return replace(final, position_out=base.position_out)


class GnssVelocity(SingleFixCause):
    """Velocities that contradict positions and inertial unit."""

    cause = "gnss_velocity"
    effect = VelocityEffect
    meaning = "some velocities contradict positions and inertial unit, a share of {fraction}, by {rms}"
    consequence = "do not use velocities of such fixes"
    view = "velocities"
    tested_with = "gnss_outliers"

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis with the velocities of the first one."""
        return replace(final, velocity_out=base.velocity_out)
