"""Why a simulated filter diverged: its initial uncertainty, or a sensor far from its configuration.

Where a filter expects attitude errors after its start beyond what is linear, or some runs diverge while the errors of
the median run are as predicted, the initial uncertainty is more than it recovers from each time. Else the rms of the
simulated errors is compared with the configuration.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise import BiasInstability, NoiseModel
from models.noise.bias_instability import flicker_ladder
from tuner.consistency.scores import BLOCKS, SETTLING_TIME, STRAYED_RATIO, run_ratios, some_strayed
from tuner.navigation.settings import FilterSettings
from tuner.simulation.imu import Sensor
from tuner.simulation.monte_carlo import Runs
from tuner.simulation.scenario import Scenario
from tuner.types.verdict import Severity, Verdict, VerdictCode

LINEAR_ATTITUDE_SD = 0.25
"""Sd of the attitude from which a filter is far from linear, rad: at two sds the cosine is down by an eighth."""
FAR_RATIO = 3.0
"""True ÷ configured rms from which a quantity is named: no filter diverges by errors smaller than configured."""


def divergence(
    simulated: Runs, plan: Scenario, settings: FilterSettings, sensor: Sensor
) -> tuple[Verdict, ...]:
    """Return the verdict on a filter that diverged, and the reason where one is found.

    Parameters
    ----------
    simulated : Runs
        Errors; at least one run diverged, or most fixes were refused.
    plan : Scenario
        Trajectory and true receiver of the runs.
    settings : FilterSettings
        The filter.
    sensor : Sensor
        The true inertial unit.
    """
    ratios = run_ratios(simulated, plan.outages)
    diverged = ratios > STRAYED_RATIO
    verdict = Verdict(VerdictCode.FIXES_REFUSED, Severity.DIVERGED)
    if diverged.any():
        verdict = Verdict(
            VerdictCode.RUNS_DIVERGED,
            Severity.DIVERGED,
            numbers={"diverged_runs": int(diverged.sum()), "runs": len(diverged)},
        )
    if _start_not_linear(simulated, ratios):
        sds = {
            f"{name}_sd": tuple(settings.initial_sd[settings.model.layout[name]].tolist())
            for name in ("attitude", "gyro_bias")
        }
        return verdict, Verdict(VerdictCode.START_NOT_LINEAR, Severity.EXPLANATION, numbers=sds)
    far = {
        name: true / own if own > 0.0 else math.inf
        for name, (true, own) in _true_and_configured(plan, settings, sensor).items()
        if true > FAR_RATIO * own
    }
    return (verdict, Verdict(VerdictCode.TRUTH_FAR, Severity.EXPLANATION, numbers=far)) if far else (verdict,)


def _start_not_linear(simulated: Runs, ratios: FloatArray) -> bool:
    """Tell whether the start is at fault: too uncertain to be linear, or most runs recover and are consistent."""
    first = simulated.covariance[:, simulated.t <= simulated.t[0] + SETTLING_TIME]
    peak = np.sqrt(np.diagonal(first, axis1=-2, axis2=-1)[..., BLOCKS["attitude"]].max(axis=(1, 2)))
    return bool(np.median(peak) > LINEAR_ATTITUDE_SD) or some_strayed(ratios)


def _true_and_configured(
    plan: Scenario, settings: FilterSettings, sensor: Sensor
) -> dict[str, tuple[float, float]]:
    """Return the rms sds of the truth and of the configuration, SI, of what both name."""
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
    """Return the sd of the state that represents a decade of flicker, or of the strongest stationary error."""
    ladder = [
        flicker_ladder(term.level, 1.0, 1.0)[0].sd
        for term in noise.terms
        if isinstance(term, BiasInstability)
    ]
    wandering = [
        term
        for term in noise.terms
        if term.is_bias and not term.deterministic and term.exponentials() is not None
    ]
    return max([*ladder, *(float(np.sqrt(term.autocovariance(0.0))) for term in wandering)], default=0.0)


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
