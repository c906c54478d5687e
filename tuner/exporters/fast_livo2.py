"""FAST-LIVO2: white noise as variances per IMU step, N²/dt, as the filter adds them times dt².

imu/acc_cov (m/s²)² and imu/gyr_cov (rad/s)². The variances of the bias walks are fixed at 1e-4 in the source; keys
such as b_acc_cov are not read.

Source: hku-mars/FAST-LIVO2 src/LIVMapper.cpp (readParameters, initializeComponents), src/IMU_Processing.cpp
(UndistortPcl).
"""

from __future__ import annotations

import math

from tuner.exporters import fastlio
from tuner.exporters.dialect import Dialect, Target
from tuner.formats.yaml_text import yaml_text
from tuner.types import FilterConfig

_FIXED_BIAS_VARIANCE = 1e-4
"""Variance of a bias step that the program sets itself, (rad/s²)² and (m/s³)²."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the two variances that FAST-LIVO2 reads."""
    known = fastlio.entries(config, target)
    walk = math.sqrt(_FIXED_BIAS_VARIANCE * target.interval)
    header = (
        *fastlio.header(config, target, "FAST-LIVO2: imu entries"),
        f"its bias walks are fixed in the source: K = {walk:.3g} rad/s²/√Hz and {walk:.3g} m/s³/√Hz at this rate",
    )
    return yaml_text({"imu": {key: known[key] for key in ("acc_cov", "gyr_cov")}}, header=header)


DIALECT = Dialect("fast-livo2", "FAST-LIVO2 YAML", "(m/s²)², (rad/s)² (per IMU step)", write)
