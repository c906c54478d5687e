"""The part of a log that its user wants is read as if the rest had not been recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import ACCEL, GYRO, T, refused, rows, write
from tuner.readers import read


def test_a_part_of_a_log_is_the_log_of_that_part(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.csv", rows(T + 1.7e9))
    kept = slice(250, 700)
    alone = write(tmp_path / "alone.csv", rows(T[kept] + 1.7e9, GYRO[kept], ACCEL[kept]))
    for part, other in zip(read(whole, begin=1.7e9 + 2.5, end=1.7e9 + 7.0), read(alone), strict=True):
        np.testing.assert_array_equal(part.y, other.y)
        np.testing.assert_allclose(part.t, other.t, atol=1e-6, rtol=0.0)
        assert part.segments == other.segments
        assert (
            "1700000002.5 to 1700000007 s are used, as stated, of 1700000000 to 1700000010 s"
            in part.notes[-1]
        )
    assert len(read(whole, begin=1.7e9 + 9.0)[0]) == 100
    assert len(read(whole, end=1.7e9 + 1.0)[0]) == 100


def test_gaps_stay_where_they_are(tmp_path: Path) -> None:
    there = np.r_[0:300, 600:1000]
    log = write(tmp_path / "gap.csv", rows(T[there], GYRO[there], ACCEL[there]))
    (whole, _), (part, _) = read(log), read(log, begin=1.0, end=8.0)
    assert [b - a for a, b in whole.segments] == [300, 400]
    assert [b - a for a, b in part.segments] == [200, 200]
    assert part.t[part.segments[1][0]] == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"begin": 12.0}, "begin 12: the clock of the log goes from 0 to 10 s"),
        ({"begin": 5.0, "end": 2.0}, "begin 5, end 2: expected an end after the beginning"),
        ({"end": 11.0}, "end 11: the clock of the log goes from 0 to 10 s"),
        ({"begin": -1.0}, "begin -1: the clock of the log goes from 0 to 10 s"),
        ({"end": float("nan")}, "read: end: expected a number or None, found nan"),
        ({"begin": 5.0, "end": 5.1}, "leave 10 samples of gyro, expected 64 or more: 0.64 s"),
    ],
)
def test_what_lies_outside_the_log_is_refused(tmp_path: Path, stated: dict[str, float], said: str) -> None:
    assert said in refused(write(tmp_path / "log.csv", rows()), ".", **stated)


@pytest.mark.parametrize(
    "command",
    [["identify", "mpu9250"], ["compare", "mpu9250", "stim300"], ["tune", "mpu9250"], ["plan", "mpu9250"]],
)
def test_a_part_of_what_is_no_log_is_refused(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    from tuner.cli import run

    for option, value in (("--begin", "3"), ("--rate", "1e3"), ("--gyro-unit", "deg/s"), ("--assume", "si")):
        assert run([*command, option, value, "--quiet"]) == 2
        assert f"{option}: expected a static log, found mpu9250" in capsys.readouterr().err
