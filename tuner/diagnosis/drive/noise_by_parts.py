"""Whether noise that was found has one density, one sd or one share in all parts of the innovations of a drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from models.arrays import FloatArray, IndexArray
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.parts_of_innovations import Check, mixed
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate

NOTHING_FURTHER: Mapping[str, float] = MappingProxyType({})
"""No further divisions."""
_NEAR, _FAR = (-0.2, 0.2), (-2.5, -1.5, -0.8, -0.45, 0.45, 0.8, 1.5, 2.5)
"""Deviations, in units of τ, at which the likelihood of an sd is evaluated; 0 is known."""


def densities_by_parts(
    noise: NoiseHypothesis,
    groups: tuple[str, ...],
    tau: float,
    parts: Mapping[str, IndexArray],
    further: Mapping[str, float] = NOTHING_FURTHER,
) -> Check:
    """Check the density of process noise: its factor between two fixes, part by part.

    Parameters
    ----------
    noise : NoiseHypothesis
        Of the last run.
    groups : tuple of str
        Groups of process noise that have one factor.
    tau : float
        Prior sd of its logarithm.
    parts : mapping of str to ndarray
        Part of every row, by division.
    further : mapping of str to float
        Evidence of further divisions.
    """
    linearized = noise.linearized
    kept = tuple(group for group in groups if group in linearized.noise and linearized.noise[group].any())
    level = evaluate(noise).value

    def gain(which: NDArray[np.bool_], x: float) -> float:
        factor = np.where(which, np.exp(2.0 * x), 1.0)[:, None, None]
        more = {group: of * factor if group in kept else of for group, of in linearized.noise.items()}
        return evaluate(replace(noise, linearized=replace(linearized, noise=more))).value - level

    if not kept:
        return Check(-math.inf, "time")
    evidence = dict(further)
    for name, part in parts.items():
        if name != "rows":
            masks = [part[:, 0] == p for p in range(int(part.max()) + 1)]
            evidence[name] = sum(integrated(partial(gain, mask), tau) for mask in masks)
    return mixed(evidence)


def evidence_of_axes(noise: NoiseHypothesis, states: slice, forward: FloatArray) -> float:
    """Return the log Bayes factor of errors that are larger along the vehicle than across, or in between, or smaller.

    A receiver does not know where the vehicle points: such errors are in its body, as of antennas in turn. Errors that
    are larger to the north than to the east are those of satellites, and are no evidence.

    Parameters
    ----------
    noise : NoiseHypothesis
        With states of errors of the fixes that stay.
    states : slice
        These states, three each.
    forward : ndarray, shape (k, 2)
        Forward axis, north and east.
    """
    linearized = noise.linearized
    level, own = evaluate(noise).value, linearized.noise["gnss_position"]
    length = np.maximum(np.linalg.norm(forward, axis=1), 1e-9)[:, None]
    north = np.broadcast_to([1.0, 0.0], forward.shape)

    def gain(axis: FloatArray, x: float) -> float:
        along = axis[:, :, None] * axis[:, None, :]
        turn = np.tile(np.eye(own.shape[1]), (len(own), 1, 1))
        for first in range(states.start, states.stop, 3):
            level_axes = slice(first, first + 2)
            turn[:, level_axes, level_axes] = np.exp(x) * along + np.exp(-x) * (np.eye(2) - along)
        more = {**linearized.noise, "gnss_position": turn @ own @ np.swapaxes(turn, 1, 2)}
        return evaluate(replace(noise, linearized=replace(linearized, noise=more))).value - level

    def either(axis: FloatArray) -> float:
        between = np.stack([axis[:, 0] - axis[:, 1], axis[:, 0] + axis[:, 1]], axis=1) / math.sqrt(2.0)
        return float(logsumexp([integrated(partial(gain, one), 1.0) for one in (axis, between)])) - math.log(
            2.0
        )

    return either(forward / length) - max(0.0, either(north))


def variances_by_parts(noise: NoiseHypothesis, tau: float, parts: Mapping[str, IndexArray]) -> Check:
    """Check sds of fixes: the mean square of their whitened innovations, of positions and velocities, part by part."""
    white = np.where(noise.counted, evaluate(noise).white, 0.0)
    evidence = {}
    for name, part in parts.items():
        total = 0.0
        for rows in (slice(0, 3), slice(3, 6)) if name != "rows" else (slice(0, 6),):
            for p in range(int(part.max()) + 1):
                which = noise.counted[:, rows] & (part[:, rows] == p)
                n, square = int(np.count_nonzero(which)), float(np.sum(white[:, rows][which] ** 2))
                total += integrated(partial(_variance_gain, n, square), tau)
        evidence[name] = total
    return mixed(evidence)


def _variance_gain(n: int, square: float, x: float) -> float:
    """Return the log likelihood that n innovations gain on unit variance with an sd of exp x."""
    return -n * x - 0.5 * square * math.expm1(-2.0 * x)


def integrated(gain: Callable[[float], float], tau: float) -> float:
    """Return ln ∫ N(x; 0, τ²) exp gain(x) dx, gain(0) = 0, by a parabola about the best of some points.

    Three points suffice where the best deviation is about between them.
    """
    known = {0.0: 0.0}
    for points in (_NEAR, _FAR):
        known |= {x: gain(x * tau) - 0.5 * x**2 for x in points}
        at = np.array(sorted(known))
        value = np.array([known[x] for x in at])
        best = min(max(int(np.argmax(value)), 1), len(at) - 2)
        three = slice(best - 1, best + 2)
        a, b, c = np.polyfit(at[three], value[three], 2)
        top = -0.5 * b / a if a < 0.0 else math.inf
        if abs(top) < 2.0 * _NEAR[1]:
            break
    if a >= 0.0:
        return float(value.max())
    peak = max(float(np.polyval((a, b, c), np.clip(top, at[best - 1], at[best + 1]))), float(value.max()))
    return peak - 0.5 * math.log(-2.0 * a)


def shares_by_parts(run: FilterRun, cause: str, parts: Mapping[str, IndexArray]) -> Check:
    """Check single fixes that are left out: the share of their runs, part by part."""
    h, t = run.hypothesis, run.linearized.t
    out = h.position_out if cause == "gnss_outliers" else h.velocity_out & ~h.position_out
    begins = np.flatnonzero(out & ~np.append(False, out[:-1]))
    # A fix that is left out altogether is in the part of the one before.
    nearest = np.clip(np.searchsorted(run.index, begins), 0, len(t) - 1)
    evidence = {}
    for name, part in parts.items():
        if name == "rows":
            continue
        of_fix = part[:, 0]
        weight = np.array([np.mean(of_fix[of_fix >= 0] == p) for p in range(int(of_fix.max()) + 1)])
        count = np.array([np.count_nonzero(of_fix[nearest] == p) for p in range(len(weight))])
        evidence[name] = dirichlet_evidence(count[weight > 0.0], weight[weight > 0.0])
    return mixed(evidence)


def dirichlet_evidence(count: IndexArray, weight: FloatArray) -> float:
    """Return the log Bayes factor of shares that are unknown, Dirichlet, against known ones."""
    prior = weight * len(weight)
    total = gammaln(prior.sum()) - gammaln(prior.sum() + count.sum())
    return float(total + np.sum(gammaln(prior + count) - gammaln(prior)) - count @ np.log(weight))
