"""One axis prepared for the search for causes: even samples without gaps, in units of its white noise.

The samples are cut into M blocks of L. Slow effects are seen on the blocks (their cosine coefficients),
fast ones on the samples. What was never measured (gaps, repeated samples) is filled with a straight line and noise,
and kept out of every test of the distribution.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.arrays import SAMPLES_AT_ONCE, BoolArray, FloatArray
from tuner.diagnosis.static.model.covariate import code_step, smoothed, typical_repeats
from tuner.types.records import DataError, Record

BLOCK_COUNT = 4096
"""Blocks that a record is cut into, within 5 %, where it has that many samples.

Chosen so that a transform of the blocks takes milliseconds while slow effects, cycles a record, are resolved.
"""
MAX_LOST_SHARE = 1e-3
"""Share of the samples, at the end, that may be left out for fast transforms; chosen as no loss of information."""
SLOW_PRIME = 11
"""Prime factor from which on transforms are slow; with one of 683 they take five times as long."""
DEEP_STOP_BAND = 0.15
"""Sd of eighth differences, as of white noise, ÷ scale below which a filter leaves some 50 dB less at high frequencies.

There what a transform leaks from the ends of a record, and arithmetic, would be all that whitened residuals show.
"""
FLOOR_STEP = 0.5
"""Step of the codes, ÷ scale, that such samples are given: rounding is a known white floor, scale²/48."""
ARITHMETIC_SD = 1e-9
"""Sd of what is left of a computed signal ÷ its own: arithmetic has no more digits."""
FIRST_SAMPLES = 4096
"""Samples that show that most signals are not computed."""
MIN_SAMPLES = 1024
"""Samples below which no test is made: too few for the spectrum bins and for asymptotic null distributions."""
GAP_NEIGHBOURS = 128
"""Samples on either side of a gap whose means are its levels: known to 0.09 white sds."""
CLOCK_KNOTS = 1024
"""Rows, about, whose times are those of a channel: clocks that wander do so over more than a thousandth of a log."""
MAX_GAP_SHARE = 0.02
"""Gap that is still bridged, as a share of the record; beyond, the longest stretch is taken.

Chosen so that what is filled in does not count in the slow noise.
"""


@dataclass(frozen=True)
class Channel:
    """Samples of one axis.

    Attributes
    ----------
    axis, unit : str
        Name, and unit of the samples before scaling.
    y : ndarray, shape (n,)
        Samples ÷ `scale`, less their median; n = M L. Empty where they were let go of.
    valid : ndarray of bool, shape (n,)
        Samples that were measured.
    scale : float
        Robust standard deviation of the differences ÷ √2, unit.
    level : float
        Median of the samples, unit.
    interval : float
        Sampling interval, s.
    clock : ndarray, shape (k, 2)
        Places of some samples, and their times, s; straight between.
    block : int
        Samples in a block, L.
    covariates : mapping of str to ndarray, shape (M,)
        Block means of further channels.
    quantizer_step, deadband : float
        Step of the codes and half-width of the dead band about zero, ÷ `scale`; 0 for none.
    interpolated : bool
        Whether law and spectrum of the samples are those of an interpolation, or of means of coarsely rounded samples.
    clipped, missing_codes : bool
        Whether rails, or codes of the converter that never come, make another law of the samples.
    """

    axis: str
    unit: str
    y: FloatArray
    valid: BoolArray
    scale: float
    level: float
    interval: float
    clock: FloatArray
    block: int
    covariates: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    quantizer_step: float = 0.0
    deadband: float = 0.0
    interpolated: bool = False
    clipped: bool = False
    missing_codes: bool = False

    def __len__(self) -> int:
        return len(self.valid)

    @property
    def blocks(self) -> int:
        """Number of blocks, M."""
        return len(self) // self.block

    @property
    def span(self) -> float:
        """Length, s."""
        return len(self) * self.interval

    @property
    def start(self) -> float:
        """Time of the first sample, s."""
        return self.time(0.0)

    def time(self, place: float) -> float:
        """Return the time of a sample, or of a place between two, s."""
        return float(self.times(place))

    def times(self, places: ArrayLike) -> FloatArray:
        """Return the times of samples, s."""
        return _straight(places, self.clock[:, 0], self.clock[:, 1], self.interval)

    def place(self, time: float) -> float:
        """Return the place of a time, s, among the samples."""
        return float(_straight(time, self.clock[:, 1], self.clock[:, 0], 1.0 / self.interval))

    @property
    def without_samples(self) -> Channel:
        """The same without the samples, which another copy of the channel has."""
        return replace(self, y=np.empty(0))

    @property
    def block_time(self) -> FloatArray:
        """Time of the middle of each block since the first sample, s, shape (M,)."""
        return np.asarray((np.arange(self.blocks) + 0.5) * self.block * self.interval, dtype=float)

    @cached_property
    def empty(self) -> BoolArray:
        """Blocks without any valid sample, shape (M,)."""
        return np.asarray(~self.valid.reshape(self.blocks, self.block).any(axis=1), dtype=bool)

    def block_mean(self, x: FloatArray) -> FloatArray:
        """Return the means of n values over the blocks, shape (M,)."""
        return np.asarray(x.reshape(self.blocks, self.block).mean(axis=1), dtype=float)

    def bridged(self, columns: FloatArray) -> FloatArray:
        """Return templates on the blocks, shape (M, p), filled as the samples are in blocks that have none."""
        return bridged(columns, self.empty, -(-GAP_NEIGHBOURS // self.block))

    def part(self, first: int, last: int) -> Channel | None:
        """Return samples first … last − 1 as a channel of their own, or None where they are too few."""
        length = last - first
        if length < MIN_SAMPLES:
            return None
        block, length = _cut(length)
        coarse = {
            name: np.interp(
                (first + (np.arange(length // block) + 0.5) * block) * self.interval, self.block_time, values
            )
            for name, values in self.covariates.items()
        }
        inside = slice(first, first + length)
        return replace(
            self, y=self.y[inside], valid=self.valid[inside], clock=self.clock - (first, 0.0), block=block,
            covariates=MappingProxyType(coarse),
        )  # fmt: skip

    def refilled(self, missing: BoolArray, rng: np.random.Generator) -> Channel:
        """Return the channel with further samples taken out and filled, shape (n,)."""
        return replace(
            self, y=fill(self.y, missing, 1.0, rng), valid=np.asarray(self.valid & ~missing, dtype=bool)
        )


def channel(
    record: Record,
    axis: str,
    *,
    quantizer_step: float = 0.0,
    repeated: BoolArray | None = None,
    seed: int = 0,
) -> Channel:
    """Return an axis of a record as an even channel without gaps, scaled by its white noise.

    Parameters
    ----------
    record : Record
        Samples; short gaps are bridged, the longest stretch between long ones is taken.
    axis : str
        One of its axes.
    quantizer_step : float
        Step of the codes, unit.
    repeated : ndarray of bool, shape (n,), optional
        Samples that repeat the one before: not measured.
    seed : int
        Seed of the noise that fills gaps.

    Raises
    ------
    DataError
        A channel that is too short, constant, or a computed sinusoid.
    """
    chosen = _without_long_gaps(record)
    first, begins = chosen[0][0], _places(record, chosen)
    n = begins[-1] + chosen[-1][1] - chosen[-1][0]
    if n < MIN_SAMPLES:
        raise DataError(
            f"{record.source or record.name}: {axis} has {n} samples, expected {MIN_SAMPLES} or more; record longer"
        )
    block, n = _cut(n)
    place: slice | NDArray[np.int64] = slice(0, n)
    source: slice | NDArray[np.int64] = slice(first, first + n)
    if len(chosen) > 1 or repeated is not None:
        place = np.concatenate([p + np.arange(b - a) for p, (a, b) in zip(begins, chosen, strict=True)])
        source = np.concatenate([np.arange(*piece) for piece in chosen])
        keep = place < n
        if repeated is not None:
            keep &= ~repeated[source]
        place, source = place[keep], source[keep]
    column = record.column(axis)
    measured = column[source]
    level, scale = float(np.median(measured)), difference_sd(measured)
    if not scale > 0:
        raise DataError(f"{record.source or record.name}: {axis} is constant, expected noise; leave it out")
    cycles = computed(measured)
    if cycles is not None:
        what = f"a sinusoid of {cycles / record.interval:.6g} Hz" if cycles > 0.0 else "a straight line"
        raise DataError(
            f"{record.source or record.name}: {axis} is {what} without any noise, expected noise; leave it out"
        )
    noise = np.random.default_rng((seed, 77))
    if _sd_of_eighth_differences(measured) < DEEP_STOP_BAND * scale * float(np.sqrt(12870.0)):  # Σ C(8, k)²
        quantizer_step = max(quantizer_step, FLOOR_STEP * scale)
        measured = measured + FLOOR_STEP * scale * noise.uniform(-0.5, 0.5, len(measured))
    valid = np.zeros(n, dtype=bool)
    valid[place] = True
    scaled = measured - level
    scaled /= scale
    y = scaled
    if not isinstance(place, slice):
        y = np.zeros(n)
        y[place] = scaled
        y = fill(y, ~valid, 1.0, noise)
    covariates = {
        name: smoothed(
            (values[source] if isinstance(place, slice) else np.interp(np.arange(n), place, values[source]))
            .reshape(-1, block)
            .mean(axis=1),
            code_step(values),
            -(-typical_repeats(values) // block),
        )
        for name, values in record.covariates.items()
        if np.all(np.isfinite(values)) and np.ptp(values) > 0
    }
    return Channel(
        axis, record.unit, y, valid, scale, level, record.interval, _clock(record, chosen, begins), block,
        MappingProxyType(covariates), quantizer_step / scale,
    )  # fmt: skip


def _straight(x: ArrayLike, at: FloatArray, values: FloatArray, slope: float) -> FloatArray:
    """Return values at x: straight between those given, shape (k,), and of this slope beyond."""
    inside = np.clip(x, at[0], at[-1])
    return np.asarray(np.interp(inside, at, values) + slope * (x - inside))


def computed(y: FloatArray) -> float | None:
    """Return the cycles a sample of a sinusoid, 0 of a straight line, that samples (n,) are but for digits; else None.

    The differences d of one obey d_(k+1) + d_(k−1) = 2 cos(2πf) d_k. What the first samples miss by more than that
    lets all of them miss it.
    """
    d = np.diff(y[:FIRST_SAMPLES])
    middle, both = d[1:-1] - d[1:-1].mean(), d[2:] + d[:-2]
    both -= both.mean()
    left = both - float(middle @ both) / max(float(middle @ middle), np.finfo(float).tiny) * middle
    if np.sqrt(float(left @ left) / len(y)) > ARITHMETIC_SD * float(np.ptp(y)):
        return None
    d = np.diff(y)
    middle, both = d[1:-1], d[2:] + d[:-2]
    twice = float(middle @ both) / float(middle @ middle)
    left = both - twice * middle
    if float(np.std(left)) > ARITHMETIC_SD * float(np.std(y)):
        return None
    cycles = float(np.arccos(np.clip(0.5 * twice, -1.0, 1.0))) / (2.0 * np.pi)
    return cycles if cycles * len(y) > 0.01 else 0.0


def _cut(n: int) -> tuple[int, int]:
    """Return the length of a block and how many samples are kept, out of n: all but a few, of small prime factors."""
    block = n / BLOCK_COUNT
    lengths = range(max(1, round(0.95 * block)), max(1, round(1.05 * block)) + 1)
    tried = [
        (size, m)
        for size in lengths
        for m in range(n // size, -int(-n * (1.0 - MAX_LOST_SHARE) // size) - 1, -1)
    ]
    size, m = min(
        tried,
        key=lambda cut: (max(_largest_prime(cut[0]), _largest_prime(cut[1]), SLOW_PRIME), -cut[0] * cut[1]),
    )
    return size, size * m


def _largest_prime(n: int) -> int:
    """Return the largest prime factor of a number."""
    factor = 2
    while factor * factor <= n:
        factor, n = (factor, n // factor) if n % factor == 0 else (factor + 1, n)
    return n


def difference_sd(x: FloatArray) -> float:
    """Return the standard deviation of the white part: by the differences, median of short blocks."""
    size = min(256, len(x) - 1)
    rows = (len(x) - 1) // size
    at_once = max(1, SAMPLES_AT_ONCE // size)

    def squares() -> Iterator[FloatArray]:
        for row in range(0, rows, at_once):
            stop = min(row + at_once, rows)
            yield (np.diff(x[row * size : stop * size + 1]) ** 2).reshape(-1, size)

    typical = float(np.median(np.concatenate([part.mean(axis=1) for part in squares()])))
    capped = np.concatenate([np.minimum(part, 25.0 * typical).mean(axis=1) for part in squares()])
    return float(np.sqrt(0.5 * (np.median(capped) or capped.mean())))


def _sd_of_eighth_differences(x: FloatArray) -> float:
    """Return the sd of the differences of differences … of samples (n,), eight times."""
    total, square, count = 0.0, 0.0, len(x) - 8
    for start in range(0, count, SAMPLES_AT_ONCE):
        part = np.diff(x[start : start + SAMPLES_AT_ONCE + 8], 8)
        total, square = total + float(part.sum()), square + float(part @ part)
    return float(np.sqrt(max(square / count - (total / count) ** 2, 0.0)))


def fill(y: FloatArray, missing: BoolArray, sd: float, rng: np.random.Generator) -> FloatArray:
    """Return samples whose missing ones are replaced by lines between the levels beside them (`bridged`), plus noise.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Samples.
    missing : ndarray of bool, shape (n,)
        Those to be replaced.
    sd : float
        Standard deviation of the noise.
    rng : numpy.random.Generator
        Its source.
    """
    if not np.any(missing):
        return y
    out = bridged(y, missing, GAP_NEIGHBOURS)
    out[missing] += sd * rng.standard_normal(int(missing.sum()))
    return out


def bridged(y: FloatArray, missing: BoolArray, width: int) -> FloatArray:
    """Return values, shape (n,) or (n, p), whose missing ones are on lines between the means of `width` others beside.

    Before the first and after the last of the others the lines are level.
    """
    good, lost = np.flatnonzero(~missing), np.flatnonzero(missing)
    if not len(lost) or not len(good):
        return y
    total = np.concatenate((np.zeros_like(y[:1]), np.cumsum(y[good], axis=0)))
    right = np.searchsorted(good, lost)
    before, after = np.maximum(right - width, 0), np.minimum(right + width, len(good))
    beyond = (lost - good[np.maximum(right - 1, 0)], good[np.minimum(right, len(good) - 1)] - lost)
    share = beyond[0] / np.maximum(beyond[0] + beyond[1], 1)
    share = np.where(right == 0, 1.0, np.where(right == len(good), 0.0, share))
    weights = ((1.0 - share) / np.maximum(right - before, 1), share / np.maximum(after - right, 1))
    shape = (len(lost), *(1,) * (y.ndim - 1))
    left, other = (weight.reshape(shape) for weight in weights)
    out = y.copy()
    out[lost] = left * (total[right] - total[before]) + other * (total[after] - total[right])
    return out


def _places(record: Record, pieces: Sequence[tuple[int, int]]) -> list[int]:
    """Return the place of the first sample of each segment on the even grid that begins with the first one."""
    places = [0]
    for (a, b), (c, _) in pairwise(pieces):
        places.append(places[-1] + b - 1 - a + round((record.t[c] - record.t[b - 1]) / record.interval))
    return places


def _clock(record: Record, pieces: Sequence[tuple[int, int]], begins: Sequence[int]) -> FloatArray:
    """Return places and times of the ends of segments and of rows between, shape (k, 2)."""
    spacing = max(sum(b - a for a, b in pieces) // CLOCK_KNOTS, 1)
    knots = []
    for place, (a, b) in zip(begins, pieces, strict=True):
        rows = np.append(np.arange(a, b - 1, spacing), b - 1)
        knots.append(np.column_stack([place + rows - a, record.t[rows]]))
    return np.concatenate(knots)


def _without_long_gaps(record: Record) -> list[tuple[int, int]]:
    """Return the segments of the longest stretch that no long gap interrupts."""
    pieces = [piece for piece in record.segments if piece[1] > piece[0]]
    longest = MAX_GAP_SHARE * (record.t[-1] - record.t[0])
    groups: list[list[tuple[int, int]]] = [[pieces[0]]]
    for before, piece in pairwise(pieces):
        gap = record.t[piece[0]] - record.t[before[1] - 1]
        if gap > longest or gap < 0.5 * record.interval:
            groups.append([])
        groups[-1].append(piece)
    return max(groups, key=lambda group: sum(stop - start for start, stop in group))
