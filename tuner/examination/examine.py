"""The examination of a drive before any filter: what is wrong with its streams, and the drive without it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import ned_between
from tuner.examination.fit import Fit, Noise
from tuner.examination.moves import AXES, CLOCK_OF_UNIT, LEVER_ARM, STATED_ODDS, TRIADS, Move
from tuner.examination.search import applied, searched
from tuner.examination.streams import Positions, Stream, Streams, receiver_streams, repeated
from tuner.examination.windows import WINDOW_LENGTH, Inertial, longest_step
from tuner.formats.grouping import gathered
from tuner.limits import LOST_SHARE, TOLERATED_RATIO
from tuner.readers.drive_checks import possible_drive
from tuner.segments.stand_stills import inside, runs
from tuner.types.clock import HALF_INTERVAL, Clock
from tuner.types.public import public
from tuner.types.records import DataError, Drive, Gnss
from tuner.types.repair import Repair
from tuner.types.shown import Shown

GATE_SDS = 4.0
"""Sds beyond which a reading is far off: the usual gate of a filter (DECISIONS: share of samples beyond 4 sd)."""
REPORTED_SPREAD = math.log(2.0)
"""Sd of the logarithm of true ÷ reported sd of receivers, before anything is known."""
CERTAIN_ODDS = math.log(STATED_ODDS)
"""Log odds from which a fault is certain: those of what a file states."""
MOVING_SPEED = 2.0
"""Speed above which the noise in motion is taken, m/s."""
FULL_SCALE_STEPS = 1000
"""Steps from zero at which a range may end: nearer, rest, steady turns and swings put as much on the last value."""
STILL_SECONDS = 5
"""Seconds of the quietest stretch, whose noise is that at rest."""


@dataclass(frozen=True)
class StreamNoise:
    """Noise of a stream within seconds.

    Attributes
    ----------
    stream, part : str
        Which stream, which of its components: empty for all or the horizontal ones.
    sd : float
        Sd of right readings about the motion of the inertial unit, `unit`.
    reported : float or None
        Median of the sds that the stream states.
    unit : str
        m, m/s.
    """

    stream: str
    part: str
    sd: float
    reported: float | None
    unit: str


@dataclass(frozen=True, repr=False)
class Examination(Shown):
    """What an examination found.

    Attributes
    ----------
    rates : mapping of str to float
        Samples or readings a second of each stream, Hz.
    repairs : tuple of Repair
        Faults in order of evidence.
    noise : tuple of StreamNoise
        Of every stream, without its faults.
    vibration : mapping of str to (float, float)
        Noise of the samples of a triad at rest and in motion, rad/s, m/s²; empty where the drive has not both.
    unseen : tuple of str
        Faults that this recording could not have shown.
    lever_arm : str
        Where the antenna is, where nobody states it and the drive shows it; else empty.
    seconds : float
        Time in windows that were examined.
    misfit : mapping of str to (t, before, after)
        Of each stream its stamps, s, and by how much its readings miss the motion of the inertial unit as they were
        recorded and as mended, in its unit, shape (k,) each; NaN outside windows.
    mended : Drive
        The drive without what was found.
    before_filter : tuple of Repair
        Those without which a filter begins: what is counted, and faults of whole streams and steps at odds of 1000 : 1.
    filtered : Drive
        The drive without these. Delays and wrong readings are left to the filter, which has a gate for them.
    clock : Clock
        Delays of the receiver and of its velocities with their sds, taken out or not.
    undecided : str
        A unit, sign or order of axes that is refuted as it is stated and fits in two others, in words; else empty.
    """

    rates: Mapping[str, float]
    repairs: tuple[Repair, ...]
    noise: tuple[StreamNoise, ...]
    vibration: Mapping[str, tuple[float, float]]
    unseen: tuple[str, ...]
    lever_arm: str
    seconds: float
    misfit: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]]
    mended: Drive
    before_filter: tuple[Repair, ...]
    filtered: Drive
    clock: Clock
    undecided: str = ""

    @property
    def mends(self) -> bool:
        """Whether a filter begins with another drive than was recorded: some faults nothing mends."""
        return any(one.done for one in self.before_filter)


def streams_of(drive: Drive) -> Streams:
    """Return the streams of a drive."""
    stated = drive.lever_arm is not None and drive.mounting is not None
    x, y, z = (drive.mounting @ np.array(drive.lever_arm)).tolist() if stated else (0.0, 0.0, 0.0)
    return Streams(Inertial(drive.imu_t, drive.rates), *receiver_streams(drive.gnss, (x, y, z)))


@public("examine")
def examine(drive: Drive) -> Examination:
    """Hold the streams of a drive against one another in windows, before any filter runs.

    Parameters
    ----------
    drive : Drive
        The drive.

    Raises
    ------
    DataError
        Where no window of ten seconds has inertial samples and fixes, or numbers are possible in no unit.
    """
    if drive.unusable:
        raise DataError(f"examine: {drive.source or drive.name} {drive.unusable}")
    stamps, (counted, kept) = drive.imu_t, _frozen(drive)
    drive = replace(drive, imu_t=drive.imu_t[kept], rates=drive.rates[kept])
    whole = streams_of(drive)
    search = searched(whole, drive.source or drive.name)
    fit, (named, repaired) = search.after, applied(search.found, whole)
    unstated = drive.lever_arm is None or drive.mounting is None
    arm = [one.fault for one in named if one.subject == LEVER_ARM and unstated]
    repairs = [one.repair for one in named if one.fault not in arm]
    sure = [one for one in named if one.kind != "constant" and min(one.nats, one.over_next) > CERTAIN_ODDS]
    lost, stale = [], []
    speed = _travelled(repaired.positions)
    for stream, noise, far, left, worth in zip(
        repaired.all, fit.noise, fit.wrong, fit.left, fit.worth, strict=True
    ):
        repeats = _repeats(stream, np.interp(stream.t, *speed) > MOVING_SPEED)
        wrong = _wrong(stream, noise, far, left, worth)
        counted += [] if repeats is None else [repeats]
        repairs += [] if wrong is None else [wrong]
        stale.append((repeated(stream.values) | ~stream.readings.any()) & (repeats is not None))
        lost.append(stale[-1] | ((np.nan_to_num(far) > 0.5) & (wrong is not None)))
    unsound, (of_sds, sds) = _unsound(fit), _right_sds(repaired, fit)
    repairs += [] if unsound is None else [unsound]
    jumps = sum(one.size or 0.0 for one in named if one.stream == CLOCK_OF_UNIT)
    counted += [*of_sds, *_gaps(stamps, jumps), *_at_ends(drive)]
    first = _in_order(drive, [*counted, *(one.repair for one in sure)])
    all_of = _in_order(drive, [*counted, *repairs])
    noise_of = (_noise(*pair) for pair in zip(repaired.all, fit.noise, strict=True))
    mended = _mended(drive, repaired, lost, sds)
    possible_drive(mended)
    filtered = _mended(drive, applied(sure, whole)[1], stale, sds)
    misfit = {
        stream.name: (stream.t, *(np.linalg.norm(one.left[k], axis=1) for one in (search.before, fit)))
        for k, stream in enumerate(whole.all)
    }
    return Examination(
        {"inertial unit": 1.0 / whole.imu.interval, **{one.name: 1.0 / one.interval for one in whole.all}},
        all_of,
        tuple(chain.from_iterable(noise_of)),
        _vibration(drive, repaired),
        search.unseen,
        "".join(arm),
        WINDOW_LENGTH * len(fit.begin),
        misfit,
        mended,
        first,
        filtered,
        search.clock,
        _undecided(named),
    )


def _undecided(found: Sequence[Move]) -> str:
    """Return which stream fits in two readings only, neither as it is stated."""
    for one in found:
        if one.rival is not None and one.nats > CERTAIN_ODDS >= one.over_next and one.kind == "reading":
            other = f"{one.rival.stream} {one.rival.fault}"
            return (
                f"{one.stream} {one.fault}, or {other}: the streams contradict what is stated and fit with "
                "either; correct the one that is wrong"
            )
    return ""


def _in_order(drive: Drive, repairs: Sequence[Repair]) -> tuple[Repair, ...]:
    """Return the repairs of a reader, then others, the surest first; those that say the same of streams as one."""
    said = gathered(((one.fault, one.done), one) for one in repairs)
    names = (" and ".join(dict.fromkeys(one.stream for one in same)) for same in said.values())
    together = [replace(same[0], stream=name) for same, name in zip(said.values(), names, strict=True)]
    return (*drive.repairs, *sorted(together, key=lambda one: -one.nats))


def _mended(
    drive: Drive, streams: Streams, lost: Sequence[NDArray[np.bool_]], sds: Sequence[FloatArray | None]
) -> Drive:
    """Return a drive of mended streams, without lost readings: rows of fixes, or their velocities alone."""
    gnss, positions = drive.gnss, streams.positions
    velocities, velocity_sd = gnss.vel_n.copy(), gnss.velocity_sd.copy()
    position_sd = gnss.position_sd if sds[0] is None else sds[0]
    for stream, gone, sd in zip(streams.others, lost[1:], sds[1:], strict=True):
        values, d = np.where(gone[:, None], np.nan, stream.values), stream.values.shape[1]
        if np.any(stream.t != positions.t):  # a fix has one stamp
            there = np.isfinite(values).all(axis=1)
            values = np.column_stack([np.interp(positions.t, stream.t[there], x) for x in values[there].T])
        velocities[:, :d] = values
        velocity_sd[:, :d] = velocity_sd[:, :d] if sd is None else sd
    fixes = Gnss(positions.t, positions.values, velocities, position_sd, velocity_sd, gnss.solution)
    inside = (fixes.t >= drive.imu_t[0]) & (fixes.t <= drive.imu_t[-1])
    turned = not np.array_equal(streams.imu.rates, drive.rates)
    return replace(
        drive,
        rates=streams.imu.rates,
        gnss=fixes.rows(~lost[0] & inside),
        start=None if turned else drive.start,
    )


def _travelled(positions: Positions) -> tuple[FloatArray, FloatArray]:
    """Return stamps and the speed over ten seconds about each, m/s."""
    t = positions.t
    ahead = np.searchsorted(t, t + 5.0).clip(0, len(t) - 1)
    behind = np.searchsorted(t, t - 5.0).clip(0, len(t) - 1)
    way = ned_between(positions.values[ahead], positions.values[behind])
    return t, np.linalg.norm(way, axis=1) / np.maximum(t[ahead] - t[behind], 1.0)


def _repeats(stream: Stream, moving: NDArray[np.bool_]) -> Repair | None:
    """Return how many readings repeat the one before exactly, where chance and the lattice of the numbers cannot.

    Velocities of zero while a vehicle stands are put there by the receiver, and right.
    """
    rows = repeated(stream.values)
    if len(rows) > 1 and rows[1:].all():
        what = "zero" if not stream.values.any() else "the same"
        return Repair(stream.name, f"are {what} in all {len(rows)} rows: no measurement", "left out")
    rows = rows & (moving | stream.values.any(axis=1))
    share = float(rows.mean())
    if share <= LOST_SHARE:
        return None
    longest = max(stop - start for start, stop in runs(rows, [(0, len(rows))]))
    how = "" if longest == 1 else f", up to {longest} in a row"
    twice = (
        np.median(np.diff(stream.t)[rows[1:]]) < 0.1 * np.median(np.diff(stream.t)[~rows[1:]])
        if not rows.all()
        else False
    )
    what = "come twice" if twice and longest == 1 else "repeat the one before, stale"
    return Repair(
        stream.name,
        f"{what}: {100.0 * share:.2g} % are the reading before, exactly{how}",
        "left out",
        size=share,
        unit="share",
        begin=float(stream.t[rows][0]),
        end=float(stream.t[rows][-1]),
    )


def _wrong(stream: Stream, noise: Noise, wrong: FloatArray, left: FloatArray, worth: float) -> Repair | None:
    """Return how many readings are wrong and by how much, where more than a few lie beyond the gate of a filter."""
    there = np.isfinite(wrong)
    reported = np.zeros(stream.values.shape) if stream.sd is None else np.nan_to_num(stream.sd)
    expected = np.maximum(reported, noise.sd)  # a filter judges by those reported, but not less than measured
    far = there & (wrong > 0.5) & (np.abs(np.nan_to_num(left)) > GATE_SDS * expected).any(axis=1)
    count, all_of = int(far.sum()), int(there.sum())
    share = count / max(all_of, 1)
    if share <= LOST_SHARE or worth < CERTAIN_ODDS:
        return None
    size = float(np.sqrt(np.mean(np.sum(left[far] ** 2, axis=1))))
    independent = len(runs(far[there], [(0, all_of)]))  # readings in a row may share one error
    spread = HALF_INTERVAL * float(np.std(np.linalg.norm(left[far], axis=1))) / math.sqrt(independent)
    right = float(np.sqrt(np.sum(noise.sd**2)))
    t = stream.t[far]
    return Repair(
        stream.name,
        f"are wrong in {100.0 * share:.2g} %: {count} readings of {all_of} by {size:.3g} {stream.unit} rms, the others "
        f"within {right:.2g} {stream.unit}",
        "left out",
        worth,
        size=size,
        interval=(max(size - spread, 0.0), size + spread),
        unit=stream.unit,
        begin=float(t[0]),
        end=float(t[-1]),
    )


def _unsound(fit: Fit) -> Repair | None:
    """Return in which windows the inertial unit does not hold."""
    bad = fit.unsound > 0.5
    if bad.mean() <= LOST_SHARE or fit.unsound_worth < CERTAIN_ODDS:
        return None
    t = fit.begin[bad]
    return Repair(
        "IMU",
        f"does not hold in {bad.sum()} of {len(bad)} windows of {WINDOW_LENGTH:g} s: its motion is not that of the "
        "other streams",
        "",
        fit.unsound_worth,
        size=float(bad.mean()),
        unit="share",
        begin=float(t[0]),
        end=float(t[-1]) + WINDOW_LENGTH,
    )


def _right_sds(streams: Streams, fit: Fit) -> tuple[list[Repair], list[FloatArray | None]]:
    """Return what is wrong with the sds that streams report, and those in their place.

    They are zero, variances, or far below the noise of readings from one to the next.
    """
    variances = _variances(streams, fit)
    found, right = [] if variances is None else [variances], []
    for stream, noise in zip(streams.all, fit.noise, strict=True):
        sd, measured = stream.sd, _noise(stream, noise)
        ratios = [x.sd / x.reported for x in measured if x.reported]
        ratio = math.exp(float(np.mean(np.log(ratios)))) if ratios else 1.0
        if sd is not None and not np.any(np.nan_to_num(sd) > 0.0):
            shown = ", ".join(f"{x.sd:.2g} {x.unit}{f' {x.part}' * bool(x.part)}" for x in measured)
            fault = f"report standard deviations of zero: measured {shown}"
            found.append(Repair(stream.name, fault, "the measured ones put in their place"))
            sd = np.broadcast_to(noise.sd, sd.shape)
        elif sd is not None and variances is not None:
            sd = np.sqrt(sd)
        elif sd is not None and ratios and min(ratios) >= TOLERATED_RATIO:
            fault = f"report standard deviations {ratio:.2g} times too small: errors from reading to reading alone "
            done = f"multiplied by {ratio:.2g}"
            found.append(Repair(stream.name, f"{fault}are larger", done, size=ratio, unit="times"))
            sd = sd * ratio
        right.append(sd)
    return found, right


def _frozen(drive: Drive) -> tuple[list[Repair], NDArray[np.bool_]]:
    """Return in which time a sensor repeats one sample for a second or longer, and the rows that are left.

    At rest one sensor may give the same in its dead zone: there only both together are frozen.
    """
    t, kept, found = drive.imu_t, np.ones(len(drive.imu_t), dtype=bool), []
    moving = np.interp(t, *_travelled(streams_of(drive).positions)) > MOVING_SPEED
    for name, of in (("inertial unit", kept), ("gyro", moving), ("accelerometer", moving)):
        rates = drive.rates[:, TRIADS[name]]
        every = runs(repeated(rates) & of & kept, [(0, len(t))])
        long = [(a, b) for a, b in every if t[b - 1] - t[a] >= 1.0]
        if long and np.ptp(rates, axis=0).any():
            rows = inside(len(t), long)
            kept = kept & ~rows
            seconds = sum(float(t[b - 1] - t[a]) for a, b in long)
            what = "zeros" if not rates[rows].any() else "one sample again and again"
            begin, end = float(t[long[0][0]]), float(t[long[-1][1] - 1])
            fault = (
                f"gives {what} for {seconds:.3g} s: frozen, no measurement, from {begin:.0f} to {end:.0f} s"
            )
            found.append(Repair(name, fault, "left out", size=seconds, unit="s", begin=begin, end=end))
    return found, kept


def _gaps(t: FloatArray, jumps: float) -> list[Repair]:
    """Return for how long the inertial unit lacks samples, where stamps that only jump take some of it, s."""
    steps = np.diff(t)
    gaps = steps[steps > longest_step(steps)] - float(np.median(steps))
    lost = float(gaps.sum()) - jumps
    if lost <= LOST_SHARE * float(np.ptp(t)):
        return []
    many = "one gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest {gaps.max():.2g} s"
    fault = f"has no samples for {lost:.3g} s, in {many}"
    return [Repair("inertial unit", fault, "", size=lost, unit="s")]


def _at_ends(drive: Drive) -> list[Repair]:
    """Return which axes never change, or are saturated: far more often at an end of their range than just before it.

    A density that falls towards its end puts at most half of the samples of its last two values on the last.
    """
    found = []
    for i, values in enumerate(drive.rates.T):
        levels, counts = np.unique(values, return_counts=True)
        name, at, most = ("gyro", "accelerometer")[i // 3], 0, 0.0
        if len(levels) == 1:
            what = "one value" if levels.any() else "zero"
            fault = f"gives {what} in all {len(values)} samples: no measurement"
            found.append(Repair(f"{name} {AXES[i % 3]}", fault, ""))
        for end, before in ((0, 1), (-1, -2)) if len(levels) > 2 else ():
            both = counts[end] + counts[before]
            p = counts[end] / both
            odds = both * (math.log(2.0 * p) + (1.0 - p) * math.log(max(1.0 / p - 1.0, 1e-9)))
            far = abs(levels[end]) > FULL_SCALE_STEPS * np.diff(levels).min()
            if far and p > 0.5 and odds > CERTAIN_ODDS:
                at, most = at + int(counts[end]), float(abs(levels[end]))
        if at > LOST_SHARE * len(values):
            shown = f"{math.degrees(most):.4g} deg/s" if i < 3 else f"{most:.4g} m/s²"
            share = at / len(values)
            fault = f"{AXES[i % 3]} is saturated in {100.0 * share:.2g} % of the samples, at {shown}"
            found.append(Repair(name, fault, "", size=share, unit="share"))
    return found


def _variances(streams: Streams, fit: Fit) -> Repair | None:
    """Return that what is reported as sds are variances, where their square roots fit the measured ones so much better.

    The logarithm of true ÷ reported sd has a Cauchy distribution for sds as for square roots of variances.
    """
    pairs = zip(streams.all, fit.noise, strict=True)
    stated = [(x, x.reported) for x in chain.from_iterable(_noise(*pair) for pair in pairs) if x.reported]
    of_sd, of_variance = (
        np.log1p([(math.log(x.sd / sd**power) / REPORTED_SPREAD) ** 2 for x, sd in stated]).sum()
        for power in (1.0, 0.5)
    )
    nats = float(of_sd - of_variance) - CERTAIN_ODDS  # a column that is called sd holds sds
    words = "; ".join(
        f"{x.stream}{f' {x.part}' * bool(x.part)} {sd:.2g}, measured {x.sd:.2g} {x.unit}" for x, sd in stated
    )
    fault = f"are variances: {words}"
    return (
        Repair("reported standard deviations", fault, "their square roots used", nats) if nats > 0.0 else None
    )


def _noise(stream: Stream, noise: Noise) -> Sequence[StreamNoise]:
    """Return the noise of each part of a stream, none of one without readings."""
    out = []
    for part, columns in stream.groups if stream.readings.any() else ():
        sds = None if stream.sd is None else stream.sd[:, list(columns)]
        stated = None if sds is None or not np.isfinite(sds).any() else float(np.nanmedian(sds))
        out.append(StreamNoise(stream.name, part, float(noise.sd[columns[0]]), stated, stream.unit))
    return out


def _vibration(drive: Drive, streams: Streams) -> dict[str, tuple[float, float]]:
    """Return the noise of samples at rest and in motion, by differences of neighbours in each second."""
    many = max(round(1.0 / float(np.median(np.diff(drive.imu_t)))), 8)
    blocks = len(drive.imu_t) // many
    steps = np.diff(streams.imu.rates[: blocks * many].reshape(blocks, many, 6), axis=1)
    square = 0.5 * steps.var(axis=1).reshape(blocks, 2, 3).mean(axis=2)
    t = drive.imu_t[: blocks * many : many] + 0.5
    moving = np.interp(t, *_travelled(streams.positions)) > MOVING_SPEED
    if moving.sum() < 2 * STILL_SECONDS:
        return {}
    means = [np.convolve(x, np.full(STILL_SECONDS, 1.0 / STILL_SECONDS), "valid") for x in square.T]
    pairs = np.sqrt([np.min(means, axis=1), np.median(square[moving], axis=0)]).T.tolist()
    return {name: (still, fast) for name, (still, fast) in zip(("gyro", "accelerometer"), pairs, strict=True)}
