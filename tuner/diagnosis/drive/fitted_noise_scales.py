"""Factors on noise settings at the end of a search, fitted to the last run together with the constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tuner.diagnosis.drive.causes.noise_scale import FINDING_NAMES
from tuner.diagnosis.drive.causes.reported_sd import (
    coefficient,
    edge_coefficients,
    reported_levels,
    sd_model_factor,
    sd_model_parameters,
)
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.linear_model.noise_fit import maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import noise_parameters, present
from tuner.linear_run.likelihood import NoiseHypothesis
from tuner.linear_run.linearized_run import NOISE_GROUPS
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.types import Coefficient


def fitted_noise_scales(
    causes: Sequence[str], base: FilterRun, run: FilterRun, noise: NoiseHypothesis
) -> dict[str, dict[str, Coefficient]]:
    """Return factors, true ÷ stated, by cause and name.

    Parameters
    ----------
    causes : sequence of str
        Codes of accepted causes that are noise scales.
    base, run : FilterRun
        Before and after the search.
    noise : NoiseHypothesis
        Of the last run, its constants free.
    """
    values = run.hypothesis.compensation.of(GNSS_NOISE_SCALE)
    levels = reported_levels(run.linearized, values)
    wanted = {"gnss_noise_scale": sd_model_parameters(values), "imu_noise_scale": NOISE_GROUPS}
    names = present(noise, tuple(name for cause in causes for name in wanted[cause]), levels)
    fit = maximize_likelihood(noise, noise_parameters(names, levels))
    estimates: dict[str, dict[str, Coefficient]] = {cause: {} for cause in causes}
    for name in names:
        if name in wanted["gnss_noise_scale"]:
            estimates["gnss_noise_scale"][name] = coefficient(fit, name, sd_model_factor(values, name))
        elif name in FINDING_NAMES:
            sensor = FINDING_NAMES[name]
            now, then = (each.hypothesis.config.channels[f"{sensor}_x"].white_density for each in (run, base))
            estimates["imu_noise_scale"][sensor] = fit.coefficient(name, scale=float(now / then))
    if "gnss_noise_scale" in causes:
        estimates["gnss_noise_scale"] |= edge_coefficients(values)
    return estimates


def consistent_with_one(parameters: Mapping[str, Coefficient]) -> bool:
    """Whether all factors may be 1: another cause that was accepted later explains them."""
    return bool(parameters) and all(
        c.interval[0] < 1.0 < c.interval[1] if c.interval else c.upper is None or c.upper > 1.0
        for c in parameters.values()
    )
