"""The errors of a receiver at rest in words."""

from __future__ import annotations

from tuner.identification.receiver import ReceiverErrors
from tuner.results import Coefficient

_NAMES = {"white_sd": "white", "sd": "Gauss–Markov", "time_constant": "time constant"}


def receiver_words(found: ReceiverErrors) -> list[str]:
    """Return a line an axis, with intervals, and the notes."""
    lines = [
        f"  position {axis}: "
        + ", ".join(f"{_NAMES[name]} {_number(coefficient)}" for name, coefficient in parts.items())
        for axis, parts in found.position.items()
    ]
    lines += [f"  velocity {axis}: white {_number(c)}" for axis, c in found.velocity.items()]
    return lines + [f"  {note}" for note in found.notes]


def _number(coefficient: Coefficient) -> str:
    assert coefficient.interval is not None
    low, high = coefficient.interval
    return f"{coefficient.value:.3g} {coefficient.unit} ({low:.3g} … {high:.3g})"
