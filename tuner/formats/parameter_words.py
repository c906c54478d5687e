"""Parameters of findings in words: no underscores, and each class of fixes by what makes it one."""

from __future__ import annotations

from collections.abc import Mapping

from tuner.formats.customary_units import digits
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
