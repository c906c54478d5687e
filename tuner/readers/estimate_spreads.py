"""Sds and covariances of named columns of the output of a filter, in SI; units that are not stated, by their size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.earth import metres_per_radian
from models.units import unit_value
from tuner.readers.estimate_column_names import (
    SPREADS,
    UNITS,
    same_kind,
    stated_unit,
    units_of_product,
)
from tuner.types.records import DataError

LATITUDE_SD_IN_DEGREES = 1e-3
"""Sds of latitude below it are in degrees where no unit is stated: in metres they would be below a millimetre."""


@dataclass(frozen=True)
class Spread:
    """Covariance of named columns in SI, shape (n, m, m), NaN where the file states none."""

    names: tuple[str, ...]
    mat: FloatArray

    def of(self, names: tuple[str, ...]) -> FloatArray:
        """Return the covariance of some of the columns."""
        at = [self.names.index(name) for name in names]
        return np.asarray(self.mat[:, at][:, :, at])


def stated_spread(
    source: str,
    columns: Mapping[str, tuple[FloatArray, str | None]],
    units: Mapping[str, str],
    values: Mapping[str, FloatArray],
    notes: list[str],
) -> Spread | None:
    """Return the covariance of all columns whose sds or covariances the file states, SI."""
    stated = {name: SPREADS[name] for name in columns if name in SPREADS}
    names = tuple(dict.fromkeys(x for pair in stated.values() for x in pair if x is not None))
    if not names:
        return None
    degrees = _horizontal_in_degrees(columns, notes)

    def factor(name: str, unit: str | None) -> float:
        if unit is not None and name in ("lat", "lon") and same_kind(unit, "m"):
            return unit_value(unit) / _metres(name, values)
        if unit is None:
            if name in ("lat", "lon") and not degrees:
                return 1.0 / _metres(name, values)
            return unit_value(units.get(name, UNITS[name]))
        if not same_kind(unit, UNITS[name]):
            raise DataError(
                f"{source}: sd or covariance of {name} in {unit}: expected a unit such as {UNITS[name]}"
            )
        return unit_value(unit)

    mat = np.full((len(values["t"]), len(names), len(names)), np.nan)
    for column, (a, b) in stated.items():
        data, bracket = columns[column]
        if b is None:
            i = names.index(a)
            unit = None if bracket is None else stated_unit(source, column, bracket)
            if np.nanmin(data) < 0.0:
                raise DataError(f"{source}: {column}: expected sds, found {np.nanmin(data):.3g}")
            mat[:, i, i] = (factor(a, unit) * data) ** 2
    for column, (a, b) in stated.items():
        if b is not None:
            data, bracket = columns[column]
            ua, ub = (None, None) if bracket is None else units_of_product(source, column, bracket)
            i, j = names.index(a), names.index(b)
            mat[:, i, j] = mat[:, j, i] = factor(a, ua) * factor(b, ub) * data
    return Spread(names, mat)


def _horizontal_in_degrees(columns: Mapping[str, tuple[FloatArray, str | None]], notes: list[str]) -> bool:
    """Tell whether sds of latitude without a unit are in degrees: in metres they would be impossibly small."""
    for name, power in (("sd_lat", 1.0), ("cov_lat_lat", 0.5)):
        if name in columns and columns[name][1] is None:
            small = float(np.nanmedian(columns[name][0])) ** power < LATITUDE_SD_IN_DEGREES
            notes.append(f"{name} without a unit is taken as {'deg' if small else 'm'}, by its size")
            return bool(small)
    return False


def _metres(name: str, values: Mapping[str, FloatArray]) -> float:
    """Return metres per radian of latitude or longitude, at the middle of the record."""
    llh = np.array([np.nanmedian(values[k]) for k in ("lat", "lon", "height")])
    return float(metres_per_radian(llh)[0 if name == "lat" else 1])
