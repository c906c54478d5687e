"""ArduPilot EKF3 parameters: noises per filter step, biases as densities of a delta angle.

Each step of dt the filter adds (dt·EK3_GYRO_P_NSE)² to an angle and (dt²·EK3_GBIAS_P_NSE)² to a delta-angle
bias. So EK3_GYRO_P_NSE = N/√dt, EK3_GBIAS_P_NSE = K/√dt, and the like for ACC. It takes samples of its loop together
until 12 ms are full to within half a sample: 12.5 ms in a loop of 400 Hz, 20 ms in one of 50 Hz.

Source: ArduPilot/ardupilot libraries/AP_NavEKF3: AP_NavEKF3_core.cpp (CovariancePrediction), AP_NavEKF3_core.h
(EKF_TARGET_DT), AP_NavEKF3_Measurements.cpp (readIMUData), AP_NavEKF3.cpp (ranges).
"""

from __future__ import annotations

import math

from tuner.exporters.autopilot import Parameter, given, loaded, parameter_lines
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import Figure, triad, walk, white
from tuner.formats.yaml_text import comment
from tuner.synthesis.projection import AUTOPILOT
from tuner.types import FilterConfig

_PARAMETERS = {
    "EK3_GYRO_P_NSE": Parameter("gyro", "white", 1e-4, 0.1, 0.015),
    "EK3_ACC_P_NSE": Parameter("accel", "white", 0.01, 1.0, 0.35),
    "EK3_GBIAS_P_NSE": Parameter("gyro", "walk", 1e-5, 1e-3, 1e-3),
    "EK3_ABIAS_P_NSE": Parameter("accel", "walk", 1e-5, 0.02, 0.02),
}

_RELEASE = "ArduPilot 4.5.5, libraries/AP_NavEKF3/AP_NavEKF3.cpp (*_P_NSE_DEFAULT)"
"""Release of the stock values: the file at commit 003d213519ec, where those of all vehicles agree.

A vehicle of ArduCopter 4.5.5 has the same for the gyros: assets/speedybeef405_ardupilot.params of
duckietown/duckiedrone-ardupilot-driver.
"""

_TARGET_STEP = 0.012
"""Step the filter aims at, s: EKF_TARGET_DT of AP_NavEKF3_core.h."""


def step_of_loop(interval: float) -> float:
    """Return the step, s, that the filter takes in a loop of this interval: whole samples, 12 ms less half of one."""
    return interval * max(1, math.ceil((_TARGET_STEP - interval / 2.0) / interval - 1e-9))


def write(config: FilterConfig, target: Target) -> str:
    """Return a parameter file of lines ``NAME,VALUE``; comments for what keeps its stock value."""
    if target.step is not None:
        step, reason = target.step, "as named"
    elif target.rate_named:
        step, reason = step_of_loop(target.interval), f"of a loop of {target.rate:g} Hz"
    else:
        step = _TARGET_STEP
        reason = "that it aims at; name the loop's rate (--rate 400 takes 12.5 ms, --rate 50 takes 20 ms)"

    def per_step(density: float) -> float:
        return density / math.sqrt(step)

    figures: dict[str, Figure] = {}
    if gyro := triad(config, "gyro"):
        figures["EK3_GYRO_P_NSE"] = white(gyro, "rad/s; N/√dt", target, per_step)
        figures["EK3_GBIAS_P_NSE"] = walk(config, gyro, "rad/s²; K/√dt", target, per_step)
    if accel := triad(config, "accel"):
        figures["EK3_ACC_P_NSE"] = white(accel, "m/s²; N/√dt", target, per_step)
        figures["EK3_ABIAS_P_NSE"] = walk(config, accel, "m/s³; K/√dt", target, per_step)
    values = loaded(figures, _PARAMETERS, config)
    lines = [
        *provenance(config, "ArduPilot EKF3 parameters", target, given(values, _PARAMETERS)),
        f"dt = {step:g} s, the step of the filter {reason}",
        *parameter_lines(figures, _PARAMETERS, config, _RELEASE),
    ]
    parameters = [f"{name},{value:.9g}" for name, value in values.items()]
    return "".join(f"{line}\n" for line in (*map(comment, lines), *parameters))


DIALECT = Dialect(
    "ardupilot",
    "ArduPilot EKF3 parameters",
    "rad/s, rad/s², m/s², m/s³ (per filter step)",
    write,
    needs=(),
    aiding=AUTOPILOT,
    shared=True,
)
