"""Errors after some time without fixes, true beside predicted, in the words of every answer and page."""

from __future__ import annotations

import math

from tuner.formats.customary_units import digits

PREDICTED_RATIOS = (0.7, 1.4)
"""True ÷ predicted error in outages between which a prediction is taken for right: sds of navigation filters are
used to one digit."""


def outage_words(
    seconds: float, rms: float, predicted: float, ratio: float, interval: tuple[float, float], windows: int
) -> str:
    """Return errors in outages of one length, m, their prediction, and how well these windows tell the ratio."""
    return f"{seconds:g} s: {errors_words(rms, predicted, ratio, interval, windows)}"


def errors_words(
    rms: float, predicted: float, ratio: float, interval: tuple[float, float], windows: int
) -> str:
    """Return errors in outages, m, their prediction, and how well these windows tell the ratio."""
    words = ratio_words(ratio, interval, windows)
    return f"true {digits(rms)} m, predicted {digits(predicted)} m ({words})"


def ratio_words(ratio: float, interval: tuple[float, float], windows: int) -> str:
    """Return true ÷ predicted with its 95 % interval, the number of windows, and where these cannot tell it from 1."""
    undecided = f": {windows} cannot tell it from 1" if is_undecided(ratio, interval) else ""
    plural = "s" if windows > 1 else ""
    return f"ratio {digits(ratio, 2)}, {interval_words(interval)} with {windows} window{plural}{undecided}"


def interval_words(interval: tuple[float, float]) -> str:
    """Return an interval of a ratio to two digits."""
    low, high = interval
    return f"{digits(low, 2)} … {'∞' if math.isinf(high) else digits(high, 2)}"


def is_undecided(ratio: float, interval: tuple[float, float]) -> bool:
    """Tell whether a ratio is off, and its interval holds 1 nevertheless: more windows would be needed to judge."""
    (least, most), (low, high) = PREDICTED_RATIOS, interval
    return not least <= ratio <= most and low <= 1.0 <= high
