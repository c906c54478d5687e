"""Constant biases far beyond their configured prior.

After a drive the estimate of a turn-on constant with prior sd σ and posterior variance p is N(0, σ² − p) where the
prior is right, plus what its random walk has added since. A g-sensitive gyro shows the same bias as long as the unit
stays level: sensitivity g of an axis to the vertical force is a bias of 9.8 g. A scale factor s of the vertical
accelerometer is a bias of 9.8 s there: which is likelier is a matter of what units differ by in practice. Constants
that are compensated and poorly known, as a scale factor of the vertical accelerometer, add their error times the force
at the start to the bias: the sd of that is added to the prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from models import rotation
from models.earth import gravity
from tuner.diagnosis.drive.causes.base import FinalCause
from tuner.diagnosis.drive.causes.constant_errors import AccelScale, Gravity
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.linear_model.linearize import columns
from tuner.diagnosis.drive.score_tests import fit_constants
from tuner.diagnosis.static.findings import words
from tuner.navigation.settings import ACCELS, GYROS
from tuner.types import Alternative, Coefficient, Enlargement, FilterConfig, Finding, Quantity

CAUSE_CODE = "sensor_bias"
"""Code of the cause."""
CAUSE_MEANING = "a constant bias is far beyond its prior, of gyro {gyro}, of accel {accel}"
CAUSE_CONSEQUENCE = "widen the prior of the turn-on constant, or calibrate"

LIKE_GYRO_BIAS = (Alternative("g_sensitivity", 1.0),)
"""Causes that have the effect of a gyro bias on a level road."""
LIKE_VERTICAL_BIAS = (AccelScale, Gravity)
"""Causes that have the effect of a bias of the vertical accelerometer on a level road."""
MIN_VERTICAL_SHARE = 0.9
"""Share of gravity that an axis at rest feels from which it is the vertical one: 26° of tilt."""
MIN_WEIGHT = 0.05
"""Odds from which a cause is an alternative: one in twenty."""


def biases_beyond_prior(
    run: FilterRun, config: FilterConfig, shifts: tuple[str, ...], threshold: float
) -> tuple[Finding, ...]:
    """Return the biases that their priors do not explain, one finding for each sensor.

    Parameters
    ----------
    run : FilterRun
        The last run.
    config : FilterConfig
        The priors.
    shifts : tuple of str
        Constant causes that are compensated.
    threshold : float
        p value below which one is a finding, all axes together.
    """
    longest = max(range(len(run.solutions)), key=lambda i: len(run.solutions[i].t))
    solution, at = run.solutions[longest], run.settings.model.layout
    span = float(solution.t[-1] - run.solutions[0].t[0])
    sd = np.sqrt(np.diag(solution.final_covariance))
    passed = _sd_from_constants(run, shifts)
    findings = []
    for sensor, axes in (("gyro", GYROS), ("accel", ACCELS)):
        biases, inflations, least, most = {}, [], 1.0, 0.0
        for axis, j in zip(axes, range(at[f"{sensor}_bias"].start, at[f"{sensor}_bias"].stop), strict=True):
            noise = config.channels[axis]
            left = passed[(GYROS + ACCELS).index(axis)]
            prior = float(
                np.hypot(np.hypot(noise.constant_sd, left), noise.random_walk_density * np.sqrt(span))
            )
            value, spread = float(solution.final_parameters[j]), float(sd[j])
            z = abs(value) / max(prior, 1e-300)
            p_value = min(1.0, 12.0 * float(norm.sf(z)))
            if p_value >= threshold or abs(value) < 4.0 * spread:
                continue
            least, most = min(least, p_value), max(most, z)
            low, high = value - 1.96 * spread, value + 1.96 * spread
            biases[axis] = Coefficient.known(value, low, high, noise.unit)
            if noise.constant_sd > 0.0:
                reason = f"{CAUSE_CODE}: on this drive"
                inflations.append(
                    Enlargement(Quantity(axis, "constant_sd"), abs(value) / noise.constant_sd, reason)
                )
        if biases:
            others = LIKE_GYRO_BIAS if sensor == "gyro" else _like_vertical_bias(run, config, biases)
            channels = tuple(biases)
            values = {
                "cause": CAUSE_CODE,
                "joins": "states",
                "parameters": {a: c.value for a, c in biases.items()},
            }
            text = words(CAUSE_CODE, channels, CAUSE_MEANING, biases)
            findings.append(
                Finding(
                    CAUSE_CODE,
                    channels,
                    "bias ÷ its prior sd",
                    most,
                    least,
                    biases,
                    text,
                    CAUSE_CONSEQUENCE,
                    values,
                    alternatives=others,
                    inflations=tuple(inflations),
                )
            )
    return tuple(findings)


def _like_vertical_bias(
    run: FilterRun, config: FilterConfig, biases: Mapping[str, Coefficient]
) -> tuple[Alternative, ...]:
    """Return the causes that a bias of the vertical accelerometer may be as well, by the odds of their priors."""
    start = run.solutions[0].state
    up = -rotation.mat_from_quat(start.quat_nb[0])[2]
    vertical = int(np.argmax(np.abs(up)))
    axis = ACCELS[vertical]
    if axis not in biases or abs(up[vertical]) < MIN_VERTICAL_SHARE:
        return ()
    size = float(gravity(np.sin(start.llh[0, 0]), start.llh[0, 2]))
    value, prior = abs(biases[axis].value or 0.0), max(config.channels[axis].constant_sd, 1e-12)
    found = []
    for cause, felt in zip(LIKE_VERTICAL_BIAS, (size, 1.0), strict=True):
        spread = felt * cause.prior_sd
        odds = math.exp(min(0.0, norm.logpdf(value, scale=spread) - norm.logpdf(value, scale=prior)))
        if odds > MIN_WEIGHT and value < felt * cause.largest:
            found.append(Alternative(cause.cause, odds))
    return tuple(found)


def _sd_from_constants(run: FilterRun, shifts: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the sds that errors of compensated constants add to the biases under the force at the start, (6,)."""
    if not shifts:
        return np.zeros(6)
    start, names = run.solutions[0].state, run.linearized.parameters
    now = fit_constants(run.whitened, names, shifts, np.zeros(len(names)))
    size = float(gravity(np.sin(start.llh[0, 0]), start.llh[0, 2]))
    force = -size * rotation.mat_from_quat(start.quat_nb[0])[2]
    sensor_errors = (columns(names).mix @ np.concatenate([np.zeros(3), force]))[list(now.columns)]
    return np.asarray(np.sqrt(np.einsum("ia,ij,ja->a", sensor_errors, now.covariance, sensor_errors)))


class SensorBias(FinalCause):
    """A constant bias far beyond its prior, of the gyros or of the accelerometers."""

    cause = CAUSE_CODE
    channels = ("imu",)
    meaning = CAUSE_MEANING
    consequence = CAUSE_CONSEQUENCE
    joins = "states"
