"""Formats of logs and fixes: the library that reads each, processor time, and what comes back.

``python -m benchmarks.inputs`` prints the tables of ``docs/inputs.md``: 20 000 samples of six axes, 3600 fixes, 3600
poses. The files are written as in the tests: binary ones by the libraries of their formats where these write.
``python -m benchmarks.inputs FILE …`` prints a row for each of these files, which others wrote: what was read of it.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from models import rotation
from tests.tuner.readers import test_files_people_have as files
from tests.tuner.readers import test_formats as formats
from tests.tuner.readers import test_receiver_files as receivers
from tests.tuner.readers import test_waypoint_text as waypoint
from tests.tuner.readers.messages import test_message_logs as messages
from tuner.formats.customary_units import phrase
from tuner.identification import identify
from tuner.readers import read
from tuner.readers.drive import read_drive
from tuner.readers.estimate import read_estimate
from tuner.readers.log_format import file_of, format_of
from tuner.types import Coefficient, Identification
from tuner.types.records import DataError

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


READINGS = 3
"""Times that each file is read, for the scatter of the times."""


def main() -> None:
    """Write, read and compare every format; of files that are named, say what was read."""
    if sys.argv[1:]:
        published([Path(name) for name in sys.argv[1:]])
        return
    logs()
    fixes()


def timed(read_it: Callable[[], Any]) -> tuple[Any, str]:
    """Return what is read, and the processor time that takes, s, with half the range of some readings."""
    spent = []
    for _ in range(READINGS):
        start = time.process_time()
        found = read_it()
        spent.append(time.process_time() - start)
    return found, f"{np.median(spent):.2f} ± {0.5 * np.ptp(spent):.2f}"


def published(paths: Sequence[Path]) -> None:
    """Print the format, the time, the rate, the length and the white noise of each log, or why it is refused."""
    print(
        "| file | read as | s | Hz | samples at rest | N, deg/√h | N, µg/√Hz |\n|---|---|---|---|---|---|---|"
    )
    for path in paths:
        try:
            title = format_of(file_of(path)).title
            records, seconds = timed(lambda path=path: read(path))
            rest = sum(stop - start for start, stop in records[0].segments)
            found = identify(records, arma=None)
        except DataError as error:
            print(f"| {path.name} | refused: {str(error).removeprefix(f'{path}: ')} | | | | | |", flush=True)
            continue
        noise = {
            unit: [phrase(one, "white.density", unit, with_unit=False) for one in whites]
            for unit, whites in _whites(found).items()
        }
        cells = ["; ".join(noise.get(unit, ["–"])) for unit in ("rad/s", "m/s^2")]
        rate = f"{records[0].rate:.5g}"
        print(f"| {path.name} | {title} | {seconds} | {rate} | {rest} | {' | '.join(cells)} |", flush=True)


def _whites(found: Identification) -> dict[str, list[Coefficient]]:
    """Return the white noise of every axis by the unit of its sensor."""
    whites: dict[str, list[Coefficient]] = {}
    for channel in found.channels.values():
        if (term := channel.term("white")) is not None:
            whites.setdefault(channel.unit, []).append(term.coefficients["density"])
    return whites


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
            (gyro, accel), seconds = timed(lambda path=path: read(path))
            pairs = ((gyro, module.GYRO), (accel, module.ACCEL))
            off = [np.abs(one.y - truth[: len(one.y)]).max() for one, truth in pairs]
            print(f"| {title} | {library} | {seconds} | {off[0]:.0e}, {off[1]:.0e} |", flush=True)


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
                drive, seconds = timed(lambda place=place: read_drive(place))
                llh = drive.gnss.llh
                written = np.column_stack([receivers.LAT, receivers.LON, receivers.HEIGHT])
            elif name == "tum":
                written = _tum(place / "tum.txt")
                found, seconds = timed(lambda place=place: read_estimate(place / "tum.txt", frame="NED"))
                llh = np.asarray(found.local)
            else:
                (place / "ie.txt").write_text(waypoint.LAYOUTS[name]())
                found, seconds = timed(lambda place=place: read_estimate(place / "ie.txt"))
                llh = found.llh
                written = np.column_stack([waypoint.LAT, waypoint.LON, waypoint.HEIGHT])
            off = (
                llh - written
                if name == "tum"
                else np.column_stack([np.degrees(llh[:, :2]), llh[:, 2]]) - written
            )
            angle = "–" if name == "tum" else f"{np.abs(off[:, :2]).max():.0e}"
            print(
                f"| {title} | {library} | {seconds} | {angle}, {np.abs(off[:, 2]).max():.0e} |",
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
