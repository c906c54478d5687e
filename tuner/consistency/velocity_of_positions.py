"""Whether the velocities of a truth are those of its own positions: if not, one of the two errs by the difference.

Over windows of `WINDOW_LENGTH` the mean velocity is the displacement by the length. What the truth states of both
explains a mean square of σ_v² + 2 σ_p²/T² at most, as where its velocities err alike in the whole window.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from models.earth import ned_between
from models.probability import chi2_quantile
from tuner.consistency.trajectory_alignment import MAX_GAP_INTERVALS
from tuner.formats.customary_units import digits
from tuner.types.filter_output import FilterOutput

WINDOW_LENGTH = 10.0
"""Length of a window, s: centimetres of a position are millimetres a second."""
MIN_WINDOWS = 6
"""Least number of windows: a minute."""
FALSE_ALARM = 1e-3
"""Probability of a note that errors are too large where each is of its stated size."""
MATTERING_SHARE = 0.3
"""Error of a truth ÷ sd of the filter that is judged, from which it counts: 5 % of what is predicted."""
MIN_RATIO = 1.25
"""Ratio of sds, of what is found to what is stated, from which it counts: stated sds are rounded and smoothed."""


def velocity_contradiction(
    truth: FilterOutput, estimate: FilterOutput, between: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return variances, (3,), m²/s², by which velocities of a truth contradict its positions, and a note.

    Parameters
    ----------
    truth : FilterOutput
        Its own rows: what it states explains a part.
    estimate : FilterOutput
        What is judged by it: contradictions that are small beside its sds count for nothing.
    between : ndarray, shape (3,)
        Variances of these velocities between rows, which count as stated.
    """
    found = _beyond_stated(truth, between)
    own = np.einsum("kii->ki", estimate.covariance)[:, 3:6]
    spread = np.where(own > 0.0, own, 0.0).sum(axis=0) / np.maximum((own > 0.0).sum(axis=0), 1)
    found = np.where((spread > 0.0) & (found > MATTERING_SHARE**2 * spread), found, 0.0)
    if not found.any():
        return found, ()
    sizes = ", ".join(
        f"{digits(float(np.sqrt(x)), 2)} m/s {axis}"
        for x, axis in zip(found, ("north", "east", "down"), strict=True)
        if x
    )
    return found, (
        f"velocities of {truth.name} contradict the changes of its own positions over {WINDOW_LENGTH:g} s by {sizes} "
        "(rms beyond its sds): one of the two is wrong by as much, which adds to the sds of velocities",
    )


def _beyond_stated(truth: FilterOutput, between: FloatArray) -> FloatArray:
    """Return variances of contradictions beyond those that the truth states, 0 where it is within them; (3,)."""
    t, step = truth.t, np.diff(truth.t)
    if truth.vel_of_body or len(t) < 2 * MIN_WINDOWS or not np.isfinite(truth.vel_n).any():
        return np.zeros(3)
    if truth.llh is not None:
        moved = ned_between(truth.llh[1:], truth.llh[:-1])
    elif truth.local is not None:
        moved = np.diff(truth.local, axis=0)
    else:
        return np.zeros(3)
    slope = np.gradient(truth.vel_n, t, axis=0)
    by_velocity = 0.5 * step[:, None] * (truth.vel_n[1:] + truth.vel_n[:-1])
    by_velocity += step[:, None] ** 2 / 12.0 * (slope[:-1] - slope[1:])
    off = moved - by_velocity
    lost = ~np.isfinite(off).all(axis=1) | (step > MAX_GAP_INTERVALS * float(np.median(step)))
    whole = np.vstack([np.zeros(3), np.cumsum(np.where(lost[:, None], 0.0, off), axis=0)])
    gaps = np.concatenate([[0], np.cumsum(lost)])
    first = np.searchsorted(t, np.arange(t[0], t[-1] - WINDOW_LENGTH, WINDOW_LENGTH))
    last = np.minimum(np.searchsorted(t, t[first] + WINDOW_LENGTH), len(t) - 1)
    good = (gaps[first] == gaps[last]) & (t[last] - t[first] >= 0.5 * WINDOW_LENGTH)
    first, last = first[good], last[good]
    if len(first) < MIN_WINDOWS:
        return np.zeros(3)
    length = (t[last] - t[first])[:, None]
    square = np.mean(((whole[last] - whole[first]) / length) ** 2, axis=0)
    own = np.nan_to_num(np.einsum("kii->ki", truth.covariance)[:, :6])
    ends = own[first, :3] + own[last, :3]
    stated = np.mean(own[first, 3:] + ends / length**2, axis=0) + between
    beyond = (
        square > max(chi2_quantile(1.0 - FALSE_ALARM, float(len(first))) / len(first), MIN_RATIO**2) * stated
    )
    return np.asarray(np.where(beyond, square - stated, 0.0))
