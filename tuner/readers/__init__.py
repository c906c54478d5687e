"""Logs of any format become records: even in time, in SI units, every repair noted.

`read` chooses the format by the ending of the name: text (``.csv .tsv .txt`` and others, ``.gz`` allowed),
``.npz``, ``.mat``, ``.h5 .hdf5``, ``.parquet``. One file a format lists the columns; `layout` chooses among
them, `timebase` finds interval and gaps, `assemble` converts to SI. `read_curve` reads an Allan curve
``tau,deviation[,dof]``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from tuner.readers.allan_curve import is_curve, read_curve
from tuner.readers.assemble import assemble_records
from tuner.readers.column_mapping import parse_columns
from tuner.readers.columns import Listing, Progress, digest
from tuner.readers.npz import list_npz
from tuner.readers.options import Options
from tuner.readers.text import list_text
from tuner.types.records import DataError, Record

__all__ = ["is_curve", "parse_columns", "read", "read_curve"]


def read(
    path: str | Path,
    *,
    rate: float | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    gyro_scale: float | None = None,
    accel_scale: float | None = None,
    columns: Mapping[str, str] | None = None,
    constant_axes: bool = False,
    progress: Progress | None = None,
) -> tuple[Record, ...]:
    """Read a log of a gyroscope, an accelerometer or both.

    Parameters
    ----------
    path : str or Path
        The log; the format is chosen by the ending of its name.
    rate : float, optional
        Sampling rate, Hz: needed where the file has neither stamps nor a stated rate; checked against stamps.
    gyro_unit, accel_unit : str, optional
        ``rad/s deg/s deg/h rad deg arcsec`` and ``m/s^2 g mg m/s``, instead of what the file says. Units
        without time (and m/s) are increments: they are divided by the interval.
    gyro_scale, accel_scale : float, optional
        Units in one count.
    columns : mapping of str to str, optional
        Columns by name: ``{"gyro": "imu0[3:6]", "t": "stamp [ms]", "pressure": "baro"}``; see
        `parse_columns`.
    constant_axes : bool
        Whether an axis that never changes is kept beside others that do.
    progress : callable, optional
        Called with (bytes done, bytes in total) while a text file is parsed.

    Returns
    -------
    tuple of Record
        A ``gyro`` record, an ``accel`` record or both, on one clock; temperature and mapped channels are
        covariates.

    Raises
    ------
    DataError
        A file that cannot be used: one line with file, place, expected, found and what to do.
    """
    path = Path(path)
    for name, value in (("--rate", rate), ("--gyro-scale", gyro_scale), ("--accel-scale", accel_scale)):
        if value is not None and not 0.0 < value < float("inf"):
            msg = f"{name}: expected a positive number, got {value}"
            raise DataError(msg)
    listing = _listing(path, progress)
    options = Options(
        rate=rate,
        unit={"gyro": gyro_unit, "accel": accel_unit},
        scale={"gyro": gyro_scale, "accel": accel_scale},
        columns=columns,
        constant_axes=constant_axes,
    )
    return assemble_records(listing, digest(path), options)


def _listing(path: Path, progress: Progress | None) -> Listing:
    if not path.exists():
        msg = f"{path}: no such file"
        raise DataError(msg)
    if not path.is_file():
        msg = f"{path}: not a file"
        raise DataError(msg)
    suffix = path.suffix.lower()
    if suffix in _BINARY:
        return _BINARY[suffix](path)
    if suffix in _FOREIGN:
        msg = f"{path}: '{suffix}' logs are not read by `read`: convert to CSV, NPZ, HDF5 or Parquet"
        raise DataError(msg)
    return list_text(path, progress=progress)


def _mat(path: Path) -> Listing:
    from tuner.readers.mat import list_mat

    return list_mat(path)


def _hdf5(path: Path) -> Listing:
    from tuner.readers.hdf5 import list_hdf5

    return list_hdf5(path)


def _parquet(path: Path) -> Listing:
    from tuner.readers.parquet import list_parquet

    return list_parquet(path)


_BINARY: Mapping[str, Callable[[Path], Listing]] = {
    ".npz": list_npz,
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".hdf": _hdf5,
    ".parquet": _parquet,
    ".pq": _parquet,
}
_FOREIGN = frozenset((".bag", ".db3", ".mcap", ".ulg", ".bin", ".tlog", ".zip", ".xlsx", ".npy"))
