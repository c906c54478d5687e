"""Bandwidth of the noise against the sampling rate.

The equivalent noise bandwidth of a sensor is B = ∫ S(f) df / S(0) over the positive frequencies: that of an ideal
filter which passes as much noise. A rate below 2 B folds noise and vibration into the band. Noise that is flat up to
half the rate has B of half the rate at least; what lies beyond, samples alone do not show. A filter found in the
spectrum has B = π/(2n sin(π/2n)) cutoff for order n (Butterworth), wherever its cutoff is. Noise that rises towards
half the rate, as quantization and differences do, determines no B, and is no sign of aliasing.

References
----------
.. [1] IEEE Std 952-1997, B.4 (sampling against the bandwidth of the instrument).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from models.noise import White
from tuner.diagnosis.static.causes.base import gain_of
from tuner.diagnosis.static.causes.colour import Colour
from tuner.diagnosis.static.causes.lowpass import LowPass
from tuner.diagnosis.static.model.fitted_channel import FittedChannel

MIN_RATE_RATIO = 2.0
"""Least rate ÷ bandwidth without aliasing: the sampling theorem."""
MIN_RISE = 1.5
"""Noise at half the rate ÷ that at a tenth of it from which it rises; chosen clearly above the scatter of the bins."""


def rises(fitted: FittedChannel) -> bool:
    """Return whether the noise at half the rate is more than `MIN_RISE` times that at a tenth of it, peaks apart."""
    dt = fitted.channel.interval
    f = np.array([0.1, 0.499]) / dt
    white = sum(t.density**2 for t in fitted.fit.terms() if isinstance(t, White))
    low, high = (
        fitted.model.psd(f, interval=dt) + white * (gain_of(fitted.extensions, f, dt) - 1.0)
    ).tolist()
    return bool(high > MIN_RISE * low)


def bandwidth(fitted: FittedChannel) -> tuple[float, bool]:
    """Return the equivalent noise bandwidth of a channel, Hz, and whether it may as well be larger."""
    dt = fitted.channel.interval
    for shape in fitted.extensions:
        if isinstance(shape, LowPass) and shape.order:
            return float(0.5 * np.pi / shape.order / np.sin(0.5 * np.pi / shape.order)) * shape.cutoff, False
        if isinstance(shape, LowPass | Colour):
            f = np.asarray((np.arange(256) + 0.5) / (512.0 * dt), dtype=float)
            share = float(np.mean(shape.gain(f, dt)) / shape.gain(np.zeros(1), dt)[0])
            return min(share, 1.0) * 0.5 / dt, isinstance(shape, Colour)
    return 0.5 / dt, True


def notes(finals: Mapping[str, FittedChannel]) -> list[str]:
    """Return one sentence for all channels of the same bandwidth, their names in front."""
    groups: dict[str, list[str]] = {}
    for axis, found in finals.items():
        rate = 1.0 / found.channel.interval
        if rises(found):
            text = "noise rises towards half the rate: its bandwidth does not show, and folding neither"
            groups.setdefault(text, []).append(axis)
            continue
        width, open_ended = bandwidth(found)
        ratio = rate / width
        text = f"noise bandwidth {width:.3g} Hz{' or more' if open_ended else ''}, "
        text += f"rate ÷ bandwidth {ratio:.3g}{' or less' if open_ended else ''}"
        if ratio < MIN_RATE_RATIO:
            text += (
                ": below 2, noise and vibration beyond half the rate are folded into the band; sample faster"
            )
        elif open_ended and ratio < 1.01 * MIN_RATE_RATIO:
            text += (
                ": flat up to half the rate; a sensor wider than that folds noise and vibration into the band"
            )
        groups.setdefault(text, []).append(axis)
    return [f"{', '.join(axes)}: {text}" for text, axes in groups.items()]
