"""Simulated records of the papers, and statistics over many of them with their intervals."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from models.arrays import FloatArray
from models.noise import NoiseModel, Term
from tuner.stages import counted
from tuner.types import LEVEL, Coefficient
from tuner.types.records import Record

Advance = Callable[[int, int], None]
"""Called with (done, total)."""

MAX_GROUPS = 50
"""Largest number of groups of runs, left out in turn for the interval of a statistic (delete-a-group jackknife)."""


@dataclass(frozen=True)
class Settings:
    """How an item is run: the seed of all randomness, whether a small version will do."""

    seed: int = 0
    small: bool = False

    def rng(self, purpose: str) -> np.random.Generator:
        """Return a stream of its own for a purpose, whatever else is run."""
        return np.random.default_rng((self.seed, zlib.crc32(purpose.encode())))

    def size(self, full: int, small: int) -> int:
        """Return the number of samples or runs."""
        return small if self.small else full

    def steps(self, count: int) -> Iterator[int]:
        """Yield 0 … count − 1 and tell of each that is done."""
        yield from counted(range(count))


def record_of(
    model: NoiseModel | Term,
    n: int,
    interval: float,
    rng: np.random.Generator,
    *,
    axes: tuple[str, ...] = ("gyro_x",),
) -> Record:
    """Return a record of independent axes with one noise, n samples each."""
    y = np.empty((n, len(axes)), order="F")
    for j in range(len(axes)):
        y[:, j] = model.sample(n, interval, rng)
    return record_from(y, interval, axes=axes)


def record_from(
    y: FloatArray, interval: float, *, axes: tuple[str, ...] = ("gyro_x",), unit: str = "rad/s"
) -> Record:
    """Return samples y, shape (n,) or (n, k), as a gap-free record."""
    return Record(
        "gyro", np.arange(len(y), dtype=np.float64) * interval, y, axes, unit, interval, source="simulated"
    )


def realisations(model: NoiseModel | Term, n: int, runs: int, rng: np.random.Generator) -> FloatArray:
    """Return independent series one second apart, shape (n, runs)."""
    return np.stack([model.sample(n, 1.0, rng) for _ in range(runs)], axis=1)


def estimate(runs: FloatArray, statistic: Callable[[FloatArray], float | np.floating]) -> Coefficient:
    """Return a statistic, a ratio, of independent runs with its jackknife interval.

    Parameters
    ----------
    runs : ndarray, shape (m,) or (m, k)
        One row a run.
    statistic : callable
        Smooth function of all rows.

    Notes
    -----
    The rows are cut into g groups, each left out in turn; with θ_i the statistic without group i, the
    variance is (g − 1)/g Σ (θ_i − θ̄)², judged by Student's t with g − 1 degrees of freedom.
    """
    value = float(statistic(runs))
    groups = min(MAX_GROUPS, len(runs))
    label = np.arange(len(runs)) * groups // len(runs)
    without = np.array([float(statistic(runs[label != g])) for g in range(groups)])
    sd = np.sqrt((groups - 1) / groups * np.sum((without - without.mean()) ** 2))
    reach = float(student.isf(0.5 * (1.0 - LEVEL), groups - 1) * sd)
    return Coefficient.known(value, value - reach, value + reach, "1")


def scatter(
    runs: FloatArray,
    statistic: Callable[[FloatArray], float | np.floating],
    size: int,
    rng: np.random.Generator,
    sets: int = 1000,
) -> tuple[float, float]:
    """Return the range of a statistic of `size` runs: 95 % of the sets drawn from all runs lie in it."""
    found = [float(statistic(runs[rng.integers(len(runs), size=size)])) for _ in range(sets)]
    low, high = np.quantile(found, [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)])
    return float(low), float(high)


def ratio_of_means(pair: FloatArray) -> float:
    """Return mean of the first column ÷ mean of the second."""
    return float(pair[:, 0].mean() / pair[:, 1].mean())


def relative_sd(values: FloatArray) -> float:
    """Return standard deviation ÷ mean."""
    return float(np.std(values, ddof=1) / np.mean(values))


def scaled(coefficient: Coefficient, factor: float, unit: str) -> Coefficient:
    """Return a coefficient in another unit (or divided by its true value)."""

    def times(x: float | None) -> float | None:
        return None if x is None else x * factor

    interval = coefficient.interval and (coefficient.interval[0] * factor, coefficient.interval[1] * factor)
    return Coefficient(times(coefficient.value), interval, times(coefficient.upper), unit, coefficient.reason)


def mean_of(found: Sequence[Coefficient]) -> Coefficient:
    """Return the mean of independent estimates of one quantity.

    Raises
    ------
    ValueError
        If one of them has no interval.
    """
    values = [c.value for c in found if c.value is not None and c.interval is not None]
    half = [0.5 * (c.interval[1] - c.interval[0]) for c in found if c.interval is not None]
    if not found or len(values) < len(found):
        raise ValueError(f"'found' must all have values with intervals, got {list(found)}")
    value, reach = float(np.mean(values)), float(np.linalg.norm(half)) / len(found)
    return Coefficient.known(value, value - reach, value + reach, found[0].unit)


def share_of(hits: NDArray[np.bool_]) -> Coefficient:
    """Return the share of runs that are True, with Wilson's interval."""
    n, z = len(hits), float(norm.isf(0.5 * (1.0 - LEVEL)))
    share = float(np.mean(hits))
    centre = (share + z**2 / (2.0 * n)) / (1.0 + z**2 / n)
    reach = z / (1.0 + z**2 / n) * float(np.sqrt(share * (1.0 - share) / n + z**2 / (4.0 * n**2)))
    low, high = max(0.0, min(share, centre - reach)), min(1.0, max(share, centre + reach))
    return Coefficient.known(share, low, high, "1")
