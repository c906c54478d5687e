"""All channels of a log: each axis on its own, then the Earth rate in the means of three gyros."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tuner.identification.arma import MAX_ORDER, MIN_SAMPLES, Criterion, fit_arma
from tuner.identification.estimates import BASE
from tuner.identification.identify_channel import identify_channel, single_axis
from tuner.identification.mean_and_earth_rate import without_earth_rate
from tuner.identification.objective import expect_terms
from tuner.jobs import each
from tuner.readers.source_kind import with_name
from tuner.segments.conditions import too_short_for
from tuner.types import ChannelIdentification, Identification
from tuner.types.arguments import expect_records
from tuner.types.number_ranges import ArmaOrder, Latitude
from tuner.types.public import public
from tuner.types.records import DataError, Record

IDENTIFICATION_COLUMNS = 8
"""Columns of a record that the identification of one axis takes; six were measured."""


@public("identify")
def identify(
    records: Sequence[Record],
    *,
    terms: Sequence[str] | None = None,
    method: str = "likelihood",
    arma: Criterion | None = "bic",
    arma_orders: ArmaOrder = MAX_ORDER,
    latitude: Latitude | None = None,
) -> Identification:
    """Identify the noise of every channel of a log.

    Parameters
    ----------
    records : sequence of Record
        Sensors at rest, such as gyro and accelerometer of one unit; no two channels of one name.
    terms : sequence of str, optional
        Fit exactly this sum of terms to every channel instead of choosing one.
    method : str
        Where the coefficients come from: ``likelihood``, ``leastsquares`` or ``slopes``.
    arma : str, optional
        What chooses the order of the ARMA model beside the sum of terms: ``bic``, ``aic``, or None for no such model.
    arma_orders : int
        Highest order on either side that is compared, 1 to 5.
    latitude : float, optional
        Degrees; takes the Earth's vertical rate out of the gyro means.

    Returns
    -------
    Identification

    Raises
    ------
    DataError
        If all channels are constant or too short, a channel comes twice, or no record is fitted by the terms.
    ValueError
        If the method is unknown.
    """
    expect_terms(terms)
    records = expect_records(records, "identify")
    varying: dict[str, Record] = {}
    notes: list[str] = []
    for record in records:
        for axis in record.axes:
            if axis in varying:
                where = record.source or record.name
                raise DataError(f"{where}: channel '{axis}' comes twice: identify each sensor on its own")
            if np.ptp(record.column(axis)) == 0.0:
                notes.append(f"{axis} is constant and was left out")
                continue
            varying[axis] = record
    if not varying:
        where = ", ".join(dict.fromkeys(record.source or record.name for record in records))
        raise DataError(f"{where}: expected a channel that varies, all are constant: nothing to identify")

    def identified(axis: str) -> ChannelIdentification:
        channel = identify_channel(varying[axis], axis, terms=terms, method=method)
        return channel if arma is None else with_series_model(channel, varying[axis], arma, arma_orders)

    need = IDENTIFICATION_COLUMNS * 8.0 * max(map(len, varying.values()))
    channels = dict(zip(varying, each(identified, list(varying), memory=need), strict=True))
    channels, about_earth = _earth(channels, latitude)
    return Identification(_source(records), channels, (*notes, *about_earth))


def with_series_model(
    channel: ChannelIdentification, record: Record, criterion: Criterion, highest: int
) -> ChannelIdentification:
    """Return the noise of an axis with its time-series model, where a stretch of the record is long enough for one."""
    single = single_axis(record, channel.axis)
    pieces = single.pieces(channel.axis)
    if max(map(len, pieces)) < MIN_SAMPLES:
        return channel
    return replace(
        channel,
        arma=fit_arma(pieces, single.interval, single.unit, criterion=criterion, highest=highest),
    )


def with_terms_found(
    records: Sequence[Record],
    identification: Identification,
    found: Mapping[str, Sequence[str]],
) -> Identification:
    """Return an identification whose terms are chosen beside those that a diagnosis found.

    Parameters
    ----------
    records : sequence of Record
        What was identified.
    identification : Identification
        Noise of the terms of the base.
    found : mapping of str to sequence of str
        Further terms by axis, ``sinusoid`` or ``gauss_markov``; a term that the data do not allow beside the others
        is left out, and a warning says so.
    """
    channels = identification.channels

    def again(place: tuple[Record, str]) -> ChannelIdentification:
        record, axis = place
        before, further = channels[axis], found[axis]
        after = identify_channel(record, axis, further=further, method=before.method)
        if absent := _absent(after, further):
            names = ", ".join(_in_words(name) for name in absent)
            about = f"{names} {BY_DIAGNOSIS}, but beside the other terms the data allow none"
            return replace(before, warnings=(*before.warnings, about))
        changes = _changed(before, after, further)
        return replace(after, mean=before.mean, arma=before.arma, warnings=(*after.warnings, *changes))

    changed = [
        (record, axis) for record in records for axis in record.axes if axis in channels and found.get(axis)
    ]
    new = {axis: channel for (_, axis), channel in zip(changed, each(again, changed), strict=True)}
    return replace(identification, channels={**channels, **new})


BY_DIAGNOSIS = "was found by the diagnosis"
"""What is said of a term that the diagnosis, not the choice of terms, brought in."""
CHANGE_WORTH_SAYING = 0.02
"""Relative change of a coefficient from which it is reported: the accuracy with which most records estimate N."""


def _changed(
    before: ChannelIdentification, after: ChannelIdentification, further: Sequence[str]
) -> tuple[str, ...]:
    """Name what the terms that the diagnosis found did to the coefficients that were identified without them."""
    changes = []
    for term in BASE:
        was, now = _amplitude(before, term), _amplitude(after, term)
        if was is None and now is None:
            continue
        if was is None or now is None:
            changes.append(f"{_in_words(term)} {'absent' if now is None else 'present'}")
        elif abs(now / was - 1.0) > CHANGE_WORTH_SAYING:
            changes.append(f"{_in_words(term)} × {now / was:.3g}")
    names = ", ".join(_in_words(name) for name in dict.fromkeys(further))
    return (f"{names} {BY_DIAGNOSIS}: {', '.join(changes)}",) if changes else ()


def _in_words(term: str) -> str:
    """Return the name of a term as it is written in a sentence."""
    return "Gauss–Markov process" if term == "gauss_markov" else term.replace("_", " ")


def _amplitude(channel: ChannelIdentification, name: str) -> float | None:
    found = next((term for term in channel.terms if term.name == name and term.present), None)
    return None if found is None else next(iter(found.coefficients.values())).value


def _absent(channel: ChannelIdentification, further: Sequence[str]) -> list[str]:
    """Return the further terms of which fewer are present than were given.

    A process whose correlation time has no upper limit is a random walk, which is another term.
    """
    present = [
        term.name
        for term in channel.terms
        if term.present
        and all(c.interval is None or np.isfinite(c.interval[1]) for c in term.coefficients.values())
    ]
    return [name for name in dict.fromkeys(further) if present.count(name) < list(further).count(name)]


def _earth(
    channels: dict[str, ChannelIdentification], latitude: float | None
) -> tuple[dict[str, ChannelIdentification], list[str]]:
    """Return the channels with the Earth's rate, as far as it is known, subtracted from the gyro means."""
    gyros = {axis: c.mean for axis, c in channels.items() if c.unit == "rad/s"}
    if not gyros:
        return channels, []
    accels = [c.mean.value for c in channels.values() if c.unit == "m/s^2"]
    force = np.array(accels, dtype=float) if len(accels) == 3 else None
    means, note = without_earth_rate(gyros, force, latitude)
    changed = {axis: replace(c, mean=means.get(axis, c.mean)) for axis, c in channels.items()}
    return changed, [note]


def _source(records: Sequence[Record]) -> dict[str, object]:
    """Return where the channels came from."""
    first = records[0]
    return {
        "name": (first.source and with_name(Path(first.source)).name.split(".")[0]) or first.name,
        "files": list(dict.fromkeys(record.source for record in records if record.source)),
        "digests": list(dict.fromkeys(record.digest for record in records if record.digest)),
        "sensors": [
            {
                "name": record.name,
                "axes": list(record.axes),
                "rate_hz": record.rate * record.samples_a_mean,
                "span_s": record.span,
                "segments": len(record.segments),
                "used_s": _used(record),
                "used_share": round(record.span / (len(record) * record.interval), 6),
                "repeated_rows": int(record.timing.get("duplicates", 0.0)),
            }
            for record in records
        ],
        "assumptions": list(dict.fromkeys(text for record in records for text in record.assumptions)),
        "too_short_for": list(dict.fromkeys(text for record in records if (text := too_short_for(record)))),
        "contradicted": list(dict.fromkeys(text for record in records for text in record.contradicted)),
        "repairs": list(dict.fromkeys(note for record in records for note in record.notes)),
    }


def _used(record: Record) -> list[float]:
    """Return begin and end of what is used of a log, s on its clock, and its length, s."""
    first, last = record.segments[0][0], record.segments[-1][1] - 1
    times = (record.t[first], record.t[last] + record.interval, record.t[-1] + record.interval - record.t[0])
    return [round(float(time), 6) for time in times]
