"""Hypotheses with one free size: a factor on noise that a filter assumes, or a process that it lacks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tuner.consistency.output_causes.error_model import ErrorModel
from tuner.consistency.output_causes.filter_model import DEFAULT_SD
from tuner.consistency.output_causes.true_noise import ExtraProcess, TrueNoise

LOG_MAX_SCALE = math.log(20.0)
"""Largest ratio of true to assumed sd that is looked for, as a logarithm."""
EXTRA_TIMES = (10.0, 60.0, 300.0)
"""Time constants of processes that a filter may lack, s; halfway between, half the gain is still there."""
_UNITS = {"gyro": "rad/s", "accel": "m/s^2", "fixes": "m"}


@dataclass(frozen=True)
class ScaleHypothesis:
    """A hypothesis with one free size s, a logarithm, and the true noise as a function of it."""

    cause: str
    subject: str
    true: Callable[[TrueNoise, float], TrueNoise]
    unit: str = "1"
    bounds: tuple[float, float] = (-LOG_MAX_SCALE, LOG_MAX_SCALE)
    time_constant: float | None = None


def _density(*which: int) -> Callable[[TrueNoise, float], TrueNoise]:
    def true(base: TrueNoise, x: float) -> TrueNoise:
        scaled = [d * math.exp(x) if i in which else d for i, d in enumerate(base.density)]
        return replace(base, density=(scaled[0], scaled[1], scaled[2], scaled[3]))

    return true


def _fixes(*which: int) -> Callable[[TrueNoise, float], TrueNoise]:
    def true(base: TrueNoise, x: float) -> TrueNoise:
        scaled = [d * math.exp(x) if i in which else d for i, d in enumerate(base.fixes)]
        return replace(base, fixes=(scaled[0], scaled[1]))

    return true


def _everything(base: TrueNoise, x: float) -> TrueNoise:
    return _fixes(0, 1)(_density(0, 1, 2, 3)(base, x), x)


def _extra(place: str, time_constant: float) -> Callable[[TrueNoise, float], TrueNoise]:
    return lambda base, x: replace(base, extra=ExtraProcess(place, math.exp(x), time_constant))


def _times(*which: int) -> Callable[[TrueNoise, float], TrueNoise]:
    def true(base: TrueNoise, x: float) -> TrueNoise:
        ratio = [math.exp(x) if i in which else 1.0 for i in (0, 1)]
        return replace(base, time_ratio=(ratio[0], ratio[1]))

    return true


def scale_hypotheses(model: ErrorModel, base: TrueNoise) -> list[ScaleHypothesis]:
    """Return all hypotheses with one free size, each with at most one process that the filter lacks."""
    r, q = "gnss_noise_scale", "imu_noise_scale"
    if model.of_body:
        return [
            ScaleHypothesis(r, "", lambda base, x: _fixes(0)(_density(3)(base, x), x)),
            ScaleHypothesis(r, "position fixes", _fixes(0)),
            ScaleHypothesis(r, "measured velocity", _density(3)),
            ScaleHypothesis(q, "", _density(0, 1, 2)),
            ScaleHypothesis(q, "attitude", _density(0, 2)),
            ScaleHypothesis(q, "velocity", _density(1)),
            ScaleHypothesis("noise_scale", "", _everything),
        ]
    if model.model.without_attitude:
        return [
            ScaleHypothesis(r, "position fixes", _fixes(0)),
            ScaleHypothesis(q, "", _density(1)),
            ScaleHypothesis("noise_scale", "", _everything),
            *_extra_processes(model, ("fixes",)),
        ]
    found = [
        ScaleHypothesis(r, "", _fixes(0, 1)),
        ScaleHypothesis(r, "position fixes", _fixes(0)),
        ScaleHypothesis(r, "velocity fixes", _fixes(1)),
        ScaleHypothesis(q, "", _density(0, 1, 2, 3)),
        ScaleHypothesis(q, "gyros", _density(0, 2)),
        ScaleHypothesis(q, "accelerometers", _density(1, 3)),
        ScaleHypothesis(q, "white noise", _density(0, 1)),
        ScaleHypothesis(q, "bias noise", _density(2, 3)),
        ScaleHypothesis(q, "gyro white noise", _density(0)),
        ScaleHypothesis(q, "accelerometer white noise", _density(1)),
        ScaleHypothesis(q, "gyro bias noise", _density(2)),
        ScaleHypothesis(q, "accelerometer bias noise", _density(3)),
        ScaleHypothesis("noise_scale", "", _everything),
    ]
    if base.extra is not None or base.time_ratio != (1.0, 1.0):
        return found
    found += [
        ScaleHypothesis("time_constant", "", _times(0, 1)),
        ScaleHypothesis("time_constant", "gyro biases", _times(0)),
        ScaleHypothesis("time_constant", "accelerometer biases", _times(1)),
    ]
    return [*found, *_extra_processes(model, tuple(_PROCESSES))]


def _extra_processes(model: ErrorModel, places: tuple[str, ...]) -> list[ScaleHypothesis]:
    """Return the processes of sensors and fixes that the filter may lack."""
    found = []
    for place in places:
        code, subject, first = _PROCESSES[place]
        usual = (
            math.sqrt(float(model.model.fix_variance[0]))
            if place == "fixes"
            # What a filter lacks it may state as next to nothing.
            else max(math.sqrt(float(np.median(np.diag(model.start)[first : first + 3]))), DEFAULT_SD[first])
        )
        middle = math.log(usual)
        bounds = (middle - 2.0 * LOG_MAX_SCALE, middle + LOG_MAX_SCALE)
        if place == "fixes" and model.by_innovations:
            continue
        found += [
            ScaleHypothesis(code, subject, _extra(place, time), _UNITS[place], bounds, time)
            for time in EXTRA_TIMES
        ]
    return found


_PROCESSES = {
    "gyro": ("missing_state", "gyro bias", 9),
    "accel": ("missing_state", "accelerometer bias", 12),
    "fixes": ("correlated_gnss", "", 0),
}
"""Cause, subject and first state of the processes that a filter may lack."""
