"""Which fault of a stream explains a drive, tried as a transformation that its likelihood has to pay for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from models.arrays import FloatArray
from models.earth import llh_displaced, metres_per_radian
from models.robust import normal_sd
from tuner.examination.distant_clocks import distant_delay
from tuner.examination.fit import FIRST_ROUNDS, LEAST_READINGS, Fit, busiest, earned, fit
from tuner.examination.installation import installed
from tuner.examination.moves import (
    DELAYS,
    STATED_ODDS,
    TRIADS,
    Move,
    jumped,
    moves,
    of_clock,
    of_values,
    times,
)
from tuner.examination.streams import Stream, Streams, Velocities
from tuner.examination.windows import WINDOW_LENGTH, Inertial, averaged, longest_step, windows_of
from tuner.types.clock import CERTAIN_SDS, Clock, Delay
from tuner.types.records import DataError

REFITTED_FAULTS = 3
"""Faults that are then tried on all windows."""
UNSEEN_GAIN = 3.0
"""Change of the log-likelihood by a fault, nats, below which a recording cannot show it."""
MOST_FAULTS = 4
"""Faults of whole streams that are looked for one after the other."""


def applied(found: Sequence[Move], streams: Streams) -> tuple[list[Move], Streams]:
    """Return faults found in slower streams, each from the sample on at which it begins, and streams without them."""
    named = []
    for one in found:
        mended = one.mended(streams)
        begin = _at_sample(streams, mended, one.begin, rises=True)
        end = _at_sample(streams, mended, one.end, rises=False)
        named.append(replace(one, begin=begin, end=end))
        streams = mended if one.whole else between(streams, mended, begin, end)
    return named, streams


@dataclass(frozen=True)
class Searched:
    """What a search found: faults, fits with them and without, what the recording cannot show, and every delay.

    A delay is that of a stream against the positions, under None that of all streams against the inertial unit.
    """

    found: tuple[Move, ...]
    before: Fit
    after: Fit
    unseen: tuple[str, ...]
    clock: Clock


def searched(streams: Streams, name: str = "streams") -> Searched:
    """Return the faults of whole streams.

    Raises
    ------
    DataError
        Where no window has inertial samples and positions.
    """
    whole = replace(streams, imu=averaged(streams.imu))
    recorded = _inside(whole)
    found: list[Move] = []
    first = fit(recorded, every=True)
    if not len(first.begin):
        raise DataError(
            f"{name}: expected windows of {WINDOW_LENGTH:g} s with inertial samples and {LEAST_READINGS} positions or "
            "more, found none: the clocks of the streams do not meet, or the recording is too short"
        )
    unseen: tuple[str, ...] = ()
    begun, now = recorded, first
    clocks = [of_clock(None, Clock(Delay(delay))) for delay in (distant_delay(whole),) if delay]
    for move in [*clocks, *_jumps(streams.imu)]:
        shifted = move.mended(whole)
        as_read = _best_fit(_inside(whole, shifted), now)
        worth = earned(_best_fit(_inside(shifted, whole), now).gains_over(as_read)) - math.log(STATED_ODDS)
        if worth > 0.0:
            found.append(replace(move, nats=worth))
            whole, begun = shifted, _inside(shifted)
            now = fit(begun, every=True)
    at = installed(begun, now)
    gain = at.gain
    for _ in range(MOST_FAULTS):
        # no unit is taken twice
        read = {(one.stream, one.fault) for one in found if one.whole and one.kind == "reading"}
        left = [one for one in moves(at.streams) if (one.stream, one.fault) not in read]
        # a lever arm may stand for a fault: each is tried without one, and beside one of its own
        bare = at.streams.changed(lambda one: replace(one, arm=recorded.positions.arm))
        plain = at.fit if bare.positions.arm == at.streams.positions.arm else fit(bare)
        tried, unseen = _tried(bare, plain, left)
        less = at.fit.total - plain.total
        better = [one for one in tried if one[0].nats > 0.0 and _says_more_than_none(*one)]
        settled = [
            (replace(one, nats=one.nats + there.gain - less), now, there)
            for one, streams, now in better
            for there in (installed(streams, now),)
        ]
        settled = sorted((each for each in settled if each[0].nats > 0.0), key=lambda each: -each[0].nats)
        if not settled:
            break
        (best, now, at), *others = settled
        rivals = [one for one, *_ in others if best.kind != "constant" or one.subject != best.subject]
        rival = rivals[0] if rivals else None
        over_next = best.nats - (rival.nats if rival else 0.0)
        found.append(replace(best, over_next=over_next, rival=rival))
        for one in found[:-1]:  # what a later fault makes superfluous
            without = [each for each in found if each is not one]
            streams = applied(without, recorded)[1]
            if (there := fit(streams)).total > now.total:
                found, now, at = without, there, installed(streams, there)
        gain = max(gain, at.gain)
    named = _joined(found, at.moves(recorded), gain)
    unseen = tuple(one for one in unseen if one not in {each.subject for each in named})
    return Searched(named, first, fit(at.streams, near=at.fit, every=True), unseen, at.clock(recorded))


def _best_fit(streams: Streams, near: Fit) -> Fit:
    """Return the likelier of two fits: one that begins anew, and one that begins near another."""
    return max(fit(streams), fit(streams, near=near), key=lambda one: one.total)


def _jumps(imu: Inertial) -> list[Move]:
    """Return that the clock of the unit jumped where its stamps have a gap, of the longest gaps some."""
    steps = np.diff(imu.t)
    usual = float(np.median(steps))
    long = np.flatnonzero(steps > longest_step(steps))
    longest = long[np.argsort(steps[long])[::-1][:MOST_FAULTS]]
    return [jumped(float(imu.t[k]), float(steps[k]) - usual) for k in longest]


def _inside(streams: Streams, *same: Streams) -> Streams:
    """Return streams without readings that a delay would bring out of all windows: their number must not change.

    Those go, too, that lie outside all windows in other streams of the same rows.
    """
    windows = streams.imu.windows
    reach = max(DELAYS) + 0.1

    def inside(one: Stream) -> Stream:
        rows = [each.t for other in (streams, *same) for each in other.all if each.name == one.name]
        kept = np.all([windows.found(t + shift) >= 0 for t in rows for shift in (-reach, 0.0, reach)], axis=0)
        return one.with_values(np.where(kept[:, None], one.values, np.nan))

    return streams.changed(inside)


def _joined(found: Sequence[Move], constant: Mapping[str, Move], gain: float) -> tuple[Move, ...]:
    """Return the faults, each constant once and of the size that it has in the end; all gain together, nats."""
    # a search may have taken up a delay beside a fault that it found later
    first = {one.subject: one for one in reversed(found) if one.kind == "constant"}
    said = ((move, first.get(subject, replace(move, nats=gain))) for subject, move in constant.items())
    delays = (replace(move, nats=one.nats, over_next=one.over_next) for move, one in said)
    return (*delays, *(one for one in found if one.kind != "constant"))


def _tried(
    streams: Streams, now: Fit, faults: Sequence[Move]
) -> tuple[list[tuple[Move, Streams, Fit]], tuple[str, ...]]:
    """Return the faults that promise most, refitted, the likeliest first, and what the windows cannot show."""
    price = math.log(STATED_ODDS * len(faults))
    part = 2.0 * math.log(len(now.begin))
    screen = busiest(streams.imu.windows, now)
    integrated = streams.imu.windows.some(screen)
    base = fit(streams, integrated, FIRST_ROUNDS)
    promise, unseen = [], []
    for fault in faults:
        mended = fault.mended(streams)
        own = integrated if mended.imu is streams.imu else windows_of(mended.imu, screen)
        gains = fit(mended, own, FIRST_ROUNDS).gains_over(base)
        promise.append(_best_part(gains)[2])
        if fault.subject and abs(gains.sum()) < UNSEEN_GAIN:
            unseen.append(fault.subject)
    likely = [faults[k] for k in np.argsort(promise)[::-1][:REFITTED_FAULTS] if promise[k] > 0.0]
    out = [_whole_or_part(streams, now, fault, price, part) for fault in likely]
    return sorted([*out, *_stepped(streams, now, price)], key=lambda one: -one[0].nats), tuple(
        dict.fromkeys(unseen)
    )


def _whole_or_part(
    streams: Streams, now: Fit, fault: Move, price: float, part: float
) -> tuple[Move, Streams, Fit]:
    """Return a fault with all windows, or with those in which it is wanted."""
    mended = fault.mended(streams)
    whole = fit(mended)
    gains = whole.gains_over(now)
    found = (replace(fault, nats=earned(gains) - price), mended, whole)
    first, last, gain = _best_part(gains)
    everywhere = first == 0 and last == len(gains)
    if not fault.partial or everywhere or gain < max(whole.total - now.total, price) + part:
        return found
    begin = None if first == 0 else _change(streams, mended, now.begin[first], rises=True)
    end = None if last == len(gains) else _change(streams, mended, now.begin[last], rises=False)
    joined = between(streams, mended, begin, end)
    again = fit(joined)
    worth = earned(again.gains_over(now)) - price - part
    other = (replace(fault, nats=worth, begin=begin, end=end), joined, again)
    return max(found, other, key=lambda one: one[0].nats)


def _says_more_than_none(found: Move, streams: Streams, mended: Fit) -> bool:
    """Return whether a triad, mended, explains more than one that measures nothing: small numbers have little noise."""
    if found.stream not in TRIADS:
        return True
    silent = of_values(found.stream, "measures nothing", "left out", times(0.0)).mended(streams)
    none = fit(between(streams, silent, found.begin, found.end))
    return mended.total > none.total + math.log(STATED_ODDS)


def _best_part(gains: FloatArray) -> tuple[int, int, float]:
    """Return the run of values with the largest sum: first, behind the last, sum."""
    total = np.append(0.0, np.cumsum(gains))
    least = np.minimum.accumulate(total)
    last = int(np.argmax(total - least))
    first = int(np.argmin(total[: last + 1]))
    return first, last, float(total[last] - total[first])


def _change(streams: Streams, mended: Streams, near: float, *, rises: bool) -> float:
    """Return when streams change, s, within a window of a time: the likeliest instant between two positions."""
    t = streams.positions.t
    steps = np.flatnonzero((t > near - 12.0) & (t < near + 12.0))
    at = 0.5 * (t[steps[1:]] + t[steps[:-1]])
    at = at[:: max(1, len(at) // 24)]
    windows = streams.imu.windows
    only = np.flatnonzero((windows.begin > near - 25.0) & (windows.begin < near + 15.0))
    values = []
    for time in at:
        joined = between(streams, mended, time, None) if rises else between(streams, mended, None, time)
        values.append(fit(joined, windows_of(joined.imu, only)).total)
    return float(at[int(np.argmax(values))])


def _at_sample(streams: Streams, mended: Streams, near: float | None, *, rises: bool) -> float | None:
    """Return when the samples of the inertial unit change, s, within a window of a time; as given if they do not."""
    imu = streams.imu
    if near is None or mended.imu is imu:
        return near
    beside = np.flatnonzero(np.abs(imu.t - near) < WINDOW_LENGTH)
    both = imu.rates[beside], mended.imu.rates[beside]
    return float(imu.t[beside[0] + _likeliest_change(*(both if rises else both[::-1]))])


def _likeliest_change(before: FloatArray, behind: FloatArray) -> int:
    """Return from which sample on the first of two series (n, 6) is the second, a linear function of it.

    Changes from sample to sample are normal, of one covariance that is not known: a wrong sample makes two large ones.
    """

    def squares(steps: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ki,kj->kij", steps, steps))

    first, second, between_them = (
        squares(x) for x in (np.diff(before, axis=0), np.diff(behind, axis=0), behind[1:] - before[:-1])
    )
    total = np.cumsum(first, axis=0) - first + between_them + np.cumsum(second[::-1], axis=0)[::-1] - second
    usual = np.median(np.einsum("kii->ki", total), axis=0)
    spread = np.linalg.slogdet(total + np.finfo(np.float32).eps * np.diag(usual))[1]
    scale = np.linalg.slogdet(np.linalg.lstsq(before, behind, rcond=None)[0])[1]
    left = np.arange(len(total), 0, -1)
    return 1 + int(np.argmax(left * scale - 0.5 * len(total) * spread))


def between(streams: Streams, mended: Streams, begin: float | None, end: float | None) -> Streams:
    """Return streams that are mended from a time to another, and as they were elsewhere."""
    low, high = -math.inf if begin is None else begin, math.inf if end is None else end

    def joined(one: Stream, other: Stream) -> Stream:
        inside = (one.t >= low) & (one.t < high)
        changed = np.where(inside, other.log_scale - one.log_scale, 0.0)
        return one.with_values(np.where(inside[:, None], other.values, one.values), changed)

    inside = (streams.imu.t >= low) & (streams.imu.t < high)
    rates = np.where(inside[:, None], mended.imu.rates, streams.imu.rates)
    imu = streams.imu if mended.imu is streams.imu else replace(streams.imu, rates=rates)
    others = {one.name: one for one in mended.all}
    return replace(streams.changed(lambda one: joined(one, others[one.name])), imu=imu)


def _stepped(streams: Streams, now: Fit, price: float) -> list[tuple[Move, Streams, Fit]]:
    """Return the step of a coordinate that explains most, with windows about it.

    A step between two windows is none, since each has a start of its own: windows are laid so that it falls into the
    middle of one.
    """
    rows = streams.positions.readings
    t, values = streams.positions.t[rows], streams.positions.values[rows]
    moved = (values[1:] - values[:-1]) * metres_per_radian(values[1:])
    odd = moved - _usual_moves(streams, t, moved)
    usual = np.maximum(normal_sd(odd, axis=0), 1e-3)
    row = int(np.argmax(np.abs((odd - np.median(odd, axis=0)) / usual).max(axis=1)))
    time = 0.5 * float(t[row] + t[row + 1])
    span = np.flatnonzero(
        (streams.imu.t > time - 1.5 * WINDOW_LENGTH) & (streams.imu.t < time + 1.6 * WINDOW_LENGTH)
    )
    if len(span) < 2:
        return []
    beside = replace(streams, imu=replace(streams.imu, t=streams.imu.t[span], rates=streams.imu.rates[span]))
    jump = np.where(np.abs(odd[row]) > CERTAIN_SDS * usual, odd[row], 0.0)
    after = fit(_step(jump, time).mended(beside), every=True)
    left, far = after.left[0], streams.positions.t - time
    here = np.isfinite(left[:, 0]) & (np.abs(far) < 0.5 * WINDOW_LENGTH)
    before, behind = left[here & (far < 0.0)], left[here & (far > 0.0)]
    if not len(before) or not len(behind):
        return []
    jump = jump + np.median(behind, axis=0) - np.median(before, axis=0)
    move = _step(np.where(np.abs(jump) > CERTAIN_SDS * after.noise[0].sd, jump, 0.0), time)
    gain = fit(move.mended(beside)).total - fit(beside).total - price
    if gain <= 0.0:
        return []
    mended = move.mended(streams)
    whole = fit(mended)
    return [(replace(move, nats=gain), mended, whole)] if whole.total > now.total - UNSEEN_GAIN else []


def _usual_moves(streams: Streams, t: FloatArray, moved: FloatArray) -> FloatArray:
    """Return moves between times by velocities of the receiver, or else by those before and behind, m."""
    step = np.diff(t)[:, None]
    for one in streams.others:
        if isinstance(one, Velocities) and one.readings.sum() > 1:
            rows = one.readings
            known = np.column_stack([np.interp(t, one.t[rows], x) for x in one.values[rows].T])
            return np.pad(0.5 * (known[1:] + known[:-1]) * step, ((0, 0), (0, 3 - known.shape[1])))
    return np.asarray(median_filter(moved / step, (5, 1)) * step)


def _step(jump: FloatArray, time: float) -> Move:
    """Return a step of the positions: north, east, down, m."""

    def mended(streams: Streams) -> Streams:
        at = streams.positions
        moved = np.where((at.t >= time)[:, None], -jump, 0.0)
        return replace(streams, positions=at.with_values(llh_displaced(at.values, moved)))

    north, east, down = (float(x) for x in jump)
    parts = [f"{name} {x:+.3g} m" for name, x in (("north", north), ("east", east), ("height", -down)) if x]
    size = float(np.linalg.norm(jump))
    if north or east:
        name, fault = "fixes", f"step by {size:.3g} m at {time:.1f} s: {', '.join(parts)}"
    else:
        name, fault = "heights", f"step by {-down:+.3g} m at {time:.1f} s"
    done = "subtracted from all behind it"
    return Move(name, fault, done, size=size, unit="m", begin=time, mended=mended, kind="event")
