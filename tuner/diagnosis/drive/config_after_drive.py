"""The filter configuration after a drive: findings taken over, and the reason of every factor on its noise settings.

Densities leave their static values only where the drive contradicts them (`imu_noise_scale`); all other factors that
a drive gives are recorded beside factor 1 with the cause that accounts for them. Findings that do harm on the last
part of the drive, which they were not fitted to, are not taken over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tuner.diagnosis.drive import ExaminedDrive
from tuner.diagnosis.drive.noise_scale_estimates import assumed_over_stated, stated_value
from tuner.types import AppliedNoiseScale, FilterConfig, NoiseScaleEstimate, Quantity

NO_GAIN_NOTE = (
    "the findings of the drive are not in this configuration: they did harm on its last part, to which they were not "
    "fitted"
)
"""Note of a configuration that takes nothing over."""
QUANTITIES: Mapping[str, Quantity] = {
    "gyro_white": Quantity("gyro", "white_density"),
    "accel_white": Quantity("accel", "white_density"),
    "gyro_bias": Quantity("gyro", "markov"),
    "accel_bias": Quantity("accel", "markov"),
    "position": Quantity("gnss", "position_sd"),
    "velocity": Quantity("gnss", "velocity_sd"),
}
"""Noise settings of the drive's fit as quantities of a configuration."""


def config_after_drive(examined: ExaminedDrive) -> FilterConfig:
    """Return the configuration after a drive, with the factors on its noise settings and their reasons."""
    diagnosis = examined.diagnosis
    chosen = diagnosis.after if diagnosis.credited else diagnosis.before
    scales = tuple(
        AppliedNoiseScale(
            QUANTITIES[one.setting], applied_factor(examined, one), one.text, one.plain.interval, one.causes
        )
        for one in diagnosis.noise_scales
    )
    return replace(
        chosen,
        inflations=(*chosen.inflations, *scales),
        notes=(
            *chosen.notes,
            *(i.text for i in diagnosis.inseparable),
            *(() if diagnosis.credited else (NO_GAIN_NOTE,)),
        ),
        provenance={
            **chosen.provenance,
            "drive": {"source": examined.drive.source, "digest": examined.drive.digest},
        },
    )


def applied_factor(examined: ExaminedDrive, one: NoiseScaleEstimate) -> float:
    """Return the factor that the configuration after the drive has on a noise setting."""
    if not examined.diagnosis.credited:
        return 1.0
    if one.setting in ("position", "velocity"):
        return assumed_over_stated(examined.search.final, one.setting)
    before, after = (
        stated_value(config, examined.search.base, one.setting)
        for config in (examined.diagnosis.before, examined.diagnosis.after)
    )
    return after / before if before and after else 1.0
