"""The ARMA models of the axes of a sensor: orders in a line, and coefficients, roots and tests in tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from rich.table import Table

from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import amount, customary_unit, digits, phrase, pretty
from tuner.formats.grouping import gathered
from tuner.identification.arma import cancelling, innovation_sd, roots, slowest_memory
from tuner.report.titled_table import titled_table
from tuner.types import ArmaFit, ChannelIdentification, SeriesTest

ABOUT_TESTS = (
    "p: the chance of such a statistic where the null hypothesis holds; below 0.05 (trend, ADF, KPSS) or 0.01 it is "
    "rejected. The trend that was taken out before hides a random walk from all of them"
)
"""What the table of the tests says."""
ROOTS = ("poles", "zeros")
"""Rows of roots."""
UNIT_ROOT_SHARE = 21.8
"""Series ÷ memory below which a root may be 1, as n (1 − φ) of a random walk beside a line is in 95 % (W. A. Fuller,
Introduction to Statistical Time Series, 1976, table 8.5.1); there intervals hold in 87 to 97 %."""
LEAST_CHANCE = 1e-99
"""Chance below which a number says nothing more."""


def orders_line(channels: Sequence[ChannelIdentification]) -> str:
    """Return the orders of axes in a line; empty where no axis has a model."""
    fits = {one.axis: one.arma for one in channels if one.arma is not None}
    by_name = gathered((order_name(fit), axis) for axis, fit in fits.items())
    said = "; ".join(f"{name} {axes_text(axes)}" for name, axes in by_name.items())
    criterion = next((fit.criterion for fit in fits.values()), "")
    return f"ARMA by {criterion.upper()}: {said}" if said else ""


def order_name(fit: ArmaFit) -> str:
    """Return what a model is called: white noise, or its order, and whether that is the highest that was tried."""
    if fit.white:
        return "white noise"
    p, q = fit.order
    highest = max(max(order) for order in fit.scores)
    return f"({p},{q}) or higher" if max(p, q) == highest else f"({p},{q})"


def series_tables(channels: Sequence[ChannelIdentification]) -> list[Table | str]:
    """Return the models of the axes of a sensor and their tests; nothing where no axis has one."""
    fits = {one.axis: one.arma for one in channels if one.arma is not None}
    if not fits:
        return []
    first = next(iter(fits.values()))
    highest = max(p for p, _ in first.scores)
    title = f"ARMA by {first.criterion.upper()}, p, q ≤ {highest}: x_k = Σ φ_i x_k−i + e_k + Σ θ_j e_k−j"
    heads = ["", *fits]
    tests = {one.name: one.null for fit in fits.values() for one in fit.tests}
    rows = [
        [f"{name} (null: {null})", *(", p ".join(chance(fit, name)) for fit in fits.values())]
        for name, null in tests.items()
    ]
    return [
        *titled_table(title, heads, model_rows(list(fits.values()))),
        *titled_table("Tests of the series and of the residuals", heads, rows),
        f"  {ABOUT_TESTS}",
        *(f"  {axis}: {text}" for axis, fit in fits.items() for text in remarks(fit)),
    ]


def model_rows(fits: Sequence[ArmaFit]) -> Iterator[list[str]]:
    """Yield the rows of the table of several models."""
    yield ["order (p,q)", *map(order_name, fits)]
    for sign, parts in (("φ", [fit.ar for fit in fits]), ("θ", [fit.ma for fit in fits])):
        for i in range(max(map(len, parts))):
            yield [f"{sign}{i + 1}", *(amount(part[i]) if i < len(part) else "–" for part in parts)]
    units = (pretty(customary_unit("level", fit.unit)) for fit in fits)
    sds = (phrase(innovation_sd(fit), "level", fit.unit, with_unit=False) for fit in fits)
    yield ["sd of e", *map(" ".join, zip(sds, units, strict=True))]
    for name in ROOTS:
        yield [name, *(roots_text(fit, name) for fit in fits)]
    yield [
        "states of a shaping filter",
        *(str(0 if fit.white else max(fit.order[0], fit.order[1] + 1)) for fit in fits),
    ]
    yield ["next best order, its score less the best", *map(next_best, fits)]


def next_best(fit: ArmaFit) -> str:
    """Return the order that comes next and by how much its score is larger."""
    own = (0, 0) if fit.white else fit.order
    others = [(score, order) for order, score in fit.scores.items() if order != own]
    if not others or own not in fit.scores:
        return "–"
    score, (p, q) = min(others)
    return f"({p},{q}): {score - fit.scores[own]:+.2g}"


def roots_text(fit: ArmaFit, name: str) -> str:
    """Return the poles or the zeros of a model."""
    return "; ".join(root_text(z, fit) for z in roots(fit)[ROOTS.index(name)] if z.imag >= 0.0) or "–"


def root_text(root: complex, fit: ArmaFit) -> str:
    """Return a root, or the size and frequency of a pair, with the time constant where that is longer than a sample."""
    size, turn = abs(root), float(np.angle(root)) / math.tau / fit.interval
    where = f"pair {digits(size, 3)} at {digits(turn)} Hz" if root.imag else digits(root.real, 4)
    time = -fit.interval / math.log(size) if 0.0 < size < 1.0 else 0.0
    if time > fit.interval * fit.samples:
        return f"{where} (memory longer than the series)"
    return f"{where} ({digits(time)} s)" if time > fit.interval else where


def chance(fit: ArmaFit, name: str) -> tuple[str, str]:
    """Return statistic and chance of one of the tests of a model; dashes where it has none of that name."""
    one = next((test for test in fit.tests if test.name == name), None)
    return ("–", "–") if one is None else (digits(one.statistic), chance_text(one))


def chance_text(one: SeriesTest) -> str:
    """p-value of a test; a limit where it lies beyond the table of critical values."""
    low, high = max(one.tabulated[0], LEAST_CHANCE), one.tabulated[1]
    if one.p_value <= low:
        return f"< {low:g}"
    return f"> {high:g}" if one.p_value >= high < 1.0 else f"{one.p_value:.2g}"


def remarks(fit: ArmaFit) -> Iterator[str]:
    """Yield what a reader of the coefficients must know."""
    memory = slowest_memory([c.value or 0.0 for c in fit.ar], [c.value or 0.0 for c in fit.ma])
    if memory >= fit.samples:
        yield (
            "a root has a memory longer than the series, as a pole of a random walk or a zero of differences: its "
            "model has no intervals"
        )
    elif UNIT_ROOT_SHARE * memory > fit.samples:
        yield (
            f"a root has a memory of 1/{UNIT_ROOT_SHARE:.0f} of the series or more: it may be 1 (a random walk, or "
            "differences of white noise), and intervals hold in 87 %, not 95 %"
        )
    if memory < fit.samples and (pairs := cancelling(fit)):
        pole, zero = min(pairs, key=lambda pair: abs(pair[0] - pair[1]))
        nearest = " and ".join(root_text(complex(one.real, abs(one.imag)), fit) for one in (pole, zero))
        yield f"a pole and a zero differ by less than their error ({nearest}): φ and θ mean little one by one"
    for one in fit.tests:
        if one.null == "no correlation" and one.found != "no correlation left":
            yield f"the chosen model leaves correlation ({one.name}, p {chance_text(one)})"
