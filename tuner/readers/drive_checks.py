"""Are the numbers of a drive possible? Sensors that were off, and sizes that no vehicle and no unit has.

Whether its streams agree with one another, and in which units, an examination says (`tuner.examination`): sizes are
judged behind it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import ned_between
from tuner.types.named_cause import one_line
from tuner.types.records import DataError, Drive

MAX_SAMPLE_INTERVAL = 0.5
"""Longest interval of inertial samples that can be navigated with, s."""
LARGEST_ANGLE = 360.0
"""Largest latitude or longitude in any order, deg."""
MAX_HEIGHT = 5e4
"""Height above which no land, sea or air vehicle of this project's users is, m."""
MAX_SPEED = 350.0
"""Speed above which no such vehicle is, m/s."""
MAX_ANGULAR_RATE = 35.0
"""Angular rate that 99 % of the samples stay below, rad/s."""
MAX_OUTLIER_SHARE = 0.01
"""Share of impossible rows up to which they are outliers, and reported; with more the drive is refused."""
MIN_CHECKED_DISTANCE = 1e3
"""Distance of fixes from which the speed between them is checked, m."""


def expect_streams(path: Path, imu: FloatArray, fixes: FloatArray) -> None:
    """Refuse streams that hold no measurement, whatever their units.

    Parameters
    ----------
    path : Path
        Where they come from.
    imu : ndarray, shape (n, 7)
        t, angular rates, specific forces.
    fixes : ndarray, shape (k, 13)
        t, position, velocity, and the sds of both; NaN where there is none.

    Raises
    ------
    DataError
        What cannot be, in one line.
    """
    interval = float(np.median(np.diff(imu[:, 0]))) if len(imu) > 1 else math.inf
    place, least = float(np.max(np.abs(fixes[:, 1:3]))), float(np.nanmin(fixes[:, 7:13], initial=0.0))
    endless = np.isinf(fixes[:, 7:13]).any(axis=1)
    still = {
        name: bool(np.all(np.ptp(imu[:, columns], axis=0) == 0.0))
        for name, columns in (("angular rate", slice(1, 4)), ("specific force", slice(4, 7)))
    }
    _expect(
        path,
        (
            interval <= MAX_SAMPLE_INTERVAL,
            f"stamps of inertial samples in seconds, {MAX_SAMPLE_INTERVAL:g} s apart at most, "
            f"got {interval:.4g} in the median; check the unit of time",
        ),
        *(
            (
                not off,
                f"{name}s that change, got the same on all axes in all {len(imu)} samples: a sensor that was off? "
                "record it",
            )
            for name, off in still.items()
        ),
        (
            not place > LARGEST_ANGLE,
            f"latitude and longitude in degrees, got up to {place:.5g}; check unit and order",
        ),
        (
            not least < 0.0,
            f"standard deviations that are not negative, got {least:.4g}; leave those empty that are not known",
        ),
        (
            not endless.any(),
            f"standard deviations that are finite, got inf in {np.count_nonzero(endless)} of {len(fixes)} fixes, first "
            f"at {fixes[np.argmax(endless), 0]:.6g} s; leave such fixes out",
        ),
    )


def _expect(source: str | Path, *rules: tuple[bool, str]) -> None:
    """Refuse a drive by the first rule that does not hold: what is expected, what was found, what to do."""
    for holds, text in rules:
        if not holds:
            raise DataError(f"{source}: expected {text}")


def possible_drive(drive: Drive) -> Drive:
    """Return a drive without the few fixes that no vehicle reaches, with notes on what is odd.

    Raises
    ------
    DataError
        Where its numbers are possible in no unit that is known, in one line.
    """
    notes: list[str] = []
    _inertial(drive, notes)
    gnss = drive.gnss
    far = _positions(drive, notes)
    speed = np.linalg.norm(np.nan_to_num(gnss.vel_n), axis=1)
    fast = _impossible(drive, gnss.t, speed, "velocities of", MAX_OUTLIER_SHARE, "m/s", notes)
    gnss = replace(gnss, vel_n=np.where(fast[:, None], np.nan, gnss.vel_n)).rows(~far)
    for name, sd in (("position", gnss.position_sd), ("velocity", gnss.velocity_sd)):
        zero = int(np.count_nonzero(np.any(sd == 0.0, axis=1)))
        if zero:
            notes.append(
                f"{zero} fixes report a standard deviation of 0 for their {name}: that of the configuration counts"
            )
    return replace(drive, gnss=gnss, notes=(*drive.notes, *one_line(notes)))


def _inertial(drive: Drive, notes: list[str]) -> None:
    """Refuse lost or impossible samples; note a few."""
    count, forces, t = len(drive.rates), drive.rates[:, 3:], drive.imu_t + drive.origin
    silent = np.all(forces == 0.0, axis=1)
    lost, first = int(np.count_nonzero(silent)), float(t[np.argmax(silent)])
    if lost > MAX_OUTLIER_SHARE * count:
        raise DataError(
            f"{drive.source}: expected a specific force of about 9.8 m/s², got 0 on all axes in {lost} of {count} "
            f"samples, first at {first:.6g} s; leave lost samples out"
        )
    if lost:
        notes.append(f"{lost} inertial samples have no specific force at all, first at {first:.6g} s")
    force = float(np.median(np.linalg.norm(forces, axis=1)))
    turn = float(np.percentile(np.abs(drive.rates[:, :3]), 99.0))
    _expect(
        drive.source,
        (
            5.0 < force < 20.0,
            f"a specific force of about 9.8 m/s², got {force:.4g} in the median; check the unit",
        ),
        (
            not turn > MAX_ANGULAR_RATE,
            f"angular rates in rad/s, got {turn:.4g} (99 % of samples are below); check the unit",
        ),
    )


def _positions(drive: Drive, notes: list[str]) -> NDArray[np.bool_]:
    """Return which fixes no vehicle reaches from those beside them, (k,); refuse positions that cannot be."""
    llh = drive.gnss.llh
    latitude, height = float(np.degrees(np.max(np.abs(llh[:, 0])))), float(np.median(np.abs(llh[:, 2])))
    _expect(
        drive.source,
        (not latitude > 90.0, f"latitudes in degrees, got up to {latitude:.5g}; check unit and order"),
        (not height > MAX_HEIGHT, f"heights in m, got {height:.5g} in the median; check the unit"),
    )
    apart = np.linalg.norm(ned_between(llh[1:], llh[:-1]), axis=1)
    speed = np.where(apart > MIN_CHECKED_DISTANCE, apart / np.diff(drive.gnss.t), 0.0)
    # A fix that is far off makes two such steps.
    leaps = _impossible(
        drive,
        drive.gnss.t[1:],
        speed,
        "positions that ask for",
        2.0 * MAX_OUTLIER_SHARE,
        "degrees and s",
        notes,
    )
    return np.asarray(np.append(True, leaps) & np.append(leaps, True), dtype=bool)


def _impossible(
    drive: Drive, t: FloatArray, speed: FloatArray, what: str, share: float, unit: str, notes: list[str]
) -> NDArray[np.bool_]:
    """Return which speeds are impossible; refuse too many, and note where the first of a few is."""
    wrong: NDArray[np.bool_] = speed > MAX_SPEED
    count, first = int(np.count_nonzero(wrong)), int(np.argmax(wrong)) if len(wrong) else 0
    if not count:
        return wrong
    speeds = (
        f"{what} up to {float(speed.max()):.4g} m/s in {count} of {len(speed)} fixes, first at "
        f"{t[first] + drive.origin:.6g} s"
    )
    if count > share * len(speed):
        raise DataError(
            f"{drive.source}: expected a vehicle slower than {MAX_SPEED:g} m/s, got {speeds}; check the units ({unit})"
        )
    notes.append(f"{speeds}: no vehicle does that, they are left out")
    return wrong
