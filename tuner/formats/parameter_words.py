"""Parameters of findings in words: no underscores, and each class of fixes by what makes it one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from tuner.formats.customary_units import amount, digits, range_text
from tuner.types import Coefficient
from tuner.types.records import SOLUTIONS

BLOCK_UNITS = {"position": "m", "velocity": "m/s"}
"""Units of the sds that a receiver reports."""


def parameter_words(parameters: Mapping[str, Coefficient]) -> dict[str, str]:
    """Return the names of parameters in words by the names they have; without those that only define a class.

    ``position_vertical_class_1`` beside ``position_solution_1`` of 4 is *position vertical of RTK fixed fixes*; beside
    ``position_edge_1`` of 0.2 it is *position vertical of fixes reported to 0.2 m and more*.
    """
    words = {}
    for name in parameters:
        row, _, number = name.partition("_class_")
        plain = row.replace("_", " ")
        if number.isdigit():
            words[name] = f"{plain} of {_fixes_of_class(parameters, row.partition('_')[0], int(number))}"
        elif "_edge_" not in name and "_solution_" not in name:
            words[name] = plain
    return words


def meaning_text(meaning: str, figures: Mapping[str, Coefficient], *, ranges: bool = False) -> str:
    """Return what a cause means, with figures of it in their places.

    Parameters
    ----------
    meaning : str
        Clauses between commas. A place in a clause, ``{sd}``, is for the figures whose names begin so, ``{}`` for those
        that no clause before it has; a clause with a place for which there is no figure is left out. Of
        ``{late|early}`` the one sign of all figures takes a word (`with_sign`), and their magnitudes are given.
    figures : mapping of str to Coefficient
        SI, by name.
    ranges : bool, optional
        Whether figures that share a place are given as their range of magnitudes, not each.
    """
    if (said := with_sign(meaning, figures)) != meaning:
        same = len({one.value < 0.0 for one in figures.values() if one.value is not None}) == 1
        meaning, figures = said, {name: _magnitude(one) if same else one for name, one in figures.items()}
    left = parameter_words(figures)
    clauses = []
    for clause in meaning.split(", "):
        before, *place = re.split(r"\{(\w*)\}", clause)
        if not place:
            clauses.append(clause)
            continue
        begin, behind = place
        found = {name: left.pop(name) for name in [*left] if name.startswith(begin)}
        if found:
            known = [figures[name] for name in found]
            sizes = [abs(one.value) for one in known if one.value is not None]
            if ranges and len(sizes) == len(known) > 1:
                text = range_text(sizes, known[0].unit, significant=2)
            else:
                names = (said.removeprefix(begin.replace("_", " ")) for said in found.values())
                text = ", ".join(
                    f"{name} {amount(one)}".strip() for name, one in zip(names, known, strict=True)
                )
            clauses.append(f"{before}{text}{behind}")
    return ", ".join(clauses)


def with_sign(meaning: str, figures: Mapping[str, Coefficient]) -> str:
    """Return a meaning whose ``{late|early}`` is *late*, or *early* where the figures are negative.

    Without figures of one sign it is *late or early*.
    """
    signs = {one.value < 0.0 for one in figures.values() if one.value is not None}

    def word(choice: re.Match[str]) -> str:
        return " or ".join(choice.groups()) if len(signs) != 1 else choice[2 if signs == {True} else 1]

    return re.sub(r"\{(\w+)\|(\w+)\}", word, meaning)


def _magnitude(one: Coefficient) -> Coefficient:
    """Return a figure without its sign."""
    if one.value is None or one.interval is None or one.value >= 0.0:
        return one
    low, high = one.interval
    return replace(one, value=-one.value, interval=(-high, -low))


def _fixes_of_class(parameters: Mapping[str, Coefficient], block: str, number: int) -> str:
    """Return which fixes a class holds: of one solution, or between levels of the sds that they report."""
    solution = parameters.get(f"{block}_solution_{number}")
    if solution is not None and solution.value is not None:
        return f"{SOLUTIONS.get(round(solution.value), 'other')} fixes"
    ends = [parameters.get(f"{block}_edge_{edge}") for edge in (number, number + 1)]
    low, high = (None if end is None or end.value is None else digits(end.value) for end in ends)
    unit = BLOCK_UNITS.get(block, "")
    if low is None and high is None:
        return f"class {number + 1} of fixes"
    if low is None:
        return f"fixes reported below {high} {unit}"
    return (
        f"fixes reported to {low} {unit} and more"
        if high is None
        else f"fixes reported to {low} to {high} {unit}"
    )
