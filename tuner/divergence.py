"""Why a simulated filter diverged, in words: its start, or a truth far from what it believes.

Where a filter expects attitude errors after its start beyond what is linear, or some runs are lost while its errors in
the median run are as predicted, the start is more than it recovers from each time. Else the rms of what was flown is
compared with the belief.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tuner.consistency import SETTLING, STRAYED, run_ratios, some_strayed
from tuner.navigation.sensor import Sensor
from tuner.navigation.settings import FilterSettings
from tuner.navigation.simulate import Runs, Scenario

FloatArray = NDArray[np.float64]

ATTITUDE = slice(6, 9)
LINEAR = 0.25
"""Sd of the attitude from which a filter is far from linear, rad: at two sds the cosine is down by an eighth."""
FAR = 3.0
"""Ratio of truth to belief, or its inverse, from which it is named."""


def divergence(flown: Runs, plan: Scenario, settings: FilterSettings, sensor: Sensor) -> tuple[str, ...]:
    """Return the verdict on a filter that diverged, and its reason.

    Parameters
    ----------
    flown : Runs
        Errors, at least one of them lost, or most fixes refused.
    plan : Scenario
        What was flown, with the true receiver.
    settings : FilterSettings
        What the filter believes.
    sensor : Sensor
        What the inertial unit truly is.
    """
    ratios = run_ratios(flown, plan.outages)
    lost = ratios > STRAYED
    how = f"in {lost.sum()} of {len(lost)} runs" if lost.any() else "and refuses most of its fixes"
    sentence = f"the filter diverged {how}: nothing it says can be used"
    if _start_is_lost(flown, ratios):
        return sentence, _start(settings)
    far = [
        f"{name} {ratio:.2g} ×" for name, ratio in _ratios(plan, settings, sensor).items() if _is_far(ratio)
    ]
    if not far:
        return (sentence,)
    return sentence, f"what was flown is not what the filter believes: {', '.join(far)} as large"


def _start_is_lost(flown: Runs, ratios: FloatArray) -> bool:
    """Tell whether a start is at fault: too uncertain to be linear, or survived by most runs, which are honest."""
    first = flown.covariance[:, flown.t <= flown.t[0] + SETTLING]
    peak = np.sqrt(np.diagonal(first, axis1=-2, axis2=-1)[..., ATTITUDE].max(axis=(1, 2)))
    return bool(np.median(peak) > LINEAR) or some_strayed(ratios)


def _start(settings: FilterSettings) -> str:
    """Return the sentence that blames the start."""
    attitude, gyros = (
        ", ".join(f"{x:.2g}" for x in np.degrees(settings.initial_sd[settings.model.layout[name]]))
        for name in ("attitude", "gyro_bias")
    )
    return (
        f"not its noise is wrong, but its start (1 sd: attitude {attitude} deg, gyro constants {gyros} deg/s) is more "
        "than a linear filter always recovers from; let the vehicle stand to find the gyro biases first, and give it "
        "what is left of them as constants"
    )


def _ratios(plan: Scenario, settings: FilterSettings, sensor: Sensor) -> dict[str, float]:
    """Return truth ÷ belief, in sd, of what both name."""
    model, receiver = settings.model, plan.receiver
    gyros, accels = (settings.initial_sd[model.layout[name]] for name in ("gyro_bias", "accel_bias"))
    pairs: dict[str, tuple[ArrayLike | None, ArrayLike | None]] = {
        "gyro white noise": (sensor.white[:3], model.gyro_density),
        "accelerometer white noise": (sensor.white[3:], model.accel_density),
        "gyro constants": (sensor.constant_sd[:3], gyros),
        "accelerometer constants": (sensor.constant_sd[3:], accels),
        "position fixes": (receiver.position_sd, settings.position_sd),
        "velocity fixes": (receiver.velocity_sd, settings.velocity_sd),
    }
    known = {name: (_rms(true), _rms(own)) for name, (true, own) in pairs.items()}
    return {name: true / own for name, (true, own) in known.items() if true > 0.0 and own > 0.0}


def _rms(values: ArrayLike | None) -> float:
    return 0.0 if values is None else float(np.sqrt(np.mean(np.square(values))))


def _is_far(ratio: float) -> bool:
    return max(ratio, 1.0 / ratio) > FAR
