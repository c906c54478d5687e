"""Lines and resonances: power that stands above the spectrum around it, and what it does to the Allan variance.

A filter has no state for them: the angle or velocity that they add is bounded, Σ p_f (2 sin(πfh)/(2πf))² over a time
h, and does not grow. They must be known all the same, since their Allan variance

    L(τ = m dt) = Σ_f 2 p_f sin⁴(πfτ) / (m sin(πf dt))²

falls as τ⁻², and would be taken for white noise near their period. p_f are read from a spectrum by Welch's method
with half-overlapping Hann windows: where it exceeds four times its median within an octave on each side, and the two
bins next to such a place, the feet of a Hann line.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.fft import rfft

from models.arrays import FloatArray
from tuner.types.prediction import SpectralExcess

EXCESS_OVER_MEDIAN = 4.0
"""Power ÷ local median from which a frequency counts: 15 or more windows of white noise do not come near it."""
SLOWEST_PERIOD = 10.0
"""Longest period, s: a slower oscillation is a bias to a filter, and is left to its bias states."""
WINDOW_LENGTH = 100.0
"""Length of a window of the spectrum, s; at most an eighth of the record."""
MIN_WINDOW = 64
"""Samples of the shortest window that tells a line from what surrounds it."""
HANN_FEET = 2
"""Bins on each side of a line that a Hann window fills."""


def spectral_excess(pieces: Sequence[FloatArray], interval: float) -> SpectralExcess | None:
    """Return what stands above the spectrum of one axis; None where nothing does, or the record is too short.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Stretches without a gap.
    interval : float
        Sampling interval, s.
    """
    window = int(min(max(len(piece) for piece in pieces) // 8, round(WINDOW_LENGTH / interval)))
    if window < MIN_WINDOW:
        return None
    frequency, density = _spectrum(pieces, interval, window)
    background = _background(frequency, density)
    fast = frequency >= 1.0 / SLOWEST_PERIOD
    over = (density > EXCESS_OVER_MEDIAN * background) & fast
    if not over.any():
        return None
    wide = over.copy()
    for shift in range(1, HANN_FEET + 1):
        wide[shift:] |= over[:-shift]
        wide[:-shift] |= over[shift:]
    wide &= fast & (density > background)
    bin_width = frequency[1] - frequency[0]
    return SpectralExcess(frequency[wide], (density - background)[wide] * bin_width, interval)


def octave_bands(interval: float, shortest: float) -> list[SpectralExcess]:
    """Return bands of unit power, an octave each, from `SLOWEST_PERIOD` to the shortest cluster time, s.

    They describe motion of the mount: power between noise and bias that belongs to neither.
    """
    highest = 1.0 / shortest
    octaves = round(np.log2(highest * SLOWEST_PERIOD)) if highest > 2.0 / SLOWEST_PERIOD else 0
    edges = np.geomspace(1.0 / SLOWEST_PERIOD, highest, octaves + 1)
    inner = (np.arange(40) + 0.5) / 40.0
    return [
        SpectralExcess(low + (high - low) * inner, np.full(40, 1.0 / 40.0), interval)
        for low, high in pairwise(edges)
        if octaves
    ]


def _spectrum(pieces: Sequence[FloatArray], interval: float, window: int) -> tuple[FloatArray, FloatArray]:
    """Return frequencies and one-sided density, without the first and the last bin; of each window less its line."""
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(window) / window)
    ramp = np.arange(window) - 0.5 * (window - 1)
    slope = ramp / float(ramp @ ramp)
    total, weight = np.zeros(window // 2 + 1), 0
    for piece in pieces:
        starts = range(0, len(piece) - window + 1, window - window // 2)
        for start in starts:
            part = piece[start : start + window]
            part = part - part.mean() - (slope @ part) * ramp
            total += np.abs(rfft(hann * part)) ** 2 * (len(piece) / len(starts))
        weight += len(piece) if starts else 0
    density = 2.0 * interval / float(hann @ hann) * total / weight
    return np.arange(1, len(density) - 1) / (window * interval), density[1:-1]


def _background(frequency: FloatArray, density: FloatArray) -> FloatArray:
    """Return the median within an octave on each side, interpolated between four centres an octave."""
    octaves = np.log2(frequency[-1] / frequency[0])
    centres = np.geomspace(frequency[0], frequency[-1], 4 * int(np.ceil(octaves)) + 1)
    first = np.searchsorted(frequency, 0.5 * centres, side="left")
    last = np.searchsorted(frequency, 2.0 * centres, side="right")
    level = [np.median(density[a:b]) for a, b in zip(first, last, strict=True)]
    return np.asarray(np.exp(np.interp(np.log(frequency), np.log(centres), np.log(level))))
