"""The filter configuration after a drive: findings taken over, and the reason of every factor on its noise settings.

Noise leaves its stated values only where findings change it (`imu_noise_scale`, `gnss_noise_scale`), and is then as
estimated with all findings in the filter: that one estimate is the factor, its interval and its reason. What is only
bounded stays as stated. `held_out_choice` decides whether the findings are taken over.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.hypothesis import with_density_factors
from tuner.diagnosis.drive.noise_factors import with_noise_factors
from tuner.diagnosis.drive.noise_scale_estimates import NOTHING_NAMED, may_be_one, stated_value
from tuner.linear_run.linearized_run import NOISE_GROUPS
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
SAME_SHARE = 1e-6
"""Share by which two factors may differ by rounding."""


def config_after_drive(examined: ExaminedDrive, *, kept: bool) -> FilterConfig:
    """Return the configuration with or without the findings of a drive, with the factors on its noise settings."""
    diagnosis = examined.diagnosis
    chosen = diagnosis.after if kept else diagnosis.before
    chosen = replace(
        chosen,
        notes=(
            *chosen.notes,
            *(i.text for i in diagnosis.inseparable),
        ),
        provenance={
            **chosen.provenance,
            "drive": {"source": examined.drive.source, "digest": examined.drive.digest},
        },
    )
    return with_records(examined, chosen)


def as_estimated(examined: ExaminedDrive, config: FilterConfig) -> FilterConfig:
    """Return a configuration whose noise, where the findings change it, is as estimated with all of them.

    What the drive does not determine, or does not contradict, is as stated.
    """
    densities = dict.fromkeys(NOISE_GROUPS, 1.0)
    rows: dict[str, float] = {}
    for one in examined.diagnosis.noise_scales:
        if (now := applied_factor(examined, config, one)) is not None:
            more = _estimate(one) / now
            if one.setting in BLOCKS:
                rows |= {f"{one.setting}_horizontal": more, f"{one.setting}_vertical": more}
            else:
                densities[one.setting] = more
    return with_noise_factors(with_density_factors(config, densities), rows)


def with_records(examined: ExaminedDrive, config: FilterConfig) -> FilterConfig:
    """Return a configuration with the factor on each noise setting, its interval and its reason: one estimate."""
    others = (one for one in config.inflations if not isinstance(one, AppliedNoiseScale))
    records = (_record(examined, config, one) for one in examined.diagnosis.noise_scales)
    return replace(config, inflations=(*others, *records))


def _estimate(one: NoiseScaleEstimate) -> float:
    """Return the factor that the drive gives a setting beside its findings, 1 where it does not contradict that."""
    known = one.identifiable and one.named.determined and not may_be_one(one.named)
    return (one.named.value or 1.0) if known else 1.0


def _record(examined: ExaminedDrive, config: FilterConfig, one: NoiseScaleEstimate) -> AppliedNoiseScale:
    title, _, text = one.text.partition(": ")
    factor, quantity, named = applied_factor(examined, config, one) or 1.0, QUANTITIES[one.setting], one.named
    if math.isclose(factor, 1.0, rel_tol=SAME_SHARE):
        if one.identifiable and not may_be_one(named):
            return AppliedNoiseScale(quantity, 1.0, f"{title}: as stated, as no finding changes it")
        known = not one.identifiable or may_be_one(one.plain)
        return AppliedNoiseScale(quantity, 1.0, one.text if known else f"{title}: as stated", named.interval)
    if named.value is None or not math.isclose(factor, named.value, rel_tol=SAME_SHARE):
        beside = f"{title}: × {factor:.3g} beside errors that stay"
        return AppliedNoiseScale(quantity, factor, beside, None, one.causes)
    said = "; ".join(part for part in text.split("; ") if not part.endswith(NOTHING_NAMED))
    return AppliedNoiseScale(quantity, named.value, f"{title}: {said}", named.interval, one.causes)


def applied_factor(examined: ExaminedDrive, config: FilterConfig, one: NoiseScaleEstimate) -> float | None:
    """Return the factor that a configuration has on a noise setting, None where that is as before the drive."""
    before = examined.diagnosis.before
    if one.setting in BLOCKS:
        own, other = (
            {
                name: x
                for name, x in each.compensation.of(GNSS_NOISE_SCALE).items()
                if name.startswith(one.setting)
            }
            for each in (config, before)
        )
        if own == other:
            return None
        return _over_reported(examined, one.setting, own) / _over_reported(examined, one.setting, other)
    now, stated = (stated_value(each, examined.search.base, one.setting) for each in (config, before))
    return now / stated if now and stated and now != stated else None


def _over_reported(examined: ExaminedDrive, block: str, values: Mapping[str, float]) -> float:
    """Return the sds of a block of fixes as a model of them has it ÷ the reported ones, rms."""
    linearized, columns = examined.search.final.linearized, BLOCKS[block]
    reported = linearized.reported_sd[:, columns]
    rows = linearized.counted[:, columns] & np.isfinite(reported)
    sds = fix_sd_model(values, block).sds(reported, linearized.solution)
    return float(np.sqrt(np.sum(sds[rows] ** 2) / np.sum(reported[rows] ** 2))) if rows.any() else 1.0
