"""Formats of logs and fixes: the library that reads each, processor time, and what comes back.

``python -m benchmarks.inputs`` prints the tables of ``docs/inputs.md``: 20 000 samples of six axes, 3600 fixes, 3600
poses. The files are written as in the tests: binary ones by the libraries of their formats where these write.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from models import rotation
from tests.tuner.readers import test_files_people_have as files
from tests.tuner.readers import test_formats as formats
from tests.tuner.readers import test_receiver_files as receivers
from tests.tuner.readers import test_waypoint_text as waypoint
from tests.tuner.readers.messages import test_message_logs as messages
from tuner.readers import read
from tuner.readers.drive import read_drive
from tuner.readers.estimate import read_estimate

COUNT, RATE = 20_000, 100.0
FIXES = 3600
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
    "sensor_logger": ("Sensor Logger folder", "pandas"),
    "sensor_logger_of_2021": ("Sensor Logger folder of 2021", "pandas"),
    "packed": ("Sensor Logger ZIP", "pandas"),
    "kitti": ("KITTI raw folder, a file a sample", "own"),
    "ulog": ("ULog", "pyulog"),
    "dataflash": ("dataflash BIN", "pymavlink"),
    "ros1": ("ROS 1 bag", "rosbags"),
    "ros2": ("ROS 2 bag", "rosbags"),
    "mcap": ("MCAP", "rosbags"),
}


FIX_TITLES = {
    "rtklib": ("RTKLIB `.pos`", "own"),
    "nmea": ("NMEA: GGA, RMC, GST", "pynmeagps"),
    "ubx": ("UBX: NAV-PVT", "pyubx2"),
    "urbannav": ("Inertial Explorer text in D M S, 60 epochs", "own"),
    "decimal": ("the same in decimal degrees", "own"),
    "tum": ("TUM trajectory", "numpy"),
}


def main() -> None:
    """Write, read and compare every format."""
    logs()
    fixes()


def logs() -> None:
    """Print the table of logs."""
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


def fixes() -> None:
    """Print the table of fixes and trajectories: places against those written."""
    receivers.SECONDS = FIXES
    receivers.LAT, receivers.LON = 47.0 + 2e-5 * np.arange(FIXES), 8.0 + 3e-5 * np.arange(FIXES)
    receivers.HEIGHT = 430.0 + 0.01 * np.arange(FIXES)
    print("\n| file | read by | s | largest difference, deg, m |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, (title, library) in FIX_TITLES.items():
            place = Path(folder) / name
            place.mkdir()
            if name in receivers.WRITERS:
                receivers.imu(place, receivers.CLOCKS["UNIX time"])
                receivers.WRITERS[name](place)
                start = time.process_time()
                llh = read_drive(place).gnss.llh
                written = np.column_stack([receivers.LAT, receivers.LON, receivers.HEIGHT])
            elif name == "tum":
                written = _tum(place / "tum.txt")
                start = time.process_time()
                llh = np.asarray(read_estimate(place / "tum.txt", frame="NED").local)
            else:
                (place / "ie.txt").write_text(waypoint.LAYOUTS[name]())
                start = time.process_time()
                llh = read_estimate(place / "ie.txt").llh
                written = np.column_stack([waypoint.LAT, waypoint.LON, waypoint.HEIGHT])
            seconds = time.process_time() - start
            off = (
                llh - written
                if name == "tum"
                else np.column_stack([np.degrees(llh[:, :2]), llh[:, 2]]) - written
            )
            angle = "–" if name == "tum" else f"{np.abs(off[:, :2]).max():.0e}"
            print(
                f"| {title} | {library} | {seconds:.2f} | {angle}, {np.abs(off[:, 2]).max():.0e} |",
                flush=True,
            )


def _tum(path: Path) -> np.ndarray:
    """Write a trajectory of TUM and return its places, m."""
    t = np.arange(FIXES) / 10.0
    places = np.column_stack([3.0 * t, np.sin(t), 0.01 * t])
    quat = rotation.quat_from_rpy(np.column_stack([0.1 * np.sin(t), 0.1 * np.cos(t), 0.01 * t]))
    rows = np.column_stack([1.7e9 + t, places, np.roll(quat, -1, axis=1)])
    np.savetxt(path, rows, header="timestamp tx ty tz qx qy qz qw", fmt="%.12g")
    return places


if __name__ == "__main__":
    main()
