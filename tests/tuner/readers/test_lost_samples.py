"""Samples that were lost leave white noise white, the rate as it is and rows of zeros out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import ACCEL, COUNT, GYRO, T, notes, refused, rows, write
from tuner.readers import read
from tuner.readers.gap_bridges import bridged
from tuner.readers.time_base import MAX_BRIDGED_SHARE


@pytest.mark.parametrize("share", [0.05, 0.15])
def test_white_noise_with_lost_samples_stays_white(share: float) -> None:
    """In eight bands of 5000 lines each the power with simulated samples differs by no more than chance, 1.4 %.

    Straight lines take 1.6 times the share from the highest band and more.
    """
    n, rng = 80_000, np.random.default_rng(21)
    white = rng.standard_normal(n)
    kept = np.flatnonzero((rng.random(n) > share) | (np.arange(n) % (n - 1) == 0))
    lines = np.abs(np.fft.rfft(np.interp(np.arange(n), kept, white[kept]))[1:]) ** 2 / n
    assert lines[-5000:].mean() < 1.0 - 1.6 * share
    filled = bridged(white[kept], kept, ((0, n),), 0)
    np.testing.assert_array_equal(filled[kept], white[kept])
    power = np.abs(np.fft.rfft(filled)[1:]) ** 2 / n
    levels = power.reshape(8, -1).mean(axis=1)
    assert levels == pytest.approx(np.ones(8), abs=4.0 * 0.0141)


def test_a_smooth_signal_is_followed() -> None:
    """Noise behind a second-order low-pass at a tenth of the rate: smaller errors than straight lines make."""
    n, rng = 40_000, np.random.default_rng(22)
    spectrum = np.fft.rfft(rng.standard_normal(n)) / (1.0 + (np.fft.rfftfreq(n) / 0.03) ** 4)
    smooth = np.fft.irfft(spectrum)
    kept = np.flatnonzero((rng.random(n) > 0.05) | (np.arange(n) % (n - 1) == 0))
    lost = np.setdiff1d(np.arange(n), kept)
    error = bridged(smooth[kept], kept, ((0, n),), 0)[lost] - smooth[lost]
    straight = np.interp(lost, kept, smooth[kept]) - smooth[lost]
    assert error.std() < 0.7 * straight.std()


@pytest.mark.parametrize("kind", ["int16", "uint16", "float32"])
def test_counts_and_single_precision_are_filled_as_the_same_numbers_in_double_precision(kind: str) -> None:
    rng = np.random.default_rng(25)
    full = np.clip(np.round(rng.normal(32_000.0, 900.0, 30_000)), 0, 32_767).astype(kind)
    kept = np.flatnonzero(rng.random(len(full)) > 0.04)
    size = int(kept[-1]) + 1
    found, expected = (bridged(x[kept], kept, ((0, size),), 1) for x in (full, full.astype(float)))
    np.testing.assert_array_equal(found, expected)


def test_an_axis_that_does_not_change_is_filled_with_its_value() -> None:
    kept = np.flatnonzero(np.random.default_rng(26).random(5000) > 0.1)
    np.testing.assert_allclose(bridged(np.full(len(kept), 9.8), kept, ((0, int(kept[-1]) + 1),), 2), 9.8)


def test_axes_are_simulated_apart_and_a_log_is_read_alike_every_time(tmp_path: Path) -> None:
    lost = np.random.default_rng(23).choice(np.arange(1, COUNT - 1), 40, replace=False)
    lines = [line for row, line in enumerate(rows()) if row not in lost]
    path = write(tmp_path / "log.csv", lines)
    gyro, accel = read(path)
    again, _ = read(path)
    np.testing.assert_array_equal(gyro.y, again.y)
    assert gyro.segments == ((0, COUNT),)
    drawn = np.hstack([(gyro.y - GYRO)[lost] / GYRO.std(axis=0), (accel.y - ACCEL)[lost] / ACCEL.std(axis=0)])
    correlation = np.corrcoef(drawn, rowvar=False)[np.triu_indices(6, 1)]
    assert np.abs(correlation).max() < 4.5 / np.sqrt(len(lost))


@pytest.mark.parametrize("share", [0.03, 0.12])
def test_lost_samples_of_a_clock_that_shows_whole_intervals_do_not_change_the_rate(
    tmp_path: Path, share: float
) -> None:
    """Stamps of two decimal places at 100 Hz have as few digits as single precision, and are exact."""
    count = 30_000
    rng = np.random.default_rng(24)
    kept = np.flatnonzero((rng.random(count) > share) | (np.arange(count) % (count - 1) == 0))
    lines = [
        "t,gyro_x (rad/s)",
        *(f"{0.01 * i:.2f},{x:.6f}" for i, x in zip(kept, rng.normal(0, 0.01, len(kept)), strict=True)),
    ]
    (gyro,) = read(write(tmp_path / "log.csv", lines))
    assert share < MAX_BRIDGED_SHARE
    assert gyro.rate == pytest.approx(100.0, rel=1e-9)
    assert len(gyro) == count
    assert gyro.timing["missing"] == count - len(kept)


def test_rows_of_zeros_are_missing_samples(tmp_path: Path) -> None:
    """Loggers of one maker write zeros for packets that did not come; 2 % of them made N thirty times too large."""
    gyro, accel = GYRO.copy(), ACCEL.copy()
    gone = np.arange(20, COUNT, 57)
    gyro[gone], accel[gone] = 0.0, 0.0
    path = write(tmp_path / "log.csv", rows(gyro=gyro, accel=accel))
    assert f"{len(gone)} rows hold zero on all axes of a sensor (first: data row 21)" in notes(path)
    found = read(path)[1]
    assert found.y.std(axis=0) == pytest.approx(ACCEL.std(axis=0), rel=0.1)
    accel[: COUNT // 2] = 0.0
    refused(
        write(tmp_path / "half.csv", rows(gyro=gyro, accel=accel)),
        "rows hold zero on all axes .* record again",
    )


def test_a_gyro_near_zero_may_read_zero(tmp_path: Path) -> None:
    coarse = np.round(GYRO / 0.02) * 0.02
    assert np.all(coarse == 0.0, axis=1).any()
    (gyro, _) = read(write(tmp_path / "log.csv", rows(gyro=coarse)), gyro_unit="rad/s")
    np.testing.assert_array_equal(gyro.t, T)
