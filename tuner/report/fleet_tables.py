"""A fleet in the terminal: a few lines, and a table of the units that are not plainly good."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.table import Table

from tuner.formats.customary_units import digits
from tuner.production.quantities import SYMBOLS, customary, is_logarithmic, pretty_unit, title
from tuner.types.fleet import Fleet, FleetUnit, Outlier

SHOWN_UNITS = 20
"""Rows of the table in the terminal: a screen; the files have all."""
MAX_REASONS = 4
"""Reasons of a unit in the terminal; the files have all."""
IN_WORDS = {
    "N": "white noise",
    "B": "bias instability",
    "K": "bias random walk",
    "sigma_10s": "Allan deviation at 10 s",
}
"""Symbols of quantities in words."""


def summary(fleet: Fleet) -> list[str]:
    """Return how many units there are, how many keep their limits, and how many stand apart."""
    verdicts = Counter(unit.verdict for unit in fleet.units)
    refused = sum(unit.error is not None for unit in fleet.units)
    outlying = sum(bool(unit.outliers) for unit in fleet.units)
    advised = sum(bool(unit.advice) for unit in fleet.units)
    look = "LOOK" if outlying or refused or advised else ""
    word = next(
        (name for name in ("FAIL", look, "OPEN") if name and (name == look or verdicts[name])), "PASS"
    )
    limits = (
        f"{verdicts['PASS']} PASS, {verdicts['FAIL']} FAIL, {verdicts['OPEN']} OPEN (log too short to tell)"
        if fleet.limits
        else "no limits given (--limits)"
    )
    stand = "stands" if outlying == 1 else "stand"
    return [
        f"Verdict: {word}: {outlying} of the {len(fleet.units)} units in {fleet.name} {stand} apart, {refused} cannot "
        f"be used; {limits}"
    ]


def outlier_text(outlier: Outlier, fleet: Fleet) -> str:
    """Say in which quantity a unit stands apart: ``gyro_x N 0.52 deg/√h, fleet 0.0091 (× 57; 80 robust sds …)``."""
    name = outlier.quantity
    unit = fleet.channel_units[name.rpartition(".")[0]]
    value, median = (customary(x, name, unit) for x in (outlier.value, outlier.median))
    distance = (
        f"× {digits(value / median)}"
        if is_logarithmic(name)
        else f"{'+' if value > median else '−'}{digits(abs(value - median))}"
    )
    score = f"{digits(outlier.score, 2)} robust sds from it; chance reaches {digits(outlier.threshold, 2)}"
    return f"{title(name)} {digits(value)} {pretty_unit(name, unit)}, fleet {digits(median)} ({distance}; {score})"


def reasons(unit: FleetUnit, fleet: Fleet) -> list[str]:
    """Return why a unit is to be looked at: what mends it, what it is outlying in, limits it breaks; or its error.

    Several amplitudes of one sensor that are outlying share a line with the factors between which they lie.
    """
    if unit.error:
        return [unit.error]
    by_sensor: dict[str, list[Outlier]] = {}
    for outlier in unit.outliers:
        channel = outlier.quantity.rpartition(".")[0]
        sensor = channel.rpartition("_")[0] or channel
        by_sensor.setdefault(sensor if is_logarithmic(outlier.quantity) else outlier.quantity, []).append(
            outlier
        )
    lines = [
        outlier_text(found[0], fleet) if len(found) == 1 else _together(sensor, found, fleet)
        for sensor, found in by_sensor.items()
    ]
    return [*unit.advice, *lines, *unit.broken]


def _together(sensor: str, found: Sequence[Outlier], fleet: Fleet) -> str:
    """Say in which amplitudes a sensor stands apart: ``gyro: N of x y z × 2.9 to 3.1 the median …``."""
    axes: dict[str, list[Outlier]] = {}
    for one in found:
        axes.setdefault(one.quantity.rpartition(".")[2], []).append(one)
    parts = []
    for symbol in (symbol for symbol in SYMBOLS if symbol in axes):
        alike = axes[symbol]
        letters = " ".join(sorted(one.quantity.rpartition(".")[0].rpartition("_")[2] for one in alike))
        ratios = sorted(one.value / one.median for one in alike)
        name = alike[0].quantity
        unit = fleet.channel_units[name.rpartition(".")[0]]
        values = _range(sorted(customary(one.value, one.quantity, unit) for one in alike))
        size = f"{values} {pretty_unit(name, unit)}"
        parts.append(f"{IN_WORDS.get(symbol, symbol)} of {letters} {size}, × {_range(ratios)}")
    scores = _range(sorted(one.score for one in found))
    limit = digits(found[0].threshold, 2)
    return f"{sensor}: {', '.join(parts)} the median of the units ({scores} robust sds from it; chance reaches {limit})"


def _range(values: Sequence[float]) -> str:
    """Return the ends of sorted values, one where they read the same."""
    low, high = digits(values[0], 2), digits(values[-1], 2)
    return low if low == high else f"{low} to {high}"


def fleet_tables(fleet: Fleet) -> list[Table | str]:
    """Return the summary and the units to look at: those that stand apart, cannot be used, fail, are open."""
    table = Table(title="Units to look at", show_lines=True)
    for head, least in (("unit", 16), ("verdict", None), ("why", 40)):
        table.add_column(head, overflow="fold", min_width=least)
    odd = [u for u in fleet.units if u.error or u.outliers or u.broken or u.advice]
    rank = {"FAIL": 2, "OPEN": 3}
    odd.sort(key=lambda u: 0 if u.outliers or u.advice else 1 if u.error else rank.get(u.verdict or "", 4))
    for unit in odd[:SHOWN_UNITS]:
        why = reasons(unit, fleet)
        more = len(why) - MAX_REASONS
        if more > 0:
            why = [*why[:MAX_REASONS], f"and {more} more, in fleet.csv"]
        table.add_row(unit.name, unit.verdict or ("ERROR" if unit.error else "LOOK"), "\n".join(why))
    answer: list[Table | str] = [*summary(fleet)]
    if odd:
        answer.append(table)
    if len(odd) > SHOWN_UNITS:
        answer.append(f"and {len(odd) - SHOWN_UNITS} more, in fleet.csv")
    return answer
