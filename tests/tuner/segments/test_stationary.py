"""Stationary parts: coloured noise is not motion (stated error rate); a turn, a push, a new position are."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tuner.readers import read
from tuner.segments.stationary import cut_to_still, find_motion
from tuner.types.records import DataError, Record

RATE = 50.0


def kept_still(records: Sequence[Record]) -> tuple[Record, ...]:
    return cut_to_still(records, find_motion(records))


def colour(rng: np.random.Generator, count: int, exponent: float) -> np.ndarray:
    """Return noise with the spectrum f^-exponent, shape (count, 3), unit variance of its innovations."""
    spectrum = np.fft.rfft(rng.standard_normal((2 * count, 3)), axis=0)
    frequency = np.fft.rfftfreq(2 * count)
    spectrum[1:] *= frequency[1:, None] ** (-exponent / 2)
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum, axis=0)[:count]


def gyro_of(y: np.ndarray, segments: tuple[tuple[int, int], ...] = ()) -> Record:
    axes = ("gyro_x", "gyro_y", "gyro_z")
    return Record("gyro", np.arange(len(y)) / RATE, y, axes, "rad/s", 1 / RATE, segments)


def accel_of(y: np.ndarray) -> Record:
    axes = ("accel_x", "accel_y", "accel_z")
    return Record("accel", np.arange(len(y)) / RATE, y, axes, "m/s^2", 1 / RATE)


@pytest.mark.parametrize("weights", [(1.0, 0.0, 0.0), (0.1, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.3, 0.02)])
@pytest.mark.parametrize("channels", [3, 6])
def test_false_alarms(weights: tuple[float, float, float], channels: int) -> None:
    # One record of a thousand may alarm, twice: 120 records give Poisson(0.24) or fewer: P(more than 5) < 2e-7.
    rng = np.random.default_rng(21)
    alarms = 0
    for _ in range(120):
        y = [
            sum(
                w * colour(rng, 3000, exponent)
                for w, exponent in zip(weights, (0.0, 1.0, 2.0), strict=True)
                if w
            )
            for _ in range(channels // 3)
        ]
        records = [gyro_of(1e-4 * y[0])] + ([accel_of(1e-3 * y[1])] if channels == 6 else [])
        alarms += bool(find_motion(records).episodes)
    assert alarms <= 5


def test_one_jumping_channel_is_not_motion() -> None:
    rng = np.random.default_rng(22)
    y = 1e-3 * rng.standard_normal((20_000, 3))
    y[7777:, 1] += 0.02
    y[12_000:12_100, 2] *= 20.0
    assert find_motion(gyro_of(y)).still == ((0, 20_000),)


@pytest.mark.parametrize("rate", [0.05, 0.5])
def test_a_turn_is_found_where_it_is(rate: float) -> None:
    rng = np.random.default_rng(23)
    y = 1e-3 * rng.standard_normal((20_000, 3))
    turn = slice(8000, 8300)
    shape = np.sin(np.linspace(0.0, np.pi, 300))[:, None]
    y[turn] += rate * shape * np.array([0.6, -0.5, 0.4]) + 0.2 * rate * rng.standard_normal((300, 3))
    motion = find_motion(gyro_of(y))
    ((start, stop),) = motion.moving
    assert 7800 <= start <= 8010
    assert 8290 <= stop <= 8500
    assert motion.still == ((0, start), (stop, 20_000))
    assert motion.episodes == ((start / RATE, pytest.approx((stop - start) / RATE)),)
    described = motion.describe()
    assert described is not None
    assert described.startswith("the sensor moved in")


def test_steady_turn_of_one_axis_is_motion() -> None:
    rng = np.random.default_rng(24)
    y = 1e-3 * rng.standard_normal((20_000, 3))
    y[5000:7000, 2] += 0.15
    ((start, stop),) = find_motion(gyro_of(y)).moving
    assert 4900 <= start <= 5000
    assert 7000 <= stop <= 7100


@pytest.mark.parametrize("rate", [0.015, 0.08])
def test_a_slow_turn_that_ends_is_motion_and_a_bias_that_stays_is_none(rate: float) -> None:
    """A robot that turned evenly for 14 s of ten minutes was at rest, with K of 44 543 deg/h/√h."""
    y = 2e-3 * np.random.default_rng(31).standard_normal((30_000, 3))
    y[20_000:, 1] += rate
    assert find_motion(gyro_of(y)).episodes == ()
    y[9000:9700, 2] += rate
    ((start, stop),) = find_motion(gyro_of(y)).moving
    assert 8900 <= start <= 9000
    assert 9700 <= stop <= 9800


def test_scale_and_bias_change_nothing() -> None:
    rng = np.random.default_rng(25)
    y = 1e-4 * rng.standard_normal((10_000, 3))
    y[3000:3200] *= 30.0
    bias = np.array([0.01, -0.02, 0.03])
    assert find_motion(gyro_of(y)).moving == find_motion(gyro_of(3.0 * y + bias)).moving != ()


def test_blocks_respect_gaps_and_short_logs_are_refused() -> None:
    rng = np.random.default_rng(26)
    y = 1e-3 * rng.standard_normal((6000, 3))
    assert find_motion(gyro_of(y, ((0, 2500), (2600, 6000)))).still == ((0, 2500), (2600, 6000))
    with pytest.raises(DataError, match="too short to tell motion from noise"):
        find_motion(gyro_of(y[:200]))


def test_segments_are_cut_to_the_stationary_parts() -> None:
    rng = np.random.default_rng(27)
    y = 1e-3 * rng.standard_normal((10_000, 3))
    assert kept_still((gyro_of(y),))[0].segments == ((0, 10_000),)
    y[3000:3500] += rng.standard_normal((500, 3))
    (kept,) = kept_still((gyro_of(y),))
    assert len(kept.segments) == 2
    assert kept.span < 190.5
    assert any("the sensor moved" in note for note in kept.notes)


def test_a_log_that_moves_all_the_time_is_refused() -> None:
    """A hand holds no quarter of it stiller than the others: its sway of half a second changes every mean."""
    rng = np.random.default_rng(29)
    sway = 0.05 * np.convolve(rng.standard_normal(10_000), np.ones(25) / 5.0, "same")[:, None]
    moving = gyro_of(1e-3 * rng.standard_normal((10_000, 3)) + sway)
    assert find_motion(moving).episodes == ()
    with pytest.raises(DataError, match=r"not at rest: .*gyro_[xyz] changes by .* deg/s"):
        kept_still((moving,))


def test_times_of_motion_are_those_of_the_clock_of_the_log() -> None:
    rng = np.random.default_rng(30)
    y = 1e-3 * rng.standard_normal((10_000, 3))
    y[3000:3500] += rng.standard_normal((500, 3))
    late = gyro_of(y)
    (kept,) = kept_still((Record("gyro", late.t + 1.4e9, y, late.axes, "rad/s", 1 / RATE),))
    assert ": from 1400000059 s on for 12 s (times of its clock)" in kept.notes[-1]


def test_quantizer_coarser_than_noise() -> None:
    rng = np.random.default_rng(28)
    y = 0.01 * np.rint(0.12 * rng.standard_normal((20_000, 3)))
    assert find_motion(gyro_of(y)).still == ((0, 20_000),)


# measured --------------------------------------------------------------------------------------------------

DATA = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static"
measured = pytest.mark.skipif(not DATA.is_dir(), reason="TUNER_DATA does not name a folder with recordings")


@measured
@pytest.mark.parametrize(
    "name", ["adis16405_run1", "adis16405_run2", "adis16405_run3", "galaxy_s5_static", "stim300_static"]
)
def test_measured_static_logs_are_still(name: str) -> None:
    records = read(DATA / f"{name}.npz")
    assert find_motion(records).episodes == ()
    for record in records:
        assert find_motion(record).episodes == ()


@measured
def test_measured_moves_of_the_animal_tag() -> None:
    hours = [start / 3600 for start, _ in find_motion(read(DATA / "cats_tag_temperature.npz")).episodes]
    assert all(h < 0.11 or 22.4 < h < 26.0 or 38.3 < h < 38.5 for h in hours)
    assert any(h < 0.1 for h in hours)
    assert any(22.4 < h < 26.0 for h in hours)
    assert any(38.3 < h < 38.5 for h in hours)


@measured
def test_measured_poses() -> None:
    still = find_motion(read(DATA / "imu_tk_xsens_multipos.npz", gyro_scale=2e-4, accel_scale=2.5e-3)).still
    assert still[0][0] == 0
    assert 4900 < still[0][1] < 5300
    assert 35 <= len(still) <= 42
    columns = {"gyro": "imu0[3:6]", "accel": "imu0[0:3]"}
    assert (
        15 <= len(find_motion(read(DATA / "mpu9150_multipos.npz", rate=100.0, columns=columns)).still) <= 30
    )
