"""Short transients: glitches that jump and decay within a second, which the catalogue has no name for.

Statistic: residuals are compared with e^(−t/T) from every sample on, for some T below the shortest time constant of a
`recovery`. The products are normal with the correlation e^(−|t|/T), of which the number of excursions beyond ±u is
Poisson with the mean 2 (n/T) u φ(u) [1]_, n samples, T in samples; the least likely count over all T and u counts.
Extension: the transients are taken out of the samples, so that no burst and no switching bias is made up for them.

References
----------
.. [1] J. Pickands, Upcrossing probabilities for stationary Gaussian processes, Trans. Am. Math. Soc. 145 (1969).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from models.arrays import FloatArray, IntArray, SingleArray
from models.probability import normal_density, poisson_at_least
from models.recursion import decaying_sum
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.recovery import MIN_BLOCKS
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.outcome import NO_GAIN, WORTH_A_FIT, TestResult

SHORTEST_TIME, TIME_RATIO = 4.0, 2.5
"""Shortest time constant, samples, and from one to the next: one between two has 0.95 of the product with either."""
LEVELS = (4.5, 5.0, 5.5, 6.5, 8.0)
"""Levels of the excursions, sds; below the first, chance makes too many."""


@dataclass(frozen=True)
class Transients(Extension):
    """Sizes, scales, of what begins at these samples and decays with a time constant, samples."""

    cause = "transients"
    group = "slow part"
    named = False
    meaning = "short transients that jump and decay"
    consequence = "look for knocks and for faults of the supply or the bus at these times"
    places: tuple[int, ...]
    sizes: tuple[float, ...]
    time_constant: float

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the transients out."""
        begun = np.zeros(len(channel))
        begun[list(self.places)] = self.sizes
        return replace(channel, y=channel.y - decaying_sum(begun, float(np.exp(-1.0 / self.time_constant))))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Count excursions of the products of the residuals with a decay."""
        e = (
            fitted.clipped
            if bool(fitted.valid.all())
            else np.where(fitted.valid, fitted.clipped, np.float32(0.0))
        )
        longest = max(MIN_BLOCKS * fitted.channel.block, SHORTEST_TIME)
        constants = SHORTEST_TIME * TIME_RATIO ** np.arange(
            int(np.log(longest / SHORTEST_TIME) / np.log(TIME_RATIO)) + 1
        )
        best, chosen = 1.0, SHORTEST_TIME
        decay = np.exp(-1.0 / constants)
        which, at, product = _beyond(e, decay, np.sqrt(-np.expm1(-2.0 / constants)), LEVELS[0])
        for k, constant in enumerate(constants.tolist()):
            places, size = at[which == k][::-1], np.abs(product[which == k])[::-1]
            for level in LEVELS:
                number = len(_excursions(places[size > level], constant))
                if not number:
                    break
                mean = 2.0 * len(e) / constant * level * normal_density(level)
                chance = poisson_at_least(number, mean)
                best, chosen = min((best, chosen), (chance, constant))
        p_value = min(1.0, best * len(constants) * len(LEVELS))
        if p_value > WORTH_A_FIT:
            return TestResult(cls.cause, p_value, NO_GAIN, 0.0, cls.meaning)
        mine = which == constants.tolist().index(chosen)
        z = dict(zip(at[mine].tolist(), product[mine].tolist(), strict=True))
        peaks = [
            max(group.tolist(), key=lambda place: abs(z[place]))
            for group in _excursions(at[mine][::-1], chosen)
        ]
        size = np.abs([z[place] for place in peaks])
        price = np.log(len(e) / chosen)
        gain = float(np.sum(np.maximum(0.5 * size**2 - price, 0.0)))
        dt = fitted.channel.interval
        largest = peaks[int(np.argmax(size))]
        place = (
            f"{len(peaks)} that decay in {chosen * dt:.2g} s, largest at {fitted.channel.time(largest):.6g} s"
        )
        white = fitted.spread * float(np.sqrt(fitted.expected_power.fast / dt))
        sizes = white * np.sqrt(-np.expm1(-2.0 / chosen)) * np.array([z[place] for place in peaks])
        found = cls(tuple(peaks), tuple(sizes.tolist()), chosen)
        return TestResult(
            cls.cause,
            p_value,
            gain,
            float(size.max()),
            cls.meaning,
            lambda: (found,),
            misfit=gain,
            place=place,
        )


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _beyond(
    e: SingleArray, decay: FloatArray, scale: FloatArray, level: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return where products of residuals with decays from each sample on, of unit variance, are beyond a level.

    Which of the decays (q,), the sample, and the product, the last samples first.
    """
    which, at, product = (
        [np.int64(0) for _ in range(0)],
        [np.int64(0) for _ in range(0)],
        [0.0 for _ in range(0)],
    )
    total, least = np.zeros(decay.size), level / scale
    for i in range(e.size - 1, -1, -1):
        beyond = False
        for k in range(decay.size):
            total[k] = decay[k] * total[k] + e[i]
            beyond |= abs(total[k]) > least[k]
        if beyond:
            for k in range(decay.size):
                if abs(total[k]) > least[k]:
                    which.append(np.int64(k))
                    at.append(np.int64(i))
                    product.append(scale[k] * total[k])
    return np.array(which, np.int64), np.array(at, np.int64), np.array(product, np.float64)


def _excursions(at: IntArray, constant: float) -> list[IntArray]:
    """Return samples, in order of time, those within two time constants of each other together."""
    return np.split(at, np.flatnonzero(np.diff(at) > 2.0 * constant) + 1) if len(at) else []
