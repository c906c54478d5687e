"""Settings that are not of the sensor itself: taken from a built-in one, and marked so wherever they appear."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from models.noise import White
from tuner.types.config import FilterConfig

BORROWED = "borrowed"
"""Key in the source of an identification, and of the provenance of a configuration: grade by axis."""
SHEET_OF = "the sheet of "
"""How the name of a sheet begins that was named for this sensor; other names are of built-in ones of nearest noise."""


def with_borrowed(source: Mapping[str, Any], axes: Iterable[str], grade: str) -> dict[str, Any]:
    """Return the source of an identification that names the grade from which terms of some axes are taken."""
    return {**source, BORROWED: {**source.get(BORROWED, {}), **dict.fromkeys(axes, grade)}}


def borrowed(config: FilterConfig) -> Mapping[str, str]:
    """Return the built-in sensor whose terms stand in, by axis; empty where all are the sensor's own."""
    source = config.provenance.get("source")
    found = source.get(BORROWED, {}) if isinstance(source, Mapping) else {}
    return MappingProxyType({axis: str(grade) for axis, grade in found.items() if axis in config.channels})


def white_is_measured(config: FilterConfig, axis: str) -> bool:
    """Whether the white noise of an axis has an interval or a limit, as only measured numbers have."""
    terms = (term for term in config.channels[axis].identified if term.name == White.name)
    return any(c.interval is not None or c.upper is not None for t in terms for c in t.coefficients.values())


def borrowed_words(config: FilterConfig) -> tuple[str, ...]:
    """Return one line for each built-in sensor that stands in: which settings of which axes it gives."""
    groups: dict[tuple[str, bool], list[str]] = {}
    for axis, grade in borrowed(config).items():
        groups.setdefault((grade, white_is_measured(config, axis)), []).append(axis)
    return tuple(
        f"bias terms of {_words(axes, config)} are ASSUMED from {grade}"
        f"{', the built-in sensor of nearest white noise' * (not grade.startswith(SHEET_OF))}, not yours"
        if measured
        else f"noise of {_words(axes, config)} is ASSUMED from the built-in sensor {grade}, not yours"
        for (grade, measured), axes in groups.items()
    )


def _words(axes: list[str], config: FilterConfig) -> str:
    return "all axes" if len(axes) == len(config.channels) > 1 else ", ".join(axes)
