"""A drive in the text layout of KF-GINS, with all entries that ``kf-gins.yaml`` needs.

==============  ===========================================================================================
NAME-imu.txt    seconds of the week, Δθ x y z rad, Δv x y z m/s: forward, right, down where the mounting is known
NAME-gnss.txt   seconds of the week, latitude, longitude deg, height m, sd north east down m
NAME-truth.nav  where the drive has a reference: week 0, seconds, latitude, longitude deg, height m, velocity north
                east down m/s, roll, pitch, yaw deg
NAME.yaml       paths, rate, start, and the configuration
==============  ===========================================================================================

KF-GINS neither aligns itself nor estimates clocks and lever arm, it knows no gap and no gate, and of the receiver it
takes positions only. So our filter takes the positions of the drive; what is written begins where it has settled, with
its estimates and sds. The sds of the fixes are the receiver's own, larger where fixes of a class are wrong by more:
factors below 1 hold only beside states that KF-GINS has not. The rest of a delay and an unknown lever arm are what our
filter makes of the whole drive where that determines them (`tuner.navigation.determined`); else they are 0, and the arm
is to be measured. Of several stretches the longest is written, and gaps within it are filled with the last rates.

Source: README.md, sections 2.1 to 2.3, of https://github.com/i2Nav-WHU/KF-GINS.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import in_degrees
from models.units import from_si
from tuner.consistency.score_drive import drive_filter
from tuner.exporters.header import provenance
from tuner.exporters.kf_gins import DIALECT, TITLE, entries
from tuner.formats.clock_words import stated_words
from tuner.formats.files import whole_file, write_text
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.navigation.compensation import compensate
from tuner.navigation.data import Solution
from tuner.navigation.determined import determined_state
from tuner.navigation.drive.run import Stretch, navigate, prepare
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE, FixSdModel
from tuner.navigation.settings import FilterSettings, total_bias
from tuner.synthesis.projection import Aiding
from tuner.types import Compensation, FilterConfig, GnssNoise
from tuner.types.clock import Clock, Delay
from tuner.types.records import DataError, Drive, Reference

SECONDS_PER_WEEK = 604800.0
"""s: KF-GINS refuses later stamps."""
MIN_GAP = 0.1
"""Interval from which KF-GINS takes an increment for one of 1/imudatarate, s."""
EQUAL_STAMPS = 1e-6
"""Stamps nearer than this are one, s."""
NO_WINDOWS = np.zeros((0, 2))
CONSTANTS = ("lever_arm", "time_offset", "gyro_scale", "accel_scale")
"""States of our filter that KF-GINS is given as numbers, where the drive determines them."""
ARM = ("forward", "right", "down")


@dataclass(frozen=True)
class DriveFiles:
    """What KF-GINS reads of a drive.

    Attributes
    ----------
    begin : float
        Time of the first inertial row on the clock of the drive, s.
    imu, fixes : ndarray, shapes (n, 7), (k, 7)
        Rows of the two files, in their units.
    truth : ndarray, shape (r, 11), or None
        Those of the reference.
    tree : mapping of str to Any
        Entries of the YAML but for paths.
    header, notes : tuple of str
        Comments of the YAML: where its numbers come from, and what was found and done.
    """

    begin: float
    imu: FloatArray
    fixes: FloatArray
    truth: FloatArray | None
    tree: Mapping[str, Any]
    header: tuple[str, ...]
    notes: tuple[str, ...]


def drive_files(drive: Drive, config: FilterConfig) -> DriveFiles:
    """Return a drive and its configuration as KF-GINS reads them.

    Parameters
    ----------
    drive : Drive
        The drive.
    config : FilterConfig
        The configuration of both filters.

    Raises
    ------
    DataError
        Where the drive cannot be aligned.
    """
    drive = compensate(drive, config.compensation)
    gnss, taken_out = drive.gnss, stated_words(config.compensation)
    clock = replace(drive.clock, lag=Delay())  # of velocities that it does not read
    if taken_out and not clock.delay.certain:
        clock = Clock()
    drive = replace(drive, gnss=replace(gnss, vel_n=np.full_like(gnss.vel_n, np.nan)), clock=clock)
    run, undetermined = _with_what_is_shown(_run(drive, config), drive, config)
    settings, stretches = run.settings, run.stretches
    notes = [*drive.notes, *filter(None, [taken_out]), *run.notes, *undetermined]
    if GNSS_NOISE_SCALE in config.compensation.causes:
        notes.append(
            "sds of the fixes are not below the receiver's own: smaller ones need states that KF-GINS lacks"
        )
    if drive.mounting is None:
        notes.append("the mounting is unknown: axes are those of the sensor")
    k = max(range(len(stretches)), key=lambda i: len(stretches[i].fixes))
    if len(stretches) > 1:
        notes.append(f"stretch {k + 1} of {len(stretches)} written: KF-GINS knows no gap")
    solution, stretch = run.solutions[k], stretches[k]
    first = _settled(stretch, solution)
    notes.append(f"written from {solution.t[first]:.1f} s on, where our filter has settled")
    begin = _seconds_of_week(drive, stretch)
    rate = max(1, round(1.0 / float(np.median(np.diff(drive.imu_t)))))
    at, last = settings.model.layout, solution.final_parameters
    arm = np.array(settings.lever_arm)
    if "lever_arm" in at:
        arm = arm + last[at["lever_arm"]]
        notes.append("antlever is what the filter makes of the whole drive")
    notes.append(
        "sds that KF-GINS states of its biases are not judged: in simulated drives half of their errors"
    )
    ends = (float(solution.t[first]), float(stretch.steps.ends()[-1]))
    left = float(last[at["time_offset"]][0]) if "time_offset" in at else 0.0
    fixes = _fixes(stretch, first, begin - left)
    if config.gnss is not None and not np.isfinite(gnss.position_sd).any():
        fixes[:, 4:] = np.hypot(
            fixes[:, 4:], _staying_sds(config.gnss)
        )  # KF-GINS has no state for what stays
    aiding = Aiding(
        "the fixes of this drive", float(np.median(np.diff(fixes[:, 0]))), float(np.median(fixes[:, 4:6]))
    )
    target = replace(DIALECT.target(config), aiding=aiding)
    tree = {
        "imudatalen": 7,
        "imudatarate": Noted(rate, "Hz"),
        "starttime": Noted(round(ends[0] + begin, 9), "s; the first row of the inertial file"),
        "endtime": Noted(-1, "to the end"),
        "antlever": Noted(Inline(arm.tolist()), "m; forward, right, down"),
        "compensated": Noted(True, "what the configuration takes out of the drive is taken out"),
        **entries(config, target),
        **_start(settings, solution, first),
    }
    return DriveFiles(
        ends[0],
        _inertial(drive, ends, begin, rate),
        fixes,
        None if drive.reference is None else truth_rows(drive.reference, begin),
        tree,
        provenance(replace(config, compensation=Compensation()), TITLE, target),  # it is taken out
        tuple(notes),
    )


def write_drive(files: DriveFiles, path: Path) -> None:
    """Write a drive for KF-GINS: the YAML, and its other files beside it, which it names by their whole paths."""
    named = {name: path.with_name(f"{path.stem}-{name}") for name in ("imu.txt", "gnss.txt", "truth.nav")}
    for one in (path, *named.values()):
        if one.is_dir():
            raise DataError(f"{one}: expected a file to write, found a folder; nothing is written")
    named["truth.nav"].unlink(missing_ok=True)  # of another drive it would be read as the truth of this one
    _table(named["imu.txt"], files.imu, ("%.9f", *["%.12e"] * 6))
    _table(named["gnss.txt"], files.fixes, ("%.9f", *["%.12f"] * 2, *["%.6f"] * 4))
    if files.truth is not None:
        _table(named["truth.nav"], files.truth, ("%d", "%.9f", *["%.12f"] * 2, *["%.6f"] * 7))
    paths = {
        "imupath": str(named["imu.txt"].resolve()),
        "gnsspath": str(named["gnss.txt"].resolve()),
        "outputpath": str(path.parent.resolve()),
    }
    write_text(
        path, yaml_text({**paths, **files.tree}, header=tuple(dict.fromkeys((*files.header, *files.notes))))
    )


@dataclass(frozen=True)
class _Run:
    """Our filter on a drive as KF-GINS takes it: positions alone, with the receiver's own sds."""

    settings: FilterSettings
    stretches: tuple[Stretch, ...]
    solutions: tuple[Solution, ...]
    notes: tuple[str, ...]


def _run(drive: Drive, config: FilterConfig, arm: tuple[float, float, float] | None = None) -> _Run:
    """Filter a drive; with a lever arm, m, in place of an unknown one."""
    if arm is not None:
        drive = replace(drive, lever_arm=(0.0, 0.0, 0.0))
    settings, assumed = drive_filter(drive, config)
    settings = settings if arm is None else replace(settings, lever_arm=arm)
    if settings.fix_sd_models is not None:
        position, velocity = map(_not_below_own, settings.fix_sd_models)
        settings = replace(settings, fix_sd_models=(position, velocity))
    elif np.isfinite(drive.gnss.position_sd).any():
        settings = replace(settings, position_sd=None)  # KF-GINS uses the reported sds
    stretches, found = prepare(drive, settings)
    return _Run(settings, stretches, navigate(stretches, settings, NO_WINDOWS), (*assumed, *found))


def _not_below_own(model: FixSdModel) -> FixSdModel:
    """Return a model of sds without what makes those that the receiver reports smaller."""
    larger = (tuple(max(1.0, factor) for factor in axis) for axis in (model.horizontal, model.vertical))
    horizontal, vertical = larger
    return replace(model, horizontal=horizontal, vertical=vertical, exponent=1.0)


def _with_what_is_shown(run: _Run, drive: Drive, config: FilterConfig) -> tuple[_Run, tuple[str, ...]]:
    """Return a run without the constants that the longest stretch does not determine, and what is left out in words.

    The filter runs again: the start that is written is consistent only with the constants that are written.
    """
    longest = max(range(len(run.stretches)), key=lambda i: len(run.stretches[i].fixes))
    solution, at = run.solutions[longest], run.settings.model.layout
    shown = {name: determined_state(solution, run.settings, name) for name in CONSTANTS if name in at}
    if all(one.all() for one in shown.values()):
        return run, ()
    kept = {name for name in CONSTANTS if name not in shown or shown[name].all()}
    arm, notes = None, []
    if "lever_arm" not in kept:
        arm = np.where(shown["lever_arm"], solution.final_parameters[at["lever_arm"]], 0.0).tolist()
        lost = ", ".join(name for name, one in zip(ARM, shown["lever_arm"], strict=True) if not one)
        notes.append(
            f"antlever {lost}: 0, as this drive does not determine it; measure it from the IMU to the antenna and "
            "state it by --lever-arm"
        )
    constants = {name: sd for name, sd in config.constants.items() if name not in shown or name in kept}
    if "time_offset" not in kept:
        drive = compensate(drive, Compensation.parse({"time_offset.delay": drive.clock.delay.taken_out}))
        notes.append("no further delay of the fixes is taken out: this drive does not determine it")
    return _run(drive, replace(config, constants=constants), arm), tuple(notes)


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
    mounting = drive.sensor_from_vehicle
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


def _staying_sds(gnss: GnssNoise) -> FloatArray:
    """Return the sds north, east, down of the errors of a receiver that stay, m."""
    sd = float(np.sqrt(sum(state.sd**2 for state in gnss.correlated)))
    return sd * np.array([1.0, 1.0, gnss.correlated_down])


def truth_rows(reference: Reference, begin: float) -> FloatArray:
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
        "initbastd": (gals(sd[12:15]), "mGal"),
    }
    for name, entry in (("gyro_scale", "initsgstd"), ("accel_scale", "initsastd")):
        if name in at:
            values[entry] = 1e6 * sd[at[name]], "ppm"
    return {name: Noted(Inline(value.tolist()), note) for name, (value, note) in values.items()}


def _degrees(llh: FloatArray) -> FloatArray:
    """Return positions in degrees, longitudes beyond ±180 beyond the date line: KF-GINS subtracts them as they are."""
    return in_degrees(llh, wrapped=False)


def _table(path: Path, rows: FloatArray, form: Sequence[str]) -> None:
    with whole_file(path) as temporary:
        np.savetxt(temporary, rows, fmt=list(form))
