"""FAST-LIVO2: white noise as variances per IMU step, N²/dt, as the filter adds them times dt².

imu/acc_cov (m/s²)² and imu/gyr_cov (rad/s)². The variances of the bias walks are fixed at 1e-4 in the source; keys
such as b_acc_cov are not read. That walk is larger than any of a sensor, so N is the configuration's own, and the
header says what the two predict.

Source: hku-mars/FAST-LIVO2 src/LIVMapper.cpp (readParameters, initializeComponents), src/IMU_Processing.cpp
(UndistortPcl).
"""

from __future__ import annotations

import math
from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import predicted_words, provenance
from tuner.exporters.triad_values import rms, triad
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import LIDAR, Projected
from tuner.types import FilterConfig

_FIXED_BIAS_VARIANCE = 1e-4
"""Variance of a bias step that the program sets itself, (rad/s²)² and (m/s³)²."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the two variances that FAST-LIVO2 reads."""
    walk = math.sqrt(_FIXED_BIAS_VARIANCE * target.interval)
    entries: dict[str, Any] = {}
    pairs: dict[str, list[Projected]] = {}
    for key, sensor, unit in (("acc_cov", "accel", "(m/s²)²"), ("gyr_cov", "gyro", "(rad/s)²")):
        channels = triad(config, sensor)
        own = rms(channels, lambda c: c.white_density, "").value
        entries[key] = Noted(rounded(own**2 / target.interval), f"{unit}; N²/dt; for all axes")
        pairs[sensor] = [Projected(own, walk)] * len(channels)
    header = (
        *provenance(config, "FAST-LIVO2: imu entries"),
        f"dt = {target.interval:g} s of the IMU",
        f"its bias walks are fixed in the source: K = {walk:.3g} rad/s²/√Hz and {walk:.3g} m/s³/√Hz at this rate",
        *predicted_words(config, target, pairs),
    )
    return yaml_text({"imu": entries}, header=header)


DIALECT = Dialect(
    "fast-livo2", "FAST-LIVO2 YAML", "(m/s²)², (rad/s)² (per IMU step)", write, aiding=LIDAR, shared=True
)
