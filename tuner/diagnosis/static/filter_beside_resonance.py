"""A filter and one resonance beside it, fitted together.

Each is found over the other as that was fitted alone: a resonance over white noise takes up the filter's own fall, and
the filter beside it gets its frequency. Together the filter, the frequency and the quality of the resonance are the
likeliest of the fast spectrum in bins, the sizes of all shapes free.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.lowpass import LowPass, extension
from tuner.diagnosis.static.causes.shaped_white_noise import ShapedWhiteNoise
from tuner.diagnosis.static.causes.vibration import MIN_QUALITY, Vibration
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, refitted, with_extensions
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, minimum
from tuner.diagnosis.static.spectrum.binned import bins, sized
from tuner.diagnosis.static.spectrum.filters import FILTERS, filter_powers
from tuner.diagnosis.static.spectrum.shape import fit_filters

START_QUALITIES = (1.5 * MIN_QUALITY, 5.0 * MIN_QUALITY)
"""Qualities of the resonance from which the search begins: within an octave of those that bins show."""
START_RATIOS = (0.7, 1.4)
"""Cutoffs ÷ frequency of the resonance from which it begins: a filter far from a resonance is found without it."""
MAX_REFITS = 4
"""Most fits of each beside the other after the common one."""


def with_joint_resonance(fitted: FittedChannel) -> FittedChannel:
    """Return a channel whose one shape of white noise and one resonance are fitted together, where that is likelier."""
    shapes = [x for x in fitted.extensions if isinstance(x, ShapedWhiteNoise)]
    resonances = [x for x in fitted.extensions if isinstance(x, Vibration)]
    if len(shapes) != 1 or len(resonances) != 1:
        return fitted
    (shape,), (resonance,) = shapes, resonances
    found = _together(fitted, shape, resonance)
    if found is None:
        return fitted
    joint = refitted(with_extensions(fitted, tuple(found.get(x, x) for x in fitted.extensions)), MAX_REFITS)
    levels = len(set(shape.response)) if isinstance(shape, LowPass) else 0  # of a curve, a nat for each
    return joint if joint.fit.log_likelihood > fitted.fit.log_likelihood - levels else fitted


def _together(
    fitted: FittedChannel, shape: Extension, resonance: Vibration
) -> dict[Extension, Extension] | None:
    """Return what stands in place of a shape and a resonance; None where no resonance is left."""
    dt = fitted.channel.interval
    data = bins(fitted, without=shape)
    others = np.maximum(data.peaks - resonance.power(data.cycles / dt, dt), 0.0)
    data = replace(data, peaks=others, loose=False)

    def peak(x: FloatArray) -> FloatArray:
        frequency, quality = np.exp(x[1:]).tolist()
        return Vibration(frequency, quality, 1.0).power(data.cycles / dt, dt)

    best, least = np.zeros(3), np.inf
    for name, (low, high) in FILTERS.items():
        powers = filter_powers(name, data.cycles, data.width)

        def cost(x: FloatArray, powers=powers, low=low, high=high) -> float:  # type: ignore[no-untyped-def]
            cutoff, frequency, quality = np.exp(x).tolist()
            if not (low < cutoff < high and 0.01 < frequency * dt < 0.495 and MIN_QUALITY < quality < 200.0):
                return COST_OUTSIDE
            rows = np.vstack((data.white * powers(cutoff), data.beside(), peak(x)))
            return sized(data, rows).cost

        starts = [
            np.log(
                [
                    np.clip(ratio * resonance.frequency * dt, 1.01 * low, 0.99 * high),
                    resonance.frequency,
                    quality,
                ]
            )
            for ratio in START_RATIOS
            for quality in START_QUALITIES
        ]
        begun = min(starts, key=cost)
        x, value = minimum(cost, [begun.tolist()], scale=0.1, tolerance=1e-2)
        if value < least:
            best, least = x, value
    if least >= COST_OUTSIDE:
        return None
    loose = replace(data, peaks=peak(best), loose=True)
    filters = fit_filters(loose)
    size = sized(loose, np.vstack((data.white, data.beside(), peak(best)))).size[-1]
    frequency, quality = np.exp(best[1:]).tolist()
    moved = replace(resonance, frequency=frequency, quality=quality, sd=float(np.sqrt(max(size, 1e-12))))
    return {shape: extension(loose, filters), resonance: moved}
