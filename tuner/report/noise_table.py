"""The noise of a sensor, axis by axis, and what to enter in filters: the table of `identify` and `tune`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rich.table import Table

from tuner.exporters.dialect import Target
from tuner.exporters.triad_values import longest_time, triad, walk, white
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, with_interval
from tuner.synthesis.equivalent_models import equivalent_noise
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
    ASSUMED: f"{ASSUMED}: ASSUMED, not measured",
    UNKNOWN: f"{UNKNOWN}: unknown",
}
PAIR, FADING = "kalibr.yaml", "kf-gins.yaml"
"""Files whose numbers stand beside the measured ones: white noise with a random walk, and with a Gauss–Markov bias."""
WIDEST_CELL = 16
"""Characters of a cell with which three axes have room in a terminal; longer ones have three digits."""
MORE_WHITE_NOISE = 1.05
"""White noise for such a filter ÷ that of the configuration from which the reason is given."""


@dataclass(frozen=True)
class Row:
    """One quantity of one sensor: its label and its cells by column."""

    label: str
    cells: Mapping[str, str]


def noise_table(
    found: Identification,
    config: FilterConfig | None = None,
    curve: Iterable[str] = (),
    files: Iterable[str] = (),
) -> Table:
    """Return measured noise, one column an axis, and beside it what to enter in the filters of two files.

    Parameters
    ----------
    found : Identification
        Noise terms.
    config : FilterConfig, optional
        Settings made from them.
    curve : iterable of str, optional
        Axes whose terms do not predict their Allan curve: `config` has numbers that do.
    files : iterable of str, optional
        Files that are written; of `PAIR` and `FADING` among them, the numbers are shown.
    """
    fitted = {} if config is None else {axis: config.channels[axis] for axis in curve}
    sensors = _sensors(found)
    rows = [row for sensor, axes in sensors.items() for row in _measured(sensor, axes, found, fitted)]
    letters = list(dict.fromkeys(letter for axes in sensors.values() for letter in axes))
    known = "measured" if any(one.span > 0.0 for one in found.channels.values()) else "stated"
    columns = _columns(rows, {letter: letter for letter in letters}, known)
    if config is not None and (wanted := [name for name in (PAIR, FADING) if name in files]):
        entries = [row for sensor in sensors for row in _entered(sensor, config, wanted)]
        rows = _merged(rows, entries)
        letters = list(dict.fromkeys(channel.axis.rpartition("_")[2] for channel in config.channels.values()))
        columns |= {PAIR: f"{PAIR}\none a sensor"} if PAIR in wanted else {}
        columns |= (
            _columns(entries, {f"{FADING} {x}": x for x in letters}, FADING) if FADING in wanted else {}
        )
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("", no_wrap=True)
    for head in columns.values():
        table.add_column(head, no_wrap=True)
    for row in rows:
        table.add_row(row.label, *(row.cells.get(column, "") for column in columns))
    return table


def _columns(rows: Iterable[Row], letters: Mapping[str, str], name: str) -> dict[str, str]:
    """Return the heads of columns, one an axis, under a name above the first; one column where all axes are alike."""
    first = next(iter(letters))
    if all(row.cells.get(column) == row.cells.get(first) for row in rows for column in letters):
        return {first: f"{name}\n{' '.join(letters.values())}"}
    return {column: f"{name if column == first else ''}\n{letter}" for column, letter in letters.items()}


def legend(table: Table) -> str:
    """Return what the signs of a table mean, those that occur."""
    cells = [str(cell) for column in table.columns[1:] for cell in column.cells]
    signs = {sign for sign in LEGEND if any(sign in cell for cell in cells)}
    signs |= {"±"} if any("(" in cell for cell in cells) else set()
    return "; ".join(text for sign, text in LEGEND.items() if sign in signs)


def more_white_noise(config: FilterConfig, files: Iterable[str]) -> str:
    """Return why the files of other filters have more white noise than was measured; empty where they have not."""
    if PAIR not in files:
        return ""
    pairs = {axis: equivalent_noise(channel) for axis, channel in config.channels.items()}
    own = {axis: channel.white_density for axis, channel in config.channels.items()}
    if not any(one.white_density > MORE_WHITE_NOISE * own[axis] for axis, one in pairs.items()):
        return ""
    low, high = min(one.mismatch[0] for one in pairs.values()), max(one.mismatch[1] for one in pairs.values())
    return (
        f"{PAIR} and {FADING} have more white noise than the sensor: such filters have no state for bias instability, "
        f"so their two numbers carry it (from 1 to 100 s they predict {low:.2f} to {high:.2f} × its drift). "
        "Do not enlarge them again; vibration of a vehicle is not covered"
    )


def _sensors(found: Identification) -> dict[str, dict[str, str]]:
    """Return the axes of each sensor by their letter."""
    sensors: dict[str, dict[str, str]] = {}
    for axis in found.channels:
        sensor, _, letter = axis.rpartition("_")
        sensors.setdefault(sensor or axis, {})[letter] = axis
    return sensors


def _measured(
    sensor: str, axes: Mapping[str, str], found: Identification, fitted: Mapping[str, ChannelNoise]
) -> list[Row]:
    """Return the rows of a sensor: white noise, bias instability and random walk, and what else an axis has."""
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
                if (name, 0) in cells or one.value is not None:
                    shown = _cell(one, name, unit)
                    assumed = axis in lent and one.value is not None and one.interval is None
                    cells.setdefault((name, seen[name]), {})[letter] = shown + ASSUMED * assumed
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
    assumed = {c.axis: c.walk_rests_on_limit or c.states_rest_on_limit or c.axis in lent for c in channels}
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


def _merged(rows: list[Row], more: list[Row]) -> list[Row]:
    """Return rows with the cells of others of the same label; what has none follows the rows of its sensor."""
    merged = {row.label: dict(row.cells) for row in rows}
    for row in more:
        merged.setdefault(row.label, {}).update(row.cells)
    sensors = list(dict.fromkeys(label.partition(" ")[0] for label in merged))
    return [
        Row(label, merged[label]) for sensor in sensors for label in merged if label.startswith(f"{sensor} ")
    ]


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
    return text if len(text) <= WIDEST_CELL else f"{digits(value)} ({digits(low)}–{digits(high)})"
