"""Sinusoids of a record: the highest peak over its surroundings, measured by least squares and taken out.

A line is deterministic, so it has no place in a spectral likelihood; but what it leaves has. With the
two-sided noise density S at its frequency f and the total span T, the errors of least squares are those of
maximum likelihood::

    var A = 2S/T,    var f = 24 S / (A² T³) / (2π)²

(T³ summed over segments, whose phases are free.)

References
----------
.. [1] D. C. Rife, R. R. Boorstyn, Single tone parameter estimation from discrete-time observations,
   IEEE Trans. Inf. Theory 20 (1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import median_filter
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray

_MEDIAN_WIDTH = 101
"""Fourier frequencies whose median is the level from which a peak rises."""


@dataclass(frozen=True)
class Line:
    """A sinusoid: amplitude (unit, peak; root mean square over segments) and frequency, Hz."""

    amplitude: float
    frequency: float


def take_out_line(pieces: Sequence[FloatArray], interval: float) -> tuple[Line, list[FloatArray]]:
    """Return the sinusoid that stands out most, and the segments without it.

    Parameters
    ----------
    pieces : sequence of ndarray
        Samples of each segment, unit; the longest has at least 8.
    interval : float
        Sampling interval, s.
    """
    longest = max(pieces, key=len)
    n = len(longest)
    power = np.abs(rfft(_detrended(longest))) ** 2
    level = median_filter(power, size=min(_MEDIAN_WIDTH, len(power)), mode="reflect")
    ratio = power / (level + 1e-12 * power.max() + np.finfo(float).tiny)
    peak = 2 + int(np.argmax(ratio[2:-1]))
    step = 1.0 / (n * interval)

    def misfit(frequency: float) -> float:
        return float(np.sum(_without(longest, interval, frequency)[0] ** 2))

    found = minimize_scalar(
        misfit,
        bounds=((peak - 1) * step, (peak + 1) * step),
        method="bounded",
        options={"xatol": 1e-5 * step},
    )
    frequency = float(found.x)
    removed = [_without(piece, interval, frequency) for piece in pieces]
    lengths = np.array([len(piece) for piece in pieces], dtype=float)
    squares = np.array([square for _, square in removed])
    return Line(float(np.sqrt(lengths @ squares / lengths.sum())), frequency), [rest for rest, _ in removed]


def line_sd(line: Line, density: float, pieces: Sequence[FloatArray], interval: float) -> FloatArray:
    """Return the standard errors of the logs of amplitude and frequency for a noise density S, unit²/Hz."""
    spans = interval * np.array([len(piece) for piece in pieces], dtype=float)
    amplitude = np.sqrt(2.0 * density / spans.sum()) / line.amplitude
    frequency = np.sqrt(24.0 * density / np.sum(spans**3)) / (2.0 * np.pi * line.amplitude) / line.frequency
    return np.array([amplitude, frequency])


def _detrended(y: FloatArray) -> FloatArray:
    t = np.linspace(-1.0, 1.0, len(y))
    centred = y - y.mean()
    return np.asarray(centred - (t @ centred) / (t @ t) * t)


def _without(y: FloatArray, interval: float, frequency: float) -> tuple[FloatArray, float]:
    """Return a segment less its least-squares sinusoid of this frequency, and the squared amplitude."""
    angle = 2.0 * np.pi * frequency * interval * np.arange(len(y))
    design = np.stack((np.cos(angle), np.sin(angle), np.ones(len(y)), np.linspace(-1.0, 1.0, len(y))))
    coefficients = np.linalg.lstsq(design @ design.T, design @ y, rcond=1e-10)[0]
    return np.asarray(y - coefficients[:2] @ design[:2]), float(coefficients[:2] @ coefficients[:2])


def about_lines(lines: Sequence[tuple[float, float]], unit: str) -> tuple[str, ...]:
    """Say which lines, of frequency (Hz) and amplitude, the noise leaves out."""
    if not lines:
        return ()
    frequency, amplitude = max(lines, key=lambda line: line[1])
    which = "one" if len(lines) == 1 else f"{len(lines)}, the largest"
    return (
        "lines in the spectrum are left out of the noise, tuner diagnose names what makes them "
        f"({which} of {amplitude:.3g} {unit} at {frequency:.4g} Hz)",
    )
