"""Attitude: the sensor tilts in its mount, so that gravity turns in its axes.

An even tilt about a horizontal axis makes a ramp of the two channels across it, which the base noise has, and bends
the third: the specific force keeps its length, so a change h across gravity takes h²/2g along it.
Statistic: likelihood ratio of that parabola, whose size the ramps foretell, in the channel along gravity;
χ²₁. It counts only where the fitted size agrees with the foretold one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.probability import REACH_95, chi2_beyond
from models.units import STANDARD_GRAVITY
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.types import Coefficient

GRAVITY_ERROR = 0.2
"""Largest error of the length of the specific force at rest, as a share of gravity."""
MEANING = "the mount gives way: gravity turns in the axes of the sensor, its length kept"
"""What the cause is, in one sentence."""
CONSEQUENCE = (
    "fix the mount; the ramps of these channels are geometry, not drift of the sensor: leave them out"
)
"""What to do about it, in one sentence."""


@dataclass(frozen=True)
class Tilt:
    """A tilt of a triad, with the statistic of its test.

    Attributes
    ----------
    channels : tuple of str
        The three axes.
    statistic, p_value : float
        Likelihood ratio and its chance.
    tilt : Coefficient
        Angle turned over the record, rad.
    """

    channels: tuple[str, ...]
    statistic: float
    p_value: float
    tilt: Coefficient


def triad(residuals: Mapping[str, FittedChannel]) -> tuple[list[str], FloatArray, float] | None:
    """Return the axes of a triad of accelerometers at rest, their levels, and the length of these, m/s²; or None."""
    axes = [axis for axis in residuals if residuals[axis].channel.unit == "m/s^2"]
    level = np.array([residuals[a].channel.level for a in axes])
    norm = float(np.linalg.norm(level))
    at_rest = abs(norm - STANDARD_GRAVITY) <= GRAVITY_ERROR * STANDARD_GRAVITY
    one_clock = len({len(residuals[a].channel) for a in axes}) == 1
    return (axes, level, norm) if len(axes) == 3 and one_clock and at_rest else None


def test(residuals: Mapping[str, FittedChannel], limit: float) -> Tilt | None:
    """Test a triad of accelerometers."""
    rest = triad(residuals)
    if rest is None:
        return None
    axes, level, norm = rest
    along = int(np.argmax(np.abs(level)))
    if abs(level[along]) < 0.95 * norm:
        return None
    rate, spread = np.zeros(2), np.zeros(2)
    across = [a for i, a in enumerate(axes) if i != along]
    for i, axis in enumerate(across):
        found = residuals[axis]
        rate[i] = found.fit.beta[0] * found.channel.scale
        spread[i] = float(np.sqrt(found.fit.beta_covariance[0, 0])) * found.channel.scale
    change, sd = float(np.hypot(*rate)), float(np.hypot(*spread))
    if change < 5.0 * sd:
        return None
    found = residuals[axes[along]]
    place = found.channel.block_time / found.channel.span - 0.5
    bend = -np.sign(level[along]) * 0.5 * (change * place) ** 2 / norm
    offsets = np.array([residuals[a].channel.level for a in across])
    slope = -np.sign(level[along]) * float(offsets @ rate) / norm * place
    template = block_transform(
        ((bend + slope) / found.channel.scale)[:, None], found.cleaned, found.track.singles
    )
    fit = found.refit(template[:, 0])
    ratio = max(0.0, 2.0 * (fit.log_likelihood - found.fit.log_likelihood))
    p_value = chi2_beyond(SLOW_RATIO_FACTOR * ratio, 1)
    size, error = float(fit.beta[-1]), float(np.sqrt(fit.beta_covariance[-1, -1]))
    if p_value > limit or abs(size - 1.0) > 4.0 * error + 4.0 * sd / change:
        return None
    tilt = float(np.arcsin(min(1.0, change / norm)))
    half = REACH_95 * sd / norm
    return Tilt(tuple(axes), ratio, p_value, Coefficient.known(tilt, tilt - half, tilt + half, "rad"))
