"""Words of a converter that were read as others: two's complement as unsigned numbers, bytes in the wrong order.

Samples at rest lie near their neighbours. Whole numbers from zero on that jump by 2ᵏ, their whole range, and by nothing
else once the jumps are taken out, are signed words; then so are those beside them. Where exchanging the two bytes of
every number leaves a small part of the noise, they were exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.robust import normal_sd
from tuner.formats.axis_words import axes_text
from tuner.readers.unit_evidence import STEP_SAMPLES

MIN_BITS, MAX_BITS = 8, 32
"""Bits of the words of converters."""
MIN_JUMPS = 3
"""Jumps across the range that are more than a glitch."""
EXCHANGED_RATIO = 16.0
"""Noise as read ÷ noise with the bytes exchanged, in counts, from which they are: white noise of any size leaves 1."""


def as_signed(
    blocks: Sequence[NDArray[Any]], axes: Sequence[Sequence[str]]
) -> tuple[list[NDArray[Any]], list[str]]:
    """Return samples of sensors, shape (n, k) each, by the words that they are, and what of them is assumed."""
    names = [axis for own in axes for axis in own]
    columns = [np.asarray(column, float) for block in blocks for column in block.T]
    swapped = [_exchanged(y) for y in columns]
    said = []
    if columns and all(one is not None for one in swapped):
        columns = [one for one in swapped if one is not None]
        said.append(
            f"{axes_text(names)}: high and low byte exchanged, which leaves a small part of the noise"
        )
    widths = [_width(y) for y in columns]
    if width := next(filter(None, widths), None):
        unsigned = [j for j, y in enumerate(columns) if np.nanmin(y) >= 0.0 and np.nanmax(y) <= width]
        for j in unsigned:
            columns[j], there = columns[j].copy(), np.isfinite(columns[j])
            whole = np.unwrap(columns[j][there], period=width) if widths[j] else columns[j][there]
            columns[j][there] = whole - width * np.round(np.median(whole) / width)
        text = (
            f"{axes_text([names[j] for j in unsigned])}: numbers from 0 to {width - 1.0:.6g} are signed words"
        )
        said.append(f"{text}, as they jump from one end to the other")
    if not said:
        return list(blocks), said
    ends = np.cumsum([block.shape[1] for block in blocks])[:-1]
    return [np.asfortranarray(part.T) for part in np.split(np.array(columns), ends)], said


def _width(y: FloatArray) -> float | None:
    """Return the range of whole numbers from zero on that jump by it and by nothing else; None for others."""
    some = _counts(y)
    if len(some) < 2 or some.min() < 0.0:
        return None
    width = 2.0 ** np.ceil(np.log2(some.max() + 1.0))
    far = np.abs(np.diff(some)) > 0.75 * width
    if np.count_nonzero(far) < MIN_JUMPS or not 2.0**MIN_BITS <= width <= 2.0**MAX_BITS:
        return None
    return float(width) if np.abs(np.diff(np.unwrap(some, period=width))).max() < 0.25 * width else None


def _counts(y: FloatArray) -> FloatArray:
    """Return the numbers among samples where all are whole, else none; the first decide for most logs."""
    for some in (y[:STEP_SAMPLES], y):
        known = some[np.isfinite(some)]
        if np.any(known != np.rint(known)):
            return np.zeros(0)
    return known


def _exchanged(y: FloatArray) -> FloatArray | None:
    """Return counts of 16 bits with their bytes exchanged, where that is what they are; else None."""
    some = _counts(y)
    if len(some) < max(len(y), 2) or np.abs(y).max() >= 2.0**16 or normal_sd(np.diff(y)) < 256.0:
        return None
    other = (y.astype(np.int64) & 0xFFFF).astype(np.uint16).byteswap().view(np.int16).astype(float)
    return other if EXCHANGED_RATIO * normal_sd(np.diff(other)) < normal_sd(np.diff(y)) else None
