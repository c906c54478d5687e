"""A long log becomes means of its samples, whose noise is that of the samples."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from tuner.identification import identify_channel
from tuner.readers import FORMATS, read
from tuner.readers.block_means import MIN_ROWS
from tuner.types.records import DataError, Record

LITTLE = 1.0
"""Bytes of memory: the least rows are kept."""
ROWS = 4 * MIN_ROWS + 1000
INTERVAL = 0.005
N, K = 1e-3, 2e-4
"""Densities of white noise, rad/s/√Hz, and random walk, rad/s²/√Hz."""


def columns(rows: int = ROWS) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    white = rng.normal(0.0, N / np.sqrt(INTERVAL), (rows, 2))
    gyro = white + np.cumsum(rng.normal(0.0, K * np.sqrt(INTERVAL), (rows, 2)), axis=0)
    accel = rng.normal(0.0, 0.02, (rows, 1)) + 9.81
    return {
        "t [s]": INTERVAL * np.arange(rows),
        **{f"gyro_{a} [rad/s]": gyro[:, j] for j, a in enumerate("xy")},
        "accel_z [m/s^2]": accel[:, 0],
        "temperature [degC]": 20.0 + 1e-4 * np.arange(rows),
    }


def written(path: Path, data: dict[str, np.ndarray]) -> Path:
    if path.suffix == ".csv":
        pd.DataFrame(data).to_csv(path, index=False)
    elif path.suffix == ".parquet":
        pd.DataFrame(data).to_parquet(path, row_group_size=20_000)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, column in data.items():
                plain, _, unit = name.partition(" [")
                file.create_dataset(plain, data=column, chunks=True).attrs["unit"] = unit[:-1]
    else:
        np.savez(path, **data)
    return path


def both(path: Path) -> tuple[Record, Record]:
    whole, small = read(path)[0], read(path, memory=LITTLE)[0]
    assert (whole.samples_a_mean, small.samples_a_mean) == (1, 8)
    return whole, small


@pytest.mark.parametrize(
    "ending", ["csv", *(pytest.param(one, marks=pytest.mark.slow) for one in ("parquet", "h5", "npz"))]
)
def test_samples_are_means_and_short_clusters_those_of_all_samples(tmp_path: Path, ending: str) -> None:
    calls: list[tuple[int, int]] = []
    path = written(tmp_path / f"log.{ending}", columns())
    whole, small = both(path)
    read(path, memory=LITTLE, progress=lambda done, total: calls.append((done, total)))
    size = small.samples_a_mean
    full = len(whole) // size * size
    np.testing.assert_allclose(
        small.y, whole.y[:full].reshape(-1, size, 2).mean(axis=1), rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(
        small.covariates["temperature"], whole.covariates["temperature"][:full].reshape(-1, size).mean(axis=1)
    )
    np.testing.assert_allclose(small.t, whole.t[:full].reshape(-1, size).mean(axis=1))
    assert small.interval == pytest.approx(size * INTERVAL, rel=1e-9)
    assert small.segments == ((0, full // size),)
    short = small.short_clusters["gyro_y"]
    assert short.m == (1, 2, 4)
    for m, variance in zip(short.m, short.variance, strict=True):
        clusters = whole.y[:full, 1].reshape(-1, m).mean(axis=1)
        # the pairs across the four borders of parts are left out
        assert variance == pytest.approx(0.5 * np.mean(np.diff(clusters) ** 2), rel=40 * m / full)
    assert calls[-1][0] == calls[-1][1] > 0
    assert "means of 8 of its 66536 samples are kept, 8317" in small.assumptions[0]


def test_a_long_log_becomes_means_unless_memory_is_stated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tuner.readers.block_means.MOST_ROWS", ROWS // 3)
    path = written(tmp_path / "log.npz", columns())
    assert read(path)[0].samples_a_mean == 4  # a half is more than a third
    assert read(path, memory=4e9)[0].samples_a_mean == 1


def test_a_part_of_a_long_log_that_fits_keeps_its_samples(tmp_path: Path) -> None:
    data = columns()
    data["t [s]"] += 1000.0
    path = written(tmp_path / "log.npz", data)
    whole = read(path)[0]
    for begin, end in ((1060.0, 1130.0), (1000.0, 1050.0), (1275.0, None), (None, 1070.0)):
        (few, _), (all_of_it, _) = (read(path, begin=begin, end=end, memory=m) for m in (LITTLE, None))
        assert few.samples_a_mean == 1
        assert few.short_clusters == {}
        assert not any("the log is long" in text for text in few.assumptions)
        np.testing.assert_array_equal(few.y, all_of_it.y)
        np.testing.assert_allclose(few.t, all_of_it.t, rtol=0.0, atol=1e-6)
        assert any("s are used, as stated, of 1000 to 1332.68 s" in note for note in few.notes)
    large = read(path, begin=1010.0, memory=LITTLE)[0]
    assert large.samples_a_mean == 4
    assert len(large) == pytest.approx((len(whole) - 2000) / 4, abs=2)
    for begin, end in ((900.0, None), (None, 1400.0), (1100.0, 1100.0)):
        said = []
        for memory in (LITTLE, None):
            with pytest.raises(DataError) as refused:
                read(path, begin=begin, end=end, memory=memory)
            said.append(str(refused.value))
        assert said[0] == said[1]


def test_archives_whose_arrays_lie_otherwise(tmp_path: Path) -> None:
    data = list(columns().values())
    gyro = np.stack([*data[1:3], data[1]], axis=1)
    for name, array in (("F", np.asfortranarray(gyro)), ("turned", gyro.T.copy()), ("C", gyro)):
        np.savez_compressed(tmp_path / f"{name}.npz", t=data[0], gyro=array, gyro_unit="rad/s")
        small = read(tmp_path / f"{name}.npz", memory=LITTLE)[0]
        np.testing.assert_allclose(small.y[:, 1], data[2][: 8 * len(small)].reshape(-1, 8).mean(axis=1))


def test_no_mean_reaches_across_a_gap_or_a_broken_row(tmp_path: Path) -> None:
    data = columns()
    data["gyro_x [rad/s]"][5000] = np.nan
    kept = np.ones(ROWS, bool)
    kept[20_000:20_120] = kept[MIN_ROWS - 3 : MIN_ROWS + 110] = False
    _, small = both(written(tmp_path / "log.npz", {name: column[kept] for name, column in data.items()}))
    at = np.array([small.t[start] - 3.5 * INTERVAL for start, _ in small.segments])
    np.testing.assert_allclose(at, INTERVAL * np.array([0, MIN_ROWS + 110, 20_120]), atol=1e-9)
    for start, stop in small.segments:
        np.testing.assert_allclose(np.diff(small.t[start:stop]), 8 * INTERVAL, rtol=1e-6)
    assert small.timing["gap_count"] == 2
    assert small.timing["missing"] == 234  # with the broken row
    assert any("1 rows with NaN" in note and "data row 1 on)" in note for note in small.notes)


def test_parts_bridge_their_borders_and_a_clock_set_back_as_a_whole_log_does(tmp_path: Path) -> None:
    """Rows of NaN at both sides of a border; inside a part the clock is set back by 1.0023 s, and rows go on."""
    data = columns()
    data["gyro_y [rad/s]"][[MIN_ROWS - 1, 2 * MIN_ROWS]] = np.nan
    data["t [s]"][MIN_ROWS + MIN_ROWS // 2 :] -= 1.0023
    whole, small = both(written(tmp_path / "log.npz", data))
    assert len(small.segments) == 1
    names = ("gap_count", "missing", "bridged", "duplicates", "disordered")
    assert [small.timing[name] for name in names] == [whole.timing[name] for name in names] == [0, 2, 2, 0, 0]
    assert small.interval == pytest.approx(8 * INTERVAL, rel=2e-5)  # half a sample in a part
    set_back = "the clock was set back once: rows follow one another at "
    for one in (whole, small):
        assert any(said.startswith(set_back) for said in one.assumptions), one.assumptions
    assert "2 missing samples between parts were simulated from those beside them" in "; ".join(small.notes)
    means = whole.y[: 8 * len(small)].reshape(-1, 8, 2).mean(axis=1)
    differ = np.flatnonzero(np.abs(small.y - means).max(axis=1) > 1e-12)
    assert set(differ) <= {(MIN_ROWS - 1) // 8, 2 * MIN_ROWS // 8}
    assert np.abs(small.y - means).max() < 4.0 * N / np.sqrt(INTERVAL) / 8 * np.sqrt(2.0)


def test_noise_of_means_is_that_of_the_samples(tmp_path: Path) -> None:
    whole, small = both(written(tmp_path / "log.npz", columns(8 * MIN_ROWS - 5)))
    every, means = (identify_channel(record, "gyro_x") for record in (whole, small))
    assert means.interval == pytest.approx(INTERVAL)
    assert means.warnings == ()
    for name, parameter in (("white", "density"), ("random_walk", "density")):
        one, other = (found.term(name).coefficients[parameter] for found in (every, means))  # type: ignore[union-attr]
        # both are efficient: the variance of their difference is the difference of their variances
        sds = [np.log(c.interval[1] / c.interval[0]) / 3.92 for c in (one, other)]
        assert abs(np.log(other.value / one.value)) < 5.0 * np.sqrt(max(sds[1] ** 2 - sds[0] ** 2, 1e-6))
    for m in (1, 4, 80):
        points = [
            float(np.interp(m * INTERVAL, c.allan.tau, c.allan.deviation()[:, 0])) for c in (every, means)
        ]
        assert points[1] == pytest.approx(points[0], rel=0.02)


def test_noise_below_the_step_of_a_quantizer_is_a_bound_in_means_and_in_samples(tmp_path: Path) -> None:
    """At 0.2 steps the codes have 0.55 of the noise where the mean lies at a code, 2.5 times it half-way."""
    step, sd, data = 1e-3, 0.2, columns(MIN_ROWS + 9000)
    noise = np.random.default_rng(3).normal(0.0, sd, (len(data["t [s]"]), 2)) + np.array([0.0, 0.5])
    data |= {f"gyro_{a} [rad/s]": step * np.rint(noise[:, j]) for j, a in enumerate("xy")}
    path = written(tmp_path / "log.npz", data)
    truth = sd * step * np.sqrt(INTERVAL)
    for record in (read(path)[0], read(path, memory=LITTLE)[0]):
        for axis, largest in (("gyro_x", 0.35), ("gyro_y", 0.51)):
            found = identify_channel(record, axis)
            assert not any(term.present for term in found.terms)
            white = found.term("white").coefficients["density"]  # type: ignore[union-attr]
            assert truth < white.upper < 1.02 * largest * step * np.sqrt(INTERVAL)
            assert found.warnings[0] in record.notes


@pytest.mark.parametrize("weeks", [True, False])
def test_a_week_of_gps_that_begins_between_parts_is_continued(tmp_path: Path, weeks: bool) -> None:
    """Also where it begins within a part, and without a column of weeks."""
    for first in (604800.0 - INTERVAL * 2 * MIN_ROWS, 604800.0 - INTERVAL * 40_000):
        data = columns()
        t = first + data.pop("t [s]")
        data |= {"tow": t % 604800.0} | ({"week": 2312.0 + t // 604800.0} if weeks else {})
        whole, small = both(written(tmp_path / "log.npz", data))
        np.testing.assert_allclose(small.t, whole.t[: 8 * len(small)].reshape(-1, 8).mean(axis=1))
        assert len(small.segments) == 1


def test_a_log_in_parts_says_what_the_whole_log_says(tmp_path: Path) -> None:
    """A cell of 9e4 rad/s, units that nobody states, a column that is not used, whole numbers."""
    data = {name.partition(" [")[0]: column for name, column in columns().items()}
    data["gyro_x"][300] = 9e4
    path = written(tmp_path / "log.csv", data | {"checksum": np.arange(ROWS) % 251})
    whole, small = both(path)
    assert np.abs(small.y).max() < 1.0
    said = [re.sub(r"[0-9][0-9.]*", "#", "; ".join(record.notes)) for record in (whole, small)]
    assert "rows hold a reading" in said[0]
    assert all(note.partition(" (")[0] in said[1] for note in said[0].split("; ")), said
    assert len(small.assumptions) == len(whole.assumptions) + 1
    data["gyro_x"][300] = 0.0
    raw = data | {f"gyro_{a}": np.rint(1e4 * data[f"gyro_{a}"]) for a in "xy"}
    for memory in (None, LITTLE):
        with pytest.raises(DataError, match="gyro holds whole numbers, as counts do"):
            read(written(tmp_path / "counts.npz", raw), memory=memory)


def test_what_is_hidden_within_the_means_is_said(tmp_path: Path) -> None:
    data = columns()
    data["gyro_x [rad/s]"] += 0.02 * np.sin(2.0 * np.pi * 50.0 * data["t [s]"])
    _, small = both(written(tmp_path / "log.npz", data))
    (warning,) = identify_channel(small, "gyro_x").warnings
    assert "below a cluster time of 0.02 s no sum of noise terms follows" in warning
    assert "f ≤ 12.5 Hz" in warning
    assert identify_channel(small, "gyro_y").warnings == ()


@pytest.mark.parametrize(
    ("factor", "offset", "found"),
    [(1.0, -100.0, "the stamps go back by 100"), (1.1, 0.0, r"181\.818 Hz: cut the log there")],
)
def test_parts_that_do_not_fit_are_refused(tmp_path: Path, factor: float, offset: float, found: str) -> None:
    data = columns()
    t = data["t [s]"]
    t[2 * MIN_ROWS :] += offset + (factor - 1.0) * (t[2 * MIN_ROWS :] - t[2 * MIN_ROWS])
    with pytest.raises(DataError, match=found):
        read(written(tmp_path / "log.npz", data), memory=LITTLE)


def test_short_comments_do_not_make_a_text_seem_long(tmp_path: Path) -> None:
    rows = 2000
    lines = written(tmp_path / "log.csv", columns(rows)).read_text().splitlines()
    (tmp_path / "log.csv").write_text("\n".join([lines[0], *(f"{line}\n#" for line in lines[1:])]))
    assert 0.4 < FORMATS["text"].read(tmp_path / "log.csv", None).rows / rows < 2.1


@pytest.mark.parametrize("packed", [True, False])
def test_a_packed_or_wide_text_is_as_long_as_its_rows(tmp_path: Path, packed: bool) -> None:
    text = written(tmp_path / "log.csv", columns(20_000)).read_text()
    path = tmp_path / ("log.csv.gz" if packed else "wide.csv")
    path.write_bytes(gzip.compress(text.encode(), 1) if packed else text.encode("utf-16"))
    assert FORMATS["text"].read(path, None).rows == pytest.approx(20_000, rel=0.05)


@pytest.mark.parametrize("share", [0.009, 0.02])
def test_broken_rows_are_judged_by_their_share_of_the_whole_log(tmp_path: Path, share: float) -> None:
    data = columns()
    data["gyro_x [rad/s]"][MIN_ROWS : MIN_ROWS + int(share * ROWS)] = np.nan
    path = written(tmp_path / "log.npz", data)
    if share < 0.01:
        whole, small = both(path)
        assert abs(8 * len(small) - len(whole)) < 16
        return
    said = []
    for memory in (LITTLE, None):
        with pytest.raises(
            DataError, match=rf"{MIN_ROWS + 1}\); more than 1 % cannot be repaired"
        ) as refused:
            read(path, memory=memory)
        said.append(str(refused.value))
    assert said[0] == said[1]
