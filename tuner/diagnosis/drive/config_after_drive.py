"""One configuration out of a static identification and a drive: findings are in it, every inflation is explained.

Densities leave their static values only where the drive contradicts them (`imu_noise_scale`); all other demands of the
drive stand beside factor 1 with the cause that accounts for them. Findings that do harm on the part of the drive held
out are not taken over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tuner.diagnosis.drive import ExaminedDrive
from tuner.diagnosis.drive.noise_scale_estimates import assumed_over_stated, stated_value
from tuner.types import Demand, FilterConfig, Inflation

NO_GAIN_NOTE = (
    "what the drive shows is not in this configuration: it did harm on the part of the drive held out"
)
"""Note of a configuration that takes nothing over."""
QUANTITIES: Mapping[str, str] = {
    "gyro_white": "gyro.white_density",
    "accel_white": "accel.white_density",
    "gyro_bias": "gyro.markov",
    "accel_bias": "accel.markov",
    "position": "gnss.position_sd",
    "velocity": "gnss.velocity_sd",
}
"""Settings as an inflation names them."""


def config_after_drive(examined: ExaminedDrive) -> FilterConfig:
    """Return the configuration after a drive, its inflations explained."""
    found = examined.diagnosis
    chosen = found.after if found.credited else found.before
    told = tuple(
        Inflation(
            QUANTITIES[one.quantity], applied_factor(examined, one), one.text, one.plain.interval, one.causes
        )
        for one in found.demands
    )
    return replace(
        chosen,
        inflations=(*chosen.inflations, *told),
        notes=(
            *chosen.notes,
            *(i.text for i in found.inseparable),
            *(() if found.credited else (NO_GAIN_NOTE,)),
        ),
        provenance={
            **chosen.provenance,
            "drive": {"source": examined.drive.source, "digest": examined.drive.digest},
        },
    )


def applied_factor(examined: ExaminedDrive, one: Demand) -> float:
    """Return the factor that the configuration after the drive has on a setting."""
    if not examined.diagnosis.credited:
        return 1.0
    if one.quantity in ("position", "velocity"):
        return assumed_over_stated(examined.search.final, one.quantity)
    before, after = (
        stated_value(config, examined.search.base, one.quantity)
        for config in (examined.diagnosis.before, examined.diagnosis.after)
    )
    return after / before if before and after else 1.0
