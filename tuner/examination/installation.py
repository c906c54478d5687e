"""Delays of streams and the lever arm of the receiver, estimated together: constants of an installation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from models.arrays import FloatArray
from tuner.examination.fit import Fit, constants, earned, fit
from tuner.examination.moves import DELAYS, STATED_ODDS, Move, arm_of, late
from tuner.examination.streams import Stream, Streams
from tuner.examination.windows import Motion, windows_of
from tuner.limits import PRIOR_SHARE
from tuner.types.clock import CERTAIN_SDS, Delay

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


@dataclass(frozen=True)
class _Settled:
    """Delays and lever arm at their likeliest values, and sds, shape (c,); streams without them, and their fit."""

    value: FloatArray
    sd: FloatArray
    streams: Streams
    fit: Fit


@dataclass(frozen=True)
class Installed:
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


def installed(recorded: Streams, streams: Streams, now: Fit) -> Installed:
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
    gain = earned(after.gains_over(now)) - price
    found = kept & (gain > 0.0)
    left = np.where(found, 0.0, best.value)
    delays |= {name: Delay(float(left[k]), float(best.sd[k])) for k, name in enumerate(names) if kept[k]}
    if not found.any():
        return Installed(streams, now, delays, best.sd[arm], 0.0)
    return Installed(moved, after, delays, best.sd[arm], gain)


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


def whole_delays(recorded: Streams, at: Installed) -> dict[str | None, Delay]:
    """Return the delays of streams as they were recorded: what was taken out, and what is left."""
    taken = _taken_out(recorded, at.streams)
    whole = {name: at.delays[name].beside(-value) for name, value in taken.items()}
    return {name: one if taken[name] or not one.certain else Delay() for name, one in whole.items()}


def certain_moves(recorded: Streams, at: Installed, delays: Mapping[str | None, Delay]) -> dict[str, Move]:
    """Return what undoes the delays and the lever arm that are certain, by their subject."""
    certain = [late(name, one.value, one.sd) for name, one in delays.items() if one.certain]
    if at.streams.positions.arm != recorded.positions.arm:
        certain.append(arm_of(np.array(at.streams.positions.arm), at.arm_sd))
    return {move.subject: move for move in certain}


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


def _with(streams: Streams, names: Sequence[str | None], sizes: FloatArray) -> Streams:
    """Return streams without delays, s, and with the rest of a lever arm, m."""
    for stream, delay in zip(names, sizes, strict=False):
        streams = late(stream, float(delay)).mended(streams)
    return arm_of(np.array(streams.positions.arm) + sizes[len(names) :], np.zeros(3)).mended(streams)
