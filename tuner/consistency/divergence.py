"""Why a simulated filter diverged, in words: its start, or a truth far from what it believes.

Where a filter expects attitude errors after its start beyond what is linear, or some runs are lost while its errors in
the median run are as predicted, the start is more than it recovers from each time. Else the rms of what was flown is
compared with the belief.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.noise import BiasInstability, GaussMarkov, NoiseModel
from models.noise.bias_instability import flicker_ladder
from tuner.consistency.scores import SETTLING, STRAYED, run_ratios, some_strayed
from tuner.navigation.settings import FilterSettings
from tuner.simulation.imu import Sensor
from tuner.simulation.monte_carlo import Runs, Scenario

FloatArray = NDArray[np.float64]

ATTITUDE = slice(6, 9)
LINEAR = 0.25
"""Sd of the attitude from which a filter is far from linear, rad: at two sds the cosine is down by an eighth."""
FAR = 3.0
"""Ratio of truth to belief from which it is named: errors smaller than believed lose no filter."""


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
        _said(name, *pair) for name, pair in _pairs(plan, settings, sensor).items() if pair[0] > FAR * pair[1]
    ]
    return (
        (sentence, f"what was flown is beyond what the filter believes: {', '.join(far)}")
        if far
        else (sentence,)
    )


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
        f"its start (1 sd: attitude {attitude} deg, gyro constants {gyros} deg/s) is more "
        "than a linear filter always recovers from; let the vehicle stand to find the gyro biases first, and give it "
        "what is left of them as constants"
    )


def _pairs(plan: Scenario, settings: FilterSettings, sensor: Sensor) -> dict[str, tuple[float, float]]:
    """Return the rms sds of the truth and of the belief, SI, of what both speak of."""
    model, receiver, at = settings.model, plan.receiver, settings.model.layout
    pairs: dict[str, tuple[ArrayLike, ArrayLike]] = {
        "position fixes": (receiver.position_sd, settings.position_sd or receiver.position_sd),
        "velocity fixes": (receiver.velocity_sd or 0.0, settings.velocity_sd or receiver.velocity_sd or 0.0),
    }
    for first, title, key, density in (
        (0, "gyro", "gyro", model.gyro_density),
        (3, "accelerometer", "accel", model.accel_density),
    ):
        own = slice(first, first + 3)
        states = settings.initial_sd[at[f"{key}_markov"]] if f"{key}_markov" in at else 0.0
        pairs[f"{title} white noise"] = (sensor.white[own], density)
        pairs[f"{title} constants"] = (sensor.constant_sd[own], settings.initial_sd[at[f"{key}_bias"]])
        pairs[f"{title} bias noise"] = ([_bias_noise(noise) for noise in sensor.noise[own]], states)
    return {name: (_rms(true), _rms(own)) for name, (true, own) in pairs.items()}


def _bias_noise(noise: NoiseModel) -> float:
    """Return the sd of the state that stands for a decade of flicker, or of the strongest Gauss–Markov error."""
    rungs = [
        flicker_ladder(term.level, 1.0, 1.0)[0].sd
        for term in noise.terms
        if isinstance(term, BiasInstability)
    ]
    return max([*rungs, *(term.sd for term in noise.terms if isinstance(term, GaussMarkov))], default=0.0)


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _said(name: str, true: float, own: float) -> str:
    return f"{name} {true / own:.2g} times as large" if own > 0.0 else f"{name}, of which it believes none"
