"""The noise model that is reported of a channel, before and after what was found in it.

It is that of the identification: terms chosen and fitted by `tuner.identification.identify_channel.choose_terms`,
before to the samples as they are, after to what the findings leave of them. The sum of terms that the tests work with
(`tuner.diagnosis.static.model.slow_likelihood`) is saturated, so that no finding is significant only because of a
missing term. What it says of the fast spectrum is reported where a finding shapes that; its slow terms never are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from models.noise import GaussMarkov, NoiseModel, Term, White
from tuner.diagnosis.static.causes.colour import Colour
from tuner.diagnosis.static.causes.gauss_markov import MoreMarkov
from tuner.diagnosis.static.causes.lowpass import LowPass
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.identification.identify_channel import choose_terms, single_axis
from tuner.types import Identification
from tuner.types.records import Record

BRIEF_SHARE = 1e-3
"""Time constant ÷ span below which a process is white to what is chosen: its corner lies above 160 ÷ span."""


def noise_before(record: Record, axis: str, identification: Identification | None) -> NoiseModel:
    """Return the noise of an axis as identified; identified here where no identification of it is given."""
    if identification is not None and axis in identification.channels:
        return identification.channels[axis].model
    return choose_terms(single_axis(record, axis).pieces(axis), record.interval).fit.model


def noise_after(fitted: FittedChannel, before: NoiseModel, *, mended: bool = False) -> NoiseModel:
    """Return the noise of a channel with everything that was found in it, SI; that before where nothing was.

    `mended` is whether samples that wrapped were put back or others stand in place of error codes, which those of
    `before` may lack.
    """
    extensions, dt = fitted.extensions, fitted.channel.interval
    if not (extensions or mended):
        return before
    if any(isinstance(x, LowPass | Colour | Vibration) for x in extensions):
        return noise_with_shape(fitted)
    chosen = choose_terms([unexplained_samples(fitted)], dt, _processes(fitted)).fit.model
    return NoiseModel((*chosen.terms, *_named_terms(fitted))).scaled(fitted.channel.scale)


def noise_with_shape(fitted: FittedChannel) -> NoiseModel:
    """Return the noise of a channel, SI, with the shape of the fast spectrum in place of its white noise.

    The slow terms are chosen as for any record, on samples whose spectrum has been made flat where the findings shape
    it: the tests' own slow terms share one Gauss–Markov process or flicker with what shapes the spectrum elsewhere, and
    may lie far from the data at long cluster times. Where the chosen terms leave out short clusters, those have the
    white noise of the tests, with a Gauss–Markov process that is shorter than what was chosen describes.
    """
    dt = fitted.channel.interval
    shape = next((x for x in fitted.extensions if isinstance(x, LowPass | Colour)), None)
    plateau = 1.0 if shape is None else float(np.sqrt(shape.gain(np.zeros(1), dt)[0]))
    brief = [] if _processes(fitted) else _brief(fitted)
    chosen = choose_terms([unshaped_samples(fitted, plateau, brief)], dt, _processes(fitted))
    slow: list[Term] = [term for term in chosen.fit.model.terms if not isinstance(term, White)]
    density = chosen.fit.model.white_density() / plateau
    if brief or chosen.band.m > 1 or density == 0.0:
        density = fitted.model.white_density()
        slow += [
            term
            for term in fitted.fit.terms()
            if term in brief or (isinstance(term, GaussMarkov) and term.time_constant < chosen.band.m * dt)
        ]
    white = White(density) if shape is None else shape.arma(dt, density)
    return NoiseModel([white, *slow, *_named_terms(fitted)]).scaled(fitted.channel.scale)


def _brief(fitted: FittedChannel) -> list[GaussMarkov]:
    """Return the Gauss–Markov processes of the tests that are white to all slow terms."""
    longest = BRIEF_SHARE * fitted.channel.span
    return [t for t in fitted.fit.terms() if isinstance(t, GaussMarkov) and t.time_constant < longest]


def unshaped_samples(
    fitted: FittedChannel, plateau: float = 1.0, brief: Sequence[GaussMarkov] = ()
) -> FloatArray:
    """Return the samples without what the findings make of them, shape (n,), scales.

    Peaks and the shape of the fast spectrum are divided out of the cosine coefficients. `plateau` is the root of the
    gain on white noise at low frequencies, which the flat spectrum keeps, as it does that of `brief` processes.
    """
    dt = fitted.channel.interval
    a = transform(unexplained_samples(fitted), dt)
    f = np.arange(1.0, len(a)) / (2.0 * len(a) * dt)
    slow = NoiseModel(t for t in fitted.fit.terms() if not isinstance(t, White) and t not in brief)
    level = sum(2.0 * t.sd**2 * t.time_constant for t in brief)
    flat = (plateau * fitted.model.white_density()) ** 2 + level + slow.psd(f, interval=dt)
    a[1:] *= np.sqrt(flat / fitted.power)
    return inverse(a, dt)


def unexplained_samples(fitted: FittedChannel) -> FloatArray:
    """Return the samples without what named findings take out or explain by templates, shape (n,), scales.

    Slow noise that has no name, as a path between more than two levels, stays in them: the reported noise describes it.
    """
    channel = fitted.channel
    centre = (np.arange(channel.blocks) + 0.5) * channel.block
    ramp = fitted.fit.beta[0] * (channel.block_time / channel.span - 0.5)
    explained = np.interp(np.arange(len(channel)) + 0.5, centre, fitted.path - ramp)
    unnamed = sum(
        (
            channel.y - x.clean_samples(channel).y
            for x in fitted.cleaners
            if not x.named and x.terms(channel.interval)
        ),
        np.zeros(len(channel)),
    )
    return np.asarray(fitted.cleaned.y - explained + unnamed, dtype=float)


def _named_terms(fitted: FittedChannel) -> list[Term]:
    """Return the noise terms that the named findings add, scales."""
    return [term for x in fitted.extensions if x.named for term in x.terms(fitted.channel.interval)]


def _processes(fitted: FittedChannel) -> list[str]:
    """Return the terms that were found beside those that are chosen."""
    return ["gauss_markov" for x in fitted.extensions if isinstance(x, MoreMarkov)]
