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
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray, IndexArray
from models.units import STANDARD_GRAVITY
from tuner.diagnosis.drive.causes.base import is_noise_scale, is_of_single_fixes
from tuner.diagnosis.drive.causes.bias_jump import BIAS_JUMP, SENSORS
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS
from tuner.diagnosis.drive.causes.correlated_velocity import CAUSE_CODE as CORRELATED_VELOCITY
from tuner.diagnosis.drive.causes.sensor_bias import CAUSE_CODE as SENSOR_BIAS
from tuner.diagnosis.drive.correlation_left import correlation_left
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.diagnosis.drive.motion_courses import Motion
from tuner.diagnosis.drive.motion_errors import STATES, bias_columns, motion_errors, with_named_noise
from tuner.diagnosis.drive.noise_by_parts import (
    densities_by_parts,
    evidence_of_axes,
    shares_by_parts,
    variances_by_parts,
)
from tuner.diagnosis.drive.parts_of_innovations import BETWEEN, Check, divisions, mixed, thirds_by_size
from tuner.diagnosis.drive.rivals_of_biases import rivals_of_bias
from tuner.diagnosis.drive.score_tests import colour_factor, columns_of
from tuner.diagnosis.drive.search import Accepted, SearchResult
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun
from tuner.linear_run.whitened_innovations import whiten
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import Alternative, Finding, Parameter

UNKNOWN = "unknown"
"""Code of what is none of the catalogue, among alternatives."""
PRIOR_ODDS = 0.1
"""Odds, before the check, that a named cause stands for something else: of ten misfits one is in no catalogue."""
MIN_WEIGHT = 0.2
"""Weight from which something else joins the alternatives: twice that of an effect of which the parts say nothing."""
MIN_LOG_SD = 0.1
"""Least deviation of a log of an sd that is looked for: factors that are known to 10 % are 1."""


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
    biased = [axis for one in findings if one.cause == SENSOR_BIAS for axis in one.parameters]
    found, instead = checks(findings, outcome), motion_errors(outcome, biased)
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
        impossible = ""
        if one.cause == BIAS_JUMP and _overlaps(one, findings):
            impossible = "two jumps of a sensor at one time are an error of some seconds, and of no bias"
        if one.cause == SENSOR_BIAS:
            rivals = rivals_of_bias(outcome, one)
            one = replace(one, alternatives=(*one.alternatives, *rivals.alternatives))
            impossible = "" if rivals.shown else "the innovations hardly show it"
        weight = 1.0 if impossible else min(1.0, max(odds, least, worst / max(gain, worst, 1.0)))
        if weight < MIN_WEIGHT:
            return one
        why = impossible or why_beside
        if not impossible and odds >= MIN_WEIGHT and other is not None and other.evidence == evidence:
            why = f"{other.text} explains the innovations better"
        elif not impossible and odds >= MIN_WEIGHT and own is not None:
            why = f"its effect differs between {BETWEEN[own.between]}"
        share = 100.0 * weight / (1.0 + weight + sum(a.score for a in one.alternatives))
        text = f"{one.text}; it stands for something else with {share:.0f} %: {why}"
        return replace(one, text=text, alternatives=(*one.alternatives, Alternative(UNKNOWN, weight)))

    return tuple(judged(one) for one in findings)


def _overlaps(jump: Finding, findings: tuple[Finding, ...]) -> bool:
    """Whether another jump of the same sensor may be at the time of this one: a bias that jumps stays for a while.

    A knock makes gyroscopes and accelerometers jump at one time; their units tell them apart.
    """
    time, unit = jump.parameters["time"].interval, jump.parameters["x"].unit
    others = [f.parameters for f in findings if f.cause == BIAS_JUMP and f is not jump]
    times = [other["time"].interval for other in others if other["x"].unit == unit]
    return time is not None and any(t is not None and t[0] < time[1] and time[0] < t[1] for t in times)


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
            found[one.cause] = shares_by_parts(run, one.cause, parts)
        elif one.cause in (CORRELATED_GNSS, CORRELATED_VELOCITY):
            layout, forward = run.settings.model.layout, Motion.of(run.linearized).mat[:, :2, 0]
            states = STATES[one.cause]
            axes = {"vehicle": evidence_of_axes(noise, layout[states], forward)} if states in layout else {}
            found[one.cause] = densities_by_parts(noise, ("gnss_position",), 1.0, parts, axes)
        elif one.cause == "imu_noise_scale":
            found[one.cause] = densities_by_parts(noise, NOISE_GROUPS[:2], tau, parts)
        elif is_noise_scale(one.cause):
            found[one.cause] = variances_by_parts(noise, tau, parts)
    return found


def _amplitudes(
    run: FilterRun, effects: Mapping[str, tuple[FloatArray, FloatArray]], parts: Mapping[str, IndexArray]
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
    by_size: dict[str, IndexArray] = {}
    for cause, (push, shift) in effects.items():
        columns[cause, "", 0] = push, shift
        for name, part in parts.items():
            for p in range(int(part.max()) + 1) if name != "rows" else ():
                here = (part[:, :1] == p).astype(float)
                columns[cause, name, p] = push * here, shift * here
        if (third := thirds_by_size(_sizes(push, shift, linearized.sd))) is not None:
            by_size[cause] = third
            for p in range(int(third.max()) + 1):
                here = (third[:, None] == p).astype(float)
                columns[cause, "size", p] = push * here, shift * here
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
        own = {"size": by_size[cause]} if cause in by_size else {}
        for name, part in {**parts, **own}.items():
            count = int(part.max()) + 1
            if name == "rows":
                of_row = part[counted]
                s = np.stack([of[cause, "", 0] * (of_row == p) for p in range(count)], axis=-1)
            else:
                s = np.stack([of[cause, name, p] for p in range(count)], axis=-1)
            evidence[name] = _normal_evidence(w.t, residual, s - q @ (q.T @ s))
        found[cause] = mixed(evidence)
    return found


def _sizes(push: FloatArray, shift: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the sizes (k,) of what is added to fixes, by their sds (k, 6), else of that of velocity and tilt."""
    if np.any(shift):
        return np.asarray(np.sqrt(np.nansum((shift / sd) ** 2, axis=1)))
    return np.asarray(
        np.linalg.norm(push[:, 3:6], axis=1) + STANDARD_GRAVITY * np.linalg.norm(push[:, 6:9], axis=1)
    )


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
