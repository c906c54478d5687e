"""Names of noise coefficients and of levels of the Allan deviation, as tables show them."""

from __future__ import annotations

from tuner.formats.customary_units import SYMBOLS

LEVEL_NAMES = {
    "mean": "mean",
    "sigma_10s": "σ(10 s)",
    "minimum": "smallest Allan deviation",
    "floor": "… ÷ 0.664",
}
"""Heads of the rows that are no coefficient of a term, by the field of `ChannelIdentification`."""


def symbol(name: str) -> str:
    """Return the symbol of a coefficient such as ``white.density``; its name where it has none."""
    return SYMBOLS.get(name, name.replace(".", " "))
