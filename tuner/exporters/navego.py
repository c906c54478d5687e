"""NaveGo: a MATLAB script that fills the IMU structure of its filter, SI throughout.

arw rad/√s, vrw m/s/√s; gb_corr, ab_corr: a T of a day; gb_psd, ab_psd = K, which the filter squares into Q; g_std,
a_std = N/√dt, sd of a sample. gb_sta, ab_sta are *values* that the filter subtracts from every sample: zeros, as only
turn-on sds are known. gb_dyn, ab_dyn are its first estimate and initial sd at once: the sd of constant and states
together. arrw, vrrw are used by the simulator alone, beside gb_dyn: zeros, as the one state is the whole bias.

Source: rodralez/NaveGo ins-gnss/ins_gnss.m (kf.xi, kf.Pi, kf.Q, wb_corrected), ins-gnss/F_update.m, kf_prediction.m.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from tuner.exporters.dialect import LASTING_TIME, Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import initial_bias_sd, triad, triple
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imu``."""
    quantities: tuple[tuple[str, Callable[[ChannelNoise], float], str], ...] = (
        ("{0}rw", target.white_density, "{1}/√Hz; N"),
        ("{0}rrw", lambda _: 0.0, "{1}/√s; of the simulator, where it would count the bias twice"),
        (
            "{2}_std",
            lambda c: target.white_density(c) / math.sqrt(target.interval),
            "{1}; N/√dt, sd of a sample",
        ),
        ("{2}b_sta", lambda _: 0.0, "{1}; subtracted from every sample: write a measured mean, or zero"),
        ("{2}b_dyn", initial_bias_sd, "{1}; first estimate and initial sd; NaveGo's simulator wants σ here"),
        ("{2}b_corr", lambda _: LASTING_TIME, "s; T"),
        ("{2}b_psd", target.bias, "{1}/√s; K"),
    )
    lines = []
    for sensor, names in (("gyro", ("a", "rad/s", "g")), ("accel", ("v", "m/s²", "a"))):
        if channels := triad(config, sensor):
            for key, quantity, note in quantities:
                values, words = triple(channels, quantity, note.format(*names))
                lines.append(f"imu.{key.format(*names)} = {vector(values)}; % {words}\n")
    lines.append(f"imu.freq = {target.rate!r}; % Hz\n")
    return commented(provenance(config, "NaveGo IMU structure", target), "%") + "".join(lines)


DIALECT = Dialect(
    "navego",
    "NaveGo IMU structure (MATLAB script)",
    "rad/√s, m/s/√s, rad/s, m/s², s, rad/s/√s, m/s²/√s",
    write,
)
