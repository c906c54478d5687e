"""Clocks of every kind become the same seconds, or are refused with an option that reads them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tuner.readers import parse_columns, read
from tuner.types.records import DataError, Record

COUNT = 9000
S = 0.01 * np.arange(COUNT)
GYRO = np.random.default_rng(3).normal(0.0, 1e-3, COUNT)
BEGIN = 45000.0
"""12:30, s of the day."""


def digits(seconds: np.ndarray, last: float) -> np.ndarray:
    """HHMMSS with further digits, as a number."""
    minutes = np.floor(seconds / 60.0)
    return np.rint((10000 * np.floor(minutes / 60) + 100 * (minutes % 60) + seconds - 60 * minutes) * last)


def write(path: Path, stamps: list[object], header: str = "t") -> Path:
    rows = (f"{t},{y!r}" for t, y in zip(stamps, GYRO.tolist(), strict=True))
    path.write_text("\n".join([f"{header},gyro_x [rad/s]", *rows]) + "\n")
    return path


def log(path: Path, stamps: np.ndarray, **options: object) -> Record:
    (record,) = read(write(path / "log.csv", stamps.tolist()), **options)  # type: ignore[arg-type]
    return record


ONE_HUNDRED_HERTZ = {
    "s": S,
    "s since 1970": 1.7e9 + S,
    "ms since 1970": np.rint(1.7e12 + 1e3 * S),
    "us since 1970": np.rint(1.7e15 + 1e6 * S),
    "ns since 1970": (np.rint(1e9 * S)).astype(np.int64) + 1_700_000_000_000_000_000,
    "us since the start (PX4)": np.rint(4.2e7 + 1e6 * S),
    "ns since the start": np.rint(3e9 + 1e9 * S),
    "days of Excel": 45000.3 + S / 86400.0,
    "days of MATLAB": 739000.3 + S / 86400.0,
    "HHMMSSmmm": digits(BEGIN + S, 1e3).astype(np.int64),
    "HHMMSS.ss": digits(BEGIN + S, 1e2) / 100.0,
    "HHMMSSmmm over an hour": digits(43160.0 + S, 1e3).astype(np.int64),
    "HHMMSSmmm over midnight": digits((86390.0 + S) % 86400.0, 1e3).astype(np.int64),
    "us in 32 bits": (np.rint(1e6 * S).astype(np.int64) + 2**32 - 5_000_000) % 2**32,
    "s of the week": (604790.0 + S) % 604800.0,
    "single precision, 8 ms": (1e5 + S).astype(np.float32),
    "single precision, 62 ms": (1e6 + S).astype(np.float32),
}


@pytest.mark.parametrize("kind", ONE_HUNDRED_HERTZ)
def test_the_rate_of_every_clock(tmp_path: Path, kind: str) -> None:
    record = log(tmp_path, ONE_HUNDRED_HERTZ[kind])
    assert record.rate == pytest.approx(100.0, rel=1e-4)
    assert record.segments == ((0, COUNT),)
    np.testing.assert_array_equal(record.y[:, 0], GYRO)


@pytest.mark.parametrize(
    ("kind", "stamps", "truth"),
    [
        ("ms", np.rint(1e3 * S), 100.0),
        ("ticks of 10 kHz", np.rint(1e4 * S), 100.0),
        ("min", S / 60.0, 100.0),
        ("h", S / 3600.0, 100.0),
        ("ms in 16 bits", (np.rint(1e3 * S) + 60000) % 65536, 100.0),
    ],
)
def test_a_clock_that_two_units_fit_is_refused_with_the_rate(
    tmp_path: Path, kind: str, stamps: np.ndarray, truth: float
) -> None:
    with pytest.raises(DataError, match="nothing states its unit, and it stays open: 100 Hz in") as caught:
        log(tmp_path, stamps)
    unit = re.search(r"pass --columns '(t=t \[[^]]*\])'", str(caught.value))
    assert unit is not None
    record = log(tmp_path, stamps, columns=parse_columns(unit[1]))
    assert record.rate == pytest.approx(truth, rel=1e-9)
    assert record.segments == ((0, COUNT),)


def test_seconds_of_a_slow_log_are_asked_for(tmp_path: Path) -> None:
    """Steps of one are 1 Hz in seconds and 1 kHz in milliseconds."""
    with pytest.raises(DataError, match="1000 Hz in ms, 1 Hz in s"):
        log(tmp_path, np.arange(COUNT))
    for options in ({"rate": 1.0}, {"columns": {"t": "t [s]"}}):
        assert log(tmp_path, np.arange(COUNT), **options).rate == pytest.approx(1.0)


@pytest.mark.parametrize("unset", [0.0, -1.0, 1e300, 2.0**32 - 1, 2.0**63])
def test_stamps_from_before_the_clock_was_set(tmp_path: Path, unset: float) -> None:
    record = log(tmp_path, np.where(np.arange(COUNT) < 50, unset, 1.7e9 + S))
    assert record.segments == ((0, COUNT - 50),)
    assert record.t[0] == pytest.approx(1.7e9 + 0.5, abs=1e-6)
    assert any(note.startswith("50 rows with stamps from before the clock was set") for note in record.notes)


def test_a_clock_that_begins_at_zero_loses_nothing(tmp_path: Path) -> None:
    assert len(log(tmp_path, S)) == COUNT


def test_a_start_on_another_clock_is_left_out(tmp_path: Path) -> None:
    record = log(tmp_path, np.where(np.arange(COUNT) < 500, S, 1.7e9 + S))
    assert record.segments == ((0, COUNT - 500),)
    assert any("500 rows with stamps more than a year from the others" in note for note in record.notes)


def test_a_clock_too_coarse_for_a_rate(tmp_path: Path) -> None:
    stamps = (1.7e9 + S).astype(np.float32)
    with pytest.raises(
        DataError, match="too coarse: 2 different stamps in 9000 rows give no rate: pass --rate"
    ):
        log(tmp_path, stamps)
    assert log(tmp_path, stamps, rate=100.0).rate == 100.0


@pytest.mark.parametrize(("step", "unit"), [(1e3, "s"), (1e-7, "s"), (1e-5, "ns")])
def test_rates_that_no_log_has(tmp_path: Path, step: float, unit: str) -> None:
    path = write(tmp_path / "log.csv", (step * np.arange(COUNT)).tolist(), f"t [{unit}]")
    with pytest.raises(DataError, match=r"is no rate of an inertial sensor|only .* usable"):
        read(path)


def test_a_span_of_years(tmp_path: Path) -> None:
    with pytest.raises(
        DataError, match=r"the log spans 3[0-9.]* years: a jump of the clock, or another unit"
    ):
        log(tmp_path, np.where(np.arange(COUNT) < COUNT // 2, 1.6e9 + S, 1.7e9 + S))


@pytest.mark.parametrize(
    ("separator", "zone", "offset"), [("T", "Z", 0.0), (" ", "", 0.0), ("T", "+02:00", 7200.0)]
)
def test_dates(tmp_path: Path, separator: str, zone: str, offset: float) -> None:
    begin = np.datetime64("2024-05-01T23:59:30", "ms")
    stamps = [str(begin + np.timedelta64(10 * i, "ms")) for i in range(COUNT)]
    (record,) = read(write(tmp_path / "log.csv", [s.replace("T", separator) + zone for s in stamps]))
    assert record.rate == pytest.approx(100.0)
    assert record.t[0] == pytest.approx(86370.0 - offset)
    assert any("read as seconds since 2024-05-01 00:00 UTC" in note for note in record.notes)


def test_times_of_day_with_colons(tmp_path: Path) -> None:
    stamps = [f"12:{30 + i // 6000:02d}:{i % 6000 / 100:05.2f}" for i in range(COUNT)]
    (record,) = read(write(tmp_path / "log.csv", list(stamps)))
    assert record.rate == pytest.approx(100.0)
    assert record.t[0] == pytest.approx(45000.0)


def test_week_and_seconds(tmp_path: Path) -> None:
    tow, week = (604790.0 + S) % 604800.0, 2300 + (S >= 9.995)
    rows = (f"{w},{t!r},{y!r}" for w, t, y in zip(week, tow.tolist(), GYRO.tolist(), strict=True))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["week,tow,gyro_x [rad/s]", *rows]))
    (record,) = read(path)
    assert record.segments == ((0, COUNT),)
    assert record.rate == pytest.approx(100.0)


def test_a_type_of_time_beats_a_name_and_contradicts_it(tmp_path: Path) -> None:
    stamps = pa.array(np.rint(1e6 * S).astype(np.int64), pa.timestamp("us"))
    for name in ("t", "t_ms"):
        parquet.write_table(pa.table({name: stamps, "gyro_x_rads": GYRO}), tmp_path / f"{name}.parquet")
    assert read(tmp_path / "t.parquet")[0].rate == pytest.approx(100.0)
    with pytest.raises(DataError, match="column 't_ms' says ms, the file states us"):
        read(tmp_path / "t_ms.parquet")


@pytest.mark.parametrize(
    "stamps", [np.zeros(COUNT), np.where(np.arange(COUNT) % 2 == 1, np.nan, S), np.r_[S[:4500], S[:4500]]]
)
def test_useless_stamps_are_left_out_by_the_option_that_the_refusal_names(
    tmp_path: Path, stamps: np.ndarray
) -> None:
    path = write(tmp_path / "log.csv", stamps.tolist())
    with pytest.raises(DataError, match="--columns t=none --rate HZ"):
        read(path)
    (record,) = read(path, columns={"t": "none"}, rate=100.0)
    assert (len(record), record.rate) == (COUNT, 100.0)
    np.testing.assert_array_equal(record.y[:, 0], GYRO)


@pytest.mark.parametrize(
    ("name", "size", "right"), [("t_ms", 1e6, "us"), ("t [s]", 1e3, "ms"), ("t_us", 1e3, "ms")]
)
def test_a_stated_unit_that_gives_an_unusual_rate_is_refused_with_the_usual_one(
    tmp_path: Path, name: str, size: float, right: str
) -> None:
    path = write(tmp_path / "log.csv", np.rint(size * S).tolist(), header=name)
    with pytest.raises(
        DataError, match=rf"is (a rate that few|no rate of an) inertial sensors?( have)?: pass .*\[{right}\]"
    ):
        read(path)
    (record,) = read(path, columns={"t": f"{name} [{right}]"})
    assert record.rate == pytest.approx(100.0)
    (slow,) = read(
        write(tmp_path / "slow.csv", (10.0 * np.arange(COUNT)).tolist(), header="t [s]"),
        columns={"t": "t [s]"},
    )
    assert slow.rate == pytest.approx(0.1)  # as it is confirmed


@pytest.mark.parametrize("begin", ["2024-05-01T12:00:00", 0])
def test_times_of_numpy_are_read_in_their_unit(tmp_path: Path, begin: str | int) -> None:
    steps = (1e9 * S).astype(np.int64).astype("timedelta64[ns]")
    t = steps if begin == 0 else np.datetime64(begin, "ns") + steps
    np.savez(tmp_path / "log.npz", t=t, gyro_x=GYRO, gyro_unit="rad/s")
    (record,) = read(tmp_path / "log.npz")
    assert record.rate == pytest.approx(100.0)
    assert not record.assumptions


def test_a_clock_that_changes_its_step_is_refused_and_each_part_is_read(tmp_path: Path) -> None:
    """Three times slower from 20 % on: at the mean rate, 36 Hz, white noise was 1.67 times too large."""
    slow = S + 2.0 * np.maximum(S - 18.0, 0.0)
    with pytest.raises(
        DataError,
        match=r"changes its step from 0.01 s to 0.03 s at (17.99|18|18.01) s.*: pass --end 1[78].*--rate HZ if",
    ):
        log(tmp_path, slow)
    assert log(tmp_path, slow, end=18.0).rate == pytest.approx(100.0)
    assert log(tmp_path, slow, begin=18.02).rate == pytest.approx(100.0 / 3.0)
    assert log(tmp_path, slow, columns={"t": "none"}, rate=100.0).rate == 100.0


def test_a_step_that_doubles_is_said_first(tmp_path: Path) -> None:
    twice = S + np.maximum(S - 45.0, 0.0)
    said = log(tmp_path, twice).assumptions
    assert any(
        "changes its step from 0.01 s to 0.02 s at 45 s: white noise is wrong by up to 1.22 times" in one
        for one in said
    )
    assert not log(tmp_path, twice, end=45.0).assumptions


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (100.0, "1 Hz, where 1000 Hz in ms is usual"),
        (0.01, "1e+04 Hz, where 166.7 Hz in min is usual"),
    ],
)
def test_a_rare_rate_of_a_stated_unit_is_said_first(tmp_path: Path, size: float, said: str) -> None:
    path = write(tmp_path / "log.csv", (size * S).tolist(), "t [s]")
    assert f"time in s, as the file states: {said}" in read(path)[0].assumptions
    confirmed = read(path, columns={"t": "t [s]"})[0].assumptions
    assert not any("is usual" in one for one in [*confirmed, *log(tmp_path, S).assumptions])


@pytest.mark.parametrize(("size", "header"), [(120.0, "t [s]"), (90.0, "t"), (0.01, "t")])
def test_a_clock_in_no_unit_is_read_by_the_rate_of_the_sensor(
    tmp_path: Path, size: float, header: str
) -> None:
    """A hundred times too slow or fast: units of a table alone were named, in which N was wrong 3 times."""
    path = write(tmp_path / "log.csv", (size * S).tolist(), header)
    with pytest.raises(DataError, match=r"or --columns 't=none' --rate HZ, the rate the sensor was set to$"):
        read(path)
    assert read(path, columns={"t": "none"}, rate=100.0)[0].rate == pytest.approx(100.0)
