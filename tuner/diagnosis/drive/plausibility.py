"""Can a diagnosis be true? Where the start failed, or an estimate is impossible, no list of causes is given.

What no cause of the catalogue explains takes the shape of one that can: an attitude that is wrong from the start makes
biases and noise of sensors that no sensor has. So causes are withdrawn where

- the filter had to correct the attitude of its start by more than `MAX_START_CORRECTION` of its stated sds: every
  residual behind it is one of the start, and nothing else can be named;
- a heading that was hardly known was corrected by more than a linear filter can (`MAX_LINEAR_CORRECTION`);
- a bias is beyond `MAX_BIAS` prior sds of its own sensor, and no scale factor of the vertical accelerometer either,
  noise is more than `MAX_RATIO` times as large as stated (of fixes in classes: that of every class), or errors of the
  fixes last longer than the drive and than any of a receiver, so that they cannot be distinguished from a constant;
- none of its figures is determined, or of factors on noise those that are may all be 1: an estimate at its bound
  names nothing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive.causes.base import is_noise_scale
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS
from tuner.diagnosis.drive.causes.correlated_velocity import CAUSE_CODE as CORRELATED_VELOCITY
from tuner.diagnosis.drive.causes.sensor_bias import CAUSE_CODE as SENSOR_BIAS
from tuner.diagnosis.drive.fitted_noise_scales import consistent_with_one
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.posterior_check import UNKNOWN
from tuner.formats.customary_units import amount
from tuner.formats.parameter_words import parameter_words
from tuner.navigation.drive.run import SETTLING_TIME
from tuner.types import Alternative, Coefficient, DriveDiagnosis, Finding, Unexplained
from tuner.types.borrowed import borrowed
from tuner.types.diagnosis import START

MAX_START_CORRECTION = 6.0
"""Correction of the attitude while a filter settles, in sds of its start, above which the start failed.

The correction of a right start has at most the variance of the start: six sds of three angles come with 6e-9; a start
whose sd is stated 30 % too small comes to 4.6.
"""
HEADING_STATE = 8
"""State of the error of the heading."""
MAX_LINEAR_SD, MAX_LINEAR_CORRECTION = math.radians(20.0), math.radians(30.0)
"""Sd of a heading from which a correction may be too far for a linear filter, and that correction, rad."""
MAX_BIAS = 20.0
"""Bias in prior sds above which no sensor explains it: data sheets err by factors of a few."""
MAX_RATIO = 50.0
"""Ratio of a true to a stated sd of noise above which no noise explains it: vibrating units have 5 to 20."""
MAX_RECEIVER_TIME = 3600.0
"""Time constant, s, above which errors are none of a receiver: those of satellites and ionosphere change in an hour."""
ANGLES = ("about north", "about east", "in heading")
START_HELP = (
    "begin with a minute at rest, then accelerate and brake on a straight line before turning, with fixes at 1 Hz or "
    "more often"
)
UNKNOWN_HELP = "a reference solution, or a static log of the unit, would show more"


def plausible(found: DriveDiagnosis, final: FilterRun) -> DriveDiagnosis:
    """Return a diagnosis without causes that cannot be, the configuration then as it was, and the reason.

    Parameters
    ----------
    found : DriveDiagnosis
        As searched.
    final : FilterRun
        The run with all causes in it.
    """
    failed = start_correction(final) or (heading_correction(final) if found.findings else "")
    if failed:
        why = Unexplained(f"the start failed: {failed}", ("drive",), 0.0, about=START)
        return replace(
            found,
            findings=(),
            after=found.before,
            unexplained=(why, *found.unexplained),
            inseparable=(),
            notes=(f"causes are not named where the start failed; {START_HELP}", *found.notes),
        )
    span = float(final.linearized.t[-1] - final.linearized.t[0])
    lent = borrowed(found.before)
    impossible = {one.cause: why for one in found.findings for why in reasons(one, span, lent)}
    if not impossible:
        return found
    unknown = tuple(
        Unexplained(f"something that acts like {cause.replace('_', ' ')}: {why}", ("drive",), 0.0)
        for cause, why in impossible.items()
    )
    return replace(
        found,
        findings=tuple(_with_unknown(one) for one in found.findings if one.cause not in impossible),
        after=found.before,
        unexplained=(*unknown, *found.unexplained),
        notes=(
            f"what cannot be true stands for something else, which may also be in the others; {UNKNOWN_HELP}",
            *found.notes,
        ),
    )


def _with_unknown(one: Finding) -> Finding:
    """Return a finding beside one that cannot be: what that stands for may be in this one, too."""
    others = tuple(a for a in one.alternatives if a.cause != UNKNOWN)
    return replace(one, alternatives=(*others, Alternative(UNKNOWN, 1.0)))


def start_correction(run: FilterRun) -> str:
    """Return in words by how much the attitude of a start was corrected beyond its sd, "" where it was not."""
    linearized, at = run.linearized, run.settings.model.layout["gyro_bias"]
    variance = np.diag(linearized.initial)
    # Gyro biases that are not known yet turn the unit meanwhile, too.
    sd = np.sqrt(variance[6:9] + variance[at].max() * SETTLING_TIME**2)
    worst, text = MAX_START_CORRECTION, ""
    for begin in np.flatnonzero(linearized.starts).tolist():
        t = linearized.t[begin:]
        early = int(np.argmax(linearized.scored[begin:])) or len(t)
        total = linearized.correction[begin : begin + early, 6:9].sum(axis=0)
        ratio = np.abs(total) / sd
        if ratio.max() > worst:
            i, worst = int(np.argmax(ratio)), float(ratio.max())
            size, stated = np.degrees(abs(total[i])), np.degrees(sd[i])
            text = (
                f"from {t[0]:.0f} to {t[early - 1]:.0f} s its attitude was corrected by {size:.1f}° {ANGLES[i]}, "
                f"{worst:.0f} times the sd of {stated:.1f}° that it was stated with"
            )
    return text


def heading_correction(run: FilterRun) -> str:
    """Return in words by how much a heading that was hardly known was corrected, "" where a linear filter could.

    The filter is linear in the errors of its attitude: with the cosine of an error of 30°, all that follows from it is
    wrong by a seventh, and named as something else.
    """
    linearized = run.linearized
    sd = float(np.sqrt(linearized.initial[HEADING_STATE, HEADING_STATE]))
    if sd < MAX_LINEAR_SD:
        return ""
    begins = np.flatnonzero(linearized.starts)
    for begin, end in zip(begins, [*begins[1:], len(linearized.t)], strict=True):
        total = np.abs(np.cumsum(linearized.correction[begin:end, HEADING_STATE]))
        if total.max(initial=0.0) > MAX_LINEAR_CORRECTION:
            return (
                f"its heading was known to {np.degrees(sd):.0f}° and corrected by {np.degrees(total.max()):.0f}°, "
                "too far for a filter that is linear in it"
            )
    return ""


def _ratios(parameters: Mapping[str, Coefficient]) -> dict[str, float]:
    """Return the ratios of a finding; of classes of fixes the least: one class may be wrong by any factor."""
    found: dict[str, float] = {}
    for name, one in parameters.items():
        if "_edge_" not in name and "_solution_" not in name:
            row = name.partition("_class_")[0]
            found[row] = min(found.get(row, np.inf), one.value or 0.0)
    return found


def reasons(one: Finding, span: float, lent: Collection[str] = ()) -> Iterator[str]:
    """Yield why a finding cannot be true on a drive of a length, s; the priors of axes `lent` are of another sensor."""
    if not one.determined:
        yield "none of its figures is determined within a factor of five"
    elif one.doubted and is_noise_scale(one.cause) and consistent_with_one(one.figures):
        yield f"only {', '.join(parameter_words(one.parameters)[name] for name in one.doubted)}, at a bound"
    scaled = any(other.cause == "accel_scale" for other in one.alternatives)
    own = not one.parameters.keys() <= set(lent)
    if one.cause == SENSOR_BIAS and one.value > MAX_BIAS and own and not scaled:
        sizes = (f"{said} {amount(one.figures[name])}" for name, said in parameter_words(one.figures).items())
        yield f"a bias of {', '.join(sizes)}, up to {one.value:.0f} × its expected sd"
    if is_noise_scale(one.cause):
        ratio = max(_ratios(one.parameters).values(), default=0.0)
        if ratio > MAX_RATIO:
            yield f"noise {ratio:.0f} times as large as stated"
    if one.cause in (CORRELATED_GNSS, CORRELATED_VELOCITY):
        time = one.parameters["time_constant"]
        shortest = time.interval[0] if time.interval else time.value or 0.0
        if shortest > max(span, MAX_RECEIVER_TIME):
            yield (
                f"errors with a time constant beyond {shortest:.0f} s, longer than any of a receiver and than the "
                f"drive of {span:.0f} s: a constant, or a drift"
            )
