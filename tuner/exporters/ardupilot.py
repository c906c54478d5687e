"""ArduPilot EKF3 parameters: noises per filter step, biases as densities of a delta angle.

Each step of dt, about 10 ms, the filter adds (dt·EK3_GYRO_P_NSE)² to an angle and (dt²·EK3_GBIAS_P_NSE)² to a
delta-angle bias. So EK3_GYRO_P_NSE = N/√dt, EK3_GBIAS_P_NSE = K/√dt, and the like for ACC.

A figure outside the range of the firmware is written as the limit, with a warning.
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import Figure, Limits, limited, triad, walk, white
from tuner.formats.yaml_text import comment
from tuner.types import FilterConfig

_LIMITS = {
    "EK3_GYRO_P_NSE": Limits(1e-4, 0.1),
    "EK3_ACC_P_NSE": Limits(0.01, 1.0),
    "EK3_GBIAS_P_NSE": Limits(1e-5, 1e-3),
    "EK3_ABIAS_P_NSE": Limits(1e-5, 0.02),
}


def write(config: FilterConfig, target: Target) -> str:
    """Return a parameter file of lines ``NAME,VALUE``."""
    factor = 1.0 / math.sqrt(target.step)
    figures: dict[str, Figure] = {}
    if gyro := triad(config, "gyro"):
        figures["EK3_GYRO_P_NSE"] = white(gyro, "rad/s; N/√dt", factor=factor, memory=target.memory)
        figures["EK3_GBIAS_P_NSE"] = walk(gyro, "rad/s²; K/√dt", target, factor=factor)
    if accel := triad(config, "accel"):
        figures["EK3_ACC_P_NSE"] = white(accel, "m/s²; N/√dt", factor=factor, memory=target.memory)
        figures["EK3_ABIAS_P_NSE"] = walk(accel, "m/s³; K/√dt", target, factor=factor)
    lines = [
        *provenance(config, "ArduPilot EKF3 parameters", walk_memory=target.memory),
        f"dt = {target.step:g} s, the step of the filter",
    ]
    parameters = []
    for name, figure in figures.items():
        bounded = limited(figure, _LIMITS[name])
        lines.append(f"{name}: {bounded.note}")
        parameters.append(f"{name},{bounded.value:.9g}")
    return "".join(f"{line}\n" for line in (*map(comment, lines), *parameters))


DIALECT = Dialect(
    "ardupilot", "ArduPilot EKF3 parameters", "rad/s, rad/s², m/s², m/s³ (per filter step)", write
)
