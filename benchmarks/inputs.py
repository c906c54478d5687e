"""Formats of logs: the library that reads each, processor time for 20 000 samples of six axes, and what comes back.

``python -m benchmarks.inputs`` prints the table of ``docs/inputs.md``; the files are written as in the tests.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from tests.tuner.readers import test_files_people_have as files
from tests.tuner.readers import test_formats as formats
from tests.tuner.readers.messages import test_message_logs as messages
from tuner.readers import read

COUNT, RATE = 20_000, 100.0
TITLES = {
    "log.csv": ("CSV", "pandas"),
    "log.npz": ("NPZ", "numpy"),
    "log.mat": ("MAT 5", "own"),
    "log.h5": ("HDF5, MAT 7.3", "h5py"),
    "log.parquet": ("Parquet", "pyarrow"),
    "spreadsheet": ("semicolons, decimal commas, deg/s and g", "pandas"),
    "xsens": ("Xsens MT text", "pandas"),
    "vectornav": ("VectorNav CSV", "pandas"),
    "sbg": ("SBG text", "pandas"),
    "euroc": ("EuRoC folder", "pandas"),
    "phyphox": ("phyphox folder", "pandas"),
    "packed": ("Sensor Logger ZIP", "pandas"),
    "ulog": ("ULog", "pyulog"),
    "dataflash": ("dataflash BIN", "pymavlink"),
    "ros1": ("ROS 1 bag", "rosbags"),
    "ros2": ("ROS 2 bag", "rosbags"),
    "mcap": ("MCAP", "rosbags"),
}


def main() -> None:
    """Write, read and compare every format."""
    rng = np.random.default_rng(3)
    for module in (files, messages, formats):
        module.RATE, module.T = RATE, np.arange(COUNT) / RATE
        module.GYRO = rng.normal(0.0, 1e-3, (COUNT, 3))
        module.ACCEL = rng.normal(0.0, 1e-2, (COUNT, 3)) + np.array([0.0, 0.0, 9.81])
    files.N = COUNT
    formats.TEMPERATURE = np.full(COUNT, 25.0)
    formats.COLUMNS = {"t": formats.T, "temperature": formats.TEMPERATURE}
    formats.COLUMNS |= {f"gyro_{a}": formats.GYRO[:, j] for j, a in enumerate("xyz")}
    formats.COLUMNS |= {f"accel_{a}": formats.ACCEL[:, j] for j, a in enumerate("xyz")}
    print("| file | read by | s | largest difference, gyro rad/s, accel m/s² |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, (title, library) in TITLES.items():
            place = Path(folder) / name
            place.mkdir()
            if name in formats.WRITERS:
                module, path = formats, formats.WRITERS[name](place / name)
            elif name in messages.MAKERS:
                module, path = messages, messages.MAKERS[name](place, fixes=False)
            else:
                module, path = files, getattr(files, name)(place)
            start = time.process_time()
            gyro, accel = read(path)
            seconds = time.process_time() - start
            pairs = ((gyro, module.GYRO), (accel, module.ACCEL))
            off = [np.abs(one.y - truth[: len(one.y)]).max() for one, truth in pairs]
            print(f"| {title} | {library} | {seconds:.2f} | {off[0]:.0e}, {off[1]:.0e} |", flush=True)


if __name__ == "__main__":
    main()
