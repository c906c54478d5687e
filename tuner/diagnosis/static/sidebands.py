"""Sidebands: a line whose amplitude swells is three lines, one of which stands on either side of the carrier.

A carrier A cos 2πft times 1 + m cos 2πgt is that line and two of amplitude mA/2 at f − g and f + g, whose phases have
that of the carrier for mean. Lines of one channel are one finding where two lie evenly about a larger one and their
amplitudes and phases agree with this, within their errors. Where the frequency swings in place of the amplitude, the
sum of the phases less twice that of the carrier is π, not 0: such lines, and harmonics 1 : 2 : 3, stay three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from models.probability import REACH_95
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.findings import AGREEMENT_SDS, Single, moments
from tuner.diagnosis.static.held_out_gain import summed
from tuner.types import Coefficient

AMPLITUDE_SDS = 2.0
"""Sds within which two amplitudes are one: few lines are large enough for more to tell 0.06 from 0.10 sd."""


def with_sidebands(found: Sequence[Single], middle: float) -> tuple[Single, ...]:
    """Return the findings of a channel, its middle at a time, s; each line with its sidebands in place of three."""
    lines = [
        one for one in found if one.cause.cause == Line.cause and "modulation_depth" not in one.parameters
    ]
    for carrier in lines:
        smaller = [one for one in lines if _amplitude(one)[0] < _amplitude(carrier)[0]]
        pair = next((pair for pair in combinations(smaller, 2) if _lie_beside(carrier, *pair, middle)), None)
        if pair is not None:
            rest = (one for one in found if one is not pair[0] and one is not pair[1])
            joined = [_modulated(carrier, *pair) if one is carrier else one for one in rest]
            return with_sidebands(joined, middle)
    return tuple(found)


def _lie_beside(carrier: Single, one: Single, other: Single, time: float) -> bool:
    """Return whether two lines lie evenly about a third one, have one amplitude, and phases about its own."""
    lines = (carrier, one, other)
    (middle, error), low, high = (_frequency(line) for line in lines)
    first, second = _amplitude(one), _amplitude(other)
    if abs(low[0] + high[0] - 2.0 * middle) >= AGREEMENT_SDS * _norm(low[1], high[1], 2.0 * error):
        return False
    if abs(first[0] - second[0]) >= AMPLITUDE_SDS * _norm(first[1], second[1]):
        return False
    lowest = min(low, high)
    if abs(middle - 2.0 * lowest[0]) < AGREEMENT_SDS * _norm(error, 2.0 * lowest[1]):
        return False
    phase, upper, lower = (_phase(line, time) for line in lines)
    off = float(np.angle(np.exp(1j * (upper + lower - 2.0 * phase))))
    sds = [sd / value for value, sd in map(_amplitude, lines)]
    return abs(off) < min(AGREEMENT_SDS * _norm(2.0 * sds[0], *sds[1:]), 0.5 * np.pi)


def _phase(line: Single, time: float) -> float:
    """Return the phase of a line at a time, s; its error in the middle of a record is the relative one of A."""
    wave = line.accepted.extension
    assert isinstance(wave, Line)
    return float(np.arctan2(-wave.sine, wave.cosine)) + 2.0 * np.pi * wave.frequency * time


def _norm(*sds: float) -> float:
    """Return the sd of a sum of independent numbers."""
    return float(np.linalg.norm(sds))


def _modulated(carrier: Single, one: Single, other: Single) -> Single:
    """Return the carrier with the frequency and the depth of its modulation, and the gain of all three lines."""
    low, high, first, second = _frequency(one), _frequency(other), _amplitude(one), _amplitude(other)
    size = _amplitude(carrier)[0]
    parameters = {
        **carrier.parameters,
        "modulation_frequency": _known(
            0.5 * abs(high[0] - low[0]), 0.5 * float(np.hypot(low[1], high[1])), "Hz"
        ),
        "modulation_depth": _known(
            (first[0] + second[0]) / size, float(np.hypot(first[1], second[1])) / size, "1"
        ),
    }
    gain = summed([line.accepted.gain for line in (carrier, one, other)])
    return replace(carrier, parameters=parameters, accepted=replace(carrier.accepted, gain=gain))


def _known(value: float, sd: float, unit: str) -> Coefficient:
    """Return a positive number with its interval."""
    return Coefficient.known(value, max(value - REACH_95 * sd, 0.0), value + REACH_95 * sd, unit)


def _frequency(line: Single) -> tuple[float, float]:
    """Return the frequency of a line and its sd, Hz."""
    return moments(line.parameters["frequency"])


def _amplitude(line: Single) -> tuple[float, float]:
    """Return the amplitude of a line and its sd, in the unit of the channel."""
    return moments(line.parameters["amplitude"])
