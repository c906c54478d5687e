"""Drives in the text format of KF-GINS: as its README and sources publish it, and as we write it.

README.md 2.1 (frames), 2.2 (columns and units), dataset/kf-gins.yaml (entries), src/fileio/imufileloader.h (intervals),
src/fileio/gnssfileloader.h (13 columns), src/kf_gins.cpp (what must be there, and in which unit) of
https://github.com/i2Nav-WHU/KF-GINS.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from models import rotation
from models.noise import GaussMarkov
from models.units import from_si, to_si
from tuner.cli import run
from tuner.consistency.score_drive import navigate_drive
from tuner.examination.examined_drive import examined_drive
from tuner.exporters.kf_gins_drive import MIN_GAP, SECONDS_PER_WEEK, drive_files, write_drive
from tuner.readers import kf_gins_settings
from tuner.readers.drive import read_drive
from tuner.types import Compensation
from tuner.types.records import DataError

REQUIRED = (
    *("imupath", "gnsspath", "outputpath", "imudatalen", "imudatarate", "starttime", "endtime"),
    *("initpos", "initvel", "initatt", "initgyrbias", "initaccbias", "initgyrscale", "initaccscale"),
    *("initposstd", "initvelstd", "initattstd", "antlever", "imunoise"),
)
"""Entries without which the program ends."""
NOISE = ("arw", "vrw", "gbstd", "abstd", "gsstd", "asstd", "corrtime")


def written_drive(drive, config, path):
    """Write a drive as it is, without a judgement; return its notes."""
    files = drive_files(drive, config)
    write_drive(files, path)
    return files.notes


def layout(path, *, imu=None, gnss=None, separator=" ", **entries):
    """Write a car that stands, 100 Hz, in Stuttgart, with `entries` in its YAML; return the YAML."""
    t = 1000.0 + 0.01 * np.arange(1, 3001)
    rng = np.random.default_rng(0)
    if imu is None:
        noise = 1e-5 * rng.standard_normal((len(t), 6))
        imu = np.column_stack([t, noise + 0.01 * np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.81])])
    if gnss is None:
        fix_t = np.arange(1000.5, 1029.0)
        gnss = np.column_stack([fix_t, np.tile([48.8, 9.2, 300.0, 0.01, 0.02, 0.03], (len(fix_t), 1))])
    np.savetxt(path / "imu.txt", imu, fmt="%.12g", delimiter=separator)
    np.savetxt(path / "gnss.txt", gnss, fmt="%.12g", delimiter=separator)
    settings = path / "kf-gins.yaml"
    content = {"imupath": "imu.txt", "gnsspath": "gnss.txt", "imudatarate": 100, **entries}
    settings.write_text(yaml.safe_dump(content), encoding="utf-8")
    return settings


@pytest.mark.parametrize("separator", [" ", ",", "\t", ", "])
def test_commas_blanks_and_tabs_separate_columns(tmp_path, separator):
    drive = read_drive(layout(tmp_path, separator=separator))
    assert drive.rates[:, 5].mean() == pytest.approx(-9.81, abs=1e-3)
    np.testing.assert_allclose(drive.gnss.position_sd[0], [0.01, 0.02, 0.03])


def test_an_increment_behind_a_gap_is_one_of_an_interval(tmp_path):
    t = 1000.0 + 0.01 * np.arange(1, 3001)
    t[1500:] += 0.3
    imu = np.column_stack([t, np.tile([0.0, 0.0, 1e-4, 0.0, 0.0, -0.0981], (len(t), 1))])
    imu[::2, 1] = 1e-6
    drive = read_drive(layout(tmp_path, imu=imu))
    np.testing.assert_allclose(drive.rates[:, 2], 0.01, rtol=1e-4)
    np.testing.assert_allclose(drive.rates[:, 5], -9.81, rtol=1e-4)


def test_of_13_columns_the_8th_to_10th_are_the_sds(tmp_path):
    t = np.arange(1000.5, 1029.0)
    row = [48.8, 9.2, 300.0, 0.1, -0.2, 0.3, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
    gnss = np.column_stack([t, np.tile(row, (len(t), 1))])
    drive = read_drive(layout(tmp_path, gnss=gnss))
    np.testing.assert_allclose(drive.gnss.position_sd[0], [0.01, 0.02, 0.03])
    with pytest.raises(DataError, match="7 or 13"):
        read_drive(layout(tmp_path, gnss=gnss[:, :10]))


def test_only_what_is_processed_is_read(tmp_path):
    drive = read_drive(layout(tmp_path, starttime=1005.0, endtime=1025.0))
    assert drive.origin == pytest.approx(1005.0)
    assert drive.imu_t[-1] == pytest.approx(20.0)
    assert drive.gnss.t.min() >= 0.0
    assert drive.gnss.t.max() <= 20.0
    assert any("starttime" in note for note in drive.notes)
    assert read_drive(layout(tmp_path, starttime=1005.0, endtime=-1)).imu_t[-1] == pytest.approx(25.0)


def test_initial_sensor_errors_are_taken_out(tmp_path):
    errors = {"initgyrbias": [360.0, 0, 0], "initaccbias": [0, 100.0, 0], "initaccscale": [0, 0, 1000.0]}
    plain = read_drive(layout(tmp_path))
    drive = read_drive(layout(tmp_path, **errors))
    expected = plain.rates - np.array([np.radians(0.1), 0.0, 0.0, 0.0, 1e-3, 0.0])
    expected[:, 5] /= 1.001
    np.testing.assert_allclose(drive.rates, expected, atol=1e-12)
    with pytest.raises(DataError, match="kf-gins"):
        read_drive(layout(tmp_path, initgyrbias=[1.0, 2.0]))


@pytest.mark.parametrize("name", ["truth.nav", "kf-gins-truth.nav"])
def test_truth_beside_the_settings_is_read(tmp_path, name):
    t = np.arange(1000.0, 1030.0)
    truth = np.column_stack(
        [0 * t, t, np.tile([48.8, 9.2, 300.0, 1.0, 2.0, 3.0, 4.0, 5.0, 190.0], (len(t), 1))]
    )
    np.savetxt(tmp_path / name, truth)
    found = read_drive(layout(tmp_path)).reference
    np.testing.assert_allclose(found.vel_n[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(np.degrees(found.rpy[0]) % 360.0, [4.0, 5.0, 190.0])
    np.savetxt(tmp_path / name, truth[:, 1:])
    with pytest.raises(DataError, match="11 columns"):
        read_drive(layout(tmp_path))


def test_sds_of_the_fixes_hold_where_no_receiver_is_named(configuration, file, tmp_path):
    settings = tmp_path / "k.yaml"
    written_drive(read_drive(file), configuration(), settings)
    found = navigate_drive(read_drive(settings), kf_gins_settings.load(settings))
    np.testing.assert_allclose(
        found.stretches[0].fixes.sd[:, :3], np.tile([0.4, 0.4, 0.8], (len(found.stretches[0].fixes), 1))
    )


def test_a_state_that_starts_below_its_sd_is_the_walk_that_it_is_until_it_has_grown(tmp_path):
    """σ of a day from a start of 5 deg/h was taken for what is known at the start."""
    noise = {"arw": [0.1] * 3, "vrw": [0.1] * 3, "gbstd": [3.0, 5.0, 13.0], "abstd": [10.0] * 3}
    settings = layout(
        tmp_path,
        imunoise={**noise, "gsstd": [0.0] * 3, "asstd": [30.0] * 3, "corrtime": 24.0},
        initbgstd=[5.0] * 3,
        initsgstd=[300.0] * 3,
    )
    found = kf_gins_settings.load(settings)
    for axis, sd in zip("xyz", noise["gbstd"], strict=True):
        walk = found.channels[f"gyro_{axis}"]
        assert not walk.markov
        assert walk.constant_sd == pytest.approx(to_si(5.0, "deg/h"))
        assert walk.random_walk_density == pytest.approx(to_si(sd, "deg/h") * (2.0 / 86400.0) ** 0.5)
    assert found.channels["accel_x"].markov[0].sd == pytest.approx(to_si(10.0, "mGal"))
    assert found.constants == pytest.approx({"gyro_scale": 3e-4, "accel_scale": 3e-5})
    assert found.time_constants == {"accel_scale": 86400.0}


def test_a_start_beyond_the_date_line_is_beside_the_fixes(tmp_path):
    """Fixes were brought to 179.99°, the start stayed at −180.01°: the filter was lost, "tuple index out of range"."""
    t = np.arange(1000.5, 1029.0)
    gnss = np.column_stack([t, np.tile([35.8, -180.01, 300.0, 0.01, 0.02, 0.03], (len(t), 1))])
    start = {
        "initpos": [35.8, -180.01, 300.0],
        "initvel": [0.0] * 3,
        "initatt": [0.0] * 3,
        "starttime": 1000.01,
    }
    drive = read_drive(layout(tmp_path, gnss=gnss, **start))
    assert drive.start.llh[1] == pytest.approx(drive.gnss.llh[0, 1])


@pytest.fixture(scope="module")
def written(file, tmp_path_factory):
    """The drive of the file, 50 Hz, mounted askew, fixes late, written by the program."""
    path = tmp_path_factory.mktemp("kf-gins") / "city.yaml"
    args = ["export", "mpu9250", "--to", "kf-gins", "--drive", str(file), "-o", str(path), "--quiet"]
    assert run(args) == 0
    return path


def test_every_entry_is_there_with_its_type(written):
    found = yaml.safe_load(written.read_text(encoding="utf-8"))
    assert set(REQUIRED) <= found.keys()
    assert set(NOISE) <= found["imunoise"].keys()
    assert isinstance(found["imudatarate"], int)
    assert found["imudatarate"] == 50
    assert found["imudatalen"] == 7
    for name in REQUIRED:
        if name.startswith("init") or name == "antlever":
            assert np.isfinite(np.array(found[name], dtype=float)).all()
            assert len(found[name]) == 3
    assert min(found["initposstd"] + found["initvelstd"] + found["initattstd"] + found["initbgstd"]) > 0.0


def test_files_fit_the_settings_to_the_digit(written):
    found = yaml.safe_load(written.read_text(encoding="utf-8"))
    imu, gnss = (np.loadtxt(found[name]) for name in ("imupath", "gnsspath"))
    assert imu.shape[1] == gnss.shape[1] == 7
    # Sought with imu.time < starttime and gnss.time <= starttime: the first row is the start.
    assert imu[0, 0] == found["starttime"]
    assert gnss[0, 0] > found["starttime"]
    assert imu[-1, 0] < SECONDS_PER_WEEK
    assert np.diff(imu[:, 0]).max() < MIN_GAP
    assert np.diff(imu[:, 0]).min() > 0.0
    wider = np.median(gnss[:, 4:], axis=0) / [0.4, 0.4, 0.8]  # white errors: little more than reported
    assert ((wider > 0.999) & (wider < 1.5)).all()


def test_the_start_is_that_of_the_truth(written):
    found = yaml.safe_load(written.read_text(encoding="utf-8"))
    truth = np.loadtxt(written.with_name("city-truth.nav"))
    at = [np.interp(found["starttime"], truth[:, 1], column) for column in truth.T]
    sd = np.array(found["initposstd"] + found["initvelstd"] + found["initattstd"])
    metres = np.radians(6.37e6) * np.array([1.0, np.cos(0.84)])
    error = np.concatenate(
        [
            (np.array(found["initpos"][:2]) - at[2:4]) * metres,
            [found["initpos"][2] - at[4]],
            np.array(found["initvel"]) - at[5:8],
            (np.array(found["initatt"]) - at[8:11] + 180.0) % 360.0 - 180.0,
        ]
    )
    assert (np.abs(error) < 5.0 * sd).all(), error / sd
    # Files are in the axes of the vehicle, the biases of the test drive in those of the sensor.
    mat = rotation.mat_from_rpy(np.radians([180.0, 3.0, 100.0]))
    for name, sds, unit, true in (
        ("initgyrbias", "initbgstd", "deg/h", np.array([2e-3, -1e-3, 1.5e-3])),
        ("initaccbias", "initbastd", "mGal", np.array([0.05, -0.04, 0.06])),
    ):
        off = np.array(found[name]) - [from_si(v, unit) for v in mat.T @ true]
        assert (np.abs(off) < 5.0 * np.array(found[sds])).all(), off / found[sds]
    np.testing.assert_allclose(found["antlever"], [0.5, -0.3, -1.2])


def test_increments_carry_the_start_along_the_truth(written):
    """Dead reckoning by the published conventions alone: a wrong sign, axis or unit is tens of metres off."""
    found = yaml.safe_load(written.read_text(encoding="utf-8"))
    imu, truth = np.loadtxt(found["imupath"]), np.loadtxt(written.with_name("city-truth.nav"))
    seconds = 10.0
    gyro = [to_si(v, "deg/h") for v in found["initgyrbias"]]
    accel = [to_si(v, "mGal") for v in found["initaccbias"]]
    rows = imu[imu[:, 0] <= found["starttime"] + seconds]
    lat, lon, height = found["initpos"]
    vel, mat = np.array(found["initvel"]), rotation.mat_from_rpy(np.radians(found["initatt"]))
    metres = np.radians(6.37e6) * np.array([1.0, np.cos(np.radians(lat))])
    moved = np.zeros(3)
    for dt, row in zip(np.diff(rows[:, 0]), rows[1:], strict=True):
        middle = mat @ rotation.mat_from_rotvec(0.5 * (row[1:4] - np.multiply(gyro, dt)))
        before = vel
        vel = vel + middle @ (row[4:7] - np.multiply(accel, dt)) + [0.0, 0.0, 9.808 * dt]
        mat = mat @ rotation.mat_from_rotvec(row[1:4] - np.multiply(gyro, dt))
        moved += 0.5 * (before + vel) * dt
    at = [np.interp(rows[-1, 0], truth[:, 1], column) for column in truth.T]
    north, east = ([lat, lon] + moved[:2] / metres - at[2:4]) * metres
    error = np.array([north, east, height - moved[2] - at[4]])
    turned = rotation.rotvec_from_mat(mat @ rotation.mat_from_rpy(np.radians(at[8:11])).T)
    sd = np.array(found["initattstd"]) + seconds * np.array(found["initbgstd"]) / 3600.0
    assert np.linalg.norm(moved) > 50.0
    assert np.abs(at[10] - found["initatt"][2]) > 10.0  # it turns
    assert (np.abs(np.degrees(turned)) < 5.0 * sd).all(), np.degrees(turned) / sd
    # From the fixes around, to 0.4 m each, velocity and tilt against the biases are known to 0.3 m/s and 0.1 m/s².
    assert np.linalg.norm(error) < 5.0
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(moved)


def test_the_program_reads_what_it_wrote(written, tmp_path):
    out = tmp_path / "out.json"
    assert run(["navigate", str(written), "--config", str(written), "--quiet", "--json", str(out)]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    (delay,) = found["source"]["estimates"]["time_offset"]
    assert abs(delay["value"]) < 4.0 * delay["sd"]  # the clocks of a clean drive agree
    assert not found["diverged"]
    assert found["gated"] < 0.02


def test_gaps_are_filled_with_constant_rates(data, saved, configuration, tmp_path):
    lost = {**data}
    away = (np.arange(len(data["imu_t"])) > 8000) & (np.arange(len(data["imu_t"])) <= 8015)
    for name in ("imu_t", "gyro", "accel"):
        lost[name] = data[name][~away]
    file = saved(
        tmp_path / "gap.npz", lost, lever_arm_frd_m=(0.5, -0.3, -1.2), mounting_rpy_deg=(180.0, 3.0, 100.0)
    )
    settings = tmp_path / "gap.yaml"
    written_drive(read_drive(file), configuration(), settings)
    imu = np.loadtxt(tmp_path / "gap-imu.txt")
    dt = np.diff(imu[:, 0])
    assert dt.max() < MIN_GAP
    rates = imu[1:, 1:] / dt[:, None]
    inside = (imu[1:, 0] > data["imu_t"][8000] + 1e-6) & (imu[1:, 0] <= data["imu_t"][8016] + 1e-6)
    assert np.count_nonzero(inside) >= 16
    np.testing.assert_allclose(
        rates[inside], np.tile(rates[inside][0], (np.count_nonzero(inside), 1)), rtol=1e-5
    )


@pytest.mark.parametrize("args", [["--to", "kalibr", "-o", "x.yaml"], ["--to", "kf-gins"]])
def test_a_drive_needs_this_dialect_and_a_file(file, capsys, args):
    assert run(["export", "mpu9250", "--drive", str(file), *args]) == 2
    assert "--drive: expected --to kf-gins and -o FILE" in capsys.readouterr().err


def test_sds_of_the_fixes_are_those_of_the_receiver(configuration, file, tmp_path):
    # Seen: a factor of 0.067, which holds beside a state for correlated errors alone, made 1.8 m into 0.13 m.
    factors = Compensation.parse(
        {"gnss_noise_scale.position_horizontal": 0.067, "gnss_noise_scale.position_vertical": 0.02}
    )
    notes = written_drive(
        read_drive(file), replace(configuration(), compensation=factors), tmp_path / "k.yaml"
    )
    fixes = np.loadtxt(tmp_path / "k-gnss.txt")
    np.testing.assert_allclose(fixes[:, 4:], np.tile([0.4, 0.4, 0.8], (len(fixes), 1)))
    assert any("not below the receiver's own" in note for note in notes)
    # Fixes that are wrong by far more than they report keep what was found.
    larger = Compensation.parse({"gnss_noise_scale.position_horizontal": 20.0})
    written_drive(read_drive(file), replace(configuration(), compensation=larger), tmp_path / "k.yaml")
    fixes = np.loadtxt(tmp_path / "k-gnss.txt")
    np.testing.assert_allclose(fixes[:, 4:], np.tile([8.0, 8.0, 0.8], (len(fixes), 1)))


def test_of_errors_that_stay_the_sds_are_in_the_file_where_no_fix_reports_its_own(
    configuration, data, saved, tmp_path
):
    silent = {name: value for name, value in data.items() if name != "gnss_pstd"}
    file = saved(tmp_path / "silent.npz", silent, lever_arm_frd_m=(0.5, -0.3, -1.2))
    config = configuration()
    stays = replace(config.gnss, correlated=(GaussMarkov(0.3, 100.0),), correlated_down=2.0)
    written_drive(read_drive(file), replace(config, gnss=stays), tmp_path / "k.yaml")
    fixes = np.loadtxt(tmp_path / "k-gnss.txt")
    np.testing.assert_allclose(fixes[:, 4:], np.tile([0.5, 0.5, 1.0], (len(fixes), 1)))


def test_a_lever_arm_that_the_drive_does_not_determine_is_to_be_measured(
    configuration, data, saved, tmp_path
):
    # A car of 400 s with fixes of 10 m: seen on a real one as an arm of 7.5 m.
    rng = np.random.default_rng(3)
    llh = data["gnss_llh"] + rng.standard_normal(data["gnss_llh"].shape) * [1e-4, 1e-4, 20.0]
    poor = {**data, "gnss_llh": llh, "gnss_pstd": np.tile([10.0, 10.0, 20.0], (len(llh), 1))}
    file = saved(tmp_path / "poor.npz", poor, mounting_rpy_deg=(180.0, 3.0, 100.0))
    notes = written_drive(read_drive(file), configuration(), tmp_path / "k.yaml")
    assert yaml.safe_load((tmp_path / "k.yaml").read_text())["antlever"] == [0.0, 0.0, 0.0]
    assert any(note.startswith("antlever forward, right, down: 0, as this drive") for note in notes)


def test_components_of_a_lever_arm_that_the_drive_determines_are_written(
    configuration, data, saved, tmp_path
):
    # Level curves show where the antenna is forward; how high it is they cannot tell from the height of the road.
    file = saved(tmp_path / "good.npz", data, mounting_rpy_deg=(180.0, 3.0, 100.0))
    notes = written_drive(examined_drive(file)[0], configuration(), tmp_path / "k.yaml")
    arm = yaml.safe_load((tmp_path / "k.yaml").read_text())["antlever"]
    assert arm[0] == pytest.approx(0.5, abs=0.3)
    assert arm[2] == 0.0
    assert any(note.startswith("antlever ") and " down: 0" in note for note in notes)
