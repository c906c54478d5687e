"""What is wrong with a stream of a recording, and what mends it, in words."""

from __future__ import annotations

import math

from tuner.formats.customary_units import digits
from tuner.types.repair import Repair


def repair_text(one: Repair) -> str:
    """Return a repair in four parts: what and where, how sure, its size, what was done."""
    words = f"{one.stream[:1].upper()}{one.stream[1:]} {one.fault}"
    bounds = [
        f"{word} {digits(t)} s"
        for word, t in (("from", one.begin), ("to", one.end))
        if t is not None and not one.unit
    ]
    sure = certainty_of(one)
    done = f"mended copy: {one.done}" if one.done else "nothing mends it here"
    return f"{' '.join([words, *bounds])} ({sure}); {done}"


def certainty_of(one: Repair) -> str:
    """Return how sure a repair is, by the odds against the next explanation."""
    if math.isinf(one.nats):
        return "counted"
    nats = min(one.nats, one.over_next)
    share = 1.0 / (1.0 + math.exp(-min(nats, 700.0)))
    return "certain" if share > 0.999 else f"{100.0 * share:.3g} % likely"
