"""Errors of a satellite receiver from a log of its antenna at rest: white noise, and a Gauss–Markov process beside it.

The position about its mean, north, east, down, is fitted as any other channel (`likelihood`): white noise of the
single fix, and a Gauss–Markov process where it gains more than ln n nats for its two parameters. What a filter is given
of the latter is one process: the rms of north and east, the down part as a multiple of it, and the mean of the
logarithms of the time constants, each by its weight.

A constant error of the receiver cannot be seen at rest, nor what changes with motion (multipath): the values are a
lower bound for a drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.earth import ned_between
from models.noise import GaussMarkov
from models.probability import REACH_95
from tuner.identification.likelihood import LikelihoodFit, fit
from tuner.types import Coefficient, GnssNoise
from tuner.types.records import DataError, Gnss

AXES = ("north", "east", "down")
DEFAULT_GATE = 5.0
"""Gate of the configuration, sigmas."""
MIN_FIXES = 100
"""Fixes below which nothing is identified."""
MIN_MOVING_SPEED = 1.0
"""Speed between means of a tenth of the record from which the antenna is not at rest, m/s."""
MIN_GAP_RATIO = 1.5
"""Step of the stamps, in usual ones, from which a piece ends."""


@dataclass(frozen=True)
class ReceiverErrors:
    """What a log at rest says of a receiver.

    Attributes
    ----------
    noise : GnssNoise
        For a filter.
    position : mapping of str to mapping
        By axis: ``white_sd`` m and, where there is such a process, ``sd`` m and ``time_constant`` s.
    velocity : mapping of str to Coefficient
        White sd by axis, m/s; empty without velocities.
    notes : tuple of str
        What to know.
    """

    noise: GnssNoise
    position: Mapping[str, Mapping[str, Coefficient]]
    velocity: Mapping[str, Coefficient]
    notes: tuple[str, ...]


def identify_receiver(gnss: Gnss, *, name: str = "log at rest") -> ReceiverErrors:
    """Identify the errors of a receiver from fixes of an antenna at rest.

    Raises
    ------
    DataError
        Too few fixes, or an antenna that moves.
    """
    if len(gnss) < MIN_FIXES:
        raise DataError(f"{name}: expected at least {MIN_FIXES} fixes of an antenna at rest, got {len(gnss)}")
    interval = float(np.median(np.diff(gnss.t)))
    ned = ned_between(gnss.llh, gnss.llh.mean(axis=0))
    _at_rest(gnss.t, ned, name)
    cuts = np.flatnonzero(np.diff(gnss.t) > MIN_GAP_RATIO * interval) + 1
    fits = [_fit(np.split(column, cuts), interval) for column in ned.T]
    position = {axis: _coefficients(found, interval) for axis, found in zip(AXES, fits, strict=True)}
    velocity = _velocity(gnss.vel_n)
    correlated, down = _process(fits)
    white = [float(found.value("white.density") / np.sqrt(interval)) for found in fits]
    speeds = tuple(c.value or 0.0 for c in velocity.values())
    noise = GnssNoise(
        (white[0], white[1], white[2]),
        (speeds[0], speeds[1], speeds[2]) if velocity else None,
        interval,
        DEFAULT_GATE,
        correlated,
        f"identified from {name}, {len(gnss)} fixes at rest",
        correlated_down=down,
    )
    notes = ["an antenna at rest shows no constant error and none that changes with motion"]
    if correlated and correlated[0].time_constant > 0.1 * float(gnss.t[-1] - gnss.t[0]):
        notes.append("the time constant exceeds a tenth of the log: its sd is little more than a guess")
    return ReceiverErrors(noise, position, velocity, tuple(notes))


def _at_rest(t: FloatArray, ned: FloatArray, name: str) -> None:
    """Raise DataError where means of tenths of the record move as an antenna at rest cannot."""
    parts = np.array_split(np.arange(len(t)), 10)
    place = np.array([np.median(ned[part], axis=0) for part in parts])
    time = np.array([t[part].mean() for part in parts])
    speed = float(np.max(np.linalg.norm(np.diff(place, axis=0), axis=1) / np.diff(time)))
    if speed > MIN_MOVING_SPEED:
        raise DataError(
            f"{name}: expected an antenna at rest, it moves at {speed:.3g} m/s; leave the moving part out"
        )


def _fit(pieces: list[FloatArray], interval: float) -> LikelihoodFit:
    """Return the better of white noise and white noise with a Gauss–Markov process."""
    alone = fit(pieces, interval, ("white",))
    both = fit(pieces, interval, ("white", "gauss_markov"))
    price = float(np.log(sum(len(piece) for piece in pieces)))
    return both if both.log_likelihood - alone.log_likelihood > price else alone


def _coefficients(found: LikelihoodFit, interval: float) -> dict[str, Coefficient]:
    def one(name: str, unit: str, scale: float = 1.0) -> Coefficient:
        low, high = found.interval(name)
        return Coefficient.known(scale * found.value(name), scale * low, scale * high, unit)

    out = {"white_sd": one("white.density", "m", interval**-0.5)}
    if "gauss_markov" in found.terms:
        out["sd"] = one("gauss_markov.sd", "m")
        out["time_constant"] = one("gauss_markov.time_constant", "s")
    return out


def _process(fits: list[LikelihoodFit]) -> tuple[tuple[GaussMarkov, ...], float]:
    """Return the one process that stands for those of three axes, and its down part over the horizontal one."""
    have = [found for found in fits if "gauss_markov" in found.terms]
    if not have:
        return (), 1.0
    sd = [found.value("gauss_markov.sd") if "gauss_markov" in found.terms else 0.0 for found in fits]
    at = [found.names.index("gauss_markov.time_constant") for found in have]
    logs = [float(found.estimate[j]) for found, j in zip(have, at, strict=True)]
    weights = [1.0 / float(found.covariance[j, j]) for found, j in zip(have, at, strict=True)]
    time = float(np.exp(np.average(logs, weights=weights)))
    level = float(np.hypot(sd[0], sd[1]) / np.sqrt(2.0))
    if level == 0.0:
        return (GaussMarkov(sd[2], time),), 1.0
    return (GaussMarkov(level, time),), sd[2] / level


def _velocity(vel_n: FloatArray) -> dict[str, Coefficient]:
    """Return the sds of velocities about 0, with the interval of n independent ones."""
    good = np.isfinite(vel_n).all(axis=1)
    n = int(np.count_nonzero(good))
    if n < MIN_FIXES:
        return {}
    sd = np.sqrt(np.mean(vel_n[good] ** 2, axis=0)).tolist()
    half = REACH_95 / np.sqrt(2.0 * n)
    return {
        axis: Coefficient.known(s, s * float(np.exp(-half)), s * float(np.exp(half)), "m/s")
        for axis, s in zip(AXES, sd, strict=True)
    }
