"""Posterior check of named causes: whether what a cause predicts is there in all parts of the innovations.

What no cause of the catalogue explains is taken up by the nearest one, which then fits where the misfit is largest and
not elsewhere. So the effect of every named cause is let differ between parts of the innovations: positions and
velocities, quarters of the drive, braking and accelerating, turns to the left and to the right, slow and fast. With the
deviation δ_p of part p, as large as the effect itself, against none::

    E = ln mean_s ∏_p ∫ N(δ_p; 0, τ²) L(δ_p) dδ_p / L(0)         over the divisions s of the innovations

Of constants and jumps of a bias the effect is an amplitude, τ = 1 and the integral of a normal law known; of noise it
is the log of an sd, τ that of its factor; of single fixes it is their share. E is some nats below 0 where a cause is
true, as deviations cost what they cannot explain, and far above where it stands for something else. The check needs
what the search fitted, and no further run of the filter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from tuner.diagnosis.drive.causes.base import is_noise_scale, is_of_single_fixes
from tuner.diagnosis.drive.causes.bias_jump import BIAS_JUMP, SENSORS
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS
from tuner.diagnosis.drive.causes.correlated_velocity import CAUSE_CODE as CORRELATED_VELOCITY
from tuner.diagnosis.drive.causes.sensor_bias import CAUSE_CODE as SENSOR_BIAS
from tuner.diagnosis.drive.causes.time_offset import OFFSET_DELAY
from tuner.diagnosis.drive.correlation_left import correlation_left
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis, as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import NOISE_GROUPS, LinearizedRun
from tuner.diagnosis.drive.linear_model.whitened_innovations import whiten
from tuner.diagnosis.drive.motion_errors import bias_columns, motion_errors, with_named_noise
from tuner.diagnosis.drive.score_tests import colour_factor, columns_of
from tuner.diagnosis.drive.search import Accepted, SearchResult
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import Alternative, Finding, Parameter

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

UNKNOWN = "unknown"
"""Code of what is none of the catalogue, among alternatives."""
PRIOR_ODDS = 0.1
"""Odds, before the check, that a named cause stands for something else: of ten misfits one is in no catalogue."""
MIN_WEIGHT = 0.2
"""Weight from which something else joins the alternatives: twice that of an effect of which the parts say nothing."""
MIN_LOG_SD = 0.1
"""Least deviation of a log of an sd that is looked for: factors that are known to 10 % are 1."""
TIME_PARTS, MOTION_PARTS = 4, 3
"""Parts of the drive in time, and of the fixes by what the vehicle does."""
MIN_SPEED_SHARE = 0.1
"""Share of the usual speed from which a vehicle moves: at rest sensors are not shaken."""
_NEAR, _FAR = (-0.2, 0.2), (-2.5, -1.5, -0.8, -0.45, 0.45, 0.8, 1.5, 2.5)
"""Deviations, in units of τ, at which the likelihood of an sd is evaluated; 0 is known."""

BETWEEN = {
    "rows": "positions and velocities, level and vertical",
    "time": "quarters of the drive",
    "course": "courses to the north, east, south and west",
    "along": "braking and accelerating",
    "turn": "left and right turns",
    "speed": "slow and fast",
}
"""What the parts of each division are."""


@dataclass(frozen=True)
class Check:
    """Evidence against a named cause, nats, and the division of the innovations that has most of it."""

    evidence: float
    between: str


def divisions(linearized: LinearizedRun) -> dict[str, IntArray]:
    """Return the part of every row of k fixes, by division; (k, 6) each, −1 where the row is in none."""
    k, t = len(linearized.t), linearized.t
    delay = linearized.parameters.index(OFFSET_DELAY)
    velocity, acceleration = -linearized.D[:, :3, delay], -linearized.D[:, 3:, delay]
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > MIN_SPEED_SHARE * float(np.quantile(speed, 0.9))
    heading = velocity / np.maximum(speed, 1e-9)[:, None]
    along = np.einsum("ki,ki->k", heading, acceleration)
    left = heading[:, 0] * acceleration[:, 1] - heading[:, 1] * acceleration[:, 0]
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    quadrant = np.floor((course + 0.25 * np.pi) / (0.5 * np.pi)).astype(np.intp) % 4
    span = max(float(t[-1] - t[0]), 1e-9)
    by_fix = {
        "time": np.minimum((TIME_PARTS * (t - t[0]) / span).astype(np.intp), TIME_PARTS - 1),
        "course": np.where(moving, quadrant, -1),
        **{
            name: np.where(moving, _thirds(values, moving), -1)
            for name, values in (("along", along), ("turn", left), ("speed", speed))
        },
    }
    rows = np.broadcast_to(np.array([0, 0, 1, 2, 2, 3], dtype=np.intp), (k, 6))
    return {"rows": rows, **{name: np.repeat(part[:, None], 6, axis=1) for name, part in by_fix.items()}}


def _thirds(values: FloatArray, among: NDArray[np.bool_]) -> IntArray:
    if not among.any():
        return np.zeros(len(values), dtype=np.intp)
    edges = np.quantile(values[among], np.arange(1, MOTION_PARTS) / MOTION_PARTS)
    return np.asarray(np.digitize(values, edges), dtype=np.intp)


def with_something_else(findings: tuple[Finding, ...], outcome: SearchResult) -> tuple[Finding, ...]:
    """Return findings with something else among their alternatives where what they predict is not there.

    Its weight is the posterior odds of deviations, or of an error in no cause in place of this one (`motion_errors`).
    Of a cause that passes, it is the largest evidence against any cause, for an error beside all of them, or for
    innovations that are not white (`correlation_left`), as a share of its own gain, and at least `MIN_WEIGHT` where
    that evidence outweighs the prior odds: then something is in the drive that none of them describes.

    Parameters
    ----------
    findings : tuple of Finding
        Of a search.
    outcome : SearchResult
        The search.
    """
    if not findings:
        return findings
    found, instead = checks(findings, outcome), motion_errors(outcome)
    noise = as_configured(outcome.final.linearized)
    beside, left = instead.pop(""), correlation_left(noise)
    unnamed = evaluate(noise).value - evaluate(with_named_noise(outcome, noise)).value
    reasons = {
        "something in the drive is explained by none of the findings": max(
            [0.0, *(one.evidence for one in found.values()), *(one.evidence for one in instead.values())]
        ),
        f"beside all findings, there seems to be {beside.text}": beside.evidence,
        left.text: left.evidence,
        "only more noise of the sensors than stated, which is no finding, lets the filter follow the drive": (
            unnamed - 0.5 * len(NOISE_GROUPS) * math.log(noise.count)
        ),
    }
    why_beside, worst = max(reasons.items(), key=lambda item: item[1])
    gains: dict[str, float] = {}
    for one in outcome.accepted:
        gains[one.cause] = max(gains.get(one.cause, 0.0), one.candidate.result.gain)

    def judged(one: Finding) -> Finding:
        own, other = found.get(one.cause), instead.get(one.cause)
        evidence = max(
            -math.inf if own is None else own.evidence, -math.inf if other is None else other.evidence
        )
        odds = PRIOR_ODDS * math.exp(min(evidence, 10.0))
        gain = gains.get(one.cause, 0.5 * one.value**2 if one.cause == SENSOR_BIAS else math.inf)
        least = MIN_WEIGHT if worst > -math.log(PRIOR_ODDS) else 0.0
        weight = min(1.0, max(odds, least, worst / max(gain, worst, 1.0)))
        if weight < MIN_WEIGHT:
            return one
        why = why_beside
        if odds >= MIN_WEIGHT and other is not None and other.evidence == evidence:
            why = f"{other.text} explains the innovations better"
        elif odds >= MIN_WEIGHT and own is not None:
            why = f"its effect differs between {BETWEEN[own.between]}"
        share = 100.0 * weight / (1.0 + weight + sum(a.score for a in one.alternatives))
        text = f"{one.text}; it stands for something else with {share:.0f} %: {why}"
        return replace(one, text=text, alternatives=(*one.alternatives, Alternative(UNKNOWN, weight)))

    return tuple(judged(one) for one in findings)


def checks(findings: tuple[Finding, ...], outcome: SearchResult) -> dict[str, Check]:
    """Return the check of every cause that was found, by code."""
    run, base = outcome.final, outcome.base.hypothesis
    biases = {
        axis: one.value or 0.0
        for f in findings
        if f.cause == SENSOR_BIAS
        for axis, one in f.parameters.items()
    }
    parts = divisions(run.linearized)
    effects = _effects(run, base, outcome.accepted, outcome.shifts, biases)
    found = _amplitudes(run, effects, parts) if effects else {}
    noise = as_configured(run.linearized)
    for one in outcome.accepted:
        logs = [abs(math.log(c.value)) for c in one.parameters.values() if c.value and c.value > 0.0]
        tau = max([MIN_LOG_SD, *logs])
        if is_of_single_fixes(one.cause):
            found[one.cause] = _shares(run, one.cause, parts)
        elif one.cause in (CORRELATED_GNSS, CORRELATED_VELOCITY):
            found[one.cause] = _scales(noise, ("gnss_position",), 1.0, parts)
        elif one.cause == "imu_noise_scale":
            found[one.cause] = _scales(noise, NOISE_GROUPS[:2], tau, parts)
        elif is_noise_scale(one.cause):
            found[one.cause] = _variances(noise, tau, parts)
    return found


def _mixed(evidence: Mapping[str, float]) -> Check:
    """Return the evidence of all divisions together, each as likely as the others beforehand."""
    names = list(evidence)
    values = np.array([evidence[name] for name in names])
    return Check(float(logsumexp(values)) - math.log(len(values)), names[int(np.argmax(values))])


def _amplitudes(
    run: FilterRun, effects: Mapping[str, tuple[FloatArray, FloatArray]], parts: Mapping[str, IntArray]
) -> dict[str, Check]:
    """Check what shifts the innovations: its amplitude, part by part.

    Parameters
    ----------
    run : FilterRun
        The last run.
    effects : mapping of str to (ndarray, ndarray)
        What each cause of the size found adds to the errors between fixes, (k, n), and to the fixes, (k, 6).
    parts : mapping of str to ndarray
        Part of every row, by division.
    """
    linearized = run.linearized
    counted = as_configured(linearized).counted
    columns: dict[tuple[str, str, int], tuple[FloatArray, FloatArray]] = {}
    for cause, (push, shift) in effects.items():
        columns[cause, "", 0] = push, shift
        for name, part in parts.items():
            for p in range(int(part.max()) + 1) if name != "rows" else ():
                here = (part[:, :1] == p).astype(float)
                columns[cause, name, p] = push * here, shift * here
    fixed = [i for i, parameter in enumerate(linearized.parameters) if parameter.cause in effects]
    more = replace(
        linearized,
        parameters=tuple(Parameter("column", str(i)) for i in range(len(fixed) + len(columns))),
        B=np.concatenate(
            [linearized.B[:, :, fixed], np.stack([push for push, _ in columns.values()], axis=-1)], axis=2
        ),
        D=np.concatenate(
            [linearized.D[:, :, fixed], np.stack([shift for _, shift in columns.values()], axis=-1)], axis=2
        ),
    )
    w = whiten(as_configured(more))
    of = {key: w.slope[:, len(fixed) + i] for i, key in enumerate(columns)}
    free = np.column_stack(
        [w.slope[:, : len(fixed)], *(of[cause, "", 0] for cause in effects if not _has(linearized, cause))]
    )
    q, _ = np.linalg.qr(free)
    residual = run.whitened.residual - q @ (q.T @ run.whitened.residual)
    found = {}
    for cause in effects:
        evidence = {}
        for name, part in parts.items():
            count = int(part.max()) + 1
            if name == "rows":
                of_row = part[counted]
                s = np.stack([of[cause, "", 0] * (of_row == p) for p in range(count)], axis=-1)
            else:
                s = np.stack([of[cause, name, p] for p in range(count)], axis=-1)
            evidence[name] = _normal_evidence(w.t, residual, s - q @ (q.T @ s))
        found[cause] = _mixed(evidence)
    return found


def _has(linearized: LinearizedRun, cause: str) -> bool:
    return any(parameter.cause == cause for parameter in linearized.parameters)


def _effects(
    run: FilterRun,
    base: Hypothesis,
    accepted: tuple[Accepted, ...],
    shifts: tuple[str, ...],
    biases: Mapping[str, float],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return what constants, jumps and biases of the sizes found add to errors, (k, n), and fixes, (k, 6), by cause."""
    linearized = run.linearized
    k, n = linearized.transition.shape[:2]
    none, found = np.zeros((k, 6)), {}
    for one in accepted:
        if one.cause not in shifts:
            continue
        own = list(columns_of(one.cause, linearized.parameters))
        names = [linearized.parameters[i] for i in own]
        total = np.array([one.parameters[name.name].value or 0.0 for name in names])
        values = total - base.compensation.vector(names)
        found[one.cause] = linearized.B[:, :, own] @ values, linearized.D[:, :, own] @ values
    unit = bias_columns(linearized)
    if run.hypothesis.jumps:
        jumped = np.zeros((k, n))
        for jump in run.hypothesis.jumps:
            at = SENSORS[jump.sensor][0]
            jumped += (unit[:, :, at] @ jump.size) * (linearized.t > jump.time)[:, None]
        found[BIAS_JUMP] = jumped, none
    if biases:
        size = np.array([biases.get(axis, 0.0) for axis in GYROS + ACCELS])
        found[SENSOR_BIAS] = unit @ size, none
    return found


def _normal_evidence(t: FloatArray, residual: FloatArray, s: FloatArray) -> float:
    """Return the log Bayes factor of deviations N(0, 1) along p columns against none; correlation may be left."""
    information, b = s.T @ s, s.T @ residual
    step = np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ b
    c = colour_factor(t, residual - s @ step, s)
    wide = np.eye(len(b)) + information / c
    return 0.5 * float(b @ np.linalg.solve(wide, b)) / c**2 - 0.5 * float(np.linalg.slogdet(wide)[1])


def _scales(
    noise: NoiseHypothesis, groups: tuple[str, ...], tau: float, parts: Mapping[str, IntArray]
) -> Check:
    """Check the density of process noise: its factor between two fixes, part by part."""
    linearized = noise.linearized
    kept = tuple(group for group in groups if group in linearized.noise and linearized.noise[group].any())
    level = evaluate(noise).value

    def gain(which: NDArray[np.bool_], x: float) -> float:
        factor = np.where(which, np.exp(2.0 * x), 1.0)[:, None, None]
        more = {group: of * factor if group in kept else of for group, of in linearized.noise.items()}
        return evaluate(replace(noise, linearized=replace(linearized, noise=more))).value - level

    if not kept:
        return Check(-math.inf, "time")
    evidence = {}
    for name, part in parts.items():
        if name != "rows":
            masks = [part[:, 0] == p for p in range(int(part.max()) + 1)]
            evidence[name] = sum(_integrated(partial(gain, mask), tau) for mask in masks)
    return _mixed(evidence)


def _variances(noise: NoiseHypothesis, tau: float, parts: Mapping[str, IntArray]) -> Check:
    """Check sds of fixes: the mean square of their whitened innovations, of positions and velocities, part by part."""
    white = np.where(noise.counted, evaluate(noise).white, 0.0)
    evidence = {}
    for name, part in parts.items():
        total = 0.0
        for rows in (slice(0, 3), slice(3, 6)) if name != "rows" else (slice(0, 6),):
            for p in range(int(part.max()) + 1):
                which = noise.counted[:, rows] & (part[:, rows] == p)
                n, square = int(np.count_nonzero(which)), float(np.sum(white[:, rows][which] ** 2))
                total += _integrated(partial(_variance_gain, n, square), tau)
        evidence[name] = total
    return _mixed(evidence)


def _variance_gain(n: int, square: float, x: float) -> float:
    """Return the log likelihood that n innovations gain on unit variance with an sd of exp x."""
    return -n * x - 0.5 * square * math.expm1(-2.0 * x)


def _integrated(gain: Callable[[float], float], tau: float) -> float:
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


def _shares(run: FilterRun, cause: str, parts: Mapping[str, IntArray]) -> Check:
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
        evidence[name] = _dirichlet_evidence(count[weight > 0.0], weight[weight > 0.0])
    return _mixed(evidence)


def _dirichlet_evidence(count: IntArray, weight: FloatArray) -> float:
    """Return the log Bayes factor of shares that are unknown, Dirichlet, against known ones."""
    prior = weight * len(weight)
    total = gammaln(prior.sum()) - gammaln(prior.sum() + count.sum())
    return float(total + np.sum(gammaln(prior + count) - gammaln(prior)) - count @ np.log(weight))
