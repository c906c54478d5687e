"""The noise model that is reported of a channel, before and after what was found in it.

It is that of the identification: terms chosen and fitted by `tuner.identification.channel.choose_terms`, before to the
samples as they are, after to what the findings leave of them. The sum of terms that the tests work with
(`tuner.diagnosis.static.model.slow_likelihood`) is saturated, so that no finding is significant only because of a
missing term; it is reported only where a finding shapes the fast spectrum, which it is fitted together with.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.noise import NoiseModel, Term, White
from tuner.diagnosis.static.causes.colour import Colour
from tuner.diagnosis.static.causes.gauss_markov import MoreMarkov
from tuner.diagnosis.static.causes.lowpass import LowPass
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.model.residual import Residual
from tuner.identification.channel import choose_terms, single_axis
from tuner.types import Identification
from tuner.types.records import Record

FloatArray = NDArray[np.float64]


def noise_before(record: Record, axis: str, identification: Identification | None) -> NoiseModel:
    """Return the noise of an axis as identified; identified here where no identification of it is given."""
    if identification is not None and axis in identification.channels:
        return identification.channels[axis].model
    return choose_terms(single_axis(record, axis).pieces(axis), record.interval).fit.model


def noise_after(fitted: Residual, before: NoiseModel) -> NoiseModel:
    """Return the noise of a channel with everything that was found in it, SI; that before where nothing was."""
    extensions, dt = fitted.extensions, fitted.channel.interval
    if not extensions:
        return before
    if any(isinstance(x, LowPass | Colour | Vibration) for x in extensions):
        return noise_with_shape(fitted)
    processes = ["gauss_markov" for x in extensions if isinstance(x, MoreMarkov)]
    chosen = choose_terms([unexplained_samples(fitted)], dt, processes).fit.model
    return NoiseModel((*chosen.terms, *(term for x in extensions for term in x.terms(dt)))).scaled(
        fitted.channel.scale
    )


def noise_with_shape(fitted: Residual) -> NoiseModel:
    """Return the terms of the tests, SI, with the shape of the fast spectrum in place of their white noise."""
    dt = fitted.channel.interval
    shape = next((x for x in fitted.extensions if isinstance(x, LowPass | Colour)), None)
    terms: list[Term] = [
        shape.arma(dt, term.density) if shape is not None and isinstance(term, White) else term
        for term in fitted.fit.terms()
    ]
    terms += [term for x in fitted.extensions for term in x.terms(dt)]
    return NoiseModel(terms).scaled(fitted.channel.scale)


def unexplained_samples(fitted: Residual) -> FloatArray:
    """Return the samples without what the extensions take out or explain by templates, shape (n,), scales."""
    channel = fitted.channel
    centre = (np.arange(channel.blocks) + 0.5) * channel.block
    ramp = fitted.fit.beta[0] * (channel.block_time / channel.span - 0.5)
    explained = np.interp(np.arange(len(channel)) + 0.5, centre, fitted.path - ramp)
    return np.asarray(fitted.cleaned.y - explained, dtype=float)
