"""Built-in grades of sensors and GNSS receivers: the YAML files of ``configs/``, by name.

``configs/`` stands beside the package in a checkout and inside it in an installed wheel; `config_directory`
finds either. A grade without data is an identification whose values have no intervals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from models.noise import POWER_LAW, GaussMarkov
from models.sensors import SensorGrade, Sourced, TriadGrade
from tuner.catalogue.datasheet_format import parse_sheet
from tuner.catalogue.model_channel import channel_of_terms
from tuner.formats.codec import load, refuse_unknown_keys
from tuner.formats.documents import parse_format
from tuner.types import (
    ChannelIdentification,
    Coefficient,
    GnssNoise,
    Identification,
    TermEstimate,
)
from tuner.types.number_ranges import Positive
from tuner.types.public import public
from tuner.types.records import DataError

GNSS_FORMAT = "tuner-gnss/1"
DEFAULT_RECEIVER = "spp"
"""Built-in receiver where nobody names one: single-point positioning, the least that any receiver does."""

POWER_LAW_PARAMETER = {kind.name: kind.PARAMETERS[0] for kind in POWER_LAW}
"""Parameter of each term that a triad gives one number of."""


@refuse_unknown_keys
@dataclass(frozen=True, kw_only=True)
class _GnssSheet:
    """Errors of a receiver, SI; sds north, east, down."""

    format: str
    name: str = ""
    title: str = ""
    position_sd: tuple[Positive, Positive, Positive]
    velocity_sd: tuple[Positive, Positive, Positive] | None = None
    interval: Positive
    gate: Positive
    correlated: tuple[GaussMarkov, ...] = ()
    reference: str
    notes: tuple[str, ...] = ()


def config_directory() -> Path:
    """Return the folder of built-in configurations, of the checkout or of the installed package."""
    package = Path(__file__).parent.parent
    for candidate in (package / "configs", package.parent / "configs"):
        if (candidate / "sensors").is_dir():
            return candidate
    raise DataError(f"{package}: expected a folder 'configs' in or beside the package; reinstall it")


def grade_names() -> tuple[str, ...]:
    """Return the names of the built-in sensors."""
    return _names("sensors")


@public("load_grade")
@cache
def load_grade(name: str) -> SensorGrade:
    """Return a built-in sensor.

    Raises
    ------
    DataError
        For an unknown name, with the known ones.
    """
    path = _path("sensors", name)
    return parse_sheet(path.read_text(encoding="utf-8"), source=str(path))


@public("load_gnss")
@cache
def load_gnss(name: str) -> GnssNoise:
    """Return the errors of a built-in GNSS receiver.

    Raises
    ------
    DataError
        For an unknown name, with the known ones.
    """
    path = _path("gnss", name)
    return parse_gnss(path.read_text(encoding="utf-8"), source=str(path))


def receiver_or_default(gnss: GnssNoise | None) -> GnssNoise:
    """Return a receiver, or `DEFAULT_RECEIVER` where nobody names one."""
    return gnss or load_gnss(DEFAULT_RECEIVER)


def parse_gnss(text: str, *, source: str) -> GnssNoise:
    """Return the errors described by a YAML of format ``tuner-gnss/1`` (SI; sds north, east, down)."""
    content = parse_format(text, source=source, expected_format=GNSS_FORMAT)
    sheet = load(content, _GnssSheet, source=source)
    return GnssNoise(
        sheet.position_sd, sheet.velocity_sd, sheet.interval, sheet.gate, sheet.correlated, sheet.reference
    )


def grade_identification(grade: SensorGrade) -> Identification:
    """Return a grade as an identification: values with their references, no intervals, method ``datasheet``.

    ``source`` carries the sds of the turn-on constants by axis, and of scale factors by sensor.
    """
    channels: dict[str, ChannelIdentification] = {}
    turn_on: dict[str, float] = {}
    for triad in (grade.gyro, grade.accel):
        estimates = tuple(_estimates(triad))
        if not estimates:
            continue
        for axis in (f"{triad.kind}_{letter}" for letter in "xyz"):
            channels[axis] = channel_of_terms(
                axis,
                triad.unit,
                estimates,
                interval=1.0 / grade.rate.value,
                method="datasheet",
                shortest_tau=0.1,
                reason="no data",
            )
            if triad.turn_on_sd is not None:
                turn_on[axis] = triad.turn_on_sd.value
    scales = {
        triad.kind: triad.scale_factor_sd.value
        for triad in (grade.gyro, grade.accel)
        if triad.scale_factor_sd is not None
    }
    source = {"name": grade.key, "title": grade.title, "turn_on_sd": turn_on, "scale_factor_sd": scales}
    return Identification(
        source, channels, (f"figures of a sheet, not of a log: {grade.title}", *grade.notes)
    )


def _names(folder: str) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in (config_directory() / folder).glob("*.yaml")))


def _path(folder: str, name: str) -> Path:
    if name not in _names(folder):
        raise DataError(f"{name}: expected a built-in grade ({' '.join(_names(folder))})")
    return config_directory() / folder / f"{name}.yaml"


def _estimates(triad: TriadGrade) -> Iterator[TermEstimate]:
    """Yield the terms of a triad, in the order of its noise model."""
    terms = iter(triad.noise_model().terms)
    for name, field in POWER_LAW_PARAMETER.items():
        number: Sourced[float] | None = getattr(triad, name)
        if number is not None:
            (unit,) = next(terms).units(triad.unit)
            yield TermEstimate(name, {field: Coefficient(number.value, None, None, unit, number.reference)})
    for state in triad.gauss_markov:
        figures = {"sd": (state.value.sd, triad.unit), "time_constant": (state.value.time_constant, "s")}
        yield TermEstimate(
            "gauss_markov",
            {
                name: Coefficient(value, None, None, unit, state.reference)
                for name, (value, unit) in figures.items()
            },
        )
