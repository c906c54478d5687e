"""Constant biases far beyond what the filter was told to expect of them.

After a drive the estimate of a turn-on constant with prior sd σ and posterior variance p is N(0, σ² − p) where the
prior is right, plus what its random walk has added since.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from tuner.diagnosis.drives.hypothesis import Pass
from tuner.diagnosis.findings import words
from tuner.navigation.settings import ACCELS, GYROS
from tuner.results import Coefficient, FilterConfig, Finding, Inflation

CAUSE = "sensor_bias"
MEANING = "a constant bias far beyond its prior"
CONSEQUENCE = "widen the prior of the turn-on constant, or calibrate"


def beyond_prior(found: Pass, config: FilterConfig, threshold: float) -> tuple[Finding, ...]:
    """Return the biases that their priors do not explain.

    Parameters
    ----------
    found : Pass
        The last pass.
    config : FilterConfig
        The priors.
    threshold : float
        Chance below which one is a finding, all axes together.
    """
    longest = max(range(len(found.solutions)), key=lambda i: len(found.solutions[i].t))
    solution, at = found.solutions[longest], found.settings.model.layout
    span = float(solution.t[-1] - found.solutions[0].t[0])
    sd = np.sqrt(np.diag(solution.final_covariance))
    findings = []
    for sensor, axes in (("gyro", GYROS), ("accel", ACCELS)):
        for axis, j in zip(axes, range(at[f"{sensor}_bias"].start, at[f"{sensor}_bias"].stop), strict=True):
            noise = config.channels[axis]
            prior = float(np.hypot(noise.constant_sd, noise.random_walk_density * np.sqrt(span)))
            value, spread = float(solution.final_parameters[j]), float(sd[j])
            z = abs(value) / max(prior, 1e-300)
            p_value = min(1.0, 12.0 * float(norm.sf(z)))
            if p_value >= threshold or abs(value) < 4.0 * spread:
                continue
            told = {
                "value": Coefficient.known(value, value - 1.96 * spread, value + 1.96 * spread, noise.unit)
            }
            findings.append(
                Finding(
                    CAUSE,
                    (axis,),
                    "bias ÷ its prior sd",
                    z,
                    p_value,
                    told,
                    words(CAUSE, (axis,), MEANING, told),
                    CONSEQUENCE,
                    {"cause": CAUSE, "joins": "states", "parameters": {"value": value}},
                    inflations=(
                        Inflation(
                            f"{axis}.constant_sd", abs(value) / noise.constant_sd, f"{CAUSE}: on this drive"
                        ),
                    )
                    if noise.constant_sd > 0.0
                    else (),
                )
            )
    return tuple(findings)
