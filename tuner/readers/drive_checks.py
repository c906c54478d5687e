"""Are the numbers of a drive possible in the stated units? Dead sensors, and speeds that no vehicle has.

Whether its streams agree with one another is checked where it is filtered (`tuner.navigation.drive.unit_checks`,
`.axes`).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from models.earth import ned_between
from models.units import FOOT, MILLI_G, STANDARD_GRAVITY
from tuner.types.records import DataError

MAX_SAMPLE_INTERVAL = 0.5
"""Longest interval of inertial samples that can be navigated with, s."""
MAX_HEIGHT = 5e4
"""Height above which no land, sea or air vehicle of this project's users is, m."""
MAX_SPEED = 350.0
"""Speed above which no such vehicle is, m/s."""
MAX_ANGULAR_RATE = 35.0
"""Angular rate that 99 % of the samples stay below, rad/s."""
FORCE_UNITS = {"g": 1.0 / STANDARD_GRAVITY, "mg": 1.0 / MILLI_G, "ft/s²": 1.0 / FOOT}
"""How many make 1 m/s²."""
GRAVITY_TOLERANCE = 0.1
"""Relative difference between the median of the specific force and gravity within which a unit is named."""
MAX_OUTLIER_SHARE = 0.01
"""Share of impossible rows up to which they are outliers, and reported; with more the drive is refused."""
MIN_CHECKED_DISTANCE = 1e3
"""Distance of fixes from which the speed between them is checked, m."""


def check_drive(path: Path, imu: FloatArray, fixes: FloatArray, notes: list[str]) -> None:
    """Refuse what cannot be a drive in these units, and note what is odd.

    Parameters
    ----------
    path : Path
        Where it comes from.
    imu : ndarray, shape (n, 7)
        t, angular rates, specific forces.
    fixes : ndarray, shape (k, 13)
        t, latitude and longitude in degrees, height, velocity, and the sds of both; NaN where there is none.
    notes : list of str
        Notes, to which this adds.

    Raises
    ------
    DataError
        What cannot be, in one line.
    """
    _inertial(path, imu, notes)
    _positions(path, fixes, notes)
    _velocities(path, fixes, notes)
    if np.nanmin(fixes[:, 7:13], initial=0.0) < 0.0:
        raise DataError(
            f"{path}: expected standard deviations that are not negative, got {np.nanmin(fixes[:, 7:13]):.4g}; "
            "leave those empty that are not known"
        )
    endless = np.isinf(fixes[:, 7:13]).any(axis=1)
    if endless.any():
        raise DataError(
            f"{path}: expected standard deviations that are finite, got inf in {np.count_nonzero(endless)} of "
            f"{len(fixes)} fixes, first at {fixes[np.argmax(endless), 0]:.6g} s; leave such fixes out"
        )
    for name, columns in (("position", slice(7, 10)), ("velocity", slice(10, 13))):
        zero = int(np.count_nonzero(np.any(fixes[:, columns] == 0.0, axis=1)))
        if zero:
            notes.append(
                f"{zero} fixes report a standard deviation of 0 for their {name}: that of the configuration counts"
            )


def _inertial(path: Path, imu: FloatArray, notes: list[str]) -> None:
    interval = float(np.median(np.diff(imu[:, 0]))) if len(imu) > 1 else math.inf
    if not interval <= MAX_SAMPLE_INTERVAL:
        raise DataError(
            f"{path}: expected stamps of inertial samples in seconds, {MAX_SAMPLE_INTERVAL:g} s apart at most, "
            f"got {interval:.4g} in the median; check the unit of time"
        )
    silent = np.all(imu[:, 4:7] == 0.0, axis=1)
    count, first = int(np.count_nonzero(silent)), int(np.argmax(silent))
    if count > MAX_OUTLIER_SHARE * len(imu):
        raise DataError(
            f"{path}: expected a specific force of about 9.8 m/s², got 0 on all axes in {count} of {len(imu)} samples, "
            f"first at {imu[first, 0]:.6g} s; leave lost samples out"
        )
    if count:
        notes.append(
            f"{count} inertial samples have no specific force at all, first at {imu[first, 0]:.6g} s"
        )
    force = float(np.median(np.linalg.norm(imu[:, 4:7], axis=1)))
    if not 5.0 < force < 20.0:
        raise DataError(
            f"{path}: expected a specific force of about 9.8 m/s², got {force:.4g} in the median; "
            f"{_force_unit(force, interval)}"
        )
    for name, columns in (("angular rate", slice(1, 4)), ("specific force", slice(4, 7))):
        if np.all(np.ptp(imu[:, columns], axis=0) == 0.0):
            raise DataError(
                f"{path}: expected {name}s that change, got the same on all axes in all {len(imu)} samples: a sensor "
                "that was off? record it"
            )
    turn = float(np.percentile(np.abs(imu[:, 1:4]), 99.0))
    if turn > MAX_ANGULAR_RATE:
        raise DataError(
            f"{path}: expected angular rates in rad/s, got {turn:.4g} (99 % of samples are below); check the unit"
        )


def _force_unit(force: float, interval: float) -> str:
    """Return what to do about a specific force of another size than that of gravity."""
    units = {**FORCE_UNITS, f"m/s gained in {interval:.4g} s": interval}
    likely = [
        unit
        for unit, many in units.items()
        if abs(force / (many * STANDARD_GRAVITY) - 1.0) < GRAVITY_TOLERANCE
    ]
    return f"it looks to be in {' or '.join(likely)}: convert it to m/s²" if likely else "check the unit"


def _positions(path: Path, fixes: FloatArray, notes: list[str]) -> None:
    if np.max(np.abs(fixes[:, 1])) > 90.0 or np.max(np.abs(fixes[:, 2])) > 360.0:
        raise DataError(
            f"{path}: expected latitude and longitude in degrees, got up to {np.max(np.abs(fixes[:, 1:3])):.5g}; "
            "check unit and order"
        )
    if np.median(np.abs(fixes[:, 3])) > MAX_HEIGHT:
        raise DataError(
            f"{path}: expected heights in m, got {np.median(np.abs(fixes[:, 3])):.5g} in the median; check the unit"
        )
    apart = np.linalg.norm(_steps(fixes), axis=1)
    speed = np.where(apart > MIN_CHECKED_DISTANCE, apart / np.diff(fixes[:, 0]), 0.0)
    # A fix that is far off makes two such steps.
    _possible(
        path, fixes[1:, 0], speed, "positions that ask for", 2.0 * MAX_OUTLIER_SHARE, "degrees and s", notes
    )


def _velocities(path: Path, fixes: FloatArray, notes: list[str]) -> None:
    speed = np.nan_to_num(np.linalg.norm(fixes[:, 4:7], axis=1))
    _possible(path, fixes[:, 0], speed, "velocities of", MAX_OUTLIER_SHARE, "m/s", notes)


def _possible(
    path: Path, t: FloatArray, speed: FloatArray, what: str, share: float, unit: str, notes: list[str]
) -> None:
    """Refuse speeds that are impossible too often; of a few, note where the first one is."""
    wrong = speed > MAX_SPEED
    count, first = int(np.count_nonzero(wrong)), int(np.argmax(wrong))
    if not count:
        return
    speeds = f"{what} up to {float(speed.max()):.4g} m/s in {count} of {len(speed)} fixes, first at {t[first]:.6g} s"
    if count > share * len(speed):
        raise DataError(
            f"{path}: expected a vehicle slower than {MAX_SPEED:g} m/s, got {speeds}; check the units ({unit})"
        )
    notes.append(f"{speeds}: no vehicle does that, they are outliers")


def _llh(fixes: FloatArray) -> FloatArray:
    return np.column_stack([np.radians(fixes[:, 1:3]), fixes[:, 3]])


def _steps(fixes: FloatArray) -> FloatArray:
    llh = _llh(fixes)
    return ned_between(llh[1:], llh[:-1])
