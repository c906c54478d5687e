"""Which fault of a stream explains a drive, tried as a transformation that its likelihood has to pay for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import expit

from models.arrays import FloatArray, IntArray
from models.earth import metres_per_radian
from models.robust import normal_sd
from tuner.examination.distant_clocks import distant_delay
from tuner.examination.fit import FIRST_ROUNDS, LEAST_READINGS, Fit, constants, fit
from tuner.examination.moves import DELAYS, Move, arm_of, exchanged, late, moves
from tuner.examination.streams import Stream, Streams, Velocities
from tuner.examination.windows import WINDOW_LENGTH, Motion, averaged, windows_of
from tuner.limits import PRIOR_SHARE
from tuner.types.clock import CERTAIN_SDS, Delay
from tuner.types.records import DataError

STATED_ODDS = 1000.0
"""Odds of what a file states of its units, axes and clocks."""
SCREENED_WINDOWS = 16
"""Windows on which every fault is tried first."""
REFITTED_FAULTS = 3
"""Faults that are then tried on all windows."""
UNSEEN_GAIN = 3.0
"""Change of the log-likelihood by a fault, nats, below which a recording cannot show it."""
NEWTON_STEPS = 10
"""Steps after which delays have settled."""
STEP_PARTS = 1.0, 0.5, 0.25
"""Parts of a step that are tried, until one is likelier."""
OPEN_STEPS = 2
"""Of them those in which no reading counts as wrong."""
SETTLED_SDS = 0.3
"""Step, in sds, below which they end."""
FIXED_SD = 1e-9
"""Prior sd of a delay that is none, s."""
ARM_SD, STATED_ARM_SD = 1.0, 0.1
"""Prior sd of a lever arm about zero, and about what is stated, m."""
MOST_FAULTS = 4
"""Faults of whole streams that are looked for one after the other."""


@dataclass(frozen=True)
class Found:
    """A fault that the likelihood wants.

    Attributes
    ----------
    move : Move
        What is wrong and what undoes it.
    gain : float
        What undoing it adds to the log-likelihood, less its price, nats.
    over_next : float
        By how much that is more than of the next explanation, nats.
    rival : Move or None
        The next explanation, where it is wanted as well.
    begin, end : float or None
        Where it holds, s; None from the start, to the end.
    """

    move: Move
    gain: float
    over_next: float
    begin: float | None = None
    end: float | None = None
    rival: Move | None = None


def applied(found: Sequence[Found], streams: Streams) -> Streams:
    """Return streams without faults that were found in slower ones."""
    for one in found:
        mended = one.move.mended(streams)
        streams = (
            mended if one.begin is None and one.end is None else between(streams, mended, one.begin, one.end)
        )
    return streams


@dataclass(frozen=True)
class Searched:
    """What a search found: faults, fits with them and without, what the recording cannot show, and every delay.

    A delay is that of a stream against the positions, under None that of all streams against the inertial unit.
    """

    found: tuple[Found, ...]
    before: Fit
    after: Fit
    unseen: tuple[str, ...]
    delays: Mapping[str | None, Delay]


def searched(streams: Streams, name: str = "streams") -> Searched:
    """Return the faults of whole streams.

    Raises
    ------
    DataError
        Where no window has inertial samples and positions.
    """
    whole = replace(streams, imu=averaged(streams.imu))
    recorded = _inside(whole)
    found: list[Found] = []
    first = fit(recorded, every=True)
    if not len(first.begin):
        raise DataError(
            f"{name}: expected windows of {WINDOW_LENGTH:g} s with inertial samples and {LEAST_READINGS} positions or "
            "more, found none: the clocks of the streams do not meet, or the recording is too short"
        )
    unseen: tuple[str, ...] = ()
    begun, now = recorded, first
    far = late(None, distant_delay(whole))
    if far.delay:
        near = _inside(far.mended(whole))
        there = fit(near, every=True)
        worth = _earned(_gains(there, first)) - math.log(STATED_ODDS)
        if worth > 0.0:
            found, begun, now = [Found(far, worth, math.inf)], near, there
    at = _installed(recorded, begun, now)
    gain = at.gain
    for _ in range(MOST_FAULTS):
        moved = [one.move for one in found if one.begin is None and one.end is None]
        read = {(one.stream, one.fault) for one in moved if one.reading}  # no unit is taken twice
        left = [one for one in moves(at.streams) if (one.stream, one.fault) not in read]
        tried, unseen = _tried(at.streams, at.fit, left)
        if not tried or tried[0][0].gain <= 0.0:
            break
        best, streams, now = tried[0]
        others = [
            one for one, *_ in tried[1:] if best.move.delay is None or one.move.subject != best.move.subject
        ]
        rival = max(others, key=lambda one: one.gain, default=None)
        rest, other = (0.0, None) if rival is None or rival.gain <= 0.0 else (rival.gain, rival.move)
        found.append(replace(best, over_next=best.gain - rest, rival=other))
        at = _installed(recorded, streams, now)
        gain = max(gain, at.gain)
    delays = _whole_delays(recorded, at)
    named = _joined(found, _constants(recorded, at, delays, gain))
    unseen = tuple(one for one in unseen if one not in {each.move.subject for each in named})
    return Searched(named, first, fit(at.streams, near=at.fit, every=True), unseen, delays)


@dataclass(frozen=True)
class _Settled:
    """Delays and lever arm at their likeliest values, and sds, shape (c,); streams without them, and their fit."""

    value: FloatArray
    sd: FloatArray
    streams: Streams
    fit: Fit


@dataclass(frozen=True)
class _Installed:
    """Streams without their delays and lever arm, as far as these are certain, and their fit.

    Attributes
    ----------
    delays : mapping of str or None to Delay
        What is left of the delay of each stream.
    arm_sd : ndarray, shape (3,)
        Sds of the lever arm, m.
    gain : float
        What all add to the log-likelihood, less their price, nats.
    """

    streams: Streams
    fit: Fit
    delays: Mapping[str | None, Delay]
    arm_sd: FloatArray
    gain: float


def _installed(recorded: Streams, streams: Streams, now: Fit) -> _Installed:
    """Return streams with their delays and the lever arm of the receiver, as far as they are certain.

    One delay is common to all against the inertial unit, each other stream has one against the positions. One that the
    likelihood does not pay for is zero when the others are estimated, unless a part of it was taken out before.
    """
    names, columns, prior = _columns(streams)
    price = math.log(STATED_ODDS * len(prior))
    nothing = np.zeros(len(prior))
    best = _settled(_Settled(nothing, prior, streams, now), streams, columns, prior, OPEN_STEPS)
    free = prior
    delays: dict[str | None, Delay] = {}
    taken = _taken_out(recorded, streams)
    for k in np.argsort(np.abs(best.value / best.sd)[: len(names)]):
        only = np.arange(len(prior)) == k
        value, fixed = np.where(only, 0.0, best.value), np.where(only, FIXED_SD, free)
        moved = _with(streams, names, value)
        begun = _Settled(value, fixed, moved, fit(moved, near=best.fit))
        without = _settled(begun, streams, columns, fixed, 0)
        if without.fit.total > best.fit.total:  # a constant less is never likelier: there is a better optimum
            again = _settled(without, streams, columns, free, 0)
            best = max(best, again, key=lambda x: x.fit.total)
        one, gain = Delay(float(best.value[k]), float(best.sd[k])), best.fit.total - without.fit.total
        if not taken[names[k]] and not (one.certain and one.sd < PRIOR_SHARE * prior[k] and gain > price):
            best, free = _averaged(best, without, gain + math.log(one.sd / prior[k])), fixed
            delays[names[k]] = Delay() if one.certain else one
    kept = free > FIXED_SD
    arm = slice(len(names), None)
    kept[arm] = np.any(
        np.abs(best.value) > CERTAIN_SDS * best.sd, where=np.arange(len(prior)) >= len(names)
    ) and bool(np.all(best.sd[arm] < PRIOR_SHARE * prior[arm]))
    moved = _with(streams, names, np.where(kept, best.value, 0.0))
    after = fit(moved) if kept.any() else now  # from first guesses, as those of the faults that are tried
    gain = _earned(_gains(after, now)) - price
    found = kept & (gain > 0.0)
    left = np.where(found, 0.0, best.value)
    delays |= {name: Delay(float(left[k]), float(best.sd[k])) for k, name in enumerate(names) if kept[k]}
    if not found.any():
        return _Installed(streams, now, delays, best.sd[arm], 0.0)
    return _Installed(moved, after, delays, best.sd[arm], gain)


def _averaged(best: _Settled, without: _Settled, evidence: float) -> _Settled:
    """Return constants without one that is not claimed, with sds of both models, weighed by their evidence, nats."""
    share = float(expit(evidence))
    more = share * ((best.value - without.value) ** 2 + best.sd**2 - without.sd**2)
    return replace(without, sd=np.sqrt(np.maximum(without.sd**2 + more, without.sd**2)))


def _settled(
    begun: _Settled,
    streams: Streams,
    columns: Callable[[Stream, Motion], FloatArray],
    prior: FloatArray,
    opened: int,
) -> _Settled:
    """Return constants where no step makes them likelier; in the first steps, `opened`, no reading counts as wrong."""
    names = (None, *(one.name for one in streams.others))
    windows, at = windows_of(streams.imu), begun
    for number in range(NEWTON_STEPS):
        sizes = constants(at.streams, windows, at.fit, columns, prior, gated=number >= opened)
        at = replace(at, sd=sizes.sd)
        if number >= opened and np.all(np.abs(sizes.value) < SETTLED_SDS * sizes.sd):
            break
        for part in STEP_PARTS:
            value = at.value + part * sizes.value
            if np.all(
                np.abs(value[: len(names)]) < max(DELAYS)
            ):  # beyond it leaves readings in other windows
                moved = _with(streams, names, value)
                found = fit(moved, windows, near=at.fit)
                if found.total > at.fit.total:
                    at = _Settled(value, sizes.sd, moved, found)
                    break
        else:
            if number >= opened:
                break
    return at


def _taken_out(recorded: Streams, streams: Streams) -> dict[str | None, float]:
    """Return by how much stamps are earlier than as they were recorded, s."""
    common = float(recorded.positions.t[0] - streams.positions.t[0])
    pairs = zip(recorded.others, streams.others, strict=True)
    return {None: common, **{one.name: float(one.t[0] - moved.t[0]) - common for one, moved in pairs}}


def _whole_delays(recorded: Streams, at: _Installed) -> dict[str | None, Delay]:
    """Return the delays of streams as they were recorded: what was taken out, and what is left."""
    taken = _taken_out(recorded, at.streams)
    whole = {name: at.delays[name].beside(-value) for name, value in taken.items()}
    return {name: one if taken[name] or not one.certain else Delay() for name, one in whole.items()}


def _constants(
    begun: Streams, at: _Installed, delays: Mapping[str | None, Delay], gain: float
) -> dict[str, Found]:
    """Return the delays and the lever arm that are certain, by their subject."""
    certain = [late(name, one.value, one.sd) for name, one in delays.items() if one.certain]
    if at.streams.positions.arm != begun.positions.arm:
        certain.append(arm_of(np.array(at.streams.positions.arm), at.arm_sd))
    return {move.subject: Found(move, gain, math.inf) for move in certain}


def _columns(
    streams: Streams,
) -> tuple[tuple[str | None, ...], Callable[[Stream, Motion], FloatArray], FloatArray]:
    """Return whose delays are estimated (None: of all streams together), derivatives, and prior sds.

    Derivatives and sds are those of the delays, s, and behind them of a lever arm, m.
    """
    names = (None, *(one.name for one in streams.others))

    def columns(one: Stream, motion: Motion) -> FloatArray:
        rate, arm = one.by_time(motion), one.by_arm(motion)
        out = np.zeros((len(motion.position), one.values.shape[1], len(names) + 3))
        if rate is not None:
            out[..., 0] = -rate
            if one.name in names:
                out[..., names.index(one.name)] = -rate
        if arm is not None:
            out[..., len(names) :] = arm
        return out

    return (
        names,
        columns,
        np.concatenate(
            [np.full(len(names), 1.0), np.full(3, STATED_ARM_SD if any(streams.positions.arm) else ARM_SD)]
        ),
    )


def _inside(streams: Streams) -> Streams:
    """Return streams without readings that a delay would bring out of all windows: their number must not change."""
    windows = windows_of(streams.imu)
    reach = max(DELAYS) + 0.1

    def inside(one: Stream) -> Stream:
        kept = np.all([windows.found(one.t + shift) >= 0 for shift in (-reach, 0.0, reach)], axis=0)
        return one.with_values(np.where(kept[:, None], one.values, np.nan))

    for one in streams.all:
        streams = exchanged(streams, one.name, inside)
    return streams


def _with(streams: Streams, names: Sequence[str | None], sizes: FloatArray) -> Streams:
    """Return streams without delays, s, and with the rest of a lever arm, m."""
    for stream, delay in zip(names, sizes, strict=False):
        streams = late(stream, float(delay)).mended(streams)
    return arm_of(np.array(streams.positions.arm) + sizes[len(names) :], np.zeros(3)).mended(streams)


def _joined(found: Sequence[Found], constant: Mapping[str, Found]) -> tuple[Found, ...]:
    """Return the faults, each delay once and of the size that it has in the end."""
    out: dict[str | Move, Found] = {}
    for one in found:
        if one.move.delay is None:
            out[one.move] = one
        # a search may have taken up a delay beside a fault that it found later
        elif one.move.subject in constant:
            before = out.get(one.move.subject, one)
            out[one.move.subject] = replace(before, move=constant[one.move.subject].move)
    return (*(one for subject, one in constant.items() if subject not in out), *out.values())


def _tried(
    streams: Streams, now: Fit, faults: Sequence[Move]
) -> tuple[list[tuple[Found, Streams, Fit]], tuple[str, ...]]:
    """Return the faults that promise most, refitted, the likeliest first, and what the windows cannot show."""
    price = math.log(STATED_ODDS * len(faults))
    part = 2.0 * math.log(len(now.begin))
    screen = _screen(streams, now)
    integrated = windows_of(streams.imu, screen)
    base = fit(streams, integrated, FIRST_ROUNDS)
    promise, unseen = [], []
    for fault in faults:
        mended = fault.mended(streams)
        own = integrated if mended.imu is streams.imu else windows_of(mended.imu, screen)
        gains = _gains(fit(mended, own, FIRST_ROUNDS), base)
        promise.append(_best_part(gains)[2])
        if fault.subject and abs(gains.sum()) < UNSEEN_GAIN:
            unseen.append(fault.subject)
    out = []
    for k in np.argsort(promise)[::-1][:REFITTED_FAULTS]:
        if promise[k] > 0.0:
            out.append(_whole_or_part(streams, now, faults[k], price, part))
    out += _stepped(streams, now, price)
    return sorted(out, key=lambda one: -one[0].gain), tuple(dict.fromkeys(unseen))


def _whole_or_part(
    streams: Streams, now: Fit, fault: Move, price: float, part: float
) -> tuple[Found, Streams, Fit]:
    """Return a fault with all windows, or with those in which it is wanted."""
    mended = fault.mended(streams)
    whole = fit(mended)
    gains = _gains(whole, now)
    found = (Found(fault, _earned(gains) - price, 0.0), mended, whole)
    first, last, gain = _best_part(gains)
    everywhere = first == 0 and last == len(gains)
    if not fault.partial or everywhere or gain < max(whole.total - now.total, price) + part:
        return found
    begin = None if first == 0 else _change(streams, mended, now.begin[first], rises=True)
    end = None if last == len(gains) else _change(streams, mended, now.begin[last], rises=False)
    joined = between(streams, mended, begin, end)
    again = fit(joined)
    other = (Found(fault, _earned(_gains(again, now)) - price - part, 0.0, begin, end), joined, again)
    return max(found, other, key=lambda one: one[0].gain)


def _screen(streams: Streams, now: Fit) -> IntArray:
    """Return the window of each sixteenth of a drive in which the unit moves most."""
    windows = windows_of(streams.imu)
    used = np.searchsorted(windows.begin, now.begin)
    first = windows.sums[used, :, :3] / np.maximum(windows.t[used], 1.0)[..., None]
    turned = np.linalg.norm(windows.attitude[used, -1] - np.eye(3), axis=(1, 2))
    activity = first.std(axis=1).sum(axis=1) * (0.1 + turned)
    groups = np.array_split(np.arange(len(used)), min(SCREENED_WINDOWS, len(used)))
    return np.array([used[g[np.argmax(activity[g])]] for g in groups])


def _gains(one: Fit, other: Fit) -> FloatArray:
    """Return the bound of the first fit less that of the second, window by window of the second, nats.

    A window that the first fit has not counts as 0 there.
    """
    gains = -other.bound.copy()
    _, own, its = np.intersect1d(one.begin, other.begin, return_indices=True)
    gains[its] += one.bound[own]
    return gains


def _earned(gains: FloatArray) -> float:
    """Return the gain of all windows, nats, less what chance gives where errors are not as modelled.

    What undoes a fault loses in no window but by chance, and chance gains as often as it loses: the losses say how far
    a sum of both scatters.
    """
    return float(gains.sum() - CERTAIN_SDS * math.sqrt(2.0 * np.sum(np.minimum(gains, 0.0) ** 2)))


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
    windows = windows_of(streams.imu)
    only = np.flatnonzero((windows.begin > near - 25.0) & (windows.begin < near + 15.0))
    values = []
    for time in at:
        joined = between(streams, mended, time, None) if rises else between(streams, mended, None, time)
        values.append(fit(joined, windows_of(joined.imu, only)).total)
    return float(at[int(np.argmax(values))])


def between(streams: Streams, mended: Streams, begin: float | None, end: float | None) -> Streams:
    """Return streams that are mended from a time to another, and as they were elsewhere."""
    low, high = -math.inf if begin is None else begin, math.inf if end is None else end

    def joined(one: Stream, other: Stream) -> Stream:
        inside = (one.t >= low) & (one.t < high)
        changed = np.where(inside, other.log_scale - one.log_scale, 0.0)
        return one.with_values(np.where(inside[:, None], other.values, one.values), changed)

    inside = (streams.imu.t >= low) & (streams.imu.t < high)
    rates = np.where(inside[:, None], mended.imu.rates, streams.imu.rates)
    positions = joined(streams.positions, mended.positions)
    assert isinstance(positions, type(streams.positions))
    return Streams(
        streams.imu if mended.imu is streams.imu else replace(streams.imu, rates=rates),
        positions,
        tuple(map(joined, streams.others, mended.others)),
    )


def _stepped(streams: Streams, now: Fit, price: float) -> list[tuple[Found, Streams, Fit]]:
    """Return the step of a coordinate that explains most, with windows about it.

    A step between two windows is none, since each has a start of its own: windows are laid so that it falls into the
    middle of one.
    """
    rows = streams.positions.readings
    t, values = streams.positions.t[rows], streams.positions.values[rows]
    moved = (values[1:] - values[:-1]) * metres_per_radian(values[1:])
    speed = _speeds(streams, t)
    odd = moved - 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)[:, None]
    usual = np.maximum(normal_sd(odd, axis=0), 1e-3)
    row = int(np.argmax(np.abs((odd - np.median(odd, axis=0)) / usual).max(axis=1)))
    time = 0.5 * float(t[row] + t[row + 1])
    span = np.flatnonzero(
        (streams.imu.t > time - 1.5 * WINDOW_LENGTH) & (streams.imu.t < time + 1.6 * WINDOW_LENGTH)
    )
    if len(span) < 2:
        return []
    beside = replace(streams, imu=replace(streams.imu, t=streams.imu.t[span], rates=streams.imu.rates[span]))
    before = fit(beside, every=True)
    if _halves(streams, before, time) is None:
        return []
    jump = np.where(np.abs(odd[row]) > CERTAIN_SDS * usual, odd[row], 0.0)
    after = fit(_step(jump, time).mended(beside), every=True)
    halves = _halves(streams, after, time)
    if halves is None:
        return []
    sd = np.array(after.noise[0].sd)
    jump = jump + halves
    move = _step(np.where(np.abs(jump) > CERTAIN_SDS * sd, jump, 0.0), time)
    gain = fit(move.mended(beside)).total - before.total - price
    if gain <= 0.0:
        return []
    mended = move.mended(streams)
    whole = fit(mended)
    if whole.total < now.total - UNSEEN_GAIN:
        return []
    return [(Found(move, gain, 0.0, time), mended, whole)]


def _speeds(streams: Streams, t: FloatArray) -> FloatArray:
    """Return velocities at times, of the receiver or else by its positions, shape (k, 3)."""
    for one in streams.others:
        if isinstance(one, Velocities) and one.readings.sum() > 1:
            rows = one.readings
            return np.column_stack([np.interp(t, one.t[rows], x) for x in one.values[rows].T])
    rows = streams.positions.readings
    values = streams.positions.values[rows]
    smooth = np.gradient(values, streams.positions.t[rows], axis=0) * metres_per_radian(values)
    return np.column_stack([np.interp(t, streams.positions.t[rows], median_filter(x, 5)) for x in smooth.T])


def _halves(streams: Streams, found: Fit, time: float) -> FloatArray | None:
    """Return how much positions still step at a time, by the residuals of the window about it; None without both."""
    left, t = found.left[0], streams.positions.t
    window = np.searchsorted(found.begin, t, side="right") - 1
    here = np.isfinite(left[:, 0]) & (window == np.searchsorted(found.begin, time, side="right") - 1)
    if not (here & (t < time)).any() or not (here & (t > time)).any():
        return None
    return np.asarray(np.median(left[here & (t > time)], axis=0) - np.median(left[here & (t < time)], axis=0))


def _step(jump: FloatArray, time: float) -> Move:
    """Return a step of the positions: north, east, down, m."""

    def mended(streams: Streams) -> Streams:
        values = streams.positions.values.copy()
        later = streams.positions.t >= time
        values[later] -= jump / metres_per_radian(values[later])
        return replace(streams, positions=streams.positions.with_values(values))

    north, east, down = (float(x) for x in jump)
    parts = [f"{name} {x:+.3g} m" for name, x in (("north", north), ("east", east), ("height", -down)) if x]
    size = float(np.linalg.norm(jump))
    if north or east:
        name, fault = "fixes", f"step by {size:.3g} m at {time:.1f} s: {', '.join(parts)}"
    else:
        name, fault = "heights", f"step by {-down:+.3g} m at {time:.1f} s"
    done = "subtracted from all behind it"
    return Move(name, fault, done, mended, partial=False, size=size, unit="m")
