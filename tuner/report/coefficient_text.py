"""Names of noise coefficients and of levels of the Allan deviation, as tables show them."""

from __future__ import annotations

LEVEL_NAMES = {
    "mean": "mean",
    "sigma_10s": "σ(10 s)",
    "minimum": "smallest Allan deviation",
    "floor": "… ÷ 0.664",
}
"""Heads of the rows that are no coefficient of a term, by the field of `ChannelIdentification`."""
