"""Raw sequences of KITTI: a folder ``oxts`` with ``timestamps.txt`` and one text file a sample.

Fields of a file, from the data set's ``dataformat.txt``: 12–14 acceleration along x forward, y left, z up, m/s²; 18–20
angular rates about them, rad/s. Positions in it are the unit's own solution, no fixes of a receiver.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError

ACCEL_FIELDS, GYRO_FIELDS = slice(11, 14), slice(17, 20)
FIELDS_A_SAMPLE = 30


def oxts_folder(path: Path) -> Path | None:
    """Return the folder with ``timestamps.txt`` and ``data`` in or at a path, or None."""
    found = (f for f in (path, path / "oxts") if (f / "timestamps.txt").is_file() and (f / "data").is_dir())
    return next(found, None)


def list_kitti(path: Path) -> Listing:
    """Return time, angular rates and specific forces of a raw sequence.

    Raises
    ------
    DataError
        Files that are missing or hold something else.
    """
    import pandas as pd

    folder = oxts_folder(path)
    assert folder is not None, "recognized by it"
    files = sorted((folder / "data").glob("*.txt"))
    try:
        stamps = pd.to_datetime((folder / "timestamps.txt").read_text().split("\n"), format="mixed").dropna()
        rows = np.array([file.read_text().split() for file in files], dtype=float)
    except (OSError, ValueError, OverflowError) as error:
        raise DataError(
            f"{path}: expected stamps and {FIELDS_A_SAMPLE} numbers a sample as in KITTI's raw data: {error}"
        ) from None
    if rows.ndim != 2 or rows.shape[1] != FIELDS_A_SAMPLE or len(rows) != len(stamps):
        raise DataError(
            f"{path}: expected {FIELDS_A_SAMPLE} numbers for each of {len(stamps)} stamps, found {rows.shape}"
        )
    t = stamps.as_unit("ns").astype(np.int64).to_numpy()
    arrays = {"t": t, "gyro": rows[:, GYRO_FIELDS], "accel": rows[:, ACCEL_FIELDS]}
    return listing_of_arrays(path, arrays, units={"t": "ns", "gyro": "rad/s", "accel": "m/s^2"}, meta={})


FORMAT = LogFormat(
    "kitti",
    "folder oxts of KITTI",
    (".oxts",),
    lambda path, _: list_kitti(path),
    folder=lambda path: path.is_dir() and oxts_folder(path) is not None,
)
