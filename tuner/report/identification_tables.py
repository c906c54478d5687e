"""Identified noise in tables: each axis of a log, logs pooled, and a GNSS receiver at rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.table import Table

from tuner.formats.customary_units import (
    amount,
    customary_unit,
    digits,
    in_customary,
    phrase,
    pretty,
    symbol,
    term_title,
)
from tuner.formats.grouping import gathered
from tuner.identification.gnss_receiver import ReceiverErrors
from tuner.report.alike_sentences import alike_sentences
from tuner.report.coefficient_text import LEVEL_NAMES, coefficients_of
from tuner.report.series_model_tables import series_tables
from tuner.report.titled_table import titled_table
from tuner.types import ChannelIdentification, Coefficient, Identification, PooledChannel

SENSOR_TITLES = {"rad/s": "Gyro", "m/s^2": "Accelerometer"}
UNKNOWN = Coefficient(None, None, None, "")


def identification_tables(identification: Identification) -> list[Table | str]:
    """Return what was assumed of the log, one table a sensor, the reasons of the bounds and the notes."""
    sensors = gathered((channel.unit, channel) for channel in identification.channels.values())
    reasons = (
        (f"{symbol(name)}: {c.reason}", channel.axis)
        for channel in identification.channels.values()
        for (name, _), c in coefficients_of(channel).items()
        if c.value is None and c.reason
    )
    return [
        *(f"  {text}" for text in identification.source.get("assumptions", ())),
        *(part for channels in sensors.values() for part in _sensor_tables(channels)),
        *(f"  {line}" for line in alike_sentences(reasons)),
        *(f"  {note}" for note in identification.notes),
    ]


def _sensor_tables(channels: Sequence[ChannelIdentification]) -> list[Table | str]:
    """Return the terms of the axes of a sensor, and their ARMA models."""
    first = channels[0]
    title = f"{digits(1 / first.interval, 6)} Hz, {digits(first.span / 3600)} h, by {first.method}"
    heads = ["", *(channel.axis for channel in channels)]
    terms = titled_table(f"{SENSOR_TITLES.get(first.unit, first.unit)}: {title}", heads, _rows(channels))
    return [*terms, *series_tables(channels)]


def _rows(channels: Sequence[ChannelIdentification]) -> Iterator[list[str]]:
    """Yield every coefficient of every term of the axes of a sensor, and their levels."""
    unit = channels[0].unit
    each = [coefficients_of(channel) for channel in channels]
    for name, which in dict.fromkeys(key for own in each for key in own):
        found = [own.get((name, which), UNKNOWN) for own in each]
        title = f"  {term_title(name.partition('.')[0])}".rstrip()
        yield _row(f"{symbol(name)}{title}", name, unit, found)
    for level, head in LEVEL_NAMES.items():
        yield _row(head, "level", unit, [getattr(channel, level) for channel in channels])
    yield ["… at τ, s", *(digits(c.minimum_tau) for c in channels)]


def _row(head: str, quantity: str, unit: str, found: Sequence[Coefficient]) -> list[str]:
    """Return coefficients of several axes behind their name and customary unit."""
    numbers = (phrase(one, quantity, unit, with_unit=False) for one in found)
    return [f"{head}, {pretty(customary_unit(quantity, unit))}", *numbers]


def pooled_tables(pooled: Mapping[str, PooledChannel], names: Sequence[str]) -> list[Table | str]:
    """Return one table an axis or triad: pooled value, spread, test of equality, each value."""
    answer: list[Table | str] = []
    for channel in pooled.values():
        coefficients = [*channel.coefficients, *([channel.mean] if channel.mean else [])]
        triad = channel.mean is None and channel.axis in {a.rpartition("_")[0] for a in pooled}
        members = [a for a in pooled if a.startswith(f"{channel.axis}_")] if triad else list(names)
        rows = []
        for one in coefficients:
            quantity = "level" if one.name == "mean" else one.name
            pooled_value = _row(symbol(one.name), quantity, channel.unit, [one.value])
            values = (
                "–" if v is None else digits(in_customary(v, quantity, channel.unit), 4) for v in one.values
            )
            relative = one.spread.unit == "relative"
            spread = amount(one.spread) if relative else phrase(one.spread, quantity, channel.unit)
            rows.append([*pooled_value, spread, f"{one.p_value:.2g}", *values])
        answer += titled_table(
            f"{channel.axis}: {len(members)} {'axes' if triad else 'records'} pooled",
            ["", "pooled (95 % interval)", "spread between them", "all equal? p", *members],
            rows,
        )
        answer += [f"  {symbol(one.name)}: {one.value.reason}" for one in coefficients if one.value.reason]
    return answer


_NAMES = {"white_sd": "white", "sd": "Gauss–Markov", "time_constant": "time constant"}


def receiver_lines(found: ReceiverErrors) -> list[str]:
    """Return a line an axis, with intervals, and the notes."""
    return [
        *(
            f"  position {axis}: " + ", ".join(f"{_NAMES[name]} {amount(c)}" for name, c in parts.items())
            for axis, parts in found.position.items()
        ),
        *(f"  velocity {axis}: white {amount(c)}" for axis, c in found.velocity.items()),
        *(f"  {note}" for note in found.notes),
    ]
