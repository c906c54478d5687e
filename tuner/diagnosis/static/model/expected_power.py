"""Expected power of each cosine coefficient of a fit, made where it is needed: of a long record it is a column."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numba
import numpy as np
from numpy.typing import NDArray

from models.arrays import SAMPLES_AT_ONCE, FloatArray

SPECTRUM_KNOTS = 8192
"""Frequencies, even and in even ratios, between which the spectrum is interpolated linearly; fine for its curvature."""


@dataclass(frozen=True)
class ExpectedPower:
    """Power of coefficients 1 … n-1.

    Attributes
    ----------
    singles : ndarray, shape (K,)
        Of coefficients 1 … K.
    knots, smooth : ndarray, shape (k,)
        Numbers of others, and their power without peaks: between them it is as good as linear.
    peaks : ndarray, shape (n - 1,)
        Power that peaks add to each.
    """

    singles: FloatArray
    knots: FloatArray
    smooth: FloatArray
    peaks: FloatArray

    def __len__(self) -> int:
        return len(self.peaks)

    def between(self, first: int, last: int) -> FloatArray:
        """Return the power of coefficients first + 1 … last."""
        low = min(max(len(self.singles), first), last)
        power = np.empty(last - first)
        power[: low - first] = self.singles[first:low]
        for start in range(low, last, SAMPLES_AT_ONCE):
            stop = min(start + SAMPLES_AT_ONCE, last)
            part = power[start - first : stop - first]
            _interpolate(start + 1, self.knots, self.smooth, part)
            part += self.peaks[start:stop]
        return power

    def means(self, first: int, width: int, count: int) -> FloatArray:
        """Return the mean power in `count` bins of `width` coefficients, the first of which is number first + 1."""
        several = max(1, SAMPLES_AT_ONCE // width)
        edges = [*range(0, count, several), count]
        return np.concatenate(
            [
                self.between(first + low * width, first + high * width).reshape(-1, width).mean(axis=1)
                for low, high in pairwise(edges)
            ]
        )

    def at(self, place: FloatArray) -> FloatArray:
        """Return the power of coefficients place + 1, between whole numbers by lines, shape of `place`."""
        below = np.minimum(place.astype(np.intp), len(self) - 2)
        power = self._of(below)
        return np.asarray(power + (place - below) * (self._of(below + 1) - power))

    def _of(self, place: NDArray[np.intp]) -> FloatArray:
        """Return the power of coefficients place + 1."""
        smooth = np.interp(place + 1.0, self.knots, self.smooth) + self.peaks[place]
        few = len(self.singles)
        return np.where(place < few, self.singles[np.minimum(place, few - 1)], smooth)

    @cached_property
    def fast(self) -> float:
        """Mean power of the upper half of the coefficients."""
        return float(self.between(len(self) - max(1, len(self) // 2), len(self)).mean())


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _interpolate(first: int, knots: FloatArray, values: FloatArray, out: FloatArray) -> None:
    """Fill `out` with values at first, first + 1 … on straight lines between knots, which rise."""
    last = len(knots) - 1
    at = min(int(np.searchsorted(knots, first, side="right")), last) - 1
    slope = (values[at + 1] - values[at]) / (knots[at + 1] - knots[at])
    for i in range(out.size):
        x = float(first + i)
        if x >= knots[at + 1] and at < last - 1:
            while at < last - 1 and x >= knots[at + 1]:
                at += 1
            slope = (values[at + 1] - values[at]) / (knots[at + 1] - knots[at])
        out[i] = slope * (x - knots[at]) + values[at] if x < knots[at + 1] else values[at + 1]


def spectrum_knots(first: int, end: int) -> FloatArray:
    """Return the places, of first … end − 1, between which a spectrum without peaks is as good as linear."""
    few = np.concatenate((np.geomspace(first, end, SPECTRUM_KNOTS), np.linspace(first, end, SPECTRUM_KNOTS)))
    return np.sort(few) if len(few) < end - first else np.arange(float(first), end)
