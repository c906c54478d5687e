"""The noise of a sensor, axis by axis, and what to enter in filters: the tables of `identify` and `tune`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rich.table import Table

from tuner.exporters.dialect import Target
from tuner.exporters.triad_values import longest_time, triad, walk, white
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, with_interval
from tuner.synthesis.equivalent_models import equivalent_noise
from tuner.synthesis.prediction import FITTED
from tuner.types import ChannelNoise, Coefficient, FilterConfig, Identification
from tuner.types.borrowed import BORROWED, borrowed

WHITE, FLICKER, WALK = "white.density", "bias_instability.level", "random_walk.density"
NAMES = {
    WHITE: "white noise",
    FLICKER: "bias instability B",
    WALK: "bias random walk",
    "gauss_markov.sd": "Gauss–Markov sd",
    "gauss_markov.time_constant": "correlation time",
    "quantization.increment_sd": "quantization",
    "ramp.rate": "bias ramp",
}
"""Names of coefficients, in the order of their rows; others have that of their term."""
ROUGH, ASSUMED, UNKNOWN = "rough", "*", "–"
"""Behind a number that is fitted to the Allan curve and one that nobody measured, and in place of an unknown one."""
LEGEND = {
    "±": "± ( ): 95 % interval",
    "<": "<: 95 % limit",
    ROUGH: f"{ROUGH}: fitted to the Allan curve of this axis, as the noise terms do not fit; no interval",
    ASSUMED: f"{ASSUMED}: partly ASSUMED or rough",
    UNKNOWN: f"{UNKNOWN}: unknown",
}
PAIR, FADING = "kalibr.yaml", "kf-gins.yaml"
"""Files whose numbers stand beside the measured ones: white noise with a random walk, and with a Gauss–Markov bias."""
WIDEST_CELL = 15
"""Characters of a cell with which three axes have room in a terminal; longer ones have three digits."""
MORE_WHITE_NOISE = 1.05
"""White noise for such a filter ÷ that of the configuration from which the reason is given."""


@dataclass(frozen=True)
class Row:
    """One quantity of one sensor: its label and its cells by column."""

    label: str
    cells: Mapping[str, str]


def measured_table(
    found: Identification,
    config: FilterConfig | None = None,
    curve: Iterable[str] = (),
    *,
    further: bool = True,
) -> Table:
    """Return the measured noise, one column an axis.

    Parameters
    ----------
    found : Identification
        Noise terms.
    config : FilterConfig, optional
        Settings made from them.
    curve : iterable of str, optional
        Axes whose terms do not predict their Allan curve: `config` has numbers that do.
    further : bool, optional
        Whether terms beside white noise, bias instability and random walk are shown.
    """
    fitted = {} if config is None else {axis: config.channels[axis] for axis in curve}
    sensors = _sensors(found)
    rows = [
        row for sensor, axes in sensors.items() for row in _measured(sensor, axes, found, fitted, further)
    ]
    known = "measured" if any(one.span > 0.0 for one in found.channels.values()) else "stated"
    letters = list(dict.fromkeys(letter for axes in sensors.values() for letter in axes))
    if _alike(rows, letters):
        return _table(rows, {letters[0]: f"{known}, each axis"})
    return _table(rows, {letter: f"{known} {letter}" for letter in letters})


def entries_table(config: FilterConfig, files: Iterable[str]) -> Table | None:
    """Return what to enter in filters that read `PAIR` and `FADING`, of those that are written; None for none."""
    entered = [name for name in (PAIR, FADING) if name in files]
    sensors = dict.fromkeys(channel.axis.rpartition("_")[0] for channel in config.channels.values())
    rows = [row for sensor in sensors for row in _entered(sensor, config, entered)]
    if not rows:
        return None
    heads = {PAIR: f"to enter:\n{PAIR}"} if PAIR in entered else {}
    if FADING in entered:
        letters = list(dict.fromkeys(channel.axis.rpartition("_")[2] for channel in config.channels.values()))
        columns = [f"{FADING} {letter}" for letter in letters]
        if _alike(rows, columns):
            heads[columns[0]] = f"{FADING},\neach axis"
        else:
            names = [FADING, *[""] * (len(columns) - 1)]
            heads |= {c: f"{n}\n{x}" for c, n, x in zip(columns, names, letters, strict=True)}
    return _table(rows, heads)


def _alike(rows: Iterable[Row], columns: Sequence[str]) -> bool:
    """Return whether several columns have the same cells."""
    return len(columns) > 1 and all(
        row.cells.get(c) == row.cells.get(columns[0]) for row in rows for c in columns
    )


def _table(rows: Iterable[Row], heads: Mapping[str, str]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    for head in ("", *heads.values()):
        table.add_column(head, no_wrap=True)
    for row in rows:
        table.add_row(row.label, *(row.cells.get(column, "") for column in heads))
    return table


def states_tables(config: FilterConfig) -> list[Table]:
    """Return the states of the filter of noise.yaml, a table a sensor and a row an axis."""
    tables: dict[str, Table] = {}
    for channel in config.channels.values():
        white, level, walk = (pretty(customary_unit(q, channel.unit)) for q in (WHITE, "level", WALK))
        table = tables.setdefault(channel.unit, Table(box=None, padding=(0, 2, 0, 0)))
        if not table.columns:
            table.add_column("states of noise.yaml")
            table.add_column(f"white noise,\n{white}")
            table.add_column(f"bias sd, {level},\nat correlation time, s", min_width=20)
            table.add_column(f"bias random walk,\n{walk}")
            table.add_column(f"turn-on sd,\n{level}")
        times: dict[str, list[str]] = {}
        for state in channel.markov:
            sd = (
                digits(in_customary(state.sd, "level", channel.unit)) + ASSUMED * channel.states_rest_on_limit
            )
            times.setdefault(sd, []).append(f"{state.time_constant:.3g}")
        numbers = (
            (channel.white_density, WHITE, channel.white_rests_on_limit),
            (channel.random_walk_density, WALK, channel.walk_rests_on_limit),
            (channel.constant_sd, "level", False),
        )
        density, random_walk, constant = (
            digits(in_customary(value, name, channel.unit)) + ASSUMED * on_limit if value else UNKNOWN
            for value, name, on_limit in numbers
        )
        states = "; ".join(f"{sd} at {', '.join(at)}" for sd, at in times.items()) or UNKNOWN
        table.add_row(channel.axis.replace("_", " "), density, states, random_walk, constant)
    return list(tables.values())


def legend(*tables: Table) -> str:
    """Return what the signs of tables mean, those that occur."""
    cells = [str(cell) for table in tables for column in table.columns[1:] for cell in column.cells]
    signs = {sign for sign in LEGEND if any(sign in cell for cell in cells)}
    signs |= {"±"} if any("(" in cell for cell in cells) else set()
    return "; ".join(text for sign, text in LEGEND.items() if sign in signs)


def more_white_noise(config: FilterConfig, files: Iterable[str]) -> str:
    """Return why the files of other filters have more white noise than was measured; empty where they have not."""
    channels = config.channels.values()
    if PAIR not in files or not any(
        equivalent_noise(c).white_density > MORE_WHITE_NOISE * c.white_density for c in channels
    ):
        return ""
    return (
        "More white noise is entered than measured: these filters have no state for bias instability. Enlarge nothing, "
        "but for vibration. Files have their own units"
    )


def _sensors(found: Identification) -> dict[str, dict[str, str]]:
    """Return the axes of each sensor by their letter."""
    sensors: dict[str, dict[str, str]] = {}
    for axis in found.channels:
        sensor, _, letter = axis.rpartition("_")
        sensors.setdefault(sensor or axis, {})[letter] = axis
    return sensors


def _measured(
    sensor: str,
    axes: Mapping[str, str],
    found: Identification,
    fitted: Mapping[str, ChannelNoise],
    further: bool,
) -> list[Row]:
    """Return the rows of a sensor: white noise, bias instability and random walk, and `further` terms of an axis."""
    cells: dict[tuple[str, int], dict[str, str]] = {(name, 0): {} for name in (WHITE, FLICKER, WALK)}
    unit = next(iter(found.channels[axis].unit for axis in axes.values()))
    lent = found.source.get(BORROWED, {})
    for letter, axis in axes.items():
        if axis in fitted:
            channel = fitted[axis]
            for name, value in ((WHITE, channel.white_density), (WALK, channel.random_walk_density)):
                cells[name, 0][letter] = (
                    f"{digits(in_customary(value, name, unit))} {ROUGH}" if value else UNKNOWN
                )
            continue
        seen: Counter[str] = Counter()
        for term in found.channels[axis].terms:
            for field, one in term.coefficients.items():
                name = f"{term.name}.{field}"
                if (name, 0) in cells or (further and one.value is not None):
                    others = axis in lent and one.value is not None and one.interval is None
                    cells.setdefault((name, seen[name]), {})[letter] = (
                        UNKNOWN if others else _cell(one, name, unit)
                    )
                    seen[name] += 1
    order = list(NAMES)
    places = {key: (order.index(key[0]) if key[0] in order else len(order), key[1]) for key in cells}
    return [
        Row(_label(sensor, name, unit), {letter: own.get(letter, UNKNOWN) for letter in axes})
        for (name, _), own in sorted(cells.items(), key=lambda one: places[one[0]])
    ]


def _entered(sensor: str, config: FilterConfig, files: Iterable[str]) -> list[Row]:
    """Return the rows of what is entered for a sensor."""
    channels = triad(config, sensor)
    if not channels:
        return []
    unit, time, target = channels[0].unit, longest_time(config), Target(config.interval)
    rows: dict[str, dict[str, str]] = {WHITE: {}, WALK: {}, "level": {}}
    lent = borrowed(config)
    assumed = {
        c.axis: c.walk_rests_on_limit
        or c.states_rest_on_limit
        or c.axis in lent
        or FITTED in c.handling.values()
        for c in channels
    }
    if PAIR in files:
        rows[WHITE][PAIR] = digits(in_customary(white(channels, "").value, WHITE, unit))
        rows[WALK][PAIR] = digits(in_customary(walk(channels, "", target).value, WALK, unit)) + ASSUMED * any(
            assumed.values()
        )
    if FADING in files:
        for channel in channels:
            column = f"{FADING} {channel.axis.rpartition('_')[2]}"
            one = equivalent_noise(channel, memory=target.memory, fading_time=time)
            rows[WHITE][column] = digits(in_customary(one.white_density, WHITE, unit))
            rows["level"][column] = (
                digits(in_customary(one.bias, "level", unit)) + ASSUMED * assumed[channel.axis]
            )
    labels = {name: _label(sensor, name, unit) for name in (WHITE, WALK)}
    labels["level"] = f"{sensor} bias sd, {pretty(customary_unit('level', unit))}, T {digits(time)} s"
    return [Row(labels[name], cells) for name, cells in rows.items() if cells]


def _label(sensor: str, name: str, unit: str) -> str:
    """Return sensor, quantity and unit."""
    words = NAMES.get(name, name.replace(".", " ").replace("_", " "))
    return f"{sensor} {words}, {pretty(customary_unit(name, unit))}".removesuffix(", ")


def _cell(one: Coefficient, name: str, unit: str) -> str:
    """Return a number with its interval, the limit of what was not seen, or that nothing is known."""
    if one.value is None:
        return UNKNOWN if one.upper is None else f"< {digits(in_customary(one.upper, name, unit))}"
    value = in_customary(one.value, name, unit)
    if one.interval is None:
        return digits(value)
    low, high = (in_customary(end, name, unit) for end in one.interval)
    text = with_interval(value, low, high, between="–").replace(" ± ", " ±")
    if len(text) <= WIDEST_CELL:
        return text
    if "±" in text:
        return f"{digits(value)} ±{digits(0.5 * (high - low), 1)}"
    return f"{digits(value)} ({digits(low)}–{digits(high)})"
