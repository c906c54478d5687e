"""Stationary parts of a log: motion is variance on all channels at once, or a rate that no bias can have.

A log is cut into blocks of about a second. With v_bj the variance of block b on channel j (of all records on one
clock), and q_j its lower quartile over the blocks, block b moved if

    T_b = exp( ½ mean_j ln(v_bj / q_j) )  >  1.5 c(k, p)

A still sensor's block variance scatters most where the noise wanders within a block (pure random walk: flicker and
white noise scatter less). Then v is the variance of a Brownian bridge of free mean, Σ λ_i χ²_1 with λ_i = 1/(iπ)²:
lower quartile 0.0701, upper tail exp(-π² v/2). All k channels must be large at once for T to be, so that

    c(k, p) = √( 2 ln(1/p) / (0.0701 π² k) ),    p = `FALSE_ALARM_PROBABILITY` ÷ number of blocks

The factor 1.5 leaves room for a noise level that changes while the sensor stands still. One channel alone is not
motion (a bias step, a burst of one axis) unless it is unmistakable: a gyroscope whose block mean is 0.1 rad/s off its
median, or leaves its level by more than any does at rest and is back within half a minute, or a block sd of more than
0.1 rad/s or 1 m/s² and ten times its usual one. Blocks beside a moving one count as moving too. Where a quarter of the
log is not at rest, as its means or a far quieter stretch show, the quietest eight adjoining blocks take the place of
the lower quartile.

Shorter motions are found in `knocks`, what settles beside a motion in `settling`. Knocks after which the level is the
same are no end of a stand-still (`knock_bridges`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from models.arrays import BoolArray, FloatArray, IntArray
from models.robust import normal_sd
from tuner.formats.customary_units import percent, stamp
from tuner.readers.unit_evidence import LARGEST_CHANGE, MIN_BLOCK_SAMPLES
from tuner.segments.block_moments import block_moments
from tuner.segments.knock_bridges import bridge_knocks
from tuner.segments.knocks import knocked
from tuner.segments.stand_stills import MIN_PART_SECONDS, alike, inside, runs, stand_stills
from tuner.types.records import DataError, Record

Segments = tuple[tuple[int, int], ...]

FALSE_ALARM_PROBABILITY = 1e-3
"""Probability that a record of a still sensor shows any motion."""
_LEVEL_MARGIN = 1.5
"""Factor for a noise level that changes while the sensor is at rest."""
_BRIDGE_QUARTILE = 0.0701
"""Lower quartile of the variance of a Brownian bridge of free mean, of unit density."""
_QUARTER_OVER_QUIETEST = 2.0
"""Sd of the lower quartile ÷ that of the quietest eight blocks, from which a quarter of the log is not at rest: it is
below 1.1 for white noise, 1.3 for a random walk, 1.5 where the noise level changes."""
_OVER_WHITE_NOISE = 2.0
"""Change of the mean ÷ that of white noise with the scatter of the samples, from which it is motion: sensors at rest
show 1.0 to 1.4, moving ones 5 to 10; white noise alone, however large, is another unit."""
_BLOCK_SECONDS = 1.0
"""Length of a block, s: the shortest movement of a hand."""
_MIN_BLOCKS = 8
"""Fewest blocks of a record, and fewest samples of a block, whose variances can be compared."""
_CERTAIN_MOTION = {"rad/s": 0.1, "m/s^2": 1.0}
"""Change of the mean rate, or sd within a block, that is motion on one channel alone; by unit."""

_LONGEST_TURN = 30
"""Blocks of a rotation that is seen by the level before and after it; longer ones are seen by their size alone."""
_RARE_SDS = 8.0
"""Sds of what the mean of a block differs from the level about it, by noise, that none of a million exceeds."""


@dataclass(frozen=True)
class Motion:
    """When a sensor moved.

    Attributes
    ----------
    still, moving : tuple of (start, stop)
        Sample ranges; together they are the segments of the record.
    episodes : tuple of (float, float)
        Start (s, on the record's clock) and duration (s) of each motion.
    share : float
        Share of the samples that moved, knocks not counted.
    knocks : tuple of (start, stop)
        Sample ranges within those at rest of short motions after which the level is the same.
    """

    still: Segments
    moving: Segments
    episodes: tuple[tuple[float, float], ...]
    share: float
    knocks: Segments = ()

    def describe(self) -> str | None:
        """Return one line about the motion, times on the record's clock, or None without any."""
        if not self.episodes:
            return None
        shown = _episodes_text(self.episodes)
        return f"the sensor moved in {percent(self.share, 3)} of the log: {shown} (times of its clock)"


def find_motion(records: Record | Sequence[Record]) -> Motion:
    """Find when a sensor moved, from all channels of records on one clock.

    Parameters
    ----------
    records : Record or sequence of Record
        A gyro record, an accel record or both, with the same time and segments.

    Raises
    ------
    DataError
        Fewer than eight blocks: too short to tell noise from motion.
    """
    together = (records,) if isinstance(records, Record) else tuple(records)
    first = together[0]
    bounds = _blocks(first)
    if len(bounds) < _MIN_BLOCKS:
        raise DataError(
            f"{first.source}: {first.span:.3g} s are too short to tell motion from noise: record longer"
        )
    moments = [_moments(record, bounds) for record in together]
    rounding = [_rounding_variance(record) for record in together]
    usual = [
        np.maximum(np.quantile(v, 0.25, axis=0), step) for (_, v), step in zip(moments, rounding, strict=True)
    ]
    moved = _moving_blocks(together, bounds, moments, usual)
    quietest = _quietest([v for _, v in moments], rounding)
    noisier = np.mean(0.5 * np.log(np.hstack(usual) / np.hstack(quietest)))
    steady = any(_steady_motion(record, _ranges(bounds, ~moved)) is not None for record in together)
    if steady or noisier > np.log(_QUARTER_OVER_QUIETEST):
        again = _moving_blocks(together, bounds, moments, quietest)
        rest = _ranges(bounds, ~again)
        if rest and all(_steady_motion(record, rest) is None for record in together):
            moved = again
    long = inside(len(first), _ranges(bounds, moved))
    parts, knocks = stand_stills(together, knocked(together, long, rounding, FALSE_ALARM_PROBABILITY), long)
    judged = inside(len(first), bounds.tolist())
    motions = runs(judged & ~inside(len(first), parts), first.segments)
    share = sum(b - a for a, b in motions) / int(judged.sum())
    return Motion(parts, motions, _episodes(first, motions), share, knocks)


def _episodes(record: Record, ranges: Segments) -> tuple[tuple[float, float], ...]:
    """Return start, on the clock of the record, and duration of ranges of its samples, s."""
    return tuple((float(record.t[a]), (b - a) * record.interval) for a, b in ranges)


def _episodes_text(episodes: Sequence[tuple[float, float]]) -> str:
    """Return the first four episodes in words, and how many more there are."""
    shown = ", ".join(f"from {stamp(start)} s on for {duration:.3g} s" for start, duration in episodes[:4])
    return f"{shown} and {len(episodes) - 4} more" if len(episodes) > 4 else shown


def _moving_blocks(
    records: Sequence[Record],
    bounds: IntArray,
    moments: Sequence[tuple[FloatArray, FloatArray]],
    usual: Sequence[FloatArray],
) -> BoolArray:
    """Return which blocks moved, by the usual variances of each record, (k,)."""
    ratios, sizes = [], []
    for record, (mean, variance), level in zip(records, moments, usual, strict=True):
        ratio = np.sqrt(np.maximum(variance, level * 1e-6) / level)
        large = (np.sqrt(variance) > _CERTAIN_MOTION.get(record.unit, np.inf)) & (ratio > 10.0)
        if record.unit == "rad/s":
            large |= np.abs(mean - np.median(mean, axis=0)) > _CERTAIN_MOTION["rad/s"]
            large |= _turned(mean, variance, bounds)
        ratios.append(ratio)
        sizes.append(large.any(axis=1))
    every = np.hstack(ratios)
    statistic = np.exp(np.mean(np.log(every), axis=1))
    threshold = _LEVEL_MARGIN * _scatter(every.shape[1], FALSE_ALARM_PROBABILITY / len(bounds))
    moved: BoolArray = (statistic > threshold) | np.logical_or.reduce(sizes)
    return _widened(moved, bounds)


def _turned(mean: FloatArray, variance: FloatArray, bounds: IntArray) -> BoolArray:
    """Return the blocks and channels, shapes (b, k), whose mean rate leaves its level and comes back to it.

    A bias may step or wander; one that returns from where no sensor at rest gets within a second was a rotation.
    """
    away = np.abs(mean - median_filter(mean, (2 * _LONGEST_TURN + 1, 1), mode="nearest"))
    usual = np.maximum(normal_sd(away, axis=0), np.sqrt(variance / np.diff(bounds)))
    return np.asarray(away > np.maximum(LARGEST_CHANGE["rad/s"], _RARE_SDS * usual))


def _quietest(variances: Sequence[FloatArray], rounding: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the mean variances of each record, (k,), over the eight adjoining blocks that are quietest together."""
    level = np.mean(np.log(np.maximum(np.hstack(variances), np.hstack(rounding))), axis=1)
    frozen = np.any(np.hstack(variances) == 0.0, axis=1)  # a sensor that repeats one value is not quiet
    total = np.concatenate(([0.0], np.cumsum(np.where(frozen, np.abs(level).max(), level))))
    at = int(np.argmin(total[_MIN_BLOCKS:] - total[:-_MIN_BLOCKS]))
    return [
        np.maximum(v[at : at + _MIN_BLOCKS].mean(axis=0), step)
        for v, step in zip(variances, rounding, strict=True)
    ]


def cut_to_still(records: Sequence[Record], motion: Motion) -> tuple[Record, ...]:
    """Return the records with their segments cut to the still parts of their motion, and a note if any part moved.

    Raises
    ------
    DataError
        Nothing stands still.
    """
    description = motion.describe()
    if not motion.still:
        raise DataError(
            f"{records[0].source}: {description}: no part stands still; record the sensor at rest"
        )
    moved = bool(motion.moving or motion.knocks)
    still = alike(records, motion.still) if moved else motion.still
    for record in records:
        if (moving := _steady_motion(record, still)) is not None:
            raise DataError(moving)
    if not moved:
        return tuple(records)
    said = "" if description is None else f"{description}: "
    used = sum(b - a for a, b in still) * records[0].interval
    if used < MIN_PART_SECONDS:
        raise DataError(
            f"{records[0].source}: {said}only {used:.3g} s at rest are alike, expected "
            f"{MIN_PART_SECONDS:g} s or more: record the sensor at rest"
        )
    knocks = tuple((a, b) for a, b in motion.knocks if any(c <= a < d for c, d in still))
    note = f"at rest and alike: {parts_text(records[0], still)}"
    note = note if description is None else f"{description}; {note}"
    if knocks:
        where = _episodes_text(_episodes(records[0], knocks))
        note += f"; knocks inside, {len(knocks)} ({where}), are replaced by simulated samples"
    cut = [replace(r, segments=still, notes=(*r.notes, note), short_clusters={}) for r in records]
    return tuple(bridge_knocks(record, knocks) if knocks else record for record in cut)


def parts_text(record: Record, still: Segments) -> str:
    """Return which parts of a record are meant, times on its clock; where they are many, the longest."""
    spans = [(float(record.t[a]), float(record.t[b - 1]) + record.interval) for a, b in still]
    longest = sorted(sorted(spans, key=lambda span: span[0] - span[1])[:4])
    shown = ", ".join(f"{stamp(first)} to {stamp(last)} s" for first, last in longest)
    if len(spans) == 1:
        return shown
    return f"{len(spans)} parts, {'the longest ' if len(spans) > len(longest) else ''}{shown}"


def _steady_motion(record: Record, still: Segments) -> str | None:
    """Return how the means of a record change as those of no sensor at rest, even where it moved least; else None.

    A log that moves nearly all the time has no quiet quarter to compare with.
    """
    if record.unit not in LARGEST_CHANGE or not still:
        return None
    bounds = _blocks(replace(record, segments=still))
    touching = bounds[1:, 0] == bounds[:-1, 1]
    if not touching.any():
        return None
    mean, variance = _moments(record, bounds)
    change = normal_sd(np.diff(mean, axis=0)[touching], axis=0)
    white = np.sqrt(2.0 * np.median(variance, axis=0) / np.median(np.diff(bounds)))
    smallest = np.sqrt(LARGEST_CHANGE[record.unit] ** 2 + _rounding_variance(record))
    limit = np.maximum(smallest, _OVER_WHITE_NOISE * white)
    worst, length = int(np.argmax(change / limit)), float(np.diff(bounds).mean()) * record.interval
    if change[worst] <= limit[worst]:
        return None
    gyro = record.unit == "rad/s"
    found, allowed, unit = (
        (np.degrees(change), np.degrees(limit), "deg/s") if gyro else (change, limit, "m/s²")
    )
    return (
        f"{record.source}: not at rest: even where it moved least, the mean of "
        f"{record.axes[worst]} changes by {found[worst]:.2g} {unit} within {length:.2g} s, at rest by less "
        f"than {allowed[worst]:.2g} {unit}: record the sensor at rest"
    )


def _scatter(channels: int, probability: float) -> float:
    """Return c(k, p): the ratio of sd that a still sensor exceeds with the given probability a block."""
    return float(np.sqrt(2.0 * np.log(1.0 / probability) / (_BRIDGE_QUARTILE * np.pi**2 * channels)))


def _blocks(record: Record) -> IntArray:
    """Return first and last (exclusive) sample of each block, shape (b, 2); no block crosses a gap."""
    length = max(MIN_BLOCK_SAMPLES, round(_BLOCK_SECONDS * record.rate))
    edges = []
    for start, stop in record.segments:
        cut = np.linspace(start, stop, max(1, (stop - start) // length) + 1).astype(np.int64)
        edges.append(np.column_stack([cut[:-1], cut[1:]]))
    bounds: IntArray = np.concatenate(edges)
    return bounds[bounds[:, 1] - bounds[:, 0] >= min(_MIN_BLOCKS, length)]


def _moments(record: Record, bounds: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and variance of each block and channel, shapes (b, k)."""
    starts, stops = (np.ascontiguousarray(edge) for edge in bounds.T)
    moments = [block_moments(column, starts, stops) for column in record.y.T]
    mean, variance = (np.stack(part, axis=1) for part in zip(*moments, strict=True))
    return mean, variance


def _rounding_variance(record: Record) -> FloatArray:
    """Return the variance of rounding to the step of each channel, shape (k,)."""
    step = []
    for column in record.y[:100_000].T:
        apart = np.diff(np.unique(column))
        step.append(apart.min() if len(apart) else 0.0)
    return np.square(step) / 12.0 + np.finfo(float).tiny


def _widened(moved: BoolArray, bounds: IntArray) -> BoolArray:
    """Return `moved` with the neighbours of each moving block that touch it."""
    wide = moved.copy()
    touching = bounds[1:, 0] == bounds[:-1, 1]
    wide[1:] |= moved[:-1] & touching
    wide[:-1] |= moved[1:] & touching
    return wide


def _ranges(bounds: IntArray, chosen: BoolArray) -> Segments:
    """Return the sample ranges of runs of chosen blocks that touch."""
    ranges: list[tuple[int, int]] = []
    for start, stop in bounds[chosen].tolist():
        if ranges and ranges[-1][1] == start:
            ranges[-1] = (ranges[-1][0], stop)
        else:
            ranges.append((start, stop))
    return tuple(ranges)
