"""Cosine periodogram: the whole record in some hundred numbers that are nearly independent.

The record followed by its mirror image has no jump at its ends, so the discrete cosine transform is a
periodogram whose ends are bridged: a random walk does not leak, as it does into the Fourier periodogram
(by a factor of 2 at every frequency). With coefficients of an orthonormal DCT-II of n samples y at
interval τ0, span T = n τ0::

    a_k = √τ0 DCT(y)_k,    f_k = k/(2T),    k = 1 … n-1,    E a_k² → S(f_k)

White noise and random walk are diagonalised *exactly* for every n; the edge terms of the others are in
closed form (`tuner.identification.expected_periodogram`). The mean is k = 0 and is dropped. A ramp R t adds R c_k::

    c_k = -√(2τ0/n) τ0 (1-(-1)^k) cos(x/2) / (4 sin²(x/2)),    x = πk/n

Coefficients up to `SINGLE_COEFFICIENTS` stay single; above, their squares are averaged in narrow cells of frequency.
There lines are left out: a sinusoid is no noise, and the power of some tens of weak ones is seen as white.

References
----------
.. [1] G. Strang, The discrete cosine transform, SIAM Review 41 (1999): DCT-II diagonalises differences.
.. [2] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from models.arrays import SAMPLES_AT_ONCE, FloatArray
from models.probability import student_quantile
from tuner.curves.long_transforms import without_tables

SINGLE_COEFFICIENTS = 64
"""Coefficients of a segment that are kept with their sign; fewer where there are more than 16 segments."""

FALSE_ALARMS = 1e-3
"""Chance that a check of a whole record rejects a right model."""
LINE_REACH = 3
"""Coefficients that are lost on either side of a line: a sinusoid
between two coefficients leaves a twentieth of its power farther away."""
LINE_FLANK = 16
"""Coefficients on either side of a line up to which what is left out counts as that line: a hundredth is beyond."""
MAX_LINE_PASSES = 64
"""Lines that a cell may lose, one in each pass; chosen above what stands in two per cent of a spectrum."""

MIN_SEGMENT_SAMPLES = 16
"""Segments with fewer samples are left out: they hold next to nothing and cost a frequency grid each."""


@dataclass(frozen=True)
class CosinePeriodogram:
    """Squared cosine coefficients on a grid of m cells, low frequencies first within each segment.

    Attributes
    ----------
    interval : float
        Sampling interval, s.
    frequency : ndarray, shape (m,)
        Mean frequency of a cell, Hz.
    amplitude : ndarray, shape (m,)
        Signed coefficient where the cell holds one, else the root of the mean square, unit/√Hz.
    count : ndarray, shape (m,)
        Coefficients in the cell, one degree of freedom each.
    order : ndarray, shape (m,)
        Mean number k of the coefficients.
    parity : ndarray, shape (m,)
        (-1)^k of a single coefficient, 0 for a cell of several.
    span : ndarray, shape (m,)
        Span T of the segment, s (harmonic mean where a cell gathers several segments).
    line : ndarray, shape (m,)
        Coefficient of the unit ramp, s^1.5; 0 for cells of several.
    law_variance : float
        Covariance of any two powers of white noise that comes from the law of the samples, unit⁴/Hz²
        (`tuner.identification.law_of_samples`); 0 for the normal law.
    lines : tuple of (float, float)
        Frequency, Hz, and amplitude, unit, of each line that was left out of the longest segment.
    """

    interval: float
    frequency: FloatArray
    amplitude: FloatArray
    count: FloatArray
    order: FloatArray
    parity: FloatArray
    span: FloatArray
    line: FloatArray
    law_variance: float = 0.0
    lines: tuple[tuple[float, float], ...] = ()

    @property
    def power(self) -> FloatArray:
        """Mean square of a cell, unit²/Hz, shape (m,)."""
        return self.amplitude**2

    @cached_property
    def sine_square(self) -> FloatArray:
        """sin²(πfτ0) of a cell, shape (m,)."""
        return np.asarray(np.sin(np.pi * self.interval * self.frequency) ** 2)

    @property
    def longest(self) -> float:
        """Span of the longest segment, s."""
        return float(self.span.max())


def cosine_periodogram(
    pieces: Sequence[FloatArray], interval: float, *, resolution: float = 0.02, widest: float = np.inf
) -> CosinePeriodogram:
    """Summarise gap-free segments of one channel; each loses its own mean.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Samples of each segment, unit.
    interval : float
        Sampling interval, s.
    resolution : float
        Relative width of a cell.
    widest : float
        Greatest width of a cell, Hz: for spectra with peaks.

    Returns
    -------
    CosinePeriodogram

    Raises
    ------
    ValueError
        If no piece has `MIN_SEGMENT_SAMPLES` samples, or they are not finite or all equal.
    """
    long_enough = [np.asarray(p, dtype=float) for p in pieces if len(p) >= MIN_SEGMENT_SAMPLES]
    if not long_enough:
        raise ValueError(f"'pieces' must hold a segment of at least {MIN_SEGMENT_SAMPLES} samples")
    if not all(np.isfinite(p).all() for p in long_enough) or not any(np.ptp(p) > 0.0 for p in long_enough):
        raise ValueError("'pieces' must hold finite samples that are not all equal")
    most = min(SINGLE_COEFFICIENTS, max(16 * SINGLE_COEFFICIENTS // len(long_enough), 4))
    lowest = most / (2.0 * interval * max(len(p) for p in long_enough))
    edges = _edges(lowest, 0.5 / interval, resolution, widest)
    singles, left_out = [], {}
    cells = np.zeros((5, len(edges) - 1))  # sums of: one, frequency, power, order, 1/span
    for piece in long_enough:
        n, low = len(piece), min(most, len(piece) - 1)
        amplitude, line = _transform(piece, interval, low)
        order = np.arange(1.0, low + 1.0)
        span = n * interval
        single = np.stack((order / (2.0 * span), amplitude[:low], np.ones(low), order, (-1.0) ** order,
                           np.full(low, span), line[:low]))  # fmt: skip
        singles.append(single)
        power = amplitude[low:]
        np.square(power, out=power)
        left_out[n] = _gather(cells, power, edges, span, low + 1)
    count, frequency, powers, order_sum, inverse_span = cells[:, cells[0] > 0]
    nothing = np.zeros_like(count)
    grouped = np.stack((frequency / count, np.sqrt(powers / count), count, order_sum / count, nothing,
                        count / inverse_span, nothing))  # fmt: skip
    together = np.concatenate((*singles, grouped), axis=1)
    return replace(CosinePeriodogram(interval, *together), lines=left_out[max(left_out)])


def _transform(piece: FloatArray, interval: float, low: int) -> tuple[FloatArray, FloatArray]:
    """Return coefficients a_k, k ≥ 1, of a segment, and the first `low` of the unit ramp.

    The straight line is taken out first and put back into those coefficients only: the rest of a strong ramp
    would hide the noise at high frequency.
    """
    n, middle = len(piece), 0.5 * (len(piece) - 1)
    rest = piece - piece.mean()
    product = 0.0
    for first in range(0, n, SAMPLES_AT_ONCE):
        part = rest[first : first + SAMPLES_AT_ONCE]
        product += float((np.arange(first, first + len(part)) - middle) @ part)
    step = product / (n * (n * n - 1.0) / 12.0)  # Σ (i − middle)², exactly
    for first in range(0, n, SAMPLES_AT_ONCE):
        part = rest[first : first + SAMPLES_AT_ONCE]
        part -= step * (np.arange(first, first + len(part)) - middle)
    slope = step / interval
    amplitude: FloatArray = dct(rest, norm="ortho", overwrite_x=True)[1:]
    without_tables(n)
    amplitude *= np.sqrt(interval)
    k = np.arange(1.0, low + 1.0)
    half = 0.5 * np.pi * k / n
    line = -np.sqrt(2.0 * interval / n) * interval * (k % 2) * np.cos(half) / (2.0 * np.sin(half) ** 2)
    amplitude[:low] += slope * line
    return amplitude, line


def _edges(lowest: float, nyquist: float, resolution: float, widest: float) -> FloatArray:
    """Return cell edges that grow by `resolution` up to the width `widest`, then evenly, Hz."""
    turn = min(max(widest / resolution, lowest), nyquist)
    growing = lowest * np.exp(resolution * np.arange(np.ceil(np.log(turn / lowest) / resolution) + 1))
    even = np.arange(growing[-1] + widest, nyquist + widest, widest) if np.isfinite(widest) else np.zeros(0)
    return np.concatenate(([0.0], growing, even, [np.inf]))


def _gather(
    cells: FloatArray, power: FloatArray, edges: FloatArray, span: float, first: int
) -> tuple[tuple[float, float], ...]:
    """Add squares of the coefficients number `first` and up of one segment to the sums of their cells.

    Returns frequency, Hz, and amplitude, unit, of each line, which is left out.
    """
    start = np.clip(np.ceil(2.0 * span * edges[:-1]) - first, 0, len(power)).astype(int)
    stop = np.append(start[1:], len(power))
    filled = stop > start
    if not np.any(filled):
        return ()
    taken, lines = _take_out_lines(power, start[filled])
    n = (stop - start)[filled] - taken
    order = first + 0.5 * (start + stop - 1)[filled]
    sums = np.add.reduceat(power, start[filled])
    cells[:, filled] += np.stack((n, n * order / (2.0 * span), sums, n * order, n / span))
    apart: list[tuple[int, float]] = []
    for peak, square in sorted(lines, key=lambda line: -line[1]):
        if all(abs(peak - other) > LINE_FLANK for other, _ in apart):
            apart.append((peak, square))
    return tuple(
        ((first + peak) / (2.0 * span), float(np.sqrt(2.0 * square / span))) for peak, square in apart
    )


def _take_out_lines(power: FloatArray, start: NDArray[np.intp]) -> tuple[FloatArray, list[tuple[int, float]]]:
    """Set coefficients that a line makes to zero, and those beside them.

    Returns their number in each cell, (m,), and the place and the sum of the squares of each line.

    A squared coefficient of noise ÷ the mean of those around it, in its cell and the next on either side, is the square
    of Student's t.
    """
    count = np.diff(start, append=len(power)).astype(float)
    chance = FALSE_ALARMS / len(power)
    taken, lines = np.zeros_like(count), []
    for _ in range(MAX_LINE_PASSES):
        number = _with_next(count - taken)
        total = _with_next(np.add.reduceat(power, start))
        largest = np.maximum.reduceat(power, start)
        limit = student_quantile(0.5 * chance, np.maximum(number - 1.0, 1.0)) ** 2
        lined = np.flatnonzero(largest * (number - 1.0) > limit * (total - largest))
        if not len(lined):
            break
        for cell in lined.tolist():
            inside = slice(start[cell], start[cell] + int(count[cell]))
            peak = int(start[cell]) + int(np.argmax(power[inside]))
            near = np.arange(max(peak - LINE_REACH, 0), min(peak + LINE_REACH + 1, len(power)))
            near = near[power[near] > 0.0]
            lines.append((peak, float(power[near].sum())))
            power[near] = 0.0
            np.add.at(taken, np.searchsorted(start, near, side="right") - 1, 1.0)
    return taken, lines


def _with_next(cells: FloatArray) -> FloatArray:
    """Return the sums of each cell and the next ones on either side, (m,)."""
    beside = np.pad(cells, 1)
    return np.asarray(beside[:-2] + cells + beside[2:])
