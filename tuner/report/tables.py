"""Tables for the terminal, in customary units; every cell is a value with its interval or a bound."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence

from rich.console import Console
from rich.table import Table

from models.sensors import SensorGrade
from tuner.exporters import Dialect
from tuner.formats.customary_units import (
    SYMBOLS,
    TITLES,
    customary_unit,
    digits,
    in_customary,
    phrase,
    pretty,
)
from tuner.identification.comparison import ComparedCoefficient, Comparison
from tuner.identification.gnss_receiver import ReceiverErrors
from tuner.identification.record_length import Plan
from tuner.types import (
    AllanCurve,
    ChannelIdentification,
    Coefficient,
    Correlogram,
    Identification,
    PooledChannel,
    Spectrum,
)

_LEVELS = {
    "mean": "mean",
    "sigma_10s": "σ(10 s)",
    "minimum": "smallest Allan deviation",
    "floor": "… ÷ 0.664",
}
UNITS = {"gyro": "rad/s", "accel": "m/s^2"}
SENSOR_TITLES = {"rad/s": "Gyro", "m/s^2": "Accelerometer"}


def show(tables: Iterable[Table | str]) -> None:
    """Print tables and lines on standard output, wide enough when it is not a terminal."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 160
    console = Console(width=width, highlight=False, markup=False, emoji=False)
    for table in tables:
        console.print(table)


def identification_tables(identification: Identification) -> list[Table | str]:
    """Return one table a sensor, then the reasons of the bounds and the warnings."""
    channels = list(identification.channels.values())
    answer: list[Table | str] = []
    for unit in dict.fromkeys(c.unit for c in channels):
        answer.append(_sensor_table([c for c in channels if c.unit == unit]))
    for text, axes in _gather(
        (f"{_symbol(name)}: {c.reason}", channel.axis)
        for channel in channels
        for name, c in _coefficients(channel)
        if c.value is None and c.reason
    ).items():
        answer.append(f"  {text}  [{', '.join(axes)}]")
    for text, axes in _gather((w, channel.axis) for channel in channels for w in channel.warnings).items():
        answer.append(f"  warning: {text}  [{', '.join(axes)}]")
    answer += [f"  note: {note}" for note in identification.notes]
    return answer


def curve_tables(curve: AllanCurve, axis_quantity: str = "level") -> list[Table | str]:
    """Return one Allan-type curve: cluster time, deviation with its 95 % interval, degrees of freedom."""
    unit = pretty(customary_unit(axis_quantity, curve.unit))
    table = Table(title=f"{curve.estimator}, deviation in {unit} (95 % interval), degrees of freedom")
    table.add_column("τ, s", justify="right")
    for axis in curve.axes:
        table.add_column(axis, justify="right")
    deviation, (low, high) = curve.deviation(), curve.interval()
    for i, tau in enumerate(curve.tau):
        cells = []
        for j in range(len(curve.axes)):
            value, a, b = (
                digits(in_customary(float(x[i, j]), axis_quantity, curve.unit))
                for x in (deviation, low, high)
            )
            cells.append(f"{value} ({a} … {b})  {digits(float(curve.dof[i, j]))}")
        table.add_row(digits(float(tau), 5), *cells)
    return [table]


def plan_tables(plan: Plan, unit: str, title: str) -> list[Table | str]:
    """Return what a planned test shows of each term, and the cluster rule."""
    table = Table(title=f"{title}: {digits(plan.hours)} h, wanted accuracy {100 * plan.accuracy:g} %")
    for head in ("term", "assumed", "best possible sd", "shown?", "hours for the wanted accuracy"):
        table.add_column(head, justify="left" if head == "term" else "right")
    for p in plan.parameters:
        value = f"{digits(in_customary(p.value, p.name, unit))} {pretty(customary_unit(p.name, unit))}"
        hours = "more than 10 000" if p.hours is None else digits(p.hours)
        spread = f"{digits(100 * p.relative_sd, 2)} %" if p.relative_sd < 10 else "> 1000 %"
        table.add_row(_symbol(p.name), value, spread, "yes" if p.shown else "no: only a bound", hours)
    rule = (
        f"  cluster rule: {100 * plan.accuracy:g} % on a single Allan point needs {plan.clusters} clusters, "
        f"here up to τ = {digits(plan.longest_tau)} s"
    )
    return [table, rule]


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
            label = f"{_symbol(row.name)}, {pretty(customary_unit(quantity, channel.unit))}"
            table.add_row(
                label,
                phrase(row.value, quantity, channel.unit, with_unit=False),
                _spread(row.spread, channel.unit),
                f"{row.p_value:.2g}",
                *cells,
            )
        answer.append(table)
    return answer


def _spread(spread: Coefficient, unit: str) -> str:
    if spread.unit != "relative":
        return phrase(spread, "level", unit, with_unit=False)
    if spread.value is None or spread.interval is None:
        return f"< {digits(100 * (spread.upper or 0.0), 2)} %"
    low, high = spread.interval
    return f"{digits(100 * spread.value, 2)} ({digits(100 * low, 2)} … {digits(100 * high, 2)}) %"


def _symbol(name: str) -> str:
    return SYMBOLS.get(name, name.replace(".", " "))


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
        head = f"{_symbol(name)}  {TITLES.get(name.split('.')[0], '')}, {pretty(customary_unit(name, unit))}"
        table.add_row(head, *cells)
    table.add_section()
    level = pretty(customary_unit("level", unit))
    for head, level_of in _LEVELS.items():
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


def _gather(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    gathered: dict[str, list[str]] = {}
    for text, axis in pairs:
        if axis not in gathered.setdefault(text, []):
            gathered[text].append(axis)
    return gathered


def statistic_tables(found: AllanCurve | Spectrum | Correlogram) -> list[Table | str]:
    """Return the table of any empirical curve."""
    if isinstance(found, AllanCurve):
        return curve_tables(found)
    if isinstance(found, Spectrum):
        return [_spectrum_table(found)]
    table = Table(title=f"{found.statistic}, white noise stays within ± {digits(found.band)} at 95 %")
    table.add_column("lag, s", justify="right")
    for axis in found.axes:
        table.add_column(axis, justify="right")
    for lag, row in zip(found.lag, found.value, strict=True):
        table.add_row(digits(float(lag), 5), *(f"{value:+.4f}" for value in row))
    return [table]


def _spectrum_table(found: Spectrum) -> Table:
    unit = "(deg/h)²/Hz" if found.unit == "rad/s" else "µg²/Hz"
    scale = in_customary(1.0, "level", found.unit) ** 2
    table = Table(title=f"two-sided power spectral density, {unit} (95 % interval)")
    table.add_column("frequency, Hz", justify="right")
    for axis in found.axes:
        table.add_column(axis, justify="right")
    low, high = found.interval()
    for i, frequency in enumerate(found.frequency):
        cells = [
            " ".join(
                (
                    digits(scale * float(found.density[i, j])),
                    f"({digits(scale * float(low[i, j]))} … {digits(scale * float(high[i, j]))})",
                )
            )
            for j in range(len(found.axes))
        ]
        table.add_row(digits(float(frequency), 4), *cells)
    return table


def comparison_tables(comparison: Comparison) -> list[Table | str]:
    """Return one table an axis; the last column says whether the last source differs from the first."""
    answer: list[Table | str] = []
    for axis, rows in comparison.axes.items():
        unit = comparison.units[axis]
        table = Table(title=axis)
        for head in ("", *comparison.names, f"{comparison.names[-1]} ÷ {comparison.names[0]}"):
            table.add_column(head, justify="right" if head else "left")
        for row in rows:
            quantity = row.name if "." in row.name else "level"
            label = f"{_LEVELS.get(row.name) or _symbol(row.name)}, {pretty(customary_unit(quantity, unit))}"
            cells = ["–" if v is None else phrase(v, quantity, unit, with_unit=False) for v in row.values]
            table.add_row(label, *cells, _ratio(row))
        answer.append(table)
    return answer


def _ratio(row: ComparedCoefficient) -> str:
    if row.ratio is None:
        return {None: "–", True: "differs", False: "agrees"}[row.differs]
    if row.ratio_interval is None:
        return f"{digits(row.ratio)} (no interval)"
    low, high = row.ratio_interval
    return f"{digits(row.ratio)} ({digits(low)} … {digits(high)}) {'differs' if row.differs else 'agrees'}"


def grade_tables(grades: Sequence[SensorGrade]) -> list[Table | str]:
    """Return the built-in grades, one a row, in customary units."""
    table = Table(title="Built-in sensor grades (references: configs/sensors)")
    shown = ("white.density", "bias_instability.level", "random_walk.density")
    columns = [(kind, quantity) for kind in UNITS for quantity in shown]
    table.add_column("name")
    table.add_column("sensor")
    for kind, quantity in columns:
        unit = UNITS[kind]
        table.add_column(
            f"{kind} {SYMBOLS[quantity]}, {pretty(customary_unit(quantity, unit))}", justify="right"
        )
    for grade in grades:
        values = {
            (kind, f"{term.name}.{field}"): getattr(term, field)
            for kind in UNITS
            for term in grade.noise_model(kind).terms
            for field in term.PARAMETERS
        }
        cells = [
            "–" if column not in values else digits(in_customary(values[column], column[1], UNITS[column[0]]))
            for column in columns
        ]
        table.add_row(grade.key, grade.title, *cells)
    return [table]


def dialect_tables(dialects: Mapping[str, Dialect]) -> list[Table | str]:
    """Return the dialects `tuner export` writes, with their units."""
    table = Table(title="Dialects of tuner export")
    for head in ("name", "for", "units"):
        table.add_column(head)
    for name, dialect in dialects.items():
        table.add_row(name, dialect.title, dialect.units)
    return [table]


_NAMES = {"white_sd": "white", "sd": "Gauss–Markov", "time_constant": "time constant"}


def receiver_words(found: ReceiverErrors) -> list[str]:
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
