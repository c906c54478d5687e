"""A drive in the text layout of KF-GINS, with all entries that ``kf-gins.yaml`` needs.

==============  ===========================================================================================
NAME-imu.txt    seconds of the week, Δθ x y z rad, Δv x y z m/s: forward, right, down where the mounting is known
NAME-gnss.txt   seconds of the week, latitude, longitude deg, height m, sd north east down m
NAME-truth.nav  where the drive has a reference: week 0, seconds, latitude, longitude deg, height m, velocity north
                east down m/s, roll, pitch, yaw deg
NAME.yaml       paths, rate, start, and the configuration
==============  ===========================================================================================

KF-GINS neither aligns itself nor estimates clocks and lever arm, it knows no gap, and of the receiver it takes
positions only. So our filter takes the positions of the drive; what is written begins where it has settled, with its
estimates and sds; the delay of the fixes and an unknown lever arm are what it makes of the whole drive. Of several
stretches the longest is written, and gaps within it are filled with the last rates.

Source: README.md, sections 2.1 to 2.3, of https://github.com/i2Nav-WHU/KF-GINS.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import in_degrees
from models.units import from_si
from tuner.consistency.score_drive import drive_filter
from tuner.exporters.dialect import Target
from tuner.exporters.kf_gins import entries, header
from tuner.formats.files import whole_file, write_text
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.navigation.compensation import compensate
from tuner.navigation.data import Solution
from tuner.navigation.drive.clock import clock_of_drive
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.navigation.drive.run import Stretch, navigate, prepare
from tuner.navigation.settings import FilterSettings, total_bias
from tuner.types import FilterConfig
from tuner.types.records import Drive, Reference

FloatArray = NDArray[np.float64]

SECONDS_PER_WEEK = 604800.0
"""s: KF-GINS refuses later stamps."""
MIN_GAP = 0.1
"""Interval from which KF-GINS takes an increment for one of 1/imudatarate, s."""
EQUAL_STAMPS = 1e-6
"""Stamps nearer than this are one, s."""
NO_WINDOWS = np.zeros((0, 2))


def write_drive(drive: Drive, config: FilterConfig, path: Path) -> tuple[str, ...]:
    """Write a drive and its configuration for KF-GINS; return what was found and done.

    Parameters
    ----------
    drive : Drive
        The drive.
    config : FilterConfig
        The configuration of both filters.
    path : Path
        The YAML; the other files are written beside it.

    Raises
    ------
    DataError
        Where the drive cannot be aligned.
    """
    drive = compensate(drive, config.compensation)
    gnss, wrong, _ = without_gross_outliers(drive.gnss)
    clock = clock_of_drive(drive)
    drive = replace(drive, gnss=replace(gnss, vel_n=np.full_like(gnss.vel_n, np.nan)))
    settings, assumed = drive_filter(drive, config, clock=clock)
    if np.isfinite(gnss.position_sd).any() and settings.fix_sd_models is None:
        settings = replace(settings, position_sd=None)  # KF-GINS uses the reported sds
    stretches, found = prepare(drive, settings, clock=replace(clock, lag=0.0))
    notes = [*drive.notes, *assumed, *found]
    if wrong:
        notes.append(f"{wrong} fixes left out: they contradict their neighbours")
    if "gnss_position" in settings.model.layout:
        notes.append("KF-GINS knows no correlated error of the receiver: its position sds will be too small")
    if drive.mounting is None:
        notes.append("the mounting is unknown: axes are those of the sensor")
    k = max(range(len(stretches)), key=lambda i: len(stretches[i].fixes))
    if len(stretches) > 1:
        notes.append(f"stretch {k + 1} of {len(stretches)} written: KF-GINS knows no gap")
    solution, stretch = navigate(stretches[: k + 1], settings, NO_WINDOWS)[k], stretches[k]
    first = _settled(stretch, solution)
    notes.append(f"written from {solution.t[first]:.1f} s on, where our filter has settled")
    begin = _seconds_of_week(drive, stretch)
    rate = max(1, round(1.0 / float(np.median(np.diff(drive.imu_t)))))
    at, last = settings.model.layout, solution.final_parameters
    arm = np.array(settings.lever_arm)
    if "lever_arm" in at:
        arm = arm + last[at["lever_arm"]]
        notes.append("antlever is what the filter makes of the whole drive")
    files = {name: path.with_name(f"{path.stem}-{name}") for name in ("imu.txt", "gnss.txt", "truth.nav")}
    ends = (float(solution.t[first]), float(stretch.steps.ends()[-1]))
    _table(files["imu.txt"], _inertial(drive, ends, begin, rate), ("%.9f", *["%.12e"] * 6))
    left = float(last[at["time_offset"]][0]) if "time_offset" in at else 0.0
    fixes = _fixes(stretch, first, begin - left)
    _table(files["gnss.txt"], fixes, ("%.9f", *["%.12f"] * 2, *["%.6f"] * 4))
    if drive.reference is not None:
        rows = _truth(drive.reference, begin)
        _table(files["truth.nav"], rows, ("%d", "%.9f", *["%.12f"] * 2, *["%.6f"] * 7))
    target = Target(config.interval)
    tree = {
        "imupath": str(files["imu.txt"]),
        "gnsspath": str(files["gnss.txt"]),
        "outputpath": str(path.parent),
        "imudatalen": 7,
        "imudatarate": Noted(rate, "Hz"),
        "starttime": Noted(round(ends[0] + begin, 9), "s; the first row of the inertial file"),
        "endtime": Noted(-1, "to the end"),
        "antlever": Noted(Inline(arm.tolist()), "m; forward, right, down"),
        **entries(config, target),
        **_start(settings, solution, first),
    }
    write_text(path, yaml_text(tree, header=(*header(config, target), *notes)))
    return tuple(notes)


def _settled(stretch: Stretch, solution: Solution) -> int:
    """Return the fix at which the filter has settled, or the middle of the stretch if that is earlier."""
    return min(int(np.searchsorted(solution.t, stretch.settled)), len(solution.t) // 2)


def _seconds_of_week(drive: Drive, stretch: Stretch) -> float:
    """Return the shift from the clock of a drive to seconds of the GPS week; 0 where the week ends during the drive."""
    begin = drive.origin % SECONDS_PER_WEEK
    return begin if begin + float(stretch.steps.ends()[-1]) < SECONDS_PER_WEEK else 0.0


def _inertial(drive: Drive, ends: tuple[float, float], begin: float, rate: int) -> FloatArray:
    """Return t and increments, shape (n, 7), between two times, gaps filled with the last rates.

    The first row stands for the start itself: KF-GINS uses its increments only to correct those of the next.
    """
    start, stop = ends
    rows = np.flatnonzero((drive.imu_t > start + EQUAL_STAMPS) & (drive.imu_t <= stop + EQUAL_STAMPS))
    mounting = np.eye(3) if drive.mounting is None else drive.mounting
    rates = drive.rates[np.concatenate([rows[:1], rows])]
    rates = np.hstack([rates[:, :3] @ mounting, rates[:, 3:] @ mounting])
    t = np.concatenate([[start], drive.imu_t[rows]])
    dt = np.diff(t, prepend=start - 1.0 / rate)
    parts = np.where(dt < 0.99 * MIN_GAP, 1, np.ceil(dt * max(rate, 2.0 / MIN_GAP))).astype(int)
    last = np.cumsum(parts)
    before = np.repeat(last, parts) - 1 - np.arange(last[-1])  # parts from here to the stamp
    step = np.repeat(dt / parts, parts)
    stamps = np.repeat(t, parts) - before * step + begin
    return np.column_stack([stamps, np.repeat(rates, parts, axis=0) * step[:, None]])


def _fixes(stretch: Stretch, first: int, begin: float) -> FloatArray:
    """Return t, latitude, longitude, height and sds, shape (k, 7), of the fixes behind the one of the start."""
    fixes, after = stretch.fixes, slice(first + 1, None)
    return np.column_stack([fixes.t[after] + begin, _degrees(fixes.llh[after]), fixes.sd[after, :3]])


def _truth(reference: Reference, begin: float) -> FloatArray:
    """Return week, t, position, velocity and angles of a reference, shape (n, 11)."""
    week = np.zeros(len(reference.t))
    angles = np.degrees(reference.rpy)
    return np.column_stack([week, reference.t + begin, _degrees(reference.llh), reference.vel_n, angles])


def _start(settings: FilterSettings, solution: Solution, k: int) -> dict[str, Noted]:
    """Return the entries of the initial state: our filter at fix k, with its sds."""
    at, x = settings.model.layout, solution.parameters[k]
    sd = np.sqrt(np.diag(solution.covariance[k]))
    bias = (total_bias(settings.model) @ x)[9:]
    scale = {name: 1e6 * x[at[name]] if name in at else np.zeros(3) for name in ("gyro_scale", "accel_scale")}

    def drifts(values: FloatArray) -> FloatArray:
        return np.array([from_si(v, "deg/h") for v in values])

    def gals(values: FloatArray) -> FloatArray:
        return np.array([from_si(v, "mGal") for v in values])

    values = {
        "initpos": (_degrees(solution.state.llh[k : k + 1])[0], "deg, deg, m"),
        "initvel": (solution.state.vel_n[k], "m/s; north, east, down"),
        "initatt": (np.degrees(rotation.rpy_from_quat(solution.state.quat_nb[k])), "deg; roll, pitch, yaw"),
        "initgyrbias": (drifts(bias[:3]), "deg/h"),
        "initaccbias": (gals(bias[3:]), "mGal"),
        "initgyrscale": (scale["gyro_scale"], "ppm"),
        "initaccscale": (scale["accel_scale"], "ppm"),
        "initposstd": (sd[:3], "m; north, east, down"),
        "initvelstd": (sd[3:6], "m/s; north, east, down"),
        "initattstd": (np.degrees(sd[6:9]), "deg; about north, east, down"),
        "initbgstd": (drifts(sd[9:12]), "deg/h"),
        "initbastd": (gals(sd[12:]), "mGal"),
    }
    return {name: Noted(Inline(value.tolist()), note) for name, (value, note) in values.items()}


def _degrees(llh: FloatArray) -> FloatArray:
    """Return positions in degrees, longitudes beyond ±180 beyond the date line: KF-GINS subtracts them as they are."""
    return in_degrees(llh, wrapped=False)


def _table(path: Path, rows: FloatArray, form: Sequence[str]) -> None:
    with whole_file(path) as temporary:
        np.savetxt(temporary, rows, fmt=list(form))
