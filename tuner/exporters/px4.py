"""PX4 EKF2 parameters: noises per prediction step of the filter, not per IMU sample.

Each step of dt = EKF2_PREDICT_US the filter adds (dt·EKF2_GYR_NOISE)² to an angle and
(dt·EKF2_GYR_B_NOISE)² to a bias. So EKF2_GYR_NOISE = N/√dt, EKF2_GYR_B_NOISE = K/√dt, the like for ACC, and
EKF2_GBIAS_INIT and EKF2_ABIAS_INIT are turn-on sds.

The firmware clamps to a range (those of the two turn-on sds are recalled). A figure outside is written as
the limit, with a warning: there is no room below 1e-4 rad/s and 0.01 m/s².
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import Figure, Limits, limited, rms, triad, walk, white
from tuner.formats.yaml_text import comment
from tuner.types import FilterConfig

_LIMITS = {
    "EKF2_GYR_NOISE": Limits(1e-4, 0.1),
    "EKF2_ACC_NOISE": Limits(0.01, 1.0),
    "EKF2_GYR_B_NOISE": Limits(0.0, 0.01),
    "EKF2_ACC_B_NOISE": Limits(0.0, 0.01),
    "EKF2_GBIAS_INIT": Limits(0.0, 0.2),
    "EKF2_ABIAS_INIT": Limits(0.0, 0.5),
}

_REAL_TYPE_CODE = 9
"""Type code of a real parameter in the file format."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a parameter file: vehicle, component, name, value, type, by tabs."""
    factor = 1.0 / math.sqrt(target.step)
    figures: dict[str, Figure] = {}
    if gyro := triad(config, "gyro"):
        figures["EKF2_GYR_NOISE"] = white(gyro, "rad/s; N/√dt", factor=factor, memory=target.memory)
        figures["EKF2_GYR_B_NOISE"] = walk(gyro, "rad/s²; K/√dt", target, factor=factor)
        figures["EKF2_GBIAS_INIT"] = rms(gyro, lambda c: c.constant_sd, "rad/s; turn-on sd")
    if accel := triad(config, "accel"):
        figures["EKF2_ACC_NOISE"] = white(accel, "m/s²; N/√dt", factor=factor, memory=target.memory)
        figures["EKF2_ACC_B_NOISE"] = walk(accel, "m/s³; K/√dt", target, factor=factor)
        figures["EKF2_ABIAS_INIT"] = rms(accel, lambda c: c.constant_sd, "m/s²; turn-on sd")
    lines = [
        *provenance(config, "PX4 EKF2 parameters", walk_memory=target.memory),
        f"dt = {target.step:g} s, the prediction step (EKF2_PREDICT_US)",
    ]
    parameters = []
    for name, figure in figures.items():
        bounded = limited(figure, _LIMITS[name])
        lines.append(f"{name}: {bounded.note}")
        parameters.append(f"1\t1\t{name}\t{bounded.value:.9g}\t{_REAL_TYPE_CODE}")
    return "".join(f"{line}\n" for line in (*map(comment, lines), *parameters))


DIALECT = Dialect("px4", "PX4 EKF2 parameters", "rad/s, rad/s², m/s², m/s³ (per prediction step)", write)
