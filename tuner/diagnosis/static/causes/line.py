"""Line: a sinusoid, such as mains, a fan or a dither.

Statistic: largest value x of the periodogram of the residuals at any frequency, over the level of its neighbours: the
largest ordinates on a grid of half bins, which lose up to a fifth of a line between two, are followed to their peaks.
With a level from m ordinates the chance of one above x is exp(−y), y = m ln(1 + x/m); the periodogram of n
samples crosses that level upwards n/2 · √(πy/3) exp(−y) times [2]_.
Extension: the sinusoid is taken out; frequency and amplitude by least squares, intervals by the bounds of
Rife and Boorstyn, var f = 6σ²/(π² A² n T²), var A = 2σ²/n.

References
----------
.. [1] D. C. Rife, R. R. Boorstyn, Single-tone parameter estimation from discrete-time observations,
   IEEE Trans. Inform. Theory 20 (1974).
.. [2] R. V. Baluev, Assessing the statistical significance of periodogram peaks, MNRAS 385 (2008): Rice's formula.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from models.effects.static.spectral import Line as Effect
from tuner.diagnosis.static.causes import vibration
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.spectrum.background import FIRST_ORDINATE, local_level

NEIGHBOUR_COUNT = 1024
"""Ordinates from whose median the level is taken; their number enters the chance of a peak."""
EFFECTIVE_NEIGHBOURS = 490
"""Independent ordinates that would give the level as well as that median: 1024 (ln 2)² = 492."""
MIN_PEAK_SHARE = 0.8
"""Least share of a peak that the nearest half bin shows: sinc²(1/4) = 0.81 half-way between two."""
FOLLOWED_P_VALUE = 1e-2
"""P-value below which ordinates are followed to their peaks: far above the threshold, so that it only saves time."""


@dataclass(frozen=True)
class Line(Extension):
    """A sinusoid c cos 2πft + s sin 2πft, t from the first sample, amplitudes in scales."""

    cause = "line"
    effect = Effect
    group = "fast spectrum"
    shares = 15
    view = "peak"
    repeats = 6
    meaning = "a coherent oscillation (mains, fan, dither): a peak one bin wide in the spectrum"
    consequence = (
        "distrust this frequency: remove the source or notch it; it needs no filter state unless it is slow"
    )
    frequency: float
    cosine: float
    sine: float

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the sinusoid out."""
        return replace(channel, y=channel.y - self.signal(len(channel), channel.interval))

    def signal(self, n: int, interval: float) -> FloatArray:
        """Return the sinusoid, shape (n,), in scales."""
        phase = 2.0 * np.pi * self.frequency * interval * np.arange(n)
        return np.asarray(self.cosine * np.cos(phase) + self.sine * np.sin(phase))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Search the spectrum of the residuals for a line."""
        n = len(fitted.e)
        name = "peak of the spectrum ÷ its neighbourhood"
        span, power = fitted.spectrum
        level = local_level(power, 2 * NEIGHBOUR_COUNT)
        ratio = power / level
        ratio[: int(np.ceil(FIRST_ORDINATE * span / (n * fitted.channel.interval))) - 1] = 0.0
        best = int(np.argmax(ratio))
        height, f = float(ratio[best]), (best + 1) / span
        if _chance(height / MIN_PEAK_SHARE, n) < FOLLOWED_P_VALUE:
            near = np.flatnonzero(ratio >= MIN_PEAK_SHARE * height)
            tops = [near[0], *near[1:][np.diff(near) > 2]]
            height, f = max(_peak(fitted, (int(i) + 1) / span, float(level[i])) for i in tops)
        nats = _nats(height)
        if nats > 2.0 * np.log(n):
            wider = vibration.rival(fitted, f, height)
            if wider is not None:
                return wider
        return TestResult(
            "line",
            _chance(height, n),
            height - 1.5 * float(np.log(n)),
            height,
            name,
            lambda: (extension(fitted, f),),
        )


def resonance_lead(fitted: FittedChannel, frequency: float) -> float:
    """Return the log likelihood that a resonance has over the line at a frequency, Hz, of residuals that hold it."""
    span, power = fitted.spectrum
    level = local_level(power, 2 * NEIGHBOUR_COUNT)
    at = min(max(round(frequency * span) - 1, 0), len(power) - 1)
    height, f = _peak(fitted, frequency, float(level[at]))
    return vibration.lead_over_line(fitted, f, height)


def _nats(height: float) -> float:
    """Return minus the log of the chance of one ordinate above a height."""
    return EFFECTIVE_NEIGHBOURS * float(np.log1p(height / EFFECTIVE_NEIGHBOURS))


def _chance(height: float, n: int) -> float:
    """Return the chance that the periodogram of n samples rises above a height."""
    nats = _nats(height)
    return float(min(1.0, 0.5 * n * np.sqrt(np.pi * nats / 3.0) * np.exp(-nats)))


def _peak(fitted: FittedChannel, near: float, level: float) -> tuple[float, float]:
    """Return the height of the peak next to a frequency over a level, and its frequency, Hz."""
    n, e = len(fitted.e), fitted.clipped
    f, amplitude = _tone(fitted, near)
    return 0.25 * n * abs(amplitude) ** 2 / (float(np.mean(e * e, dtype=float)) * level), f


def extension(fitted: FittedChannel, near: float) -> Line:
    """Return the line next to a frequency, Hz."""
    n, dt = len(fitted.e), fitted.channel.interval
    f, z = _tone(fitted, near)
    white = fitted.spread * float(np.sqrt(fitted.power_at(f) / dt))
    amplitude = abs(z)
    cosine, sine = z.real * white, -z.imag * white
    sd = float(np.sqrt(6.0 / n)) / (np.pi * amplitude * n * dt)
    return Line(
        f,
        cosine,
        sine,
        values={
            "frequency": Value.of(f, sd, "Hz"),
            "amplitude": Value.of(amplitude * white, float(np.sqrt(2.0 / n)) * white, "{u}"),
        },
    )


def _tone(fitted: FittedChannel, near: float) -> tuple[float, complex]:
    """Return the frequency, Hz, next to a given one at which the clipped residuals have most power, and c − i s."""
    n, dt = len(fitted.e), fitted.channel.interval
    span = n * dt
    size = fitted.channel.block
    turned = fitted.clipped.reshape(-1, size) @ np.exp(-2j * np.pi * near * dt * np.arange(size))
    start = 2.0 * np.pi * dt * size * np.arange(n // size)
    middle = np.pi * dt * (size - 1)

    def project(f: float) -> complex:
        turn = np.exp(-1j * (f * start + (f - near) * middle))
        return complex(np.sum(turned * turn) * 2.0 / n)

    peak = minimize_scalar(
        lambda f: -abs(project(f)),
        bounds=(near - 0.6 / span, near + 0.6 / span),
        method="bounded",
        options={"xatol": 1e-4 / span},
    )
    return float(peak.x), project(float(peak.x))
