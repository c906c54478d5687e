"""Thermal lag: a bias in proportion to a temperature that follows the measured one with a first-order lag.

Statistic: likelihood ratio of the best lag of a grid, the noise refitted; Davies' bound over the grid.
Extension: a template; slope and lag from a joint linearised fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from models.effects.thermal import ThermalLag as Effect
from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.causes.temperature import COVARIATE
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.cosine import block_transform
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.residual import Residual
from tuner.diagnosis.scan import judge, project, rest, scan, weights

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ThermalLag(Extension):
    """Bias in proportion to the lagging temperature."""

    cause: ClassVar[str] = "thermal_lag"
    meaning: ClassVar[str] = "the bias follows the measured temperature late: a loop of bias over temperature"
    consequence: ClassVar[str] = (
        "a calibration to apply to the low-passed temperature, slope × (L − T₀) with dL/dt = (T − L)/τ"
    )
    time_constant: float

    def columns(self, channel: Channel) -> FloatArray:
        """Return the lagging temperature on the blocks, shape (M, 1)."""
        return lagged(channel, self.time_constant)[:, None]

    def refined(self, size: Value, widening: float) -> ThermalLag:
        """Take the slope from a joint fit; its interval keeps the share of the time constant."""
        slope = replace(size, unit="{u}/K").joined(self.values["slope"])
        constant = self.values["time_constant"].widened(widening)
        return replace(self, values={"time_constant": constant, "slope": slope})


def lagged(channel: Channel, time_constant: float) -> FloatArray:
    """Return the lagging temperature on the blocks about its mean, K, shape (M,)."""
    effect = Effect(1.0, time_constant)
    out = effect.lagged(channel.covariates[COVARIATE], channel.block * channel.interval)
    return np.asarray(out - out.mean())


def lags(channel: Channel) -> FloatArray:
    """Return the grid of lags, s."""
    shortest = max(30.0, 4.0 * channel.block * channel.interval)
    return np.geomspace(shortest, max(0.25 * channel.span, 2.0 * shortest), 9)


def test(found: Residual) -> Alarm | None:
    """Search for a lag between temperature and bias; None where no temperature was measured."""
    channel = found.channel
    if COVARIATE not in channel.covariates:
        return None
    grid = lags(channel)
    scores, templates = scan(found, np.stack([lagged(channel, t) for t in grid], axis=1))
    name = "likelihood ratio of a lagging temperature"
    if not scores.promising:
        return Alarm("thermal_lag", 1.0, -9.0, float(scores.score[scores.best] ** 2), name)
    result = judge(found, templates[:, scores.best], scores.correlation, price=float(np.log(8.0)))
    near = float(grid[scores.best])
    return Alarm(
        "thermal_lag", result.p_value, result.gain, result.ratio, name, lambda: (extension(found, near),)
    )


def extension(found: Residual, near: float) -> ThermalLag:
    """Return the lag next to a time constant, s."""
    channel, singles = found.channel, found.track.singles
    target = rest(found) * np.sqrt(weights(found))

    def loss(log_constant: float) -> float:
        template = block_transform(lagged(channel, np.exp(log_constant))[:, None], channel, singles)
        return -float((project(found, template)[0][:, 0] @ target) ** 2)

    best = minimize_scalar(loss, bounds=(np.log(near / 2.0), np.log(near * 2.0)), method="bounded")
    constant = float(np.exp(best.x))
    shape = lagged(channel, constant)
    slope = (lagged(channel, 1.02 * constant) - lagged(channel, constant / 1.02)) / (2.0 * np.log(1.02))
    white, norm = project(found, block_transform(np.stack((shape, slope), axis=1), channel, singles))
    design = white * norm
    covariance = np.linalg.pinv(design.T @ design, hermitian=True)
    size = float((covariance @ (design.T @ target))[0])
    relative = float(np.sqrt(covariance[1, 1])) / max(abs(size), 1e-12)
    return ThermalLag(
        constant,
        values={
            "time_constant": Value.log(constant, relative, "s"),
            "slope": Value.of(size, float(np.sqrt(covariance[0, 0])), "{u}/K"),
        },
    )
