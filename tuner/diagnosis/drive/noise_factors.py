"""Configurations with factors on their noise, and with the sds of fixes of another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from tuner.diagnosis.drive.hypothesis import with_density_factors
from tuner.diagnosis.drive.linear_model.noise_parameters import ROW_GROUPS
from tuner.diagnosis.drive.staying_errors import described, with_staying_errors
from tuner.linear_run.linearized_run import NOISE_GROUPS
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE, class_count
from tuner.types import AppliedNoiseScale, FilterConfig, Parameter, Quantity

FACTORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "white": ("gyro_white", "accel_white"),
        "bias": ("gyro_bias", "accel_bias"),
        "position_vertical": ("position_vertical",),
        "velocity_vertical": ("velocity_vertical",),
        "position_horizontal": ("position_horizontal",),
        "velocity_horizontal": ("velocity_horizontal",),
    }
)
"""Factors that are tried, with the noise groups or fix rows that they multiply, in the order of trial."""
QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "gyro_white": Quantity("gyro", "white_density"),
        "accel_white": Quantity("accel", "white_density"),
        "gyro_bias": Quantity("gyro", "markov"),
        "accel_bias": Quantity("accel", "markov"),
        "position_vertical": Quantity("gnss", "position_sd"),
        "velocity_vertical": Quantity("gnss", "velocity_sd"),
        "position_horizontal": Quantity("gnss", "position_sd"),
        "velocity_horizontal": Quantity("gnss", "velocity_sd"),
    }
)
"""Settings that a factor changes."""
OUTAGE_REASON = (
    "errors in outages of 10 to 60 s on the first 60 % of the drive; the last 40 % are predicted better, too"
)
"""Why there are factors."""


def with_noise_factors(config: FilterConfig, factors: Mapping[str, float]) -> FilterConfig:
    """Return a configuration whose noise is multiplied by factors; their names are those of `FACTORS` and `STAYING`."""
    config = with_staying_errors(config, factors)
    each = {setting: factor for name, factor in factors.items() for setting in FACTORS.get(name, ())}
    config = with_density_factors(config, {group: each.get(group, 1.0) for group in NOISE_GROUPS})
    own = config.compensation.of(GNSS_NOISE_SCALE)
    rows = {name: factor for name, factor in each.items() if name not in NOISE_GROUPS}
    values = {Parameter(GNSS_NOISE_SCALE, name): own.get(name, 1.0) * factor for name, factor in rows.items()}
    return replace(config, compensation=config.compensation.with_values(values))


def with_sds_of(config: FilterConfig, other: FilterConfig) -> FilterConfig:
    """Return a configuration with the sds of the fixes that another one makes of the reported ones.

    Where the other has states for correlated errors, its sds are those of the rest: only larger ones are taken over.
    """
    found = dict(other.compensation.of(GNSS_NOISE_SCALE))
    if other.gnss is not None and other.gnss.correlated:
        common = {name: found.get(name, 1.0) for name in ROW_GROUPS}
        for name, value in found.items():
            row, _, number = name.partition("_class_")
            if number:
                found[name] = max(1.0, value * common[row])
        for name in common.keys() & found.keys():
            by_class = class_count(found, name.partition("_")[0]) > 1
            found[name] = 1.0 if by_class else max(1.0, found[name])
    values = {Parameter(GNSS_NOISE_SCALE, name): value for name, value in found.items()}
    return replace(config, compensation=config.compensation.with_values(values))


def with_recorded_factors(config: FilterConfig, factors: Mapping[str, float]) -> FilterConfig:
    """Return a configuration with factors on its noise, each with its reason: one record a setting.

    Horizontal and vertical sds of the fixes are two settings where their factors differ.
    """
    each = {setting: factor for name, factor in factors.items() for setting in FACTORS.get(name, ())}
    scales = {one.quantity: one for one in config.inflations if isinstance(one, AppliedNoiseScale)}
    records: dict[Quantity, AppliedNoiseScale] = {}
    for setting, factor in each.items():
        whole, row = QUANTITIES[setting], setting.partition("_")[2]
        alike = [each.get(other) for other, quantity in QUANTITIES.items() if quantity == whole]
        own = whole if set(alike) == {factor} else Quantity(whole.owner, f"{whole.field}_{row}")
        before = scales.get(whole)
        total = factor if before is None else factor * before.factor
        parts = [f"× {factor:.3g} for {OUTAGE_REASON}"]
        if before is not None and before.factor != 1.0:
            parts = [f"× {total:.3g} in all", before.reason, *parts]
        causes = () if before is None else before.causes
        records[own] = AppliedNoiseScale(own, total, "; ".join(parts), None, causes)
    kept = (one for one in config.inflations if one.quantity not in records)
    config = with_noise_factors(config, factors)
    notes = (*config.notes, *described(config, factors))
    return replace(config, inflations=(*kept, *records.values()), notes=notes)
