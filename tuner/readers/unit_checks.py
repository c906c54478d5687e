"""Are the units of a log possible? A reading of an inertial sensor at rest has a known size.

An accelerometer triad at rest reads g = 9.80665 m/s² whatever its attitude; a mean reading off by more than
100× has another unit than the one it was read in. A mean reading far below g is not refused where it drowns in the
noise: then gravity was taken out, or the log is simulated noise. A gyroscope that reads more than 35 rad/s
(2000 deg/s) in the median, or turns evenly at more than 5 rad/s, reads another unit. A single reading beyond
`MAX_READING` is a broken row of the file, no spike of a sensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from models.units import STANDARD_GRAVITY, unit_value
from tuner.readers.column_names import INCREMENT_UNITS, UNITS
from tuner.types.records import DataError, Record

MAX_UNIT_FACTOR = 100.0
"""Factor by which a unit may be wrong before it is refused: nearer ones, such as g for m/s², get a note."""
MAX_READING: Mapping[str, float] = MappingProxyType({"gyro": 1e5, "accel": 1e6})
"""Readings that no sensor has, rad/s and m/s²."""
_MAX_MEDIAN_RATE = 35.0
"""rad/s, 2000 deg/s: the range of consumer gyroscopes, which no log exceeds in the median."""
_MAX_STEADY_RATE = 5.0
"""rad/s: nothing that is navigated turns as fast all the time; rate tables are slower."""
_CHECKED_SAMPLES = 200_000
"""Samples from which sizes are taken: medians are then known to 0.3 %."""


def check_units(
    source: str, records: Sequence[Record], units: Mapping[str, str], *, stated: Iterable[str] = ()
) -> list[str]:
    """Return notes on units that may be wrong.

    `units` are those the records were read in; `stated` names the sensors whose unit the user gave as an
    option.

    Raises
    ------
    DataError
        A unit off by more than 100×, with the probable one; a reading that no sensor has.
    """
    notes = []
    for record in records:
        if record.y.shape[1] == 3 and record.name == "accel":
            notes += _check_accel(source, record, units["accel"], stated="accel" in stated)
        elif record.y.shape[1] == 3:
            _check_gyro(source, record, units["gyro"])
        _check_range(source, record)
    return notes


def _check_range(source: str, record: Record) -> None:
    """Refuse a record with single readings that no sensor has; where all are, they are counts."""
    limit = MAX_READING.get(record.name, np.inf)
    if max(record.y.max(), -record.y.min()) > limit > np.median(np.abs(record.y[:_CHECKED_SAMPLES])):
        first = int(np.argmax(np.abs(record.y).max(axis=1)))
        msg = (
            f"{source}: {record.name} reads {np.abs(record.y[first]).max():.3g} {record.unit} in sample {first + 1}, "
            "which no sensor does: a broken row; take it out or write NaN"
        )
        raise DataError(msg)


def _sizes(record: Record) -> tuple[float, float, float]:
    """Return the median norm, the norm of the mean, and the norm of the robust sample-to-sample noise."""
    y = record.y[:: max(1, len(record) // _CHECKED_SAMPLES)]
    noise = np.median(np.abs(np.diff(y, axis=0)), axis=0) * 1.4826 / np.sqrt(2.0)
    norm = np.sqrt(np.einsum("ij,ij->i", y, y))
    return float(np.median(norm)), float(np.linalg.norm(y.mean(axis=0))), float(np.linalg.norm(noise))


def _check_accel(source: str, record: Record, unit: str, *, stated: bool) -> list[str]:
    size, mean, noise = _sizes(record)
    tiny = size < STANDARD_GRAVITY / MAX_UNIT_FACTOR
    if size > MAX_UNIT_FACTOR * STANDARD_GRAVITY or (tiny and not stated and mean > 20.0 * noise):
        msg = (
            f"{source}: accel reads {size:.3g} m/s^2 where gravity alone is 9.8: the unit is wrong by "
            f"{max(size / STANDARD_GRAVITY, STANDARD_GRAVITY / size):.3g}x; pass --accel-unit"
            f"{_probable(size / _si(unit, record), record)}"
        )
        raise DataError(msg)
    if tiny:
        return ["accel: no gravity in the log, so its unit could not be checked"]
    if abs(size - 1.0) < 0.1 and noise < 0.1:
        return [f"accel reads {size:.4g} m/s^2 at rest, as if in g: if so pass --accel-unit g"]
    return []


def _check_gyro(source: str, record: Record, unit: str) -> None:
    size, _, noise = _sizes(record)
    even = float(np.linalg.norm(np.median(record.y[:: max(1, len(record) // _CHECKED_SAMPLES)], axis=0)))
    if size > _MAX_MEDIAN_RATE or (even > _MAX_STEADY_RATE and noise < even):
        raw = size / _si(unit, record)
        rates = [u for u in UNITS["gyro"] if u not in INCREMENT_UNITS and u != unit]
        fitting = [u for u in rates if raw * unit_value(u) < 1.0]
        msg = (
            f"{source}: gyro reads {size:.3g} rad/s ({np.rad2deg(size):.3g} deg/s) in the median: the unit "
            "is wrong; "
            "pass --gyro-unit" + (f" {fitting[0]} (probably)" if fitting else "")
        )
        raise DataError(msg)


def _si(unit: str, record: Record) -> float:
    """Return the SI value of one unit; of an increment, as a rate."""
    return unit_value(unit) / (record.interval if unit in INCREMENT_UNITS else 1.0)


def _probable(raw: float, record: Record) -> str:
    """Return the unit in which a raw reading is g, as words to follow ``--accel-unit``."""
    best = min(UNITS["accel"], key=lambda u: abs(np.log(raw * _si(u, record) / STANDARD_GRAVITY)))
    return f" {best} (probably)" if abs(raw * _si(best, record) / STANDARD_GRAVITY - 1.0) < 0.2 else ""
