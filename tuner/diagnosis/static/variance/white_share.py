"""Share of the residuals that is white noise of the sensor: the rest dilutes what they show of its distribution.

With W the spectrum of the white noise without the Δ²/12 that a quantizer of step Δ adds to it, and E that of the model,
the white samples w reach the residuals through the zero-phase filter of response H = √(W/E)::

    e = Σ_j h_j w_{k−j} + …,     variance of that part  a = Σ h² = mean W/E,     its excess kurtosis  κ_w Σ h⁴

so that a change of the variance of w by the factor r is seen as 1 − a + a r where it is short, and an excess
kurtosis κ_w as κ_w Σ h⁴ in residuals of unit variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.noise import White
from tuner.diagnosis.static.causes.base import gain_of, hidden_by
from tuner.diagnosis.static.model.fitted_channel import FittedChannel

FREQUENCY_COUNT = 4096
"""Frequencies, even up to half the rate, at which the filter is computed.

Chosen fine against the smooth spectra of the terms.
"""
MIN_WHITE_SHARE = 0.05
"""Least share of white noise that is used: below, its distribution cannot be estimated from the residuals."""


@dataclass(frozen=True)
class Dilution:
    """Shares of the white noise in the residuals.

    Attributes
    ----------
    variance : float
        Σ h², share of the variance.
    third : float
        Σ h³, factor on its skewness.
    fourth : float
        Σ h⁴, factor on its excess kurtosis.
    error : float
        Relative standard deviation of `variance`, from the fit.
    """

    variance: float
    third: float
    fourth: float
    error: float

    def undiluted(self, ratio: float, share: float) -> float:
        """Return the ratio of variances of the white noise that is seen as `ratio`, over a share of the record.

        `variance` is that of the whole record, part of it noisier: the quiet part has a/(1 + share (r − 1)) of it.
        """
        a, excess = self.variance, ratio - 1.0
        return max(1.0 + excess / max(a - excess * (1.0 - a) * share, MIN_WHITE_SHARE * a), 1e-3)


def dilution(fitted: FittedChannel) -> Dilution:
    """Return the shares of white noise in the residuals."""
    dt = fitted.channel.interval
    f = np.linspace(0.0, 0.5 / dt, FREQUENCY_COUNT + 1)
    order = next(i for i, term in enumerate(fitted.fit.terms()) if isinstance(term, White))
    at = sum(len(kind.PARAMETERS) for kind in fitted.fit.kinds[:order])
    density = float(np.exp(2.0 * fitted.fit.theta[at]))
    own = max(density - fitted.channel.quantizer_step**2 * dt / 12.0, MIN_WHITE_SHARE * density)
    response = np.sqrt(np.minimum(own * gain_of(fitted.extensions, f, dt) / fitted.power_at(f), 1.0))
    response[hidden_by(fitted.extensions, f, dt)] = 0.0
    h = np.fft.irfft(response)
    error = 2.0 * float(np.sqrt(fitted.fit.covariance[at, at]))
    return Dilution(
        max(float(h @ h), MIN_WHITE_SHARE),
        max(float(np.sum(h**3)), MIN_WHITE_SHARE**1.5),
        max(float(np.sum(h**4)), MIN_WHITE_SHARE**2),
        error * density / own,
    )
