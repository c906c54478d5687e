"""Allan curve at octaves and the search for terms that make it.

A sum of terms predicts ln AVAR(τ_i) = ln Σ_terms AVAR_term(τ_i; θ), θ the logarithms of the parameters.
`CurveProblem` evaluates it with its derivatives, finds the θ of the least weighted square, and profiles that
square over one parameter for an interval that stays right where a logarithm runs to minus infinity.

References
----------
.. [1] K. Levenberg, A method for the solution of certain non-linear problems in least squares (1944).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from models.arrays import LEAST_DIVISOR, FloatArray, IntArray
from models.noise import NoiseModel, Term
from tuner.curves.allan import overlapping_allan
from tuner.identification.nonnegative import nonnegative
from tuner.types.records import DataError

_NEGLIGIBLE_SHARE = 1e-8
"""Share of the Allan variance, at every τ, below which an amplitude counts as zero."""


@dataclass(frozen=True)
class OctaveCurve:
    """Overlapping Allan variances of one axis at octaves, with what their covariance needs.

    Attributes
    ----------
    m : ndarray of int, shape (k,)
        Cluster sizes 1, 2, 4, … up to a quarter of the longest segment.
    variance : ndarray, shape (k,)
        Allan variance, pooled over segments by their numbers of second differences.
    lengths : tuple of int
        Samples of each segment.
    interval : float
        Sampling interval, s.
    law_variance : float
        Variance of the white power that comes from the law of the samples, unit⁴/Hz²
        (`tuner.identification.law_of_samples`); 0 for the normal law.
    """

    m: IntArray
    variance: FloatArray
    lengths: tuple[int, ...]
    interval: float
    law_variance: float = 0.0

    @property
    def tau(self) -> FloatArray:
        """Cluster times, s."""
        return self.m.astype(np.float64) * self.interval

    @classmethod
    def of(cls, pieces: Sequence[FloatArray], interval: float) -> OctaveCurve:
        """Compute the curve of gap-free pieces.

        Raises
        ------
        DataError
            If no piece has eight samples, or all are constant.
        """
        lengths = tuple(len(piece) for piece in pieces)
        longest = max(lengths, default=0)
        if longest < 8:
            raise DataError(
                f"an Allan curve needs a gap-free segment of at least 8 samples, the longest has {longest}"
            )
        m = 2 ** np.arange(int(np.log2(longest // 4)) + 1, dtype=np.int64)
        total, number = np.zeros(len(m)), np.zeros(len(m))
        for piece in pieces:
            fits = 2 * m <= len(piece)
            count = len(piece) + 1 - 2 * m[fits]
            total[fits] += count * overlapping_allan(piece, m[fits])
            number[fits] += count
        if not np.all(total > 0.0):
            raise DataError("a constant channel has no Allan variance")
        return cls(m, total / number, lengths, interval)


@dataclass(frozen=True)
class CurveProblem:
    """ln AVAR of a sum of terms as a function of the logarithms of its parameters."""

    curve: OctaveCurve
    terms: tuple[Term, ...]
    shapes: tuple[FloatArray | None, ...]
    lower: FloatArray

    @classmethod
    def of(cls, curve: OctaveCurve, start: NoiseModel) -> CurveProblem:
        """Prepare the terms; those of a single parameter have one shape for good."""
        units = [term.scaled(1.0 / getattr(term, term.PARAMETERS[0])) for term in start.terms]
        unit_curves = [unit.allan_variance(curve.tau, interval=curve.interval) for unit in units]
        shapes = tuple(c if len(u.PARAMETERS) == 1 else None for u, c in zip(units, unit_curves, strict=True))
        lower: list[float] = []
        for unit, shape in zip(units, unit_curves, strict=True):
            visible = np.min(curve.variance / np.maximum(shape, LEAST_DIVISOR))
            lower += [
                0.5 * float(np.log(_NEGLIGIBLE_SHARE * visible)),
                *[-np.inf] * (len(unit.PARAMETERS) - 1),
            ]
        return cls(curve, tuple(units), shapes, np.array(lower))

    def start(self) -> FloatArray:
        """Return logarithms: amplitudes by non-negative least squares, the rest as given."""
        weight = np.sqrt(self.curve.m[-1] / self.curve.m)
        curves = [term.allan_variance(self.curve.tau, interval=self.curve.interval) for term in self.terms]
        amplitudes = nonnegative(np.stack(curves, axis=1) * (weight / self.curve.variance)[:, None], weight)
        theta: list[float] = []
        for term, amplitude in zip(self.terms, amplitudes, strict=True):
            rest = [float(np.log(getattr(term, name))) for name in term.PARAMETERS[1:]]
            theta += [0.5 * float(np.log(max(amplitude, LEAST_DIVISOR))), *rest]
        raised = self.lower + 0.5 * np.log(1e-3 / _NEGLIGIBLE_SHARE)  # nearer to zero it is too flat
        return np.maximum(theta, np.where(np.isfinite(raised), raised, -np.inf))

    def model(self, theta: FloatArray) -> NoiseModel:
        """Return the sum of terms at these logarithms."""
        terms, at = [], 0
        for unit in self.terms:
            own = np.exp(theta[at : at + len(unit.PARAMETERS)]).tolist()
            values = dict(zip(unit.PARAMETERS, own, strict=True))
            terms.append(replace(unit, **values))
            at += len(values)
        return NoiseModel(tuple(terms))

    def __call__(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln AVAR, shape (k,), and its derivatives by θ, shape (k, p)."""
        step = 1e-4
        rows, at = [], 0
        total = np.zeros(len(self.curve.m))
        for unit, shape in zip(self.terms, self.shapes, strict=True):
            size = len(unit.PARAMETERS)
            gain = np.exp(2.0 * theta[at])

            def curve(logs: FloatArray, unit: Term = unit) -> FloatArray:
                values = dict(zip(unit.PARAMETERS[1:], np.exp(logs).tolist(), strict=True))
                term = replace(unit, **values)
                return np.asarray(term.allan_variance(self.curve.tau, interval=self.curve.interval))

            logs = theta[at + 1 : at + size]
            value = gain * (curve(logs) if shape is None else shape)
            total += value
            rows.append(2.0 * value)
            for move in step * np.eye(size - 1):
                rows.append(gain * (curve(logs + move) - curve(logs - move)) / (2.0 * step))
            at += size
        return np.log(total), np.stack(rows, axis=1) / total[:, None]

    def minimise(
        self, theta: FloatArray, target: FloatArray, weight: FloatArray, *, fixed: int | None = None
    ) -> tuple[FloatArray, float]:
        """Return θ at the least weighted square next to a start, and the square; number `fixed` stays."""
        free = np.flatnonzero(np.arange(len(theta)) != fixed)
        damping = 1e-3
        value, jacobian = self(theta)
        score = float((target - value) @ weight @ (target - value))
        for _ in range(200):
            normal = jacobian.T @ weight @ jacobian
            pull = jacobian.T @ weight @ (target - value)
            at_bound = (theta <= self.lower) & (pull < 0)
            move = free[~at_bound[free]]
            if not len(move):
                break
            matrix = normal[np.ix_(move, move)]
            step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix) + 1e-9), pull[move])
            trial = theta.copy()
            trial[move] = np.maximum(theta[move] + np.clip(step, -2.0, 2.0), self.lower[move])
            trial_value, trial_jacobian = self(trial)
            trial_score = float((target - trial_value) @ weight @ (target - trial_value))
            if trial_score <= score:
                gain, score = score - trial_score, trial_score
                theta, value, jacobian = trial, trial_value, trial_jacobian
                damping = max(0.1 * damping, 1e-12)
                if gain < 1e-9:
                    break
            elif damping > 1e8:
                break
            else:
                damping *= 10.0
        return theta, score

    def interval(
        self, k: int, theta: FloatArray, target: FloatArray, weight: FloatArray, allowed: float
    ) -> tuple[float, float]:
        """Return where the square, profiled over the others, exceeds that at θ by no more than `allowed`.

        From 0 where it allows no amplitude at all, to infinity where it sets no limit.
        """
        least = self.minimise(theta, target, weight)[1]

        def excess(log_value: float) -> float:
            start = theta.copy()
            start[k] = log_value
            return float(self.minimise(start, target, weight, fixed=k)[1] - least - allowed)

        limits = [0.0, np.inf]
        for side, sign in enumerate((-1.0, 1.0)):
            near = float(theta[k])
            for _ in range(12):
                far = max(near + sign, float(self.lower[k]))
                if far == near:
                    break
                if excess(far) > 0.0:
                    limits[side] = float(np.exp(brentq(excess, near, far, xtol=1e-3)))
                    break
                near = far
        return limits[0], limits[1]
