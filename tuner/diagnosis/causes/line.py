"""Line: a sinusoid, such as mains, a fan or a dither.

Statistic: largest ordinate of the periodogram of the residuals on a grid of half bins, over the level x̄ of its
neighbours. With a level from m of them the chance of an ordinate above x is (1 + x/m)^−m; there are n cells.
Extension: the sinusoid is taken out; frequency and amplitude by least squares, intervals by the bounds of
Rife and Boorstyn, var f = 6σ²/(π² A² n T²), var A = 2σ²/n.

References
----------
.. [1] D. C. Rife, R. R. Boorstyn, Single-tone parameter estimation from discrete-time observations,
   IEEE Trans. Inform. Theory 20 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.causes import vibration
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.level import FIRST, local_level
from tuner.diagnosis.residual import CLIP, Residual
from tuner.diagnosis.statistics import any_of

FloatArray = NDArray[np.float64]

NEIGHBOURS = 1024
"""Ordinates from whose median the level is taken."""
EFFECTIVE = 490
"""Independent ordinates that would give the level as well as that median."""


@dataclass(frozen=True)
class Line(Extension):
    """A sinusoid c cos 2πft + s sin 2πft, t from the first sample, amplitudes in scales."""

    cause: ClassVar[str] = "line"
    repeats: ClassVar[int] = 6
    meaning: ClassVar[str] = (
        "a coherent oscillation (mains, fan, dither): a peak one bin wide in the spectrum"
    )
    consequence: ClassVar[str] = (
        "distrust this frequency: remove the source or notch it; it needs no filter state unless it is slow"
    )
    frequency: float
    cosine: float
    sine: float

    def repair(self, channel: Channel) -> Channel:
        """Take the sinusoid out."""
        return replace(channel, y=channel.y - self.signal(len(channel), channel.interval))

    def signal(self, n: int, interval: float) -> FloatArray:
        """Return the sinusoid, shape (n,), in scales."""
        phase = 2.0 * np.pi * self.frequency * interval * np.arange(n)
        return np.asarray(self.cosine * np.cos(phase) + self.sine * np.sin(phase))


def test(found: Residual) -> Alarm:
    """Search the spectrum of the residuals for a line."""
    n = len(found.e)
    frequency, power = found.spectrum
    level = local_level(power, 2 * NEIGHBOURS)
    ratio = power / level
    first = int(np.searchsorted(frequency, FIRST / (n * found.channel.interval)))
    if first >= len(ratio):
        return Alarm("line", 1.0, -9.0, 0.0, "peak of the spectrum")
    best = first + int(np.argmax(ratio[first:]))
    height, f = float(ratio[best]), float(frequency[best])
    nats = EFFECTIVE * float(np.log1p(height / EFFECTIVE))
    if nats > 2.0 * np.log(n):
        wider = vibration.rival(found, f, height)
        if wider is not None:
            return wider
    return Alarm(
        "line",
        any_of(float(np.exp(-nats)), n),
        height - 1.5 * float(np.log(n)),
        height,
        "peak of the spectrum ÷ its neighbourhood",
        lambda: (extension(found, f),),
        local=True,
    )


def extension(found: Residual, near: float) -> Line:
    """Return the line next to a frequency, Hz."""
    n, dt = len(found.e), found.channel.interval
    e = np.clip(found.e, -CLIP, CLIP)
    span = n * dt
    size = found.channel.block
    turned = e.reshape(-1, size) @ np.exp(-2j * np.pi * near * dt * np.arange(size))
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
    f = float(peak.x)
    z = project(f)
    white = found.spread * float(np.sqrt(found.power_at(f) / dt))
    amplitude = abs(z)
    cosine, sine = z.real * white, -z.imag * white
    sd = float(np.sqrt(6.0 / n)) / (np.pi * amplitude * span)
    return Line(
        f,
        cosine,
        sine,
        values={
            "frequency": Value.of(f, sd, "Hz"),
            "amplitude": Value.of(amplitude * white, float(np.sqrt(2.0 / n)) * white, "{u}"),
        },
    )
