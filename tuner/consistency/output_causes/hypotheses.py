"""Hypotheses with one free size: a factor on noise that a filter assumes, or a process that it lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.noise import GaussMarkov
from tuner.consistency.output_causes.error_model import ErrorModel
from tuner.consistency.output_causes.filter_model import DEFAULT_SD
from tuner.consistency.output_causes.true_noise import TrueNoise

LOG_MAX_SCALE = math.log(20.0)
"""Largest ratio of true to assumed sd that is looked for, as a logarithm."""
SMALL_STEP = 0.15
"""Change of a size, as a logarithm, over which a deviance is about a parabola."""
RATIOS = (-LOG_MAX_SCALE, -2.2, -0.8, -SMALL_STEP, SMALL_STEP, 0.8, 2.2, LOG_MAX_SCALE)
"""Logarithms of ratios from which the best is sought."""
EXTRA_TIMES = (10.0, 60.0, 300.0)
"""Time constants of processes that a filter may lack, s; halfway between, half the gain is still there."""


@dataclass(frozen=True)
class ScaleHypothesis:
    """A hypothesis with one free size s, a logarithm, and the true noise as a function of it."""

    cause: str
    subject: str
    true: Callable[[TrueNoise, float], TrueNoise]
    unit: str = "1"
    grid: tuple[float, ...] = RATIOS
    time_constant: float | None = None


def _scaled(
    *, density: Sequence[int] = (), fixes: Sequence[int] = (), times: Sequence[int] = ()
) -> Callable[[TrueNoise, float], TrueNoise]:
    """Return the true noise with some densities, sds of fixes and time constants larger, of ln of the factor."""

    def true(base: TrueNoise, x: float) -> TrueNoise:
        def larger(values: tuple[float, ...], which: Sequence[int]) -> tuple[float, ...]:
            return tuple(value * math.exp(x) if i in which else value for i, value in enumerate(values))

        return replace(
            base,
            density=larger(base.density, density),
            fixes=larger(base.fixes, fixes),
            time_ratio=larger(base.time_ratio, times),
        )

    return true


def _extra(place: str, time_constant: float) -> Callable[[TrueNoise, float], TrueNoise]:
    return lambda base, x: replace(base, extra=(place, GaussMarkov(math.exp(x), time_constant)))


def scale_hypotheses(model: ErrorModel, base: TrueNoise) -> list[ScaleHypothesis]:
    """Return all hypotheses with one free size, each with at most one process that the filter lacks."""
    r, q = "gnss_noise_scale", "imu_noise_scale"
    everything = ScaleHypothesis("noise_scale", "", _scaled(density=range(4), fixes=range(2)))
    if model.course.motion.of_body:
        return [
            ScaleHypothesis(r, "", _scaled(density=[3], fixes=[0])),
            ScaleHypothesis(r, "position fixes", _scaled(fixes=[0])),
            ScaleHypothesis(r, "measured velocity", _scaled(density=[3])),
            ScaleHypothesis(q, "", _scaled(density=[0, 1, 2])),
            ScaleHypothesis(q, "attitude", _scaled(density=[0, 2])),
            ScaleHypothesis(q, "velocity", _scaled(density=[1])),
            everything,
        ]
    if model.model.without_attitude:
        return [
            ScaleHypothesis(r, "position fixes", _scaled(fixes=[0])),
            ScaleHypothesis(q, "", _scaled(density=[1])),
            everything,
            *_extra_processes(model, ("fixes",)),
        ]
    found = [
        ScaleHypothesis(r, "", _scaled(fixes=[0, 1])),
        ScaleHypothesis(r, "position fixes", _scaled(fixes=[0])),
        ScaleHypothesis(r, "velocity fixes", _scaled(fixes=[1])),
        ScaleHypothesis(q, "", _scaled(density=[0, 1, 2, 3])),
        ScaleHypothesis(q, "gyros", _scaled(density=[0, 2])),
        ScaleHypothesis(q, "accelerometers", _scaled(density=[1, 3])),
        ScaleHypothesis(q, "white noise", _scaled(density=[0, 1])),
        ScaleHypothesis(q, "bias noise", _scaled(density=[2, 3])),
        ScaleHypothesis(q, "gyro white noise", _scaled(density=[0])),
        ScaleHypothesis(q, "accelerometer white noise", _scaled(density=[1])),
        ScaleHypothesis(q, "gyro bias noise", _scaled(density=[2])),
        ScaleHypothesis(q, "accelerometer bias noise", _scaled(density=[3])),
        everything,
    ]
    if base.extra is not None or base.time_ratio != (1.0, 1.0):
        return found
    found += [
        ScaleHypothesis("time_constant", "", _scaled(times=[0, 1])),
        ScaleHypothesis("time_constant", "gyro biases", _scaled(times=[0])),
        ScaleHypothesis("time_constant", "accelerometer biases", _scaled(times=[1])),
    ]
    return [*found, *_extra_processes(model, tuple(_PROCESSES))]


def _extra_processes(model: ErrorModel, places: tuple[str, ...]) -> list[ScaleHypothesis]:
    """Return the processes of sensors and fixes that the filter may lack."""
    found = []
    for place in places:
        if place == "fixes" and model.by_innovations:
            continue
        code, subject, unit, first = _PROCESSES[place]
        usual = (
            math.sqrt(float(model.model.fix_variance[0]))
            if place == "fixes"
            # What a filter lacks it may state as next to nothing.
            else max(
                math.sqrt(float(np.median(np.diag(model.errors.initial)[first : first + 3]))),
                DEFAULT_SD[first],
            )
        )
        ends = math.log(usual) - 2.0 * LOG_MAX_SCALE, math.log(usual) + LOG_MAX_SCALE
        grid = tuple(np.linspace(*ends, 8).tolist())
        found += [
            ScaleHypothesis(code, subject, _extra(place, time), unit, grid, time) for time in EXTRA_TIMES
        ]
    return found


_PROCESSES = {
    "gyro": ("missing_state", "gyro bias", "rad/s", 9),
    "accel": ("missing_state", "accelerometer bias", "m/s^2", 12),
    "fixes": ("correlated_gnss", "", "m", 0),
}
"""Cause, subject, unit and first state of the processes that a filter may lack."""
