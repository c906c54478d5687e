"""Burst: a stretch of louder (or quieter) noise.

Statistic: mean squares of the residuals in windows of 64, 128, … samples, three quarters overlapping, made normal by
the cube root of Wilson and Hilferty with the degrees of freedom that the measured kurtosis allows. Every width has the
same share of the false alarms, and so has every window of a width; half of them are counted because neighbours
overlap. Gain: likelihood of two variances, edges fitted.
Extension: the residuals inside are divided by the square root of the ratio. What is told is the ratio of the white
noise itself (`tuner.diagnosis.dilution`), and edges by the likelihood of a point of change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.dilution import dilution
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.loudness import loudness
from tuner.diagnosis.residual import CLIP, Residual
from tuner.diagnosis.statistics import EDGE

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.signedinteger[Any]]

SHORTEST = 64
"""Samples in the narrowest window."""


@dataclass(frozen=True)
class Burst(Extension):
    """Samples first … last − 1 have `ratio` times the variance of the others."""

    cause: ClassVar[str] = "burst"
    repeats: ClassVar[int] = 3
    meaning: ClassVar[str] = (
        "the noise is louder (or quieter) for a while: something ran nearby, or a regime changed"
    )
    consequence: ClassVar[str] = (
        "leave the stretch out of the identification; a filter needs the larger noise while it lasts"
    )
    first: int
    last: int
    ratio: float

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring the stretch to the variance of the rest."""
        out = e.copy()
        out[self.first : self.last] /= np.sqrt(self.ratio)
        return out


def test(found: Residual) -> Alarm:
    """Scan windows for another variance."""
    loud = loudness(found)
    n = len(loud.square)
    total, scatter = (np.concatenate(([0.0], np.cumsum(x))) for x in (loud.square, loud.scatter))
    widths = [SHORTEST * 2**k for k in range(int(np.log2(n / (3 * SHORTEST))) + 1)]
    best = (1.0, 0, SHORTEST, 1.0)
    for width in widths:
        start = np.arange(0, n - width, width // 4)
        mean = (total[start + width] - total[start]) / width
        freedom = 2.0 * width**2 / np.maximum(scatter[start + width] - scatter[start], 1e-9)
        deviate = np.abs(loud.deviate(mean, freedom * (1.0 - width / n)))
        at = int(np.argmax(deviate))
        chance = float(norm.sf(deviate[at])) * len(start) * len(widths)
        if chance < best[0]:
            best = (chance, int(start[at]), width, float(mean[at]))
    p_value = best[0]
    gain, edges = 0.0, (best[1], best[1] + best[2])
    if p_value < 1e-2:
        gain, edges = refine(total, *edges)
        cells = len(widths) * 4.0 * n / (edges[1] - edges[0])
        inside = (scatter[edges[1]] - scatter[edges[0]]) / (edges[1] - edges[0])
        gain = gain * 2.0 / max(inside, 1e-9) - float(np.log(cells) + 0.5 * np.log(n))
    return Alarm(
        "burst",
        p_value,
        gain,
        best[3],
        f"mean square of {best[2]} residuals",
        lambda: (extension(found, *edges),),
    )


def two_variances(total: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Return the log likelihood gained by another variance in samples first … last − 1, same shapes."""
    n = len(total) - 1
    inside = np.asarray(last - first, dtype=float)
    energy = total[last] - total[first]
    outside = np.maximum((total[-1] - energy) / np.maximum(n - inside, 1.0), 1e-12)
    gain = n * np.log(total[-1] / n) - (n - inside) * np.log(outside)
    return np.asarray(0.5 * (gain - inside * np.log(np.maximum(energy / inside, 1e-12))))


def refine(total: FloatArray, first: int, last: int) -> tuple[float, tuple[int, int]]:
    """Return the best edges next to a window, and their gain, nats."""
    n, step = len(total) - 1, max(1, (last - first) // 8)
    gain = float(two_variances(total, np.array(first), np.array(last)))
    while True:
        offsets = step * np.arange(-16, 17)
        a = np.clip(first + offsets, 0, n - 2)[:, None]
        b = np.clip(last + offsets, 2, n)[None, :]
        a, b = np.broadcast_arrays(a, b)
        value = np.where(b - a >= 16, two_variances(total, np.minimum(a, b - 1), b), -np.inf)
        best = np.unravel_index(int(np.argmax(value)), value.shape)
        if value[best] > gain + 1e-6:
            gain, first, last = float(value[best]), int(a[best]), int(b[best])
        elif step > 1:
            step = max(1, step // 4)
        else:
            return gain, (first, last)


def extension(found: Residual, first: int, last: int) -> Burst:
    """Return the stretch with its place, length and ratio of the variances of the white noise itself."""
    dt, begin = found.channel.interval, found.channel.start
    square = np.clip(found.e, -3 * CLIP, 3 * CLIP) ** 2
    square[~found.valid] = square[found.valid].mean()
    inside = np.zeros(len(square), dtype=bool)
    inside[first:last] = True
    quiet, loud = square[~inside], square[inside]
    ratio = float(loud.mean() / quiet.mean())
    kappa = float(np.var(quiet) / quiet.mean() ** 2)
    relative = float(np.sqrt(kappa / len(loud) + kappa / len(quiet)))
    total = np.concatenate(([0.0], np.cumsum(square)))
    start = _reach(total, first, last, kappa, move_first=True)
    stop = _reach(total, first, last, kappa, move_first=False)
    duration = Value((last - first) * dt, max(stop[0] - start[1], 1) * dt, (stop[1] - start[0]) * dt, "s")
    return Burst(
        first,
        last,
        ratio,
        values={
            "start": Value(begin + first * dt, begin + start[0] * dt, begin + start[1] * dt, "s"),
            "duration": duration,
            "variance_ratio": _ratio(found, ratio, relative, (last - first) / len(square)),
        },
    )


def _ratio(found: Residual, seen: float, relative: float, share: float) -> Value:
    """Return the ratio of variances of the white noise, from that of the residuals and its relative deviation."""
    white = dilution(found)
    low, value, high = (
        white.undiluted(seen * float(np.exp(k * relative)), share) for k in (-1.96, 0.0, 1.96)
    )
    return Value(value, low, high).owing(1.96 * white.error * abs(value - 1.0))


def _reach(total: FloatArray, first: int, last: int, kappa: float, *, move_first: bool) -> tuple[int, int]:
    """Return between which samples an edge lies, 95 %: where the likelihood is within `EDGE` of its best.

    The true edge lies after one sample and not after the next: the sample before the first one belongs to it.
    """
    edge, n = (first, len(total) - 1) if move_first else (last, len(total) - 1)
    width = max(64, last - first)
    place = np.unique(np.clip(np.linspace(edge - width, edge + width, 4001).astype(int), 0, n))
    place = place[place < last - 8] if move_first else place[place > first + 8]
    fixed = np.full(len(place), last if move_first else first)
    value = two_variances(total, place, fixed) if move_first else two_variances(total, fixed, place)
    near = np.flatnonzero(value > value.max() - EDGE * 0.5 * kappa)
    low, high = place[max(near[0] - 1, 0)], place[min(near[-1] + 1, len(place) - 1)]
    return min(int(low), edge - 1), max(int(high), edge)
