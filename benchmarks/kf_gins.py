"""KF-GINS and our filter on the same files: differences, errors against the truth, outages, time.

    tuner export CONFIG --to kf-gins --drive DRIVE -o NAME.yaml
    python benchmarks/kf_gins.py KF-GINS NAME.yaml [SKIPPED]

KF-GINS is the program, built from https://github.com/i2Nav-WHU/KF-GINS; the YAML is configuration and drive for both.
Rows are root mean squares at the fixes from SKIPPED seconds (60) on: north, east, down of position m, velocity m/s and
attitude deg. Our filter runs as `tuner navigate` does, and with the clocks believed to agree, as KF-GINS believes.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import ned_between
from models.strapdown import NavigationState
from tuner.consistency.drive_scores import reference_at
from tuner.consistency.score_drive import drive_filter
from tuner.examination.examine import examine
from tuner.navigation.drive.run import RECOVERY_TIME, navigate, prepare
from tuner.readers import kf_gins_settings
from tuner.readers.drive import read_drive
from tuner.readers.text import find_dialect, read_numbers
from tuner.types.clock import Clock
from tuner.types.records import Drive

FloatArray = NDArray[np.float64]
Track = tuple[NavigationState, FloatArray]
"""States at the fixes and their nine sds."""
NEVER = np.zeros((0, 2))


def theirs(
    program: Path, settings: Path, drive: Drive, t: FloatArray, windows: FloatArray
) -> tuple[Track, float]:
    """Return what KF-GINS says at times, fixes inside windows left out, and how long it took, s."""
    with tempfile.TemporaryDirectory() as folder:
        fixes = settings.with_name(f"{settings.stem}-gnss.txt")
        rows = numbers(fixes)
        since = rows[:, :1] - drive.origin
        away = ((since > windows[:, 0]) & (since <= windows[:, 1])).any(axis=1)
        np.savetxt(Path(folder) / "gnss.txt", rows[~away], fmt="%.12f")
        lines = settings.read_text(encoding="utf-8").splitlines()
        named = {"gnsspath": str(Path(folder) / "gnss.txt"), "outputpath": folder}
        named["imupath"] = str(settings.with_name(f"{settings.stem}-imu.txt"))
        lines = [
            f"{key}: {named[key]}" if (key := line.partition(":")[0]) in named else line for line in lines
        ]
        copy = Path(folder) / "kf-gins.yaml"
        copy.write_text("\n".join(lines), encoding="utf-8")
        begin = time.perf_counter()
        subprocess.run([program, copy], check=True, stdout=subprocess.DEVNULL)
        took = time.perf_counter() - begin
        nav, sds = (numbers(Path(folder) / name) for name in ("KF_GINS_Navresult.nav", "KF_GINS_STD.txt"))
    stamps = nav[:, 1] - drive.origin
    # Each epoch holds the fixes before it: its state is carried back to the fix by the slope to the next.
    k = np.searchsorted(stamps, t - 1e-6).clip(0, len(stamps) - 2)
    step = nav[k + 1, 2:] - nav[k, 2:]
    step[:, 8] = (step[:, 8] + 180.0) % 360.0 - 180.0
    back = (stamps[k] - t) / (stamps[k + 1] - stamps[k])
    now = nav[k, 2:] - step * back[:, None]
    llh = np.column_stack([np.radians(now[:, :2]), now[:, 2]])
    quat = rotation.quat_from_rpy(np.radians(now[:, 6:]))
    return (NavigationState(llh, now[:, 3:6], quat), sds[k, 1:10]), took


def ours(
    drive: Drive, settings: Path, windows: FloatArray, *, clocks_agree: bool
) -> tuple[FloatArray, Track]:
    """Return times of the fixes and what our filter says of them."""
    clock = Clock() if clocks_agree else examine(drive).clock
    drive = replace(drive, clock=clock)
    filtering, _ = drive_filter(drive, kf_gins_settings.load(settings))
    stretches, _ = prepare(drive, filtering)
    solution = navigate(stretches, filtering, windows)[0]
    sds = np.sqrt(np.diagonal(solution.covariance, axis1=1, axis2=2))[:, :9]
    return solution.t, (solution.state, np.hstack([sds[:, :6], np.degrees(sds[:, 6:9])]))


def apart(a: NavigationState, b: NavigationState) -> FloatArray:
    """Return position, velocity and attitude (deg) of a less those of b, shape (k, 9)."""
    turn = rotation.mat_from_quat(a.quat_nb) @ np.swapaxes(rotation.mat_from_quat(b.quat_nb), -1, -2)
    angles = np.degrees([rotation.rotvec_from_mat(mat) for mat in turn])
    return np.hstack([ned_between(a.llh, b.llh), a.vel_n - b.vel_n, angles])


def truth(drive: Drive, t: FloatArray) -> NavigationState | None:
    """Return the reference at times."""
    if drive.reference is None:
        return None
    llh, vel_n, rpy = reference_at(drive.reference, t)[:3]
    return NavigationState(llh, vel_n, rotation.quat_from_rpy(rpy))


def numbers(path: Path) -> FloatArray:
    """Return the numbers of a text file."""
    dialect = find_dialect(path)
    return read_numbers(path, dialect, [range(len(dialect.names))])[0]


def row(name: str, values: FloatArray) -> None:
    """Print the root mean squares of columns."""
    print(f"{name:28s}", *(f"{v:9.4f}" for v in np.sqrt(np.nanmean(values**2, axis=0))))


def main(program: Path, settings: Path, skipped: float) -> None:
    drive = read_drive(settings)
    print(f"{settings.name}: {len(drive.imu_t)} inertial rows, {len(drive.gnss)} fixes")
    for agree, name in ((False, "ours"), (True, "ours, clocks agree")):
        t, (state, sd) = ours(drive, settings, NEVER, clocks_agree=agree)
        begin = time.perf_counter()
        ours(drive, settings, NEVER, clocks_agree=agree)
        mine = time.perf_counter() - begin
        (other, told), took = theirs(program, settings, drive, t, NEVER)
        late, true = t > t[0] + skipped, truth(drive, t)
        row(f"{name} - KF-GINS", apart(state, other)[late])
        row(f"sd of {name}", sd[late])
        row("sd of KF-GINS", told[late])
        if true is not None:
            row(f"error of {name}", apart(state, true)[late])
            row("error of KF-GINS", apart(other, true)[late])
        print(f"{name} {mine:.2f} s (alignment and filter), KF-GINS {took:.2f} s (files and filter)")
    true = truth(drive, t)
    if true is None:
        return
    for horizon in (30.0, 60.0):
        begins = np.arange(t[0] + 2.0 * skipped, t[-1] - horizon, horizon + RECOVERY_TIME) + 0.3
        windows = np.column_stack([begins, begins + horizon])
        t, (state, sd) = ours(drive, settings, windows, clocks_agree=True)
        (other, told), _ = theirs(program, settings, drive, t, windows)
        k = np.searchsorted(t, windows[:, 1]) - 1
        found = [apart(a, b)[k, :3] for a, b in ((state, true), (other, true), (state, other))]
        values = [
            np.sqrt((v**2).sum(axis=1).mean()) for v in (found[0], sd[k, :3], found[1], told[k, :3], found[2])
        ]
        print(
            f"{len(k)} outages of {horizon:g} s: error and prediction, ours {values[0]:.3g} ({values[1]:.3g}) m, "
            f"KF-GINS {values[2]:.3g} ({values[3]:.3g}) m; apart {values[4]:.3g} m"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]) if len(sys.argv) > 3 else 60.0)
