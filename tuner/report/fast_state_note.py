"""What a reader must know who copies N and K alone: fast bias states carry a part of the white noise."""

from __future__ import annotations

from tuner.formats.customary_units import digits
from tuner.synthesis.equivalent_models import FILTER_MEMORY, equivalent_white_density
from tuner.types import FilterConfig

FAST = 0.1 * FILTER_MEMORY
"""Time constant up to which a state is like white noise of density² 2σ²T, s: the memory of a filter is ten of them."""
MIN_RATIO = 1.2
"""White density for a filter of N and K alone ÷ N from which it is said: twice as far from 1 as the true
errors beside those that a ladder of states predicts, 1.09."""


def fast_state_note(config: FilterConfig) -> str:
    """Return with which fast states N counts, where N and K alone would need a clearly larger N; else empty."""
    times = []
    for channel in config.channels.values():
        fast = [state.time_constant for state in channel.markov if state.time_constant <= FAST]
        if fast and equivalent_white_density(channel) > MIN_RATIO * channel.white_density > 0.0:
            times.append(min(fast))
    if not times:
        return ""
    each = [digits(time, 2).removesuffix(".0") for time in sorted(set(times))]
    named = f"{each[0]} s state" if len(each) == 1 else f"states of {each[0]} to {each[-1]} s"
    return f"N counts with the {named}"
