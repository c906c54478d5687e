"""Samples from which a program took the noise, so that it cannot be read in them.

dead zone
    Rates near zero are given as zero. A law of noise with its mode near zero has at least as many samples in (0, w) as
    in [w, 2w), w the smallest reading that is not zero: of k samples there, none below w has the chance 2^−k.
bias taken out
    A program learns the bias while the sensor rests, and subtracts it: a high-pass. White noise is flat up to half the
    rate, and every other noise of a sensor is larger at low frequencies [1]_; what a quantizer of angles adds is not
    flat at high ones. So a spectrum that is flat over the three highest octaves and lower in one below them is that of
    a high-pass: a mean of m ordinates ÷ that of the flat part has the law of a χ² of 2m degrees of freedom ÷ 2m.

References
----------
.. [1] IEEE Std 952-2020, annex C: powers of the frequency of the noise terms.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import gammainc

from models.arrays import FloatArray
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, range_text
from tuner.limits import WRONG_FACTOR
from tuner.types.records import DataError, Record

MIN_ZERO_SHARE = 0.3
"""Share of samples of exactly zero from which a dead zone is looked for."""
MAX_P_VALUE = 1e-9
"""Chance of samples from which nothing was taken."""
SIDES_ALIKE = 0.01
"""Share of the readings beside a dead zone that lie on its emptier side, at least."""
FLAT_OCTAVES, MAX_STEP = 3, 1.1
"""Octaves below half the rate that are white, and the largest ratio of the power of two of them."""
MIN_ORDINATES = 32
"""Ordinates of the lowest octave."""


def expect_noise(records: Sequence[Record]) -> None:
    """Refuse records at rest whose noise was withheld or taken out.

    Raises
    ------
    DataError
        Of a sensor with such axes: which, what was measured, and what to do.
    """
    for record in records:
        other = f"; --columns {record.name}=none reads the other sensor alone" if len(records) > 1 else ""
        zones = {axis: zone for axis in record.axes if (zone := dead_zone(record.column(axis))) > 0.0}
        if zones:
            raise DataError(
                f"{record.source}: {axes_text(list(zones))} read 0 where they are smaller than "
                f"{range_text(zones.values(), record.unit)}, a dead zone, which withholds the noise: record samples "
                f"without fusion or threshold{other}"
            )
        falls = {axis: fall for axis in record.axes if (fall := high_pass(record.pieces(axis))) > 1.0}
        if falls:
            raise DataError(
                f"{record.source}: {axes_text(list(falls))}: noise at low frequencies is up to "
                f"{digits(max(falls.values()), 2)} times weaker than the white noise above them, a high-pass, as where "
                f"a program learns the bias at rest and subtracts it: record samples as the sensor gives them{other}"
            )


def dead_zone(y: FloatArray) -> float:
    """Return the smallest size of samples (n,) that are given, where smaller ones are given as zero; 0 for none."""
    given = y[y != 0.0]
    if len(y) - len(given) < MIN_ZERO_SHARE * len(y) or not len(given):
        return 0.0
    size = np.abs(given)
    smallest = float(size.min())
    levels = np.unique(size)
    if len(levels) < 2 or smallest < 1.5 * float(np.diff(levels).min()):
        return 0.0
    positive = float(np.mean(given > 0.0))
    beside = int(np.count_nonzero(size < 2.0 * smallest))
    alike = SIDES_ALIKE < positive < 1.0 - SIDES_ALIKE
    return smallest if alike and 0.5**beside < MAX_P_VALUE else 0.0


def high_pass(pieces: Iterable[FloatArray]) -> float:
    """Return white power ÷ the least of an octave below it, of the longest of pieces (n,); 1 where nothing is less."""
    y = max(pieces, key=len, default=np.zeros(0))
    if len(y) < MIN_ORDINATES * 2 ** (FLAT_OCTAVES + 2):
        return 1.0
    power = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)))[1:-1]) ** 2
    octaves, top = [], len(power)
    while top // 2 >= MIN_ORDINATES:
        octaves.append(power[top // 2 : top])
        top //= 2
    level = np.array([float(one.mean()) for one in octaves])
    flat = level[:FLAT_OCTAVES]
    if flat.min() <= 0.0 or flat.max() > MAX_STEP * flat.min():
        return 1.0
    below = level[FLAT_OCTAVES:] / flat.mean()
    count = np.array([len(one) for one in octaves[FLAT_OCTAVES:]]) / 2.0  # a window makes two ordinates one
    least = int(np.argmin(below))
    chance = float(gammainc(count[least], count[least] * below[least]))
    return float(1.0 / below[least]) if chance < MAX_P_VALUE and below[least] * WRONG_FACTOR**2 < 1.0 else 1.0
