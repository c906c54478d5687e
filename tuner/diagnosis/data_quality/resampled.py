"""Samples that a program put on a rate less than twice as high by straight lines: no three of them lie on one line.

Between two inputs there is then one output or two. The power of second differences swings with the place between
the inputs, so that their squares have a line at the beat of the two rates: at a ratio r of them, 1 < r < 2, its
frequency is 1 − 1/r cycles a sample, or twice that, folded. With r known, outputs y = A(φ) x, x fewer than y: at the
right phase φ what least squares leave of short windows is zero but for digits and quantization; in any noise, however
smooth, one phase leaves about as much as another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import rfft

from models.arrays import FloatArray
from models.probability import chi2_below
from tuner.diagnosis.data_quality.copied_samples import Lines

MAX_SEARCHED_SAMPLES = 65_536
"""Samples whose squares are searched for the beat: enough for a phase that is known over a window."""
MIN_BEAT = 30.0
"""Ordinate, in medians of those around, from which a beat is looked at closer: chance reaches half of it."""
LEVEL_ORDINATES, MIN_ORDINATE = 256, 8
"""Ordinates whose median is their level, as second differences are not white, and the first one that is no trend."""
WINDOW_SAMPLES, WINDOW_COUNT = 64, 12
"""Samples of a window, few enough for the error of the ratio, and number of windows, spread over the record."""
PHASE_COUNT = 100
"""Phases tried: the next one is off by 0.005, which leaves 3e-5 of the power."""
MAX_LEFT = 0.25
"""Power that the right phase leaves ÷ that of the others up to which the samples lie on lines.

Chosen as that of a quantizer step of the sd of the noise; in smooth noise of one phase another leaves half as much.
"""
MAX_P_VALUE = 1e-12
"""P-value above which nothing is said: phases of smooth noise are not as independent as it takes them to be."""
MIN_RATIO = 1.05
"""Least ratio: with a smaller one a window has less than three outputs more than inputs."""


def find_resampled(pieces: Sequence[FloatArray]) -> Lines:
    """Test gap-free samples of a channel, shape (n,), for straight lines between inputs of a rate 1 … 2 times lower."""
    y = max(pieces, key=len)[:MAX_SEARCHED_SAMPLES]
    none = Lines(0.0, 1.0)
    if len(y) < 4 * WINDOW_SAMPLES * WINDOW_COUNT:
        return none
    square = np.diff(y, 2) ** 2
    square = np.minimum(square, 25.0 * float(np.median(square)))
    if not square.any():
        return none
    power = np.abs(rfft((square - square.mean()) * np.hanning(len(square)))) ** 2
    power = power[: len(power) // LEVEL_ORDINATES * LEVEL_ORDINATES].reshape(-1, LEVEL_ORDINATES)
    power = (power / np.median(power, axis=1, keepdims=True)).ravel()
    at = int(np.argmax(power[MIN_ORDINATE:])) + MIN_ORDINATE
    if not power[at] > MIN_BEAT or at + 1 >= len(power):
        return none
    left, middle, right = np.sqrt(power[at - 1 : at + 2])
    if 2.0 * middle <= left + right:
        return none
    beat = (at + (right - left) / (2.0 * middle - left - right) / 2.0) / len(square)
    tests = [
        _on_lines(y, inputs)
        for inputs in (1.0 - beat, 1.0 - 0.5 * beat, 0.5 + 0.5 * beat)
        if MIN_RATIO * inputs < 1.0
    ]
    return min(tests, key=lambda test: test.p_value, default=none)


def _on_lines(y: FloatArray, inputs: float) -> Lines:
    """Test samples for lines between so many inputs a sample, by windows of any phase each."""
    starts = np.linspace(0, len(y) - WINDOW_SAMPLES, WINDOW_COUNT).astype(int)
    windows = y[starts[:, None] + np.arange(WINDOW_SAMPLES)]
    windows = windows - windows.mean(axis=1, keepdims=True)
    left = np.stack([_left(windows, inputs, phase) for phase in np.arange(PHASE_COUNT) / PHASE_COUNT])
    usual = np.median(left, axis=0)
    ratio = left.min(axis=0) / np.where(usual > 0.0, usual, np.inf)
    if float(ratio.mean()) > MAX_LEFT:
        return Lines(0.0, 1.0)
    freedom = WINDOW_SAMPLES - int(np.ceil(WINDOW_SAMPLES * inputs)) - 1
    chance = np.minimum(PHASE_COUNT * chi2_below(freedom * ratio, freedom), 1.0)
    p_value = float(np.prod(chance))
    return Lines(1.0 - inputs, p_value if p_value < MAX_P_VALUE else 1.0)


def _left(windows: FloatArray, inputs: float, phase: float) -> FloatArray:
    """Return the power that lines between inputs at one phase leave of each window, shape (w,)."""
    place = phase + inputs * np.arange(WINDOW_SAMPLES)
    lines = np.maximum(1.0 - np.abs(place[:, None] - np.arange(int(place[-1]) + 2)), 0.0)
    basis = np.linalg.qr(lines[:, np.any(lines > 0.0, axis=0)])[0]
    rest = windows - (windows @ basis) @ basis.T
    return np.asarray(np.sum(rest**2, axis=1) / (WINDOW_SAMPLES - basis.shape[1]))
