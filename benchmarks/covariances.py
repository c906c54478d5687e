"""True ÷ declared of streams, and the filter of robot_localization with what is proposed against its defaults.

    python -m benchmarks.covariances streams 60
    python -m benchmarks.covariances filter 5

The first simulates recordings of an IMU, fixes and wheels (white and lasting errors; declared right, three times, a
third, zero; every second with velocities of the receiver) and counts the intervals that hold the truth. The second
chooses settings on one recording for each of four sets of sensors, and runs `tests.robot_localization` with them and
with its defaults on so many other recordings of each set.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from models.earth import ned_between
from models.trajectory.catalogue import city
from tests import robot_localization as robot
from tests.tuner.covariances.recordings import DECLARED, Errors, recording
from tuner.covariances.proposal import key_of
from tuner.covariances.robot_localization_form import chosen, course_of
from tuner.covariances.streams import stream_errors
from tuner.examination.examined_drive import examined_drive
from tuner.synthesis.from_drive import config_for_drive

STREAMS = {"fixes": "fixes", "receiver velocities": "velocities", "wheels": "wheels"}
UNIT = "icm20602"
STEP = 0.1
SETTLED = 300
"""Steps in which a filter settles."""


def measured(drive, declared):
    """Errors of the streams; zero sds are replaced by the examination, as the command does it."""
    examined = examined_drive(drive)[0] if declared == "zero" else drive
    return stream_errors(examined, config_for_drive(examined, UNIT), drive)


def streams(count: int) -> None:
    """Print how many intervals of true ÷ declared hold the truth."""
    held: dict[str, list[bool]] = {}
    for seed in range(count):
        declared = list(DECLARED)[seed % 4]
        drive, true = recording(1000 + seed, declared=declared, velocities=seed // 4 % 2 == 0)
        for one in measured(drive, declared)[0]:
            if one.stream in STREAMS:
                errors = true[STREAMS[one.stream]]
                size = errors.white if one.part == "across" else errors.size
                low, high = one.size.interval or (0.0, np.inf)
                held.setdefault(key_of(one), []).append(low <= size <= high)
                ratio = (one.size.value or np.nan) / size
                print(
                    seed,
                    declared,
                    key_of(one),
                    f"{ratio:.2f} ({low / size:.2f} {high / size:.2f})",
                    flush=True,
                )
    for name, one in held.items():
        print(f"{name}: {sum(one)} of {len(one)}")
    total = [inside for one in held.values() for inside in one]
    print(f"all: {sum(total)} of {len(total)}, {100.0 * np.mean(total):.1f} %")


def readings(drives) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Return true states (m, k, 15) and readings of robot_localization in steps of `STEP`."""
    true, places, speeds, rates = [], [], [], []
    for drive in drives:
        t = np.arange(1.0, drive.imu_t[-1] - STEP, STEP)
        at = city(float(drive.imu_t[-1])).evaluate(t)
        first = drive.gnss.llh[0]
        body = np.einsum("nji,nj->ni", at.mat_nb, at.vel_n)
        state = np.zeros((len(t), 15))
        state[:, robot.PLACE], state[:, robot.ANGLES] = ned_between(at.llh, first), at.rpy
        state[:, robot.SPEED], state[:, robot.RATE] = body, at.omega_ib_b
        state[:, 12:] = np.gradient(body, STEP, axis=0)
        place = np.full((len(t), 3), np.nan)
        place[np.clip(np.round((drive.gnss.t - t[0]) / STEP).astype(int), 0, len(t) - 1)] = ned_between(
            drive.gnss.llh, first
        )
        whole = np.cumsum(drive.rates[:, :3] * np.diff(drive.imu_t, prepend=0.0)[:, None], axis=0)
        turned = [np.interp(t, drive.imu_t, one) - np.interp(t - STEP, drive.imu_t, one) for one in whole.T]
        true.append(state)
        places.append(place)
        speeds.append(np.column_stack([np.interp(t, drive.wheels.t, one) for one in drive.wheels.v.T]))
        rates.append(np.column_stack(turned) / STEP)
    found = {"rate": np.stack(rates), "speed": np.stack(speeds), "place": np.stack(places)}
    return np.stack(true), found, np.arange(len(t)) * STEP


def filters(count: int) -> None:
    """Print position errors and their ratio to predicted ones, proposed and by default."""
    rng, consistent, worse = np.random.default_rng(5), 0, 0
    for number, declared in enumerate(DECLARED):
        own = {
            "fixes": Errors(0.3 + 0.2 * number, 0.6 + 0.3 * number, 12.0 + 5.0 * number),
            "wheels": Errors(0.03 + 0.02 * number, 0.03 + 0.03 * number, 25.0 - 5.0 * number),
            "declared": declared,
            "velocities": True,
        }
        drive, _ = recording(2000 + number, **own)
        errors, run = measured(drive, declared)
        best, _ = chosen(course_of(drive, run), {key_of(one): one for one in errors})
        print(declared, {name: round(sd, 4) for name, sd in best.sds.items()}, best.process_noise, flush=True)
        others = [recording(3000 + 100 * number + i, **own)[0] for i in range(count)]
        true, found, _ = readings(others)
        start = true[:, 0] + rng.standard_normal((count, 15)) * robot.SPREAD
        sd = best.sds
        proposed = {
            "rate": np.full(3, sd["gyro"] ** 2 * drive.imu_t[1] / STEP),
            "speed": np.square([sd["wheels forward"], sd["wheels across"], sd["wheels across"]]),
            "place": np.square([sd["fixes horizontal"]] * 2 + [sd["fixes vertical"]]),
        }
        noise = next(one for one in errors if one.stream == "gyro").white.value or 0.0
        stated = {
            "rate": np.full(3, noise**2 * drive.imu_t[1] / STEP),
            "speed": drive.wheels.sd[0] ** 2,
            "place": drive.gnss.position_sd[0] ** 2,
        }
        apart = []
        for process, variances in ((best.process_noise, proposed), (robot.DEFAULT_PROCESS, stated)):
            x, p = robot.filtered(start, found, process, variances, STEP)
            error = (x - true)[:, SETTLED:, robot.PLACE]
            square = np.einsum("mki,mkij,mkj->mk", error, np.linalg.inv(p[:, SETTLED:, :3, :3]), error)
            apart.append((np.sum(error**2, axis=2), np.sqrt(square.mean(axis=1) / 3.0)))
        for i in range(count):
            ours, theirs = (one[0][i] for one in apart)
            change = (ours - theirs)[: len(ours) // 300 * 300].reshape(-1, 300).mean(axis=1)
            sure = change.mean() - 1.96 * change.std(ddof=1) / np.sqrt(len(change)) > 0.0
            ratio = apart[0][1][i]
            consistent, worse = consistent + (1.0 / 1.5 <= ratio <= 1.5), worse + sure
            print(
                f"{declared} {i}: proposed {np.sqrt(ours.mean()):.2f} m, {ratio:.2f} × predicted; default "
                f"{np.sqrt(theirs.mean()):.2f} m, {apart[1][1][i]:.1f} ×{' WORSE' * bool(sure)}",
                flush=True,
            )
    print(f"consistent within 50 %: {consistent}; worse beyond the paired interval: {worse}; of {4 * count}")


if __name__ == "__main__":
    {"streams": streams, "filter": filters}[sys.argv[1]](int(sys.argv[2]))
