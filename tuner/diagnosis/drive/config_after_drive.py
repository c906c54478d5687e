"""The filter configuration after a drive: findings taken over, and the reason of every factor on its noise settings.

Densities leave their static values only where the drive contradicts them (`imu_noise_scale`); all other factors that
a drive gives are recorded beside factor 1 with the cause that accounts for them. `held_out_choice` decides whether the
findings are taken over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive import ExaminedDrive
from tuner.diagnosis.drive.noise_scale_estimates import assumed_over_stated, stated_value
from tuner.navigation.fix_sd_model import BLOCKS, GNSS_NOISE_SCALE, fix_sd_model
from tuner.types import AppliedNoiseScale, FilterConfig, NoiseScaleEstimate, Quantity

QUANTITIES: Mapping[str, Quantity] = {
    "gyro_white": Quantity("gyro", "white_density"),
    "accel_white": Quantity("accel", "white_density"),
    "gyro_bias": Quantity("gyro", "markov"),
    "accel_bias": Quantity("accel", "markov"),
    "position": Quantity("gnss", "position_sd"),
    "velocity": Quantity("gnss", "velocity_sd"),
}
"""Noise settings of the drive's fit as quantities of a configuration."""


def config_after_drive(examined: ExaminedDrive, *, kept: bool) -> FilterConfig:
    """Return the configuration with or without the findings of a drive, with the factors on its noise settings."""
    diagnosis = examined.diagnosis
    chosen = diagnosis.after if kept else diagnosis.before
    scales = tuple(
        AppliedNoiseScale(
            QUANTITIES[one.setting],
            applied_factor(examined, one) if kept else 1.0,
            one.text,
            one.plain.interval,
            one.causes,
        )
        for one in diagnosis.noise_scales
    )
    return replace(
        chosen,
        inflations=(*chosen.inflations, *scales),
        notes=(
            *chosen.notes,
            *(i.text for i in diagnosis.inseparable),
        ),
        provenance={
            **chosen.provenance,
            "drive": {"source": examined.drive.source, "digest": examined.drive.digest},
        },
    )


def applied_factor(examined: ExaminedDrive, one: NoiseScaleEstimate) -> float:
    """Return the factor that the configuration after the drive has on a noise setting."""
    if one.setting in ("position", "velocity"):
        found = examined.search.final.hypothesis.compensation
        written = examined.search.determined(found).of(GNSS_NOISE_SCALE)
        if written == found.of(GNSS_NOISE_SCALE):
            return assumed_over_stated(examined.search.final, one.setting)
        return _written_over_reported(examined, one.setting, written)
    before, after = (
        stated_value(config, examined.search.base, one.setting)
        for config in (examined.diagnosis.before, examined.diagnosis.after)
    )
    return after / before if before and after else 1.0


def _written_over_reported(examined: ExaminedDrive, block: str, written: Mapping[str, float]) -> float:
    """Return the sds of a block of fixes as a model of them has it ÷ the reported ones, rms."""
    linearized, columns = examined.search.final.linearized, BLOCKS[block]
    reported = linearized.reported_sd[:, columns]
    rows = linearized.counted[:, columns] & np.isfinite(reported)
    sds = fix_sd_model(written, block).sds(reported, linearized.solution)
    return float(np.sqrt(np.sum(sds[rows] ** 2) / np.sum(reported[rows] ** 2))) if rows.any() else 1.0
