"""A filter run over a drive as a linear model around its estimates: all that the tests of causes need.

Between the updates of fixes i − 1 and i the error state obeys e⁻ᵢ = Φᵢ e⁺ᵢ₋₁ + Bᵢ θ + w, e⁺ᵢ = e⁻ᵢ − cᵢ, and the
innovation of fix i is νᵢ = Hᵢ e⁻ᵢ + Dᵢ θ + v. Here cᵢ is the correction that the filter applied, θ the parameters
of causes that the filter does not model, var w = Σ_g s_g Q_gᵢ over groups of process noise, each as configured
(s_g = 1), and var v the square of the assumed sds. Errors are truth minus estimate, attitude the φ-angle in n, as
in `models.error_state`. All causes, other Q, R and further states are evaluated on this linear model alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from models.arrays import BoolArray, FloatArray, IntArray
from tuner.types import Parameter

NOISE_GROUPS = ("gyro_white", "accel_white", "gyro_bias", "accel_bias")
"""Groups of process noise: white noise of the sensors, and the noise that drives all their bias states."""


@dataclass(frozen=True)
class LinearizedRun:
    """A filter run over k fixes with n states, and the effect of p candidate parameters on it.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Times of the fixes, s.
    transition : ndarray, shape (k, n, n)
        Φ from just after the update of the fix before (or from the start) to each fix.
    noise : mapping of str to ndarray, shape (k, n, n)
        Process noise of each of `NOISE_GROUPS` over the same interval, as configured, and of ``gnss_position`` where
        the filter has states of errors of the receiver that stay; Q is the sum of all.
    H : ndarray, shape (k, 6, n)
        Jacobian of position (north, east, down, m) and velocity (m/s) fixes.
    innovation : ndarray, shape (k, 6)
        Fix minus prediction; 0 where the fix has none.
    sd : ndarray, shape (k, 6)
        Assumed sds.
    reported_sd : ndarray, shape (k, 6)
        Sds reported by the receiver, NaN where it reports none.
    available, used : ndarray of bool, shape (k, 6)
        Rows that the fix has; rows that the filter took (neither gated nor withheld).
    correction : ndarray, shape (k, n)
        c: what the filter added to its state.
    initial : ndarray, shape (n, n)
        P at the start.
    parameters : tuple of Parameter
        Constants behind the columns of B and D, such as ``time_offset.delay``.
    B : ndarray, shape (k, n, p)
        Effect of one unit of each parameter on the errors between two fixes.
    D : ndarray, shape (k, 6, p)
        Effect of one unit of each parameter on the innovations.
    starts : ndarray of bool, shape (k,)
        True at the first fix of every stretch: P begins anew there (`initial` once more for the first nine states).
    solution : ndarray, shape (k,)
        Classes of solution that the receiver states; NaN by default.
    scored : ndarray of bool, shape (k,)
        Fixes that count in sums over the run; false while the filter settles, all by default.
    sparse_cache : dict of bool to SparseStack
        Noise (true) and transition without their zeros, filled when needed and shared with copies.
    """

    t: FloatArray
    transition: FloatArray
    noise: Mapping[str, FloatArray]
    H: FloatArray
    innovation: FloatArray
    sd: FloatArray
    reported_sd: FloatArray
    available: BoolArray
    used: BoolArray
    correction: FloatArray
    initial: FloatArray
    parameters: tuple[Parameter, ...]
    B: FloatArray
    D: FloatArray
    starts: BoolArray
    scored: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    solution: FloatArray = field(default_factory=lambda: np.zeros(0))
    sparse_cache: dict[bool, SparseStack] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.scored) != len(self.t):
            object.__setattr__(self, "scored", np.ones(len(self.t), dtype=bool))
        if len(self.solution) != len(self.t):
            object.__setattr__(self, "solution", np.full(len(self.t), np.nan))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def counted(self) -> BoolArray:
        """Rows that enter sums: taken by the filter, after it has settled; shape (k, 6)."""
        return self.used & self.scored[:, None]

    def rows(self, which: slice, settling: int) -> LinearizedRun:
        """Return a part of the run as a filter that starts there with the first P; its first fixes do not count."""
        scored = self.scored[which].copy()
        scored[:settling] = False
        out = LinearizedRun(
            self.t[which],
            self.transition[which],
            {name: of[which] for name, of in self.noise.items()},
            self.H[which],
            self.innovation[which],
            self.sd[which],
            self.reported_sd[which],
            self.available[which],
            self.used[which],
            self.correction[which],
            self.initial,
            self.parameters,
            self.B[which],
            self.D[which],
            self.starts[which],
            scored,
            self.solution[which],
        )
        for lower in (False, True):
            whole = self.sparse(noise=lower)
            out.sparse_cache[lower] = replace(whole, of=out.stacks(lower), values=whole.values[which])
        return out

    def stacks(self, noise: bool) -> tuple[FloatArray, ...]:
        """Return the process noise of all groups, or the transition."""
        return tuple(self.noise.values()) if noise else (self.transition,)

    def sparse(self, *, noise: bool) -> SparseStack:
        """Return the lower halves of the process noise of all groups, or the transition, without zeros."""
        dense, kept = self.stacks(noise), self.sparse_cache.get(noise)
        if kept is None or any(one is not other for one, other in zip(kept.of, dense, strict=True)):
            self.sparse_cache[noise] = kept = sparse_stack(dense, lower=noise)
        return kept


@dataclass(frozen=True)
class SparseStack:
    """The m entries of stacks of matrices (k, n, n) that are not 0 throughout, one stack after another, row by row.

    Attributes
    ----------
    of : tuple of ndarray, shape (k, n, n)
        The matrices.
    start : ndarray of int
        First entry of every row of a single stack, (n + 1,), or of every stack, (g + 1,), then the number of all.
    row, column : ndarray of int, shape (m,)
        Position of every entry.
    values : ndarray, shape (k, m)
        Its values.
    """

    of: tuple[FloatArray, ...]
    start: IntArray
    row: IntArray
    column: IntArray
    values: FloatArray


def sparse_stack(stacks: Sequence[FloatArray], *, lower: bool = False) -> SparseStack:
    """Return matrices without their zeros: by rows, or where `lower` the lower halves of symmetric ones by stacks."""
    n = stacks[0].shape[-1]
    place = [np.any(one != 0.0, axis=0) if len(one) else np.zeros((n, n), dtype=bool) for one in stacks]
    found = [np.nonzero(np.tril(one | one.T) if lower else one) for one in place]
    row, column = (np.concatenate(each).astype(np.int64) for each in zip(*found, strict=True))
    start = np.searchsorted(row, np.arange(n + 1))
    if lower:
        start = np.cumsum([0, *(len(rows) for rows, _ in found)])
    values = np.concatenate([one[:, at[0], at[1]] for one, at in zip(stacks, found, strict=True)], axis=1)
    return SparseStack(tuple(stacks), start.astype(np.int64), row, column, np.ascontiguousarray(values))
