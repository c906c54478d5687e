"""An Allan curve as a text file: columns ``tau``, ``deviation`` and optionally ``dof``.

A unit may follow in brackets (``deviation [deg/h]``); without one it is rad/s. Other names of the same
columns: ``taus``, ``adev``, ``sigma``, ``allan_deviation``, ``edf``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from models.units import unit_of_samples, unit_value
from tuner.readers import column_names as names
from tuner.readers.text import named_columns, read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types import AllanCurve
from tuner.types.records import DataError

_TAU = frozenset(("tau", "taus", "averaging_time", "cluster_time"))
_DEVIATION = frozenset(("deviation", "adev", "oadev", "sigma", "allan_deviation", "dev", "allan_dev"))
_DOF = frozenset(("dof", "edf", "degrees_of_freedom"))


def is_curve(path: str | Path) -> bool:
    """Return whether a file is a text file with the columns tau and deviation."""
    plain = {names.parse_name(name).plain for name in named_columns(Path(path))}
    return bool(plain & _TAU) and bool(plain & _DEVIATION)


def read_curve(path: str | Path) -> AllanCurve:
    """Read an overlapping Allan curve.

    Parameters
    ----------
    path : str or Path
        Text file with the columns tau (s), deviation and optionally dof.

    Returns
    -------
    AllanCurve
        Estimator ``oadev``, one axis ``gyro`` or ``accel`` (by the unit), SI, sorted by tau. `dof` is NaN
        where the file does not state it.

    Raises
    ------
    DataError
        Missing columns, text in numbers, or values that are not positive.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    dialect = find_dialect(path)
    parsed = [names.parse_name(name) for name in dialect.names]
    found = []
    for wanted, aliases in (("tau", _TAU), ("deviation", _DEVIATION), ("dof", _DOF)):
        column = next((j for j, name in enumerate(parsed) if name.plain in aliases), None)
        if column is None and wanted != "dof":
            raise DataError(
                f"{path}: no column '{wanted}': expected tau,deviation[,dof], found "
                f"{', '.join(dialect.names)}"
            )
        found.append(column)
    columns = [j for j in found if j is not None]
    (table,) = read_numbers(path, dialect, [columns])
    for row, values in enumerate(table):
        bad = next((j for j, value in enumerate(values) if not 0.0 < value < np.inf), None)
        if bad is not None:
            raise DataError(
                f"{path}: data row {row + 1}: expected a positive {dialect.names[columns[bad]]}, found "
                f"{values[bad]:g}: "
                "repair or remove the line"
            )
    table = table[np.argsort(table[:, 0], kind="stable")]
    if len(table) < 2 or (np.diff(table[:, 0]) == 0.0).any():
        raise DataError(
            f"{path}: expected at least two different tau, found {len(np.unique(table[:, 0]))} in "
            f"{len(table)} rows"
        )
    tau_unit = names.unit_of(parsed[columns[0]].unit or "s", names.TIME_UNITS, what=f"{path}: tau")
    rates = [u for sensor in names.SENSORS for u in names.UNITS[sensor] if u not in names.INCREMENT_UNITS]
    named = names.unit_of(parsed[columns[1]].unit or "rad/s", rates, what=f"{path}: deviation")
    sensor = "gyro" if named in names.UNITS["gyro"] else "accel"
    deviation = table[:, 1:2] * unit_value(named)
    return AllanCurve(
        estimator="oadev",
        tau=table[:, 0] * names.TIME_UNITS[tau_unit],
        variance=deviation**2,
        dof=table[:, 2:3].copy() if len(columns) == 3 else np.full((len(table), 1), np.nan),
        unit=unit_of_samples(sensor),
        axes=(sensor,),
    )
