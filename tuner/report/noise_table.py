"""The noise of a sensor, axis by axis, and what to enter in filters: the tables of `identify` and `tune`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np
from rich.table import Table

from tuner.exporters import kalibr, kf_gins
from tuner.exporters.header import stated_ratios
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, with_interval
from tuner.formats.grouping import gathered
from tuner.formats.yaml_text import Noted
from tuner.identification.slopes import read_segments
from tuner.judgement import curve_axes
from tuner.report.coefficient_text import coefficients_of
from tuner.report.titled_table import table_of
from tuner.types import BoundUsed, Coefficient, FilterConfig, Identification, Quantity
from tuner.types.borrowed import BORROWED
from tuner.types.config import ChannelNoise
from tuner.types.prediction import PredictedBlock

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
ROUGH, TAKEN, LENT, UNKNOWN = "rough", "→", "lent", "–"
"""Behind a number that is fitted to the Allan curve, between a limit and what is taken for it, behind a number of
another sensor's sheet; in place of an unknown one."""
LEGEND = {
    "±": "± ( ): 95 % interval",
    "<": "<: not seen, 95 % limit",
    TAKEN: f"{TAKEN}: in the settings, ASSUMED",
    LENT: f"{LENT}: of the sensor named above, ASSUMED",
    ROUGH: f"{ROUGH}: by the Allan curve, no interval",
    UNKNOWN: f"{UNKNOWN}: unknown",
}
ASSUMED = "ASSUMED"
"""Behind a number that nothing measures."""
PAIR, FADING = "kalibr.yaml", "kf-gins.yaml"
"""Files whose numbers stand beside the measured ones: white noise with a random walk, and with a Gauss–Markov bias."""
WIDEST_CELL = 15
"""Characters of a cell with which three axes have room in a terminal; longer ones have fewer digits."""
NARROW_INTERVAL = 0.05
"""Distance of the further end of an interval ÷ value below which a longer cell has that distance alone."""
_FADING_KEYS = ("arw", "gbstd", "vrw", "abstd")
"""Keys of `FADING` with a value an axis."""


def measured_table(
    found: Identification,
    config: FilterConfig | None = None,
    predictions: Mapping[str, PredictedBlock] = MappingProxyType({}),
    *,
    further: bool = True,
) -> Table:
    """Return the measured noise, one column an axis.

    Parameters
    ----------
    found : Identification
        Noise terms.
    config : FilterConfig, optional
        Settings made from them: what they take for a limit is shown beside it.
    predictions : mapping of str to PredictedBlock, optional
        How settings predict the log: of an axis whose terms do not predict its Allan curve, what its slopes show.
    further : bool, optional
        Whether terms beside white noise, bias instability and random walk are shown.
    """
    read = {axis: _read_off(predictions[axis], found.channels[axis].unit) for axis in curve_axes(predictions)}
    bounds = () if config is None else config.inflations
    shares = {one.quantity: one.factor for one in bounds if isinstance(one, BoundUsed) and one.factor > 0.0}
    sensors = _sensors(found)
    rows = [
        row
        for sensor, axes in sensors.items()
        for row in _measured(sensor, axes, found, read, shares, further=further)
    ]
    known = "measured" if any(one.span > 0.0 for one in found.channels.values()) else "stated"
    letters = list(dict.fromkeys(letter for axes in sensors.values() for letter in axes))
    heads = [f"{known} {letter}" for letter in letters]
    if len(letters) > 1 and all(len({cells.get(one) for one in letters}) == 1 for _, cells in rows):
        letters, heads = letters[:1], [f"{known}, each axis"]
    lines = [[label, *(cells.get(one, "") for one in letters)] for label, cells in rows]
    return table_of(("", *heads), lines, words=1 + len(heads))


def entries_tables(config: FilterConfig, files: Iterable[str]) -> list[Table]:
    """Return what stands in `PAIR` and `FADING`, those of them that are written, by their own keys and units.

    Numbers of `PAIR` have their customary units, too.
    """
    tables = []
    if PAIR in files:
        written = kalibr.noise_entries(config, kalibr.DIALECT.target(config))
        rows = [_of_pair(key, written[key]) for key in sorted(written, key=lambda key: key[:5] == "accel")]
        tables.append(table_of((f"{PAIR}, to enter", "one for all axes", "that is"), rows, words=3))
    if FADING in files:
        noise = kf_gins.entries(config, kf_gins.DIALECT.target(config))["imunoise"]
        rows = [
            [f"{key}, {noise[key].note.partition(';')[0]}", *(f"{x:.4g}" for x in noise[key].value.value)]
            for key in _FADING_KEYS
            if key in noise
        ]
        heads = ["x", "y", "z"] if any(len(set(row[1:])) > 1 for row in rows) else ["each axis"]
        rows.append(["corrtime, h", f"{noise['corrtime'].value:.4g}: a walk", "", ""])
        lines = [row[: 1 + len(heads)] for row in rows]
        tables.append(table_of((f"{FADING}, to enter", *heads), lines, words=4))
    return tables


def _of_pair(key: str, one: Noted) -> list[str]:
    """Return a line of `PAIR`: key, value with its unit, customary value."""
    name, unit = WALK if key.endswith("walk") else WHITE, "rad/s" if key.startswith("gyro") else "m/s^2"
    value = f"{digits(in_customary(one.value, name, unit))} {pretty(customary_unit(name, unit))}"
    return [key, f"{one.value:.4g} {one.note.partition(',')[0]}", value]


def states_tables(config: FilterConfig) -> list[Table]:
    """Return the states of the filter of noise.yaml, a table a sensor and a row an axis."""
    tables = []
    for unit, channels in gathered((one.unit, one) for one in config.channels.values()).items():
        white, level, walk = (pretty(customary_unit(name, unit)) for name in (WHITE, "level", WALK))
        states = f"bias sd, {level},\nat correlation time, s"
        heads = f"white noise,\n{white}", states, f"bias random walk,\n{walk}", f"turn-on sd,\n{level}"
        rows = [_states_row(one, config) for one in channels]
        tables.append(table_of(("states of noise.yaml", *heads), rows, words=5))
        tables[-1].columns[2].min_width = 20
    return tables


def _states_row(channel: ChannelNoise, config: FilterConfig) -> tuple[str, ...]:
    """Return the states of an axis."""
    limits, assumed = config.on_limit(channel.axis), config.states_on_limit(channel.axis)

    def cell(value: float, name: str, *, assumed: bool = False) -> str:
        number = digits(in_customary(value, name, channel.unit))
        return f"{number}{f' {ASSUMED}' * assumed}" if value else UNKNOWN

    times = gathered(
        (cell(one.sd, "level", assumed=one in assumed), f"{float(f'{one.time_constant:.3g}'):g}")
        for one in channel.markov
    )
    return (
        channel.axis.replace("_", " "),
        cell(channel.white_density, WHITE, assumed="white_density" in limits),
        "; ".join(f"{sd} at {', '.join(at)}" for sd, at in times.items()) or UNKNOWN,
        cell(channel.random_walk_density, WALK, assumed="random_walk_density" in limits),
        cell(channel.constant_sd, "level"),
    )


def legend(*tables: Table) -> str:
    """Return what the signs of tables mean, those that occur."""
    cells = [str(cell) for table in tables for column in table.columns[1:] for cell in column.cells]
    signs = {
        sign for sign in LEGEND if any(sign in cell.replace(UNKNOWN, "") or sign == cell for cell in cells)
    }
    signs |= {"±"} if any("(" in cell for cell in cells) else set()
    return "; ".join(text for sign, text in LEGEND.items() if sign in signs)


def why_larger(texts: Iterable[str]) -> str:
    """Return why numbers to enter are larger than the terms measured, and how well they predict by their files.

    Empty where no file has fewer numbers than there are terms.
    """
    found = [ratio for text in texts for ratio in stated_ratios(text)]
    if not found:
        return ""
    return (
        "To enter: few numbers stand for all terms, so most are larger; a linear filter with usual fixes errs by "
        f"{min(found):.2f} to {max(found):.2f} × predicted; enlarge for vibration only"
    )


def _sensors(found: Identification) -> dict[str, dict[str, str]]:
    """Return the axes of each sensor by their letter."""
    named = ((axis, axis.rpartition("_")) for axis in found.channels)
    sensors = gathered((sensor or axis, (letter, axis)) for axis, (sensor, _, letter) in named)
    return {sensor: dict(axes) for sensor, axes in sensors.items()}


def _measured(
    sensor: str,
    axes: Mapping[str, str],
    found: Identification,
    read: Mapping[str, Mapping[str, str]],
    shares: Mapping[Quantity, float],
    *,
    further: bool,
) -> list[tuple[str, Mapping[str, str]]]:
    """Return the rows of a sensor, label and cells by axis: the three common terms, and `further` ones of an axis."""
    cells: dict[tuple[str, int], dict[str, str]] = {(name, 0): {} for name in (WHITE, FLICKER, WALK)}
    unit = next(iter(found.channels[axis].unit for axis in axes.values()))
    lent = found.source.get(BORROWED, {})
    for letter, axis in axes.items():
        if axis in read:
            for name in (WHITE, FLICKER, WALK):
                cells[name, 0][letter] = read[axis].get(name, UNKNOWN)
            continue
        for (name, which), one in coefficients_of(found.channels[axis]).items():
            if (name, 0) in cells or (further and one.value is not None):
                text = _cell(one, name, unit, shares.get(Quantity(axis, name)))
                others = axis in lent and one.value is not None and one.interval is None
                cells.setdefault((name, which), {})[letter] = f"{text} {LENT}" if others else text
    if any(found.channels[axis].span > 0.0 for axis in axes.values()):  # what a sheet does not state is shown
        cells = {key: own for key, own in cells.items() if set(own.values()) - {UNKNOWN}}
    order = list(NAMES)
    places = {key: (order.index(key[0]) if key[0] in order else len(order), key[1]) for key in cells}
    return [
        (_label(sensor, name, unit), {letter: own.get(letter, UNKNOWN) for letter in axes})
        for (name, _), own in sorted(cells.items(), key=lambda one: places[one[0]])
    ]


def _read_off(found: PredictedBlock, unit: str) -> dict[str, str]:
    """Return the cells of an axis by what stands parallel to a term in its Allan curve.

    White noise is that of the sum that was fitted to the curve, with states that a filter cannot follow: some cluster
    times show more, beside a peak, or less, behind a filter.
    """
    curve = found.measured
    seen = read_segments(curve.tau, np.sqrt(curve.variance), curve.dof["white"])
    names = {name.partition(".")[0]: name for name in (FLICKER, WALK)}
    cells = {WHITE: found.block.without_fast_states().white_density} | {
        names[one.term]: one.value for one in seen if one.term in names
    }
    return {
        name: f"{digits(in_customary(value, name, unit))} {ROUGH}" for name, value in cells.items() if value
    }


def _label(sensor: str, name: str, unit: str) -> str:
    """Return sensor, quantity and unit."""
    words = NAMES.get(name, name.replace(".", " ").replace("_", " "))
    return f"{sensor} {words}, {pretty(customary_unit(name, unit))}".removesuffix(", ")


def _cell(one: Coefficient, name: str, unit: str, share: float | None) -> str:
    """Return a number with its interval, a limit with what is taken for it by its share, or that nothing is known."""
    if one.value is None and one.upper is not None:
        limit = in_customary(one.upper, name, unit)
        return f"< {digits(limit)}" + ("" if share is None else f" {TAKEN} {digits(share * limit)}")
    if one.value is None:
        return UNKNOWN
    value = in_customary(one.value, name, unit)
    if one.interval is None:
        return digits(value)
    if one.value in one.interval:  # lowered to what the Allan curve allows
        return f"{digits(value)} {ROUGH}"
    low, high = (in_customary(end, name, unit) for end in one.interval)
    text = with_interval(value, low, high, between="–").replace(" ± ", " ±")
    if len(text) <= WIDEST_CELL:
        return text
    side = max(high - value, value - low)
    if side < NARROW_INTERVAL * value:
        return f"{digits(value, 4)} ±{digits(side, 1)}"
    return f"{digits(value)} ({digits(low, 2)}–{digits(high, 2)})"
