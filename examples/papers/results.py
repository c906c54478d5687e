"""Results of a reproduced figure or table: claims with verdicts, and a picture as plain data.

A verdict follows from numbers alone. Ours has a 95 % interval; a value *agrees* with it where it lies within
`AGREEMENT_WIDTHS` times that interval, about four standard deviations, so that a true statement fails once in ten
thousand::

    reproduced       the paper's value agrees
    corrected        the value derived in its place agrees, and lies nearer
    untestable       the paper does not publish what a test needs
    not reproduced   neither value agrees: something is wrong, in the paper, the derivation or the code

Where both values agree, as in small samples, the nearer one counts.

A picture names what is drawn, not how: `examples.papers.figures` draws it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from models.arrays import FloatArray
from tuner.types import Coefficient

Range = tuple[float, float]
Verdict = Literal["reproduced", "corrected", "untestable", "not reproduced"]
Style = Literal["line", "dashed", "dotted", "points", "crosses", "faint"]

AGREEMENT_WIDTHS = 2.0
"""Half width of agreement, in half widths of the 95 % interval."""


@dataclass(frozen=True)
class Claim:
    """A statement of a paper beside ours.

    Attributes
    ----------
    text : str
        What is claimed, of which quantity.
    paper : str
        The paper's value, as printed.
    ours : Coefficient
        Our value with its 95 % interval, in the unit of the paper.
    verdict : str
        ``reproduced``, ``corrected``, ``untestable`` or ``not reproduced``.
    why : str
        Reason of the verdict, with the derivation of a correction.
    """

    text: str
    paper: str
    ours: Coefficient
    verdict: Verdict
    why: str


@dataclass(frozen=True)
class Curve:
    """One curve of a panel: points (x, y), a band where `low` and `high` are given."""

    x: FloatArray
    y: FloatArray
    label: str = ""
    style: Style = "line"
    low: FloatArray | None = None
    high: FloatArray | None = None
    group: int = 0
    """Curves of one group share a colour."""


@dataclass(frozen=True)
class Panel:
    """One pair of axes: its curves, and vertical lines at `marks` (x, label)."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    scale: Literal["loglog", "semilogx", "semilogy", "linear"] = "loglog"
    marks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Table:
    """A panel of numbers: `cells` (rows × columns), NaN where there is none: errors, or `ratios` whose best is 1."""

    title: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: FloatArray
    ratios: bool = False


@dataclass(frozen=True)
class Picture:
    """What is drawn of an item, `columns` panels a row."""

    panels: tuple[Panel | Table, ...]
    columns: int = 2


@dataclass(frozen=True)
class Item:
    """A figure, table or statement of a paper, reproduced and judged."""

    name: str
    paper: str
    claims: tuple[Claim, ...]
    figure: Picture


def judge(
    text: str,
    paper: str,
    ours: Coefficient,
    *,
    claimed: float | Range | None,
    derived: float | Range | None = None,
    why: str,
) -> Claim:
    """Compare a value with the one that the paper prints and with the one derived in its place.

    Parameters
    ----------
    text, paper, why : str
        See `Claim`.
    ours : Coefficient
        With an interval.
    claimed, derived : float or (float, float)
        Values; a range is what a rounded or a qualitative statement allows, None that there is no value.

    Raises
    ------
    ValueError
        If `ours` has no interval.
    """
    if ours.value is None or ours.interval is None:
        raise ValueError(f"'ours' must have a value and an interval to be judged, got {ours}")
    to_paper, to_derived = (_distance(ours.value, ours.interval, wanted) for wanted in (claimed, derived))
    verdict: Verdict = "not reproduced"
    if min(to_paper, to_derived) <= AGREEMENT_WIDTHS:
        verdict = "reproduced" if to_paper <= to_derived else "corrected"
    return Claim(text, paper, ours, verdict, why)


def absent(text: str, paper: str, found: Coefficient, *, why: str) -> Claim:
    """Return the claim that something does not show: reproduced where the data only bound it."""
    return Claim(text, paper, found, "reproduced" if found.value is None else "not reproduced", why)


def untestable(text: str, paper: str, missing: str) -> Claim:
    """Return a claim that lacks what a test needs."""
    return Claim(text, paper, Coefficient(None, None, None, "", missing), "untestable", missing)


def exact(value: float, unit: str) -> Coefficient:
    """Return a computed value that has no sampling error, its interval that of rounding."""
    slack = 1e-6 * abs(value) + 1e-12
    return Coefficient.known(value, value - slack, value + slack, unit)


def rounded(value: float, digits: int) -> Range:
    """Return the values that print as `value` with so many decimals."""
    half = 0.5 * 10.0**-digits
    return value - half, value + half


def _distance(value: float, interval: Range, wanted: float | Range | None) -> float:
    """Return how far a value lies from what is wanted, in half widths of its interval on that side."""
    if wanted is None:
        return np.inf
    low, high = wanted if isinstance(wanted, tuple) else (wanted, wanted)
    gap, end = (low - value, interval[1]) if value < low else (value - high, interval[0])
    return max(gap, 0.0) / max(abs(end - value), np.finfo(float).tiny)
