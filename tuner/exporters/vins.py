"""VINS-Mono, VINS-Fusion, GVINS: figures per sample of a mid-point integration, although their names suggest densities.

The code adds (0.25 + 0.25) dt² acc_n² to the variance of a velocity increment and dt² acc_w² to that of a
bias. The true growth N² dt and K² dt is had with

    acc_n, gyr_n = N √(2/dt)        acc_w, gyr_w = K / √dt
"""

from __future__ import annotations

import math
from typing import Any

from models.units import STANDARD_GRAVITY
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the noise entries of a VINS configuration."""
    return text(config, target, "VINS: noise entries of the estimator's YAML")


def text(config: FilterConfig, target: Target, title: str) -> str:
    """Return the noise entries below a header with a title."""
    density, drive = math.sqrt(2.0 / target.interval), 1.0 / math.sqrt(target.interval)
    entries: dict[str, Any] = {}
    if accel := triad(config, "accel"):
        entries["acc_n"] = white(accel, "m/s²; N·√(2/dt)", target, lambda n: n * density).noted()
        entries["acc_w"] = walk(config, accel, "m/s³; K/√dt", target, lambda k: k * drive).noted()
    if gyro := triad(config, "gyro"):
        entries["gyr_n"] = white(gyro, "rad/s; N·√(2/dt)", target, lambda n: n * density).noted()
        entries["gyr_w"] = walk(config, gyro, "rad/s²; K/√dt", target, lambda k: k * drive).noted()
    entries["g_norm"] = Noted(STANDARD_GRAVITY, "m/s²")
    header = (
        *provenance(config, title, target),
        f"dt = {target.interval:g} s of the IMU",
    )
    return "%YAML:1.0\n" + yaml_text(entries, header=header)


DIALECT = Dialect(
    "vins",
    "VINS-Mono, VINS-Fusion, GVINS YAML",
    "rad/s, rad/s², m/s², m/s³ (per IMU sample, mid-point)",
    write,
    aiding=CAMERA,
    shared=True,
)
