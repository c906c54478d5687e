"""Samples from which a program took the noise, so that it cannot be read in them.

dead zone
    Rates near zero are given as zero, or changes near zero are not given. A law of noise with its mode near zero has at
    least as many samples in (0, w) as in [w, 2w), w the smallest reading that is not zero: of k samples there, none
    below w has the chance 2^−k.
rails
    Of normal noise the samples at a rail are those beyond it. Where the outermost reading comes more often than the
    next, a symmetric law has as many samples above it as below the next: of k there, none above has the chance 2^−k.
bias taken out
    A program learns the bias while the sensor rests, and subtracts it: a high-pass below the frequencies of motion.
    Every noise of a sensor but the white one is larger at low frequencies [1]_, in each axis and in all together. So a
    spectrum that is flat over three octaves above 2 Hz (of slow logs over those below half the rate) and lower below
    some frequency is that of a high-pass: a mean of m ordinates ÷ that of the flat part has the law of a χ² of 2m
    degrees of freedom ÷ 2m. What filters, mounts and vibration do at higher frequencies takes no part.

References
----------
.. [1] IEEE Std 952-2020, annex C: powers of the frequency of the noise terms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.special import gammainc, ndtri

from models.arrays import FloatArray
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, range_text
from tuner.limits import SHOWN_CHANGE, WRONG_FACTOR
from tuner.types.records import DataError, Record

MIN_ZERO_SHARE = 0.3
"""Share of samples of exactly zero from which a dead zone is looked for."""
MAX_P_VALUE = 1e-6
"""Chance of samples from which nothing was taken; with all octaves and axes of a log a ten-thousandth at most."""
NEXT_LEVELS, LEAST_CODES = 3, 1.9
"""Distances of the next levels beside a dead zone, of which the largest is that of codes, and its least width in codes:
one lacks at least, and printed digits part codes unevenly."""
LEVEL_DIGITS = 2
"""Digits to which levels ÷ the smallest are compared: differences of one code in single precision are one level."""
SIDES_ALIKE = 0.01
"""Share of the readings beside a dead zone that lie on its emptier side, at least."""
SLOWEST_MOTION = 2.0
"""Frequency below which a program that learns a bias takes it, Hz: a faster one would take the motion, too."""
FLAT_OCTAVES, MAX_STEP = 3, 1.25
"""Octaves above it that are white, and the largest ratio of the power of two of them."""
MIN_ORDINATES, LEAST_BAND = 32, 8
"""Ordinates of the lowest white octave, and of the narrowest band below: fewer are low without the mean in any log."""


def expect_noise(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return records at rest, which say where rails make noise weaker; refuse noise that was withheld or taken out.

    Raises
    ------
    DataError
        Of a sensor with such axes: which, what was measured, and what to do.
    """
    kept = []
    for record in records:
        other = f"; --columns {record.name}=none reads the other sensor alone" if len(records) > 1 else ""
        zones = {axis: zone for axis in record.axes if (zone := dead_zone(record.column(axis))) > 0.0}
        stuck = {
            axis: zone for axis in record.axes if (zone := dead_zone(np.diff(record.column(axis)))) > 0.0
        }
        if stuck and not zones:
            raise DataError(
                f"{record.source}: {axes_text(list(stuck))} stay at a reading until it changes by "
                f"{range_text(stuck.values(), record.unit)}, a dead zone of changes (hysteresis), which withholds the "
                f"noise: record samples without a threshold{other}"
            )
        if zones:
            raise DataError(
                f"{record.source}: {axes_text(list(zones))} read 0 where they are smaller than "
                f"{range_text(zones.values(), record.unit)}, a dead zone, which withholds the noise: record samples "
                f"without fusion or threshold{other}"
            )
        ends = {axis: left for axis in record.axes if (left := left_by_rails(record.column(axis))) < 1.0}
        weaker = f"{digits(1.0 / min(ends.values()), 2)} times weaker than it is" if ends else ""
        if min(ends.values(), default=1.0) * WRONG_FACTOR < 1.0:
            raise DataError(
                f"{record.source}: {axes_text(list(ends))} lie at the end of their range so often that noise seems "
                f"{weaker}: record with a wider range{other}"
            )
        if min(ends.values(), default=1.0) * (1.0 + SHOWN_CHANGE) < 1.0:
            ranged = f"{axes_text(list(ends))}, cut off at the end of the range: noise seems {weaker}"
            record = replace(record, contradicted=(*record.contradicted, ranged))
        kept.append(record)
        longest = {axis: max(record.pieces(axis), key=len, default=np.zeros(0)) for axis in record.axes}
        tried = [*((axis,) for axis in record.axes), record.axes]
        falls = {
            axis: fall
            for axes in tried
            if (fall := high_pass([longest[axis] for axis in axes], record.interval)) > 1.0
            for axis in axes
        }
        if falls:
            raise DataError(
                f"{record.source}: {axes_text(list(falls))}: noise at low frequencies is up to "
                f"{digits(max(falls.values()), 2)} times weaker than the white noise above them, a high-pass, as where "
                f"a program learns the bias at rest and subtracts it: record samples as the sensor gives them{other}"
            )
    return tuple(kept)


def dead_zone(y: FloatArray) -> float:
    """Return the smallest size of samples (n,) that are given, where smaller ones are given as zero; 0 for none."""
    given = y[y != 0.0]
    if len(y) - len(given) < MIN_ZERO_SHARE * len(y) or not len(given):
        return 0.0
    size = np.abs(given)
    smallest = float(size.min())
    levels = np.unique(
        np.round(size / smallest, LEVEL_DIGITS)
    )  # differences of one code differ in their last digits
    steps = np.diff(levels[: NEXT_LEVELS + 1])
    if not len(steps) or LEAST_CODES * float(steps.max()) > 1.0:
        return 0.0
    positive = float(np.mean(given > 0.0))
    beside = int(np.count_nonzero(size < 2.0 * smallest))
    alike = SIDES_ALIKE < positive < 1.0 - SIDES_ALIKE
    return smallest if alike and 0.5**beside < MAX_P_VALUE else 0.0


def left_by_rails(y: FloatArray) -> float:
    """Return the sd of normal samples of which as many lie at a rail as of y (n,), ÷ that without; 1 without rails."""
    for one in (y, -y):
        top = one.max()
        share, below = float(np.mean(one == top)), one[one < top]
        if not len(below) or not 0.0 < share < 1.0:
            continue
        near = below.max()
        rail = float(ndtri(1.0 - share))
        density = math.exp(-0.5 * rail**2) / math.sqrt(2.0 * math.pi)
        mean = rail * share - density
        left = math.sqrt(1.0 - share - rail * density + rail**2 * share - mean**2)
        further = int(np.count_nonzero(below < near))
        often = share * len(y) > np.count_nonzero(below == near)
        if often and 0.5**further < MAX_P_VALUE:
            return left
    return 1.0


def high_pass(columns: Sequence[FloatArray], interval: float) -> float:
    """Return white power ÷ the least below any frequency that noise has in no case, of axes (n,) together, or 1."""
    below = [one for one in (_power_below(y, interval) for y in columns) if len(one)]
    if not below:
        return 1.0
    ratio, least = np.mean(below, axis=0), 1.0
    for place, one in enumerate(ratio.tolist()):
        count = (
            0.5 * len(below) * (_lowest(len(columns[0]), interval) >> place)
        )  # a window makes two ordinates one
        if gammainc(count, count * one) < MAX_P_VALUE:
            least = min(least, one)
    return 1.0 / least if least * WRONG_FACTOR**2 < 1.0 else 1.0


def _lowest(n: int, interval: float) -> int:
    """Return the ordinate, of n samples, above which the noise has to be white."""
    return round(min(SLOWEST_MOTION * interval, 0.5 ** (FLAT_OCTAVES + 1)) * n)


def _power_below(y: FloatArray, interval: float) -> FloatArray:
    """Return mean powers below a frequency, its half, quarter … ÷ that above it; none where that is not white."""
    lowest = _lowest(len(y), interval)
    edges = lowest * 2 ** np.arange(FLAT_OCTAVES + 1)
    if lowest // 2 < MIN_ORDINATES:
        return np.empty(0)
    power = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)))[1:]) ** 2
    # the median of ordinates, which are exponential, does not see lines
    flat = np.array([np.median(power[a:b]) / math.log(2.0) for a, b in pairwise(edges.tolist())])
    if flat.min() <= 0.0 or flat.max() > MAX_STEP * flat.min():
        return np.empty(0)
    octaves = int(math.log2(lowest / LEAST_BAND)) + 1
    below = np.array([power[: lowest >> octave].mean() for octave in range(octaves)])
    return np.asarray(below / flat.mean())
