"""Identified noise in tables: each axis of a log, logs pooled, and a GNSS receiver at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table

from tuner.formats.customary_units import (
    customary_unit,
    digits,
    in_customary,
    phrase,
    pretty,
    symbol,
    term_title,
)
from tuner.identification.gnss_receiver import ReceiverErrors
from tuner.report.alike_sentences import alike_sentences
from tuner.report.coefficient_text import LEVEL_NAMES
from tuner.types import (
    ChannelIdentification,
    Coefficient,
    Identification,
    PooledChannel,
)

SENSOR_TITLES = {"rad/s": "Gyro", "m/s^2": "Accelerometer"}


def identification_tables(identification: Identification) -> list[Table | str]:
    """Return what was assumed of the log, one table a sensor, the reasons of the bounds and the warnings."""
    channels = list(identification.channels.values())
    answer: list[Table | str] = [f"  {text}" for text in identification.source.get("assumptions", ())]
    for unit in dict.fromkeys(c.unit for c in channels):
        answer.append(_sensor_table([c for c in channels if c.unit == unit]))
    reasons = (
        (f"{symbol(name)}: {c.reason}", channel.axis)
        for channel in channels
        for name, c in _coefficients(channel)
        if c.value is None and c.reason
    )
    answer += [f"  {line}" for line in alike_sentences(reasons)]
    warnings = ((text, channel.axis) for channel in channels for text in channel.warnings)
    answer += [f"  warning: {line}" for line in alike_sentences(warnings)]
    answer += [f"  note: {note}" for note in identification.notes]
    return answer


def pooled_tables(pooled: Mapping[str, PooledChannel], names: Sequence[str]) -> list[Table | str]:
    """Return one table an axis or triad: pooled value, spread, test of equality, each value."""
    answer: list[Table | str] = []
    for channel in pooled.values():
        rows = [*channel.coefficients, *([channel.mean] if channel.mean else [])]
        triad = channel.mean is None and channel.axis in {a.rpartition("_")[0] for a in pooled}
        members = [a for a in pooled if a.startswith(f"{channel.axis}_")] if triad else list(names)
        table = Table(title=f"{channel.axis}: {len(members)} {'axes' if triad else 'records'} pooled")
        for head in ("", "pooled (95 % interval)", "spread between them", "all equal? p", *members):
            table.add_column(head, justify="right" if head else "left")
        for row in rows:
            quantity = "level" if row.name == "mean" else row.name
            cells = [
                "–" if v is None else digits(in_customary(v, quantity, channel.unit), 4) for v in row.values
            ]
            label = f"{symbol(row.name)}, {pretty(customary_unit(quantity, channel.unit))}"
            table.add_row(
                label,
                phrase(row.value, quantity, channel.unit, with_unit=False),
                _spread(row.spread, channel.unit),
                f"{row.p_value:.2g}",
                *cells,
            )
        answer.append(table)
        answer += [f"  {symbol(row.name)}: {row.value.reason}" for row in rows if row.value.reason]
    return answer


def _spread(spread: Coefficient, unit: str) -> str:
    if spread.unit != "relative":
        return phrase(spread, "level", unit, with_unit=False)
    if spread.value is not None and spread.interval is None:
        return f"{digits(100 * spread.value, 2)} %"
    if spread.value is None or spread.interval is None:
        return f"< {digits(100 * (spread.upper or 0.0), 2)} %"
    low, high = spread.interval
    return f"{digits(100 * spread.value, 2)} ({digits(100 * low, 2)} … {digits(100 * high, 2)}) %"


def _coefficients(channel: ChannelIdentification) -> list[tuple[str, Coefficient]]:
    return [(f"{e.name}.{field}", c) for e in channel.terms for field, c in e.coefficients.items()]


def _sensor_table(channels: Sequence[ChannelIdentification]) -> Table:
    unit = channels[0].unit
    first = channels[0]
    title = SENSOR_TITLES.get(unit, unit)
    table = Table(
        title=f"{title}: {digits(1 / first.interval, 6)} Hz, {digits(first.span / 3600)} h, by {first.method}"
    )
    table.add_column("")
    for channel in channels:
        table.add_column(channel.axis, justify="right")
    names = dict.fromkeys(name for c in channels for name, _ in _coefficients(c))
    for name in names:
        cells = []
        for channel in channels:
            found = dict(_coefficients(channel)).get(name)
            cells.append("–" if found is None else phrase(found, name, unit, with_unit=False))
        title = term_title(name.split(".")[0])
        head = f"{symbol(name)}{f'  {title}' if title else ''}, {pretty(customary_unit(name, unit))}"
        table.add_row(head, *cells)
    table.add_section()
    level = pretty(customary_unit("level", unit))
    for head, level_of in LEVEL_NAMES.items():
        values: list[Coefficient] = [getattr(channel, head) for channel in channels]
        table.add_row(f"{level_of}, {level}", *(phrase(v, "level", unit, with_unit=False) for v in values))
    table.add_row("… at τ, s", *(digits(c.minimum_tau) for c in channels))
    table.add_row("time-series model", *(_arma(c) for c in channels))
    return table


def _arma(channel: ChannelIdentification) -> str:
    if channel.arma is None:
        return "–"
    if channel.arma.white:
        return "not distinguishable from white"
    p, q = channel.arma.order
    return f"ARMA({p},{q}) by {channel.arma.criterion.upper()}"


_NAMES = {"white_sd": "white", "sd": "Gauss–Markov", "time_constant": "time constant"}


def receiver_lines(found: ReceiverErrors) -> list[str]:
    """Return a line an axis, with intervals, and the notes."""
    lines = [
        f"  position {axis}: "
        + ", ".join(f"{_NAMES[name]} {_number(coefficient)}" for name, coefficient in parts.items())
        for axis, parts in found.position.items()
    ]
    lines += [f"  velocity {axis}: white {_number(c)}" for axis, c in found.velocity.items()]
    return lines + [f"  {note}" for note in found.notes]


def _number(coefficient: Coefficient) -> str:
    assert coefficient.interval is not None
    low, high = coefficient.interval
    return f"{coefficient.value:.3g} {coefficient.unit} ({low:.3g} … {high:.3g})"
