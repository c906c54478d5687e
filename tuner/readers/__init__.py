"""Logs of any format become records: even in time, in SI units, every repair noted.

`read` finds the format by the ending of the name, else by the first bytes (`log_format`). One file a format lists the
columns; `sensor_columns` chooses among them, `column_units` decides their units and `unit_checks` whether the samples
agree, `time_base` finds interval and gaps, `assemble` converts to SI. `read_curve` reads an Allan curve
``tau,deviation[,dof]``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tuner.formats.guard import input_guard
from tuner.readers import hdf5, kitti, mat, npz, parquet, phone_folders, text
from tuner.readers.allan_curve import is_curve, read_curve
from tuner.readers.assemble import Plan, checked, even, plan_of
from tuner.readers.block_means import read_means, reduction
from tuner.readers.column_mapping import parse_columns
from tuner.readers.columns import Listing, Progress, digest
from tuner.readers.log_format import FORMATS, LogFormat, columns_of, file_of, log_folder
from tuner.readers.logs_in_memory import Table, in_python, list_table
from tuner.readers.messages import ardupilot, rosbag, ulog
from tuner.readers.options import Options
from tuner.readers.readings import advised
from tuner.readers.refusal import Refusal, RowsApart
from tuner.readers.source_kind import unit_of_log
from tuner.readers.time_range import between
from tuner.types.arguments import expect
from tuner.types.one_line import printable
from tuner.types.public import public
from tuner.types.records import DataError, Record

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FORMATS", "LogFormat", "is_curve", "parse_columns", "read", "read_curve"]

FORMATS.extend((npz.FORMAT, mat.FORMAT, hdf5.FORMAT, parquet.FORMAT))
FORMATS.extend((ulog.FORMAT, rosbag.FORMAT, ardupilot.FORMAT))
FORMATS.extend((phone_folders.FORMAT, kitti.FORMAT, text.FORMAT))


@public("read")
def read(
    path: str | Path | Table | pd.DataFrame,
    *,
    rate: float | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    gyro_scale: float | None = None,
    accel_scale: float | None = None,
    columns: Mapping[str, str] | None = None,
    constant_axes: bool = False,
    assume: str | None = None,
    memory: float | None = None,
    stamps: bool = False,
    begin: float | None = None,
    end: float | None = None,
    progress: Progress | None = None,
) -> tuple[Record, ...]:
    """Read a log of a gyroscope, an accelerometer or both.

    Parameters
    ----------
    path : str, Path, mapping of str to array, or DataFrame
        The log; the format of a file is found by the ending of its name, else by its first bytes. ``log.bin:IMU.1``
        is one of several inertial units of a log of messages. Columns of a table
        have the names of a file's, ``gyro_x [deg/s]`` or ``gyro`` (n, 3); an index of time stands for ``t``.
    rate : float, optional
        Sampling rate, Hz: needed where the file has neither stamps nor a stated rate; checked against stamps.
    gyro_unit, accel_unit : str, optional
        ``rad/s deg/s deg/h mrad/s mdeg/s rad deg arcsec`` and ``m/s^2 g mg ug cm/s^2 ft/s^2 m/s cm/s ft/s``, instead
        of what the file says. Units without time (and lengths by s) are increments: they are divided by the interval.
    gyro_scale, accel_scale : float, optional
        Units in one count.
    columns : mapping of str to str, optional
        Columns by name: ``{"gyro": "imu0[3:6]", "t": "stamp [ms]", "pressure": "baro"}``; see
        `parse_columns`.
    constant_axes : bool
        Whether an axis that never changes is kept beside others that do.
    assume : str, optional
        ``si``: units that neither the file nor an option states are SI, whatever the samples look like.
    memory : float, optional
        Bytes that the program may take; by default half of what is free, and no more than 4 million rows are kept. A
        text, Parquet, HDF5 or NPZ log that needs more becomes records of means of 2, 4, 8 … samples, and says so.
    stamps : bool
        Whether the stamps as they are become a channel ``stamp``: samples of a drive may lie unevenly.
    begin, end : float, optional
        Part of the log that is used, s from its first sample.
    progress : callable, optional
        Called with (done, total) while a file is read: bytes of a text, else rows or arrays.

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
    for name, value in (
        ("rate", rate),
        ("gyro_scale", gyro_scale),
        ("accel_scale", accel_scale),
        ("memory", memory),
    ):
        if value is not None and not value > 0.0:
            raise DataError(f"read: {name}: expected a positive number, found {value}")
    if assume not in (None, "si"):
        raise DataError(f"read: assume: expected 'si' or None, found {assume!r}")
    if isinstance(path, str):
        expect(path, str, "read", "the path of a log")
    options = Options(
        rate=rate,
        unit={"gyro": gyro_unit, "accel": accel_unit},
        scale={"gyro": gyro_scale, "accel": accel_scale},
        columns=columns,
        constant_axes=constant_axes,
        assume_si=assume == "si",
        stamps=stamps,
        part=(-math.inf if begin is None else begin, math.inf if end is None else end),
    )
    if not isinstance(path, str | Path):
        try:
            listing, identity = list_table(path)
            try:
                return between(_records(listing, plan_of(listing, options), identity, options), begin, end)
            except Refusal as refusal:
                raise DataError(advised(refusal, listing, options)) from None
        except DataError as error:
            raise DataError(in_python(str(error))) from None
    named = path
    whole, unit_name = unit_of_log(path)
    path = file_of(whole)
    if not path.exists():
        raise DataError(f"{path}: no such file")
    if not path.is_file() and log_folder(path) is None:
        found = (
            "a folder without their files; name the file in it"
            if path.is_dir()
            else "neither; copy it to a file"
        )
        kinds = "EuRoC, KITTI, phyphox, Sensor Logger or a ROS 2 bag"
        raise DataError(f"{path}: expected a file, or a folder of {kinds}, found {found}")
    listing = columns_of(path, progress, unit_name)
    with input_guard(path, "a log"), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            plan = plan_of(listing, options)
            how = reduction(listing, plan, memory)
            if how is not None:
                return read_means(listing, plan, digest(path), options, how, begin, end)
            records = _records(listing, plan, digest(path), options)
        except Refusal as refusal:
            raise refusal.line(advised(refusal, listing, options)) from None
        if unit_name:
            records = tuple(replace(record, source=printable(str(named))) for record in records)
        return between(records, begin, end)


def _records(listing: Listing, plan: Plan, identity: str, options: Options) -> tuple[Record, ...]:
    """Return the records of a listing; sensors that stand in different rows each by itself, with a clock of its own."""
    try:
        return checked(listing, plan, even(listing, plan, identity, options), options)
    except RowsApart as apart:
        alone = (
            replace(options, columns={**(options.columns or {}), **change.columns})
            for change in apart.changes
        )
        each = (_records(listing, plan_of(listing, one), identity, one) for one in alone)
        return tuple(record for records in each for record in records)
