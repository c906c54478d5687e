"""A configuration compared with the record it came from: every axis must predict its own Allan curve and forecasts.

The settings of an axis that fail are replaced by a block fitted to the curve, and the notes say so with the figures;
an axis that no block predicts is marked with the cluster times or horizons at which it fails. What stays bounded in
the integral (quantization noise, lines, resonances) is no setting of a filter; it is kept with the comparison.
A constant bias rate that was identified is taken out of the samples first: the filter has a state for it. Where
nothing predicts the samples as they are, the settings are those of samples without the signals that a diagnosis found
(warm-up, steps, temperature), or whose measured temperature is compensated, and the note says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.ndimage import uniform_filter1d

from models.arrays import FloatArray
from tuner.jobs import each
from tuner.types import BoundUsed, ChannelNoise, FilterConfig, Quantity, TermEstimate
from tuner.types.prediction import BlockSource, NoiseBlock, PredictedBlock
from tuner.types.records import Record

TEMPERATURE_MEAN = 60.0
"""Length of the mean over which the temperature is taken, s: its own noise and codes must not enter the samples."""
MIN_TEMPERATURE_RANGE = 1.0
"""Range of temperature from which it is compensated, K: below, a slope says nothing about another day."""
FITTED = (
    "not used: the settings of this axis are fitted to its Allan curve, which those made from the identified terms "
    "do not predict"
)
"""What becomes of the identified terms of an axis that fails."""
LIMITED = "bounded: the whole limit, as the codes at rest hide noise that motion shows"
"""What becomes of white noise below the step of a quantizer."""


def hold_to_records(
    config: FilterConfig,
    records: Sequence[Record],
    signals: Mapping[str, tuple[tuple[str, ...], FloatArray]] = MappingProxyType({}),
) -> tuple[FilterConfig, Mapping[str, PredictedBlock]]:
    """Return a configuration whose axes predict their records, and how well each does.

    Parameters
    ----------
    config : FilterConfig
        Settings without any enlargement for causes.
    records : sequence of Record
        Samples at rest from which they were identified; axes without a record stay as they are.
    signals : mapping of str to (tuple of str, ndarray of shape (n,)), optional
        By axis, causes that a diagnosis found and the sum of what they add to the samples of its record: taken out
        where no settings predict the samples with them.

    Returns
    -------
    (FilterConfig, mapping of str to PredictedBlock)
        An axis whose quantizer leaves a limit of its white noise alone is not among those judged: what is written for
        it are its limits, not what its codes at rest show.
    """
    channels, notes = dict(config.channels), list(config.notes)
    judged: dict[str, PredictedBlock] = {}
    places = [(record, channels[axis]) for record in records for axis in record.axes if axis in channels]
    limited = {axis for record in records for axis in record.limiting_steps}
    for (_, channel), (found, about) in zip(
        places, each(lambda place: _predicting(*place, signals), places), strict=True
    ):
        if found is None:
            continue
        if (
            channel.axis in limited
        ):  # its codes at rest are not its noise, so that the curve decides no slow term
            white = max(channel.white_density, found.block.white_density)
            channels[channel.axis] = replace(channel, white_density=white)
            continue
        judged[channel.axis] = found
        if found.source is not BlockSource.LIKELIHOOD:
            channels[channel.axis] = _with_block(channel, found)
        notes += [*about, *_notes(channel, found)]
    bounded = [_at_bound(channels, axis) for axis in sorted(limited & set(channels))]
    fitted = {axis for axis, found in judged.items() if found.source is not BlockSource.LIKELIHOOD}
    written = {one.quantity: one for one in config.inflations if one.quantity.owner not in fitted}
    written |= {one.quantity: one for one in bounded}
    return replace(config, channels=channels, inflations=tuple(written.values()), notes=tuple(notes)), judged


def _at_bound(channels: dict[str, ChannelNoise], axis: str) -> BoundUsed:
    """Set the white noise of an axis that its quantizer limits to its bound, and return the record of it.

    In motion the mean wanders between codes, and the samples have the noise of the sensor and of the rounding,
    whatever the one code that they keep to at rest shows. Where the Allan curve of the codes has more white noise than
    the limit that their terms give, that is the limit.
    """
    channel = channels[axis]
    white = [t.coefficients["density"] for t in channel.identified if t.name == "white"]
    limit = max(channel.white_density, *(one.upper or 0.0 for one in white))
    channels[axis] = replace(
        channel,
        white_density=limit,
        identified=tuple(
            replace(t, coefficients={"density": replace(t.coefficients["density"], upper=limit)})
            if t.name == "white"
            else t
            for t in channel.identified
        ),
        handling={**channel.handling, "white": LIMITED},
    )
    return BoundUsed(Quantity(axis, "white.density"), 1.0, LIMITED)


def _predicting(
    record: Record, channel: ChannelNoise, signals: Mapping[str, tuple[tuple[str, ...], FloatArray]]
) -> tuple[PredictedBlock | None, list[str]]:
    """Return the settings of an axis that predict its record, and what was taken out of that; None if too short."""
    from tuner.identification.predictive.choose_block import choose_block  # loaded when used: slow to import

    axis, notes = channel.axis, []
    samples = _samples(record, channel)
    found = choose_block(samples, record.interval, _block(channel))
    if found is None:
        return None, []
    if not found.passes and axis in signals:
        causes, signal = signals[axis]
        clean = replace(record, y=(record.column(axis) - signal)[:, None], axes=(axis,))
        compensated = choose_block(_samples(clean, channel), record.interval, None)
        if compensated is not None and compensated.passes:
            notes.append(_about_causes(axis, causes, found))
            found = replace(compensated, without=tuple(dict.fromkeys(causes)))
    if not found.passes and (slope := _temperature_slope(record, samples)) is not None:
        compensated = choose_block(_compensated(record, samples, slope), record.interval, None)
        if compensated is not None and compensated.passes:
            notes.append(_about_temperature(axis, channel.unit, slope, found))
            found = replace(compensated, without=("temperature",))
    return found, notes


def _samples(record: Record, channel: ChannelNoise) -> list[FloatArray]:
    """Return the stretches without a gap, less the ramp that was identified."""
    rate = _coefficient(channel.identified, "ramp", "rate")
    pieces = [
        (record.column(channel.axis)[start:stop], record.t[start:stop])
        for start, stop in record.segments
        if np.ptp(record.column(channel.axis)[start:stop]) > 0.0
    ]
    if rate == 0.0 or not pieces:
        return [np.ascontiguousarray(y) for y, _ in pieces]
    # each stretch has a level of its own: after a motion the unit may lie otherwise
    y = np.concatenate([y - y.mean() for y, _ in pieces])
    t = np.concatenate([t - t.mean() for _, t in pieces])
    slope = float(t @ y / (t @ t))
    return [np.ascontiguousarray(y - slope * (t - t[0])) for y, t in pieces]


def _temperature(record: Record) -> list[FloatArray]:
    """Return the smoothed temperature on the stretches that are judged, or nothing where it was not measured."""
    if "temperature" not in record.covariates:
        return []
    celsius = record.covariates["temperature"]
    width = max(1, round(TEMPERATURE_MEAN / record.interval))
    return [uniform_filter1d(celsius[a:b], width, mode="nearest") for a, b in record.segments]


def _temperature_slope(record: Record, samples: Sequence[FloatArray]) -> float | None:
    """Return the regression on the temperature within stretches, unit/K; None where it does not change.

    Each stretch has its own mean: the unit may have been laid down in another pose.
    """
    celsius = _temperature(record)
    if len(celsius) != len(samples):
        return None
    if not max(np.ptp(t) for t in celsius) >= MIN_TEMPERATURE_RANGE:
        return None
    spread = np.concatenate([t - t.mean() for t in celsius])
    y = np.concatenate([y - y.mean() for y in samples])
    return float(spread @ y / (spread @ spread))


def _compensated(record: Record, samples: Sequence[FloatArray], slope: float) -> list[FloatArray]:
    """Return the samples less what follows the temperature."""
    return [y - slope * (t - t.mean()) for y, t in zip(samples, _temperature(record), strict=True)]


def _about_causes(axis: str, causes: Sequence[str], before: PredictedBlock) -> str:
    return (
        f"{axis}: the settings are for samples without {' and '.join(dict.fromkeys(causes))}, to be compensated or cut "
        f"out (--begin S, --end S); with that no settings predict the record ({_failure(before)})"
    )


def _about_temperature(axis: str, unit: str, slope: float, before: PredictedBlock) -> str:
    return (
        f"{axis}: the settings are for samples whose temperature is compensated, by {slope:.3g} {unit}/K in this "
        f"record; without that no settings predict it ({_failure(before)})"
    )


def _failure(before: PredictedBlock) -> str:
    failed = [f for f in before.forecasts if not f.passes]
    return (
        f"the Allan deviation is predicted {before.curve.worst:.2f} times at {before.curve.worst_tau:.3g} s"
        if not failed
        else f"the error over {failed[0].horizon:g} s is {failed[0].ratio:.2f} of what is predicted"
    )


def _coefficient(terms: Sequence[TermEstimate], name: str, parameter: str) -> float:
    term = next((term for term in terms if term.name == name and term.present), None)
    return 0.0 if term is None else float(term.coefficients[parameter].value or 0.0)


def _block(channel: ChannelNoise) -> NoiseBlock:
    return NoiseBlock(
        channel.white_density,
        channel.markov,
        channel.random_walk_density,
        _coefficient(channel.identified, "quantization", "increment_sd"),
    )


def _with_block(channel: ChannelNoise, found: PredictedBlock) -> ChannelNoise:
    block = found.block
    return replace(
        channel,
        white_density=block.white_density,
        markov=block.states,
        random_walk_density=block.random_walk_density,
        handling=dict.fromkeys(channel.handling, FITTED),
    )


def _notes(channel: ChannelNoise, found: PredictedBlock) -> list[str]:
    """Say where the settings of an axis do not come from its identified terms, and where they do not predict it."""
    notes, axis = [], channel.axis
    if found.source is not BlockSource.LIKELIHOOD and found.rejected is not None:
        failed = [f for f in found.rejected_forecasts if not f.passes]
        why = (
            f"these predict {found.rejected.worst:.2f} times the measured Allan deviation "
            f"at {found.rejected.worst_tau:.3g} s"
            if not found.rejected.passes or not failed
            else f"the error over {failed[0].horizon:g} s is {failed[0].ratio:.2f} of what they predict"
        )
        notes.append(
            f"{axis}: the settings are fitted to the Allan curve, not made from the identified terms: {why}; "
            f"N is {found.block.white_density / channel.white_density:.3g} of that of the terms"
        )
    if not found.curve.passes:
        notes.append(
            f"{axis}: no sum of white noise, bias states and random walk predicts the Allan curve: "
            f"{found.curve.worst:.2f} of the measured deviation at {found.curve.worst_tau:.3g} s; "
            "compensate the temperature, or cut out what moves: --begin S, --end S"
        )
    notes += [
        f"{axis}: the error over {f.horizon:g} s is {f.ratio:.2f} of what the settings predict "
        f"({f.lowest:.2f} … {f.highest:.2f} is expected)"
        for f in found.forecasts
        if not f.passes
    ]
    return notes
