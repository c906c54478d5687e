"""Measured logs: units and rates agree with what is known of the sensors."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tuner.readers import read
from tuner.readers.gap_bridges import bridged
from tuner.types.records import DataError

DATA = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="TUNER_DATA does not name a folder with recordings")


def gravity(y: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(y, axis=1)))


@pytest.mark.parametrize("run", [1, 2, 3])
def test_adis16405(run: int) -> None:
    gyro, accel = read(DATA / f"adis16405_run{run}.npz")
    assert gyro.y.shape == accel.y.shape == (1_000_000, 3)
    assert gyro.rate == pytest.approx(100.0)
    assert gravity(accel.y) == pytest.approx(9.8, rel=0.03)
    second = gyro.y.reshape(-1, 100, 3).mean(axis=1)
    deviation = np.sqrt(0.5 * np.mean(np.diff(second, axis=0) ** 2, axis=0))
    np.testing.assert_allclose(np.rad2deg(deviation), 0.039, rtol=0.15)


def test_galaxy_s5() -> None:
    gyro, accel = read(DATA / "galaxy_s5_static.npz")
    assert gyro.rate == pytest.approx(10.0)
    assert gravity(accel.y) == pytest.approx(10.0, rel=0.02)
    assert any("gyro_raw" in note and "gyro_os_corrected" in note for note in gyro.notes)
    (other, _) = read(DATA / "galaxy_s5_static.npz", columns={"gyro": "gyro_os_corrected"})
    assert not np.array_equal(other.y, gyro.y)


def test_cats_tag() -> None:
    gyro, accel = read(DATA / "cats_tag_temperature.npz")
    assert gyro.interval == pytest.approx(1.0)
    assert gyro.span == pytest.approx(51 * 3600, rel=1e-3)
    temperature = accel.covariates["temperature"]
    assert temperature.min() == pytest.approx(4.8, abs=0.3)
    assert temperature.max() == pytest.approx(27.8, abs=0.3)


def test_stim300() -> None:
    gyro, accel = read(DATA / "stim300_static.npz", rate=125.0)
    assert gyro.span == pytest.approx(160.0)
    assert gravity(accel.y) == pytest.approx(9.79, rel=0.01)
    short, _ = read(
        DATA / "stim300_static.npz", rate=125.0, columns={"gyro": "gyro_dps_3", "accel": "accel_g_3"}
    )
    noise = np.diff(short.y, axis=0).std(axis=0), np.diff(gyro.y, axis=0).std(axis=0)
    assert len(short) == 7497
    assert (noise[0] < 20 * noise[1]).all()


@pytest.mark.parametrize("unit", range(5))
def test_mpu9150(unit: int) -> None:
    columns = {"gyro": f"imu{unit}[3:6]", "accel": f"imu{unit}[0:3]"}
    gyro, accel = read(DATA / "mpu9150_multipos.npz", rate=100.0, columns=columns)
    assert gyro.span == pytest.approx(160.0, rel=0.01)
    assert gravity(accel.y) == pytest.approx(9.8, rel=0.05)
    with pytest.raises(DataError, match=r"found imu0 \(15969, 6\).*--columns 'gyro=imu0\[3:6\]"):
        read(DATA / "mpu9150_multipos.npz", rate=100.0)


def test_xsens() -> None:
    with pytest.raises(DataError, match="holds counts: pass --gyro-scale"):
        read(DATA / "imu_tk_xsens_multipos.npz")
    gyro, accel = read(DATA / "imu_tk_xsens_multipos.npz", gyro_scale=2e-4, accel_scale=2.5e-3)
    assert gyro.rate == pytest.approx(100.01, rel=1e-3)
    assert gyro.segments == accel.segments == ((0, 51175),)
    assert any("unsigned counts: 32768" in note for note in gyro.notes)


@pytest.mark.parametrize("axis", range(3))
def test_lost_samples_leave_the_allan_deviation_of_a_filtered_quantized_sensor(axis: int) -> None:
    """5 % lost one by one and twenty gaps of 40: 1.5 % to 1.3 s, and at most the share of lost samples more to 5 s.

    Straight lines take 3.5 % at one sample.
    """
    accel = read(DATA / "adis16405_run2.npz")[1].y[:200_000, axis]
    rng = np.random.default_rng(6)
    here = rng.random(len(accel)) > 0.05
    for start in rng.integers(1, len(accel) - 50, 20):
        here[start : start + 40] = False
    here[[0, -1]] = True
    kept = np.flatnonzero(here)
    filled = bridged(accel[kept], kept, ((0, len(accel)),), axis)

    def deviations(y: np.ndarray) -> list[float]:
        total = np.concatenate(([0.0], np.cumsum(y - y.mean())))
        changes = [(total[2 * m :] - 2.0 * total[m:-m] + total[: -2 * m]) / m for m in 2 ** np.arange(10)]
        return [float(np.sqrt(0.5 * np.mean(change**2))) for change in changes]

    ratio = np.divide(deviations(filled), deviations(accel))
    assert np.abs(ratio[:8] - 1.0).max() < 0.015
    assert np.all((ratio[8:] > 0.985) & (ratio[8:] < 1.015 + 1.0 - here.mean()))
