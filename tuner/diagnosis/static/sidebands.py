"""Sidebands: a line whose amplitude swells is three lines, one of which stands on either side of the carrier.

A carrier A cos 2πft times 1 + m cos 2πgt is that line and two of amplitude mA/2 at f − g and f + g. Lines of one
channel are one finding where two lie evenly about a larger one and their amplitudes agree, within their errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.findings import AGREEMENT_SDS, Single, moments
from tuner.diagnosis.static.held_out_gain import summed
from tuner.types import Coefficient


def with_sidebands(found: Sequence[Single]) -> tuple[Single, ...]:
    """Return the findings of one channel, each line with its sidebands in place of three."""
    lines = [
        one for one in found if one.cause.cause == Line.cause and "modulation_depth" not in one.parameters
    ]
    for carrier in lines:
        smaller = [one for one in lines if _amplitude(one)[0] < _amplitude(carrier)[0]]
        pair = next((pair for pair in combinations(smaller, 2) if _lie_beside(carrier, *pair)), None)
        if pair is not None:
            rest = (one for one in found if one is not pair[0] and one is not pair[1])
            return with_sidebands([_modulated(carrier, *pair) if one is carrier else one for one in rest])
    return tuple(found)


def _lie_beside(carrier: Single, one: Single, other: Single) -> bool:
    """Return whether two lines lie evenly about a third one and have one amplitude."""
    middle, low, high = (_frequency(line) for line in (carrier, one, other))
    first, second = _amplitude(one), _amplitude(other)
    apart, unlike = low[0] + high[0] - 2.0 * middle[0], first[0] - second[0]
    return (abs(apart) < AGREEMENT_SDS * float(np.hypot(np.hypot(low[1], high[1]), 2.0 * middle[1]))) and abs(
        unlike
    ) < AGREEMENT_SDS * float(np.hypot(first[1], second[1]))


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
    return Coefficient.known(value, max(value - 1.96 * sd, 0.0), value + 1.96 * sd, unit)


def _frequency(line: Single) -> tuple[float, float]:
    """Return the frequency of a line and its sd, Hz."""
    return moments(line.parameters["frequency"])


def _amplitude(line: Single) -> tuple[float, float]:
    """Return the amplitude of a line and its sd, in the unit of the channel."""
    return moments(line.parameters["amplitude"])
