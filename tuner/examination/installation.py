"""Delays of streams and the lever arm of the receiver, estimated together: constants of an installation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from models.arrays import FloatArray
from models.effects.drive.gnss import middle_of
from tuner.examination.fit import Fit, Placed, constants, earned, fit
from tuner.examination.moves import DELAYS, RECEIVER, STATED_ODDS, Move, arm_of, of_clock
from tuner.examination.streams import Streams
from tuner.examination.windows import Motion, Windows
from tuner.limits import PRIOR_SHARE
from tuner.types.clock import CERTAIN_SDS, Clock, Delay

NEWTON_STEPS = 10
"""Steps after which delays have settled."""
STEP_PARTS = 1.0, 0.5, 0.25
"""Parts of a step that are tried, until one is likelier."""
OPEN_STEPS = 2
"""Of them those in which no reading counts as wrong."""
SETTLED_SDS = 0.3
"""Step, in sds, below which they end."""
NEAR_DELAYS = tuple(delay for delay in DELAYS if abs(delay) <= 0.5)
"""Common delays from which the search begins as well, s: at a steady speed a lever arm stands for a part of one."""
FIXED_SD = 1e-9
"""Prior sd of a delay that is none, s."""
DRIFT = "drift"
"""Name of the growth of the delay of all streams in a second."""
DELAY_SD, DRIFT_SD = 1.0, 1e-3
"""Prior sds of a delay, s, and of its growth in a second: crystals and clocks of operating systems err by less."""
ARM_SD, STATED_ARM_SD = 1.0, 0.1
"""Prior sd of a lever arm about zero, and about what is stated, m."""


@dataclass(frozen=True)
class _Settled:
    """Delays and lever arm, and sds, shape (c,); streams without them, and their fit."""

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
        Of each stream as it was recorded, None: of all against the inertial unit, under `DRIFT` its growth in a second.
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

    def moves(self, recorded: Streams) -> dict[str, Move]:
        """Return what undoes the delays and the lever arm that are certain, by their subject."""
        delays = {name: one for name, one in self.delays.items() if name != DRIFT and one.certain}
        certain = [of_clock(name, Clock(one)) for name, one in delays.items()]
        if (clock := self.clock(recorded)).drift.certain:
            certain = [of_clock(None, clock), *(one for one in certain if one.stream != RECEIVER)]
        if self.streams.positions.arm != recorded.positions.arm:
            certain.append(arm_of(np.array(self.streams.positions.arm), self.arm_sd))
        return {move.subject: move for move in certain}

    def clock(self, recorded: Streams) -> Clock:
        """Return the clock that the delays make, with the stamps of the first and the last position."""
        first, last = recorded.positions.t[[0, -1]].tolist()
        lag = self.delays.get("velocities", Delay())
        return Clock(self.delays[None], lag, drift=self.delays[DRIFT], ends=(first, last))


def installed(streams: Streams, now: Fit) -> Installed:
    """Return streams with their delays and the lever arm of the receiver, as far as they are certain.

    One delay is common to all against the inertial unit, each other stream has one against the positions. One that the
    likelihood does not pay for is zero when the others are estimated, unless a part of it was taken out before.
    """
    problem = _Problem.of(streams)
    names, prior, arm = problem.names, problem.prior, slice(len(problem.names), None)
    price = math.log(STATED_ODDS * len(prior))
    best = max(
        (problem.settled(at, prior, OPEN_STEPS) for at in problem.starts(now)), key=lambda at: at.fit.total
    )
    taken = _taken_out(streams)
    free = prior
    delays: dict[str | None, Delay] = {}
    for k in np.argsort(np.abs(best.value / best.sd)[: len(names)]):
        only = np.arange(len(prior)) == k
        value, fixed = np.where(only, 0.0, best.value), np.where(only, FIXED_SD, free)
        without = problem.settled(problem.at(value, fixed, best.fit), fixed)
        if without.fit.total > best.fit.total:  # a constant less is never likelier: there is a better optimum
            best = max(best, problem.settled(without, free), key=lambda x: x.fit.total)
        one, gain = Delay(float(best.value[k]), float(best.sd[k])), best.fit.total - without.fit.total
        if not taken[names[k]] and not (one.certain and one.sd < PRIOR_SHARE * prior[k] and gain > price):
            best, free = _averaged(best, without, gain + math.log(one.sd / prior[k])), fixed
            delays[names[k]] = Delay() if one.certain else one
    kept = free > FIXED_SD
    kept[arm] = np.any(np.abs(best.value[arm]) > CERTAIN_SDS * best.sd[arm]) and np.all(
        best.sd[arm] < PRIOR_SHARE * prior[arm]
    )
    moved = problem.without(np.where(kept, best.value, 0.0))
    # from first guesses, as those of the faults that are tried
    after = fit(moved, problem.windows) if kept.any() else now
    gain = earned(after.gains_over(now)) - price
    found = kept & (gain > 0.0)
    left = np.where(found, 0.0, best.value)
    delays |= {name: Delay(float(left[k]), float(best.sd[k])) for k, name in enumerate(names) if kept[k]}
    if not found.any():
        moved, after, gain = streams, now, 0.0
    taken = _taken_out(moved)
    delays = {name: one.beside(-taken[name]) for name, one in delays.items()}
    delays = {name: one if taken[name] or not one.certain else Delay() for name, one in delays.items()}
    return Installed(moved, after, delays, best.sd[arm], gain)


def _averaged(best: _Settled, without: _Settled, evidence: float) -> _Settled:
    """Return constants without one that is not claimed, with sds of both models, weighed by their evidence, nats."""
    share = float(expit(evidence))
    more = share * ((best.value - without.value) ** 2 + best.sd**2 - without.sd**2)
    return replace(without, sd=np.sqrt(np.maximum(without.sd**2 + more, without.sd**2)))


@dataclass(frozen=True)
class _Problem:
    """Streams of which delays and a lever arm are estimated.

    Attributes
    ----------
    streams, windows : Streams, Windows
        Before anything is taken out, and their inertial unit in windows.
    names : tuple of str or None
        Whose delays are estimated; None: of all streams together, which may grow: `DRIFT`.
    prior : ndarray, shape (c,)
        Prior sds of these delays, s, and behind them of the lever arm, m.
    middle : float
        Time of the delay of a clock that drifts: halfway between the first and the last fix, s.
    """

    streams: Streams
    windows: Windows
    names: tuple[str | None, ...]
    prior: FloatArray
    middle: float

    @staticmethod
    def of(streams: Streams) -> _Problem:
        names = (None, *(one.name for one in streams.others), DRIFT)
        arm_sd = STATED_ARM_SD if any(streams.positions.arm) else ARM_SD
        prior = np.repeat([DELAY_SD, DRIFT_SD, arm_sd], [len(names) - 1, 1, 3])
        return _Problem(streams, streams.imu.windows, names, prior, middle_of(streams.positions.t))

    def columns(self, one: Placed, motion: Motion) -> FloatArray:
        """Return the derivatives of what a stream reads by delays and lever arm, shape (m, d, c)."""
        stream = one.stream
        rate = -stream.by_time(motion)[..., None]
        own = np.array([name in (None, stream.name) for name in self.names[:-1]])
        since = (stream.t[one.row.ravel()] - self.middle)[:, None, None]
        return np.concatenate([rate * own, rate * since, stream.by_arm(motion)], axis=-1)

    def without(self, sizes: FloatArray) -> Streams:
        """Return the streams without delays, s, and with the rest of a lever arm, m."""
        streams, ends = self.streams, (self.middle, self.middle)
        for name, value in zip(self.names, sizes.tolist(), strict=False):
            clock = Clock(drift=Delay(value), ends=ends) if name == DRIFT else Clock(Delay(value))
            streams = of_clock(None if name == DRIFT else name, clock).mended(streams)
        arm = np.array(streams.positions.arm) + sizes[len(self.names) :]
        return arm_of(arm, np.zeros(3)).mended(streams)

    def at(self, value: FloatArray, sd: FloatArray, near: Fit) -> _Settled:
        """Return constants of some values, with a fit that begins from another."""
        moved = self.without(value)
        return _Settled(value, sd, moved, fit(moved, self.windows, near=near))

    def starts(self, now: Fit) -> list[_Settled]:
        """Return where the search begins: at no delay, and at the likeliest of `NEAR_DELAYS` if that is likelier."""
        first = _Settled(np.zeros(len(self.prior)), self.prior, self.streams, now)
        alone = np.eye(len(self.prior))[0]
        near = [self.at(delay * alone, self.prior, now) for delay in NEAR_DELAYS]
        likeliest = max(near, key=lambda at: at.fit.total)
        return [first, likeliest] if likeliest.fit.total > now.total else [first]

    def settled(self, at: _Settled, free: FloatArray, opened: int = 0) -> _Settled:
        """Return constants with prior sds `free` where no step makes them likelier, from others.

        In the first steps, `opened`, no reading counts as wrong.
        """
        for number in range(NEWTON_STEPS):
            gated = number >= opened
            step, sd = constants(at.streams, self.windows, at.fit, self.columns, free, gated=gated)
            at = replace(at, sd=sd)
            if gated and np.all(np.abs(step) < SETTLED_SDS * sd):
                break
            for part in STEP_PARTS:
                value = at.value + part * step
                if np.any(np.abs(value[: len(self.names)]) >= max(DELAYS)):
                    continue  # it would leave readings in other windows
                found = self.at(value, sd, at.fit)
                if found.fit.total > at.fit.total:
                    at = found
                    break
            else:
                if gated:
                    break
        return at


def _taken_out(streams: Streams) -> dict[str | None, float]:
    """Return the delay of each stream that was already taken out of its stamps, s, and how much it grew a second."""
    common, drift = streams.positions.delay, streams.positions.drift
    return {None: common, DRIFT: drift, **{one.name: one.delay - common for one in streams.others}}
