"""A line within the width of a resonance: the highest ordinate of a sharp one is found first, and looks like a line."""

from __future__ import annotations

import numpy as np

from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, refitted, without
from tuner.diagnosis.static.outcome import Accepted

MAX_REFITS = 2
"""Largest number of refits without the line: the resonance takes up what it had."""
LINE_PRICE = 1.5
"""Price of a line, logs of the number of samples: half of one for amplitude and phase each, one for the frequency."""


def without_line_of_resonance(
    fitted: FittedChannel, accepted: list[Accepted]
) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model without a line within the width of a resonance that explains as much alone, fitted again.

    The highest ordinate of a sharp resonance is found first, and looks like a line.
    """
    given = len(fitted.extensions) - len(accepted)
    resonances = [x for x in fitted.extensions if isinstance(x, Vibration)]
    for at, one in enumerate(accepted):
        tone = one.extension
        if not isinstance(tone, Line) or not any(
            abs(tone.frequency - x.frequency) < x.frequency / x.quality for x in resonances
        ):
            continue
        other = refitted(without(fitted, given + at), MAX_REFITS)
        lead = _spectrum_likelihood(fitted) - _spectrum_likelihood(other)
        if lead < LINE_PRICE * float(np.log(len(fitted.channel))):
            return without_line_of_resonance(other, [*accepted[:at], *accepted[at + 1 :]])
    return fitted, accepted


def _spectrum_likelihood(fitted: FittedChannel) -> float:
    """Return the log likelihood of the coefficients of the residual, nats up to a constant."""
    power = fitted.power * fitted.spread**2
    return -0.5 * float(np.sum(np.log(power) + fitted.coefficients[1:] ** 2 / power))
