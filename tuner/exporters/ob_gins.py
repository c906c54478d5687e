"""OB_GINS and IC-GVINS: one number for three axes in customary units, one correlation time; units as KF-GINS.

imumodel: arw deg/√h, vrw m/s/√h, gbstd deg/h, abstd mGal, corrtime h. The code forms 2σ²/T, lets the covariance fade
by 1 − dt/T a step and compares biases as they are: with a T of a day, biases are random walks, σ = K·√(T/2).

Source: i2Nav-WHU/OB_GINS src/ob_gins.cc, src/preintegration/preintegration_normal.cc (setNoiseMatrix,
updateJacobianAndCovariance); i2Nav-WHU/IC-GVINS ic_gvins/ic_gvins/ic_gvins.cc (constructPrior), the same
preintegration.
"""

from __future__ import annotations

from typing import Any

from models.units import from_si
from tuner.exporters.dialect import LASTING_TIME, WALK_SD, Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import RTK
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the entries ``imumodel``."""
    gyro, accel = triad(config, "gyro"), triad(config, "accel")
    entries: dict[str, Any] = {
        "arw": white(gyro, "deg/√h; N", target, lambda n: from_si(n, "deg/sqrt(h)")).noted(),
        "vrw": white(accel, "m/s/√h; N", target, lambda n: from_si(n, "m/s/sqrt(h)")).noted(),
        "gbstd": walk(
            config, gyro, "deg/h; K·√(T/2)", target, lambda k: from_si(WALK_SD * k, "deg/h")
        ).noted(),
        "abstd": walk(
            config, accel, "mGal; K·√(T/2)", target, lambda k: from_si(WALK_SD * k, "mGal")
        ).noted(),
        "corrtime": Noted(rounded(LASTING_TIME / 3600.0), "h; T"),
    }
    header = (
        *provenance(config, "OB_GINS, IC-GVINS: entries imumodel", target),
        "at rest IC-GVINS starts with a gyro-bias prior of 3 gbstd",
    )
    return yaml_text({"imumodel": entries}, header=header)


DIALECT = Dialect(
    "ob-gins",
    "OB_GINS and IC-GVINS YAML",
    "deg/√h, m/s/√h, deg/h, mGal, h",
    write,
    aiding=RTK,
    shared=True,
)
