"""The noise of a sensor, axis by axis, and what to enter in filters: the tables of `identify` and `tune`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest

from rich.table import Table

from tuner.exporters import kalibr, kf_gins
from tuner.exporters.dialect import Target
from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, with_interval
from tuner.formats.yaml_text import Noted
from tuner.report.coefficient_text import coefficients_of
from tuner.report.titled_table import table_of
from tuner.synthesis.equivalent_models import equivalent_noise
from tuner.synthesis.prediction import FITTED
from tuner.types import ChannelNoise, Coefficient, FilterConfig, Identification
from tuner.types.borrowed import BORROWED, borrowed, white_is_measured

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
ROUGH, HALF, WHOLE, LENT, UNKNOWN = "rough", "half", "limit", "lent", "–"
"""Behind a number that is fitted to the Allan curve, one that is half of a limit, one that is the limit, and one of
another sensor's sheet; in place of an unknown one."""
LEGEND = {
    "±": "± ( ): 95 % interval",
    "<": "<: not seen, 95 % limit",
    HALF: f"{HALF}: has half of it, ASSUMED",
    WHOLE: f"{WHOLE}: is that limit",
    LENT: f"{LENT}: of the sensor named above, ASSUMED",
    ROUGH: f"{ROUGH}: fitted to the Allan curve, as the terms do not fit",
    UNKNOWN: f"{UNKNOWN}: unknown",
}
PAIR, FADING = "kalibr.yaml", "kf-gins.yaml"
"""Files whose numbers stand beside the measured ones: white noise with a random walk, and with a Gauss–Markov bias."""
WIDEST_CELL = 15
"""Characters of a cell with which three axes have room in a terminal; longer ones have fewer digits."""
NARROW_INTERVAL = 0.05
"""Distance of the further end of an interval ÷ value below which a longer cell has that distance alone."""
_FADING_KEYS = {
    "arw": ("gyro", WHITE),
    "gbstd": ("gyro", "level"),
    "vrw": ("accel", WHITE),
    "abstd": ("accel", "level"),
}
"""Keys of `FADING` with their sensor and quantity."""
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
    heads = [f"{known} {letter}" for letter in letters]
    if len(letters) > 1 and all(len({row.cells.get(one) for one in letters}) == 1 for row in rows):
        letters, heads = letters[:1], [f"{known}, each axis"]
    lines = [[row.label, *(row.cells.get(one, "") for one in letters)] for row in rows]
    return table_of(("", *heads), lines, words=1 + len(heads))


def entries_tables(config: FilterConfig, files: Iterable[str]) -> list[Table]:
    """Return what stands in `PAIR` and `FADING`, those of them that are written, by their own keys and units.

    Behind a number is where it comes from if it is not measured; numbers of `PAIR` have their customary units, too.
    """
    target = Target(config.interval)
    tables = []
    if PAIR in files:
        written = kalibr.noise_entries(config, target)
        gyros_first = sorted(written, key=lambda key: (key.startswith("accel"), key))
        rows = [_of_pair(key, written[key], config) for key in gyros_first]
        tables.append(table_of((f"{PAIR}, to enter", "rms of the axes", "that is"), rows, words=3))
    if FADING in files:
        noise = kf_gins.entries(config, target)["imunoise"]
        rows = [_of_fading(key, noise[key], config) for key in _FADING_KEYS if key in noise]
        heads = ["x", "y", "z"] if any(len(set(row[1:])) > 1 for row in rows) else ["each axis"]
        rows.append(["corrtime, h", f"{noise['corrtime'].value:.4g} chosen", "", ""])
        if len(heads) > 1:
            tables.append(table_of((f"{FADING}, to enter", *heads), rows, words=4))
        else:
            line = [*heads, *(row[1] for row in rows)]
            tables.append(table_of((FADING, *(row[0] for row in rows)), [line], words=len(line)))
    return tables


def _of_pair(key: str, one: Noted, config: FilterConfig) -> list[str]:
    """Return a line of `PAIR`: key, value, customary value, and the axes on which it is not measured."""
    channels = triad(config, "gyro" if key.startswith("gyro") else "accel")
    name, unit = WALK if key.endswith("walk") else WHITE, channels[0].unit
    sources: dict[str, list[str]] = {}
    for channel in channels:
        if source := _source(channel, config, name):
            sources.setdefault(source, []).append(channel.axis[-1])
    value = f"{digits(in_customary(one.value, name, unit))} {pretty(customary_unit(name, unit))}"
    said = "; ".join(
        source if len(axes) == len(channels) else f"{source} {' '.join(axes)}"
        for source, axes in sources.items()
    )
    return [key, f"{one.value:.4g} {one.note.partition(',')[0]}", f"{value} {said}".rstrip()]


def _of_fading(key: str, one: Noted, config: FilterConfig) -> list[str]:
    """Return a line of `FADING`: key with unit, and a value an axis with its source."""
    sensor, name = _FADING_KEYS[key]
    sources = [_source(channel, config, name) for channel in triad(config, sensor)]
    cells = [
        f"{x:.4g} {source}".rstrip() for x, source in zip_longest(one.value.value, sources, fillvalue=ROUGH)
    ]
    return [f"{key}, {one.note.partition(';')[0]}", *cells]


def _source(channel: ChannelNoise, config: FilterConfig, name: str) -> str:
    """Return why a number of an axis is not measured; empty where it is."""
    if FITTED in channel.handling.values():
        return ROUGH
    if name != WHITE and channel.axis in borrowed(config):
        return LENT
    if name == WHITE:
        return _share(config.on_limit(channel.axis).get("white_density"))
    return HALF if config.bias_on_limit(channel.axis) else ""


def _share(of_limit: float | None) -> str:
    """Return the mark of a number that is half of a limit, or the limit itself."""
    return "" if of_limit is None else HALF if of_limit < 1.0 else WHOLE


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
        limits, assumed = config.on_limit(channel.axis), config.states_on_limit(channel.axis)
        times: dict[str, list[str]] = {}
        for state in channel.markov:
            sd = f"{digits(in_customary(state.sd, 'level', channel.unit))} {HALF * (state in assumed)}".rstrip()
            times.setdefault(sd, []).append(f"{float(f'{state.time_constant:.3g}'):g}")
        numbers = (
            (channel.white_density, WHITE, limits.get("white_density")),
            (channel.random_walk_density, WALK, limits.get("random_walk_density")),
            (channel.constant_sd, "level", None),
        )
        density, random_walk, constant = (
            f"{digits(in_customary(value, name, channel.unit))} {_share(share)}".rstrip()
            if value
            else UNKNOWN
            for value, name, share in numbers
        )
        states = "; ".join(f"{sd} at {', '.join(at)}" for sd, at in times.items()) or UNKNOWN
        table.add_row(channel.axis.replace("_", " "), density, states, random_walk, constant)
    return list(tables.values())


def legend(*tables: Table) -> str:
    """Return what the signs of tables mean, those that occur."""
    cells = [str(cell) for table in tables for column in table.columns[1:] for cell in column.cells]
    signs = {
        sign for sign in LEGEND if any(sign in cell.replace(UNKNOWN, "") or sign == cell for cell in cells)
    }
    signs |= {"±"} if any("(" in cell for cell in cells) else set()
    return "; ".join(text for sign, text in LEGEND.items() if sign in signs)


def more_white_noise(config: FilterConfig, files: Iterable[str]) -> tuple[str, str]:
    """Return why the files of other filters have more white noise than was measured, and how well that predicts.

    Both are empty where they have not.
    """
    pairs = [(channel, equivalent_noise(channel)) for channel in config.channels.values()]
    if PAIR not in files or all(
        one.white_density <= MORE_WHITE_NOISE * channel.white_density for channel, one in pairs
    ):
        return "", ""
    known = "measured" if any(white_is_measured(config, axis) for axis in config.channels) else "stated"
    least, most = min(one.mismatch[0] for _, one in pairs), max(one.mismatch[1] for _, one in pairs)
    return (
        f"More white noise is entered than {known}: it stands for bias instability, too",
        f"The two numbers predict {least:.2f} to {most:.2f} × the drift; enlarge for vibration only",
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
        for (name, which), one in coefficients_of(found.channels[axis]).items():
            if (name, 0) in cells or (further and one.value is not None):
                others = axis in lent and one.value is not None and one.interval is None
                cells.setdefault((name, which), {})[letter] = UNKNOWN if others else _cell(one, name, unit)
    if any(found.channels[axis].span > 0.0 for axis in axes.values()):  # what a sheet does not state is shown
        cells = {key: own for key, own in cells.items() if set(own.values()) - {UNKNOWN}}
    order = list(NAMES)
    places = {key: (order.index(key[0]) if key[0] in order else len(order), key[1]) for key in cells}
    return [
        Row(_label(sensor, name, unit), {letter: own.get(letter, UNKNOWN) for letter in axes})
        for (name, _), own in sorted(cells.items(), key=lambda one: places[one[0]])
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
    if len(text) <= WIDEST_CELL:
        return text
    side = max(high - value, value - low)
    if side < NARROW_INTERVAL * value:
        return f"{digits(value, 4)} ±{digits(side, 1)}"
    return f"{digits(value)} ({digits(low, 2)}–{digits(high, 2)})"
