"""Memory that stages take beside the samples they are given, in multiples of one axis.

A record of 10⁸ samples is larger than the caches and nearly as large as the memory: what a stage makes of it must be
small, or few columns. Allocations are counted exactly (`tracemalloc`); the bounds are what the stages need by design,
with room for what does not grow with the record.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tuner.diagnosis.data_quality import data_quality_tests
from tuner.diagnosis.static.causes import motion
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.hypothesis_tests import threshold
from tuner.diagnosis.static.search import search_causes
from tuner.readers import read
from tuner.readers.assemble import plan_of
from tuner.readers.block_means import BASE_BYTES, BYTES_A_NUMBER, BYTES_A_ROW
from tuner.readers.npz import list_npz
from tuner.readers.options import Options
from tuner.segments.multi_position import find_poses
from tuner.types.records import Record

SAMPLES = 300_000


@pytest.fixture(scope="module")
def sensors() -> tuple[Record, Record]:
    """Two triads of white noise on one clock; the accelerometers feel gravity."""
    rng, t = np.random.default_rng(0), 0.01 * np.arange(SAMPLES)
    gyro, force = rng.standard_normal((2, 3, SAMPLES))
    return (
        Record("gyro", t, 1e-3 * gyro.T, ("gyro_x", "gyro_y", "gyro_z"), "rad/s", 0.01),
        Record("accel", t, 0.01 * force.T + [0.0, 0.0, 9.81], ("a_x", "a_y", "a_z"), "m/s^2", 0.01),
    )


def columns_taken(work: Callable[[], object]) -> float:
    """Return the largest memory that work takes, in columns of `SAMPLES` numbers; what it returns counts."""
    work()  # compiles, and loads what is loaded when it is used
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / (8.0 * SAMPLES)
    finally:
        tracemalloc.stop()


def test_search_for_stand_stills_takes_half_a_column_a_channel(sensors: tuple[Record, Record]) -> None:
    """Blocks of a quarter of a second that overlap are 1/12 of the samples, with four numbers for each of six axes."""
    assert columns_taken(lambda: find_poses(sensors)) < 3.2


def test_search_for_motion_of_six_channels_takes_no_copy_of_one(sensors: tuple[Record, Record]) -> None:
    """Steps between block means are a quarter of a second apart."""
    six = [channel(record, axis) for record in sensors for axis in record.axes]
    assert columns_taken(lambda: motion.stretches(six)) < 1.0


def test_search_for_causes_takes_few_columns(sensors: tuple[Record, Record]) -> None:
    """Residuals, coefficients and squares are columns; spectra are in single precision and taken by turns."""
    one = channel(sensors[0], "gyro_x")
    limit = threshold(6)
    assert columns_taken(lambda: search_causes(one, limit)) < 10.0


def test_channel_is_prepared_in_place(sensors: tuple[Record, Record]) -> None:
    """What comes back is a column, and a byte for each sample."""
    assert columns_taken(lambda: channel(sensors[0], "gyro_x")) < 1.3


def test_data_quality_of_a_triad_takes_few_columns(sensors: tuple[Record, Record]) -> None:
    """What is largest here does not grow with the record: the values of the first 200 000 samples, lags of 100 000."""
    assert columns_taken(lambda: data_quality_tests(sensors[0])) < 6.5


def test_columns_are_loaded_beside_one_copy_of_a_sensor(
    sensors: tuple[Record, Record], tmp_path: Path
) -> None:
    """Seven columns are loaded, three at a time brought into one block."""
    columns = {axis: record.column(axis) for record in sensors for axis in record.axes}
    np.savez(tmp_path / "log.npz", t=sensors[0].t, **columns)
    listing = list_npz(tmp_path / "log.npz")
    groups = plan_of(listing, Options(None, {}, {}, None)).groups
    assert columns_taken(lambda: listing.load(groups)) < 10.2


def test_log_larger_than_its_memory_is_read_into_its_means(
    sensors: tuple[Record, Record], tmp_path: Path
) -> None:
    """Means of four samples make 1.75 columns; parts, here an eighth of the log, are held some seven times."""
    columns = {axis: record.column(axis) for record in sensors for axis in record.axes}
    np.savez(tmp_path / "log.npz", t=sensors[0].t, **columns)
    allowed = BASE_BYTES + SAMPLES / 4 * (7 * BYTES_A_NUMBER + BYTES_A_ROW)
    assert read(tmp_path / "log.npz", memory=allowed)[0].samples_a_mean == 4
    assert columns_taken(lambda: read(tmp_path / "log.npz", memory=allowed)) < 8.8
