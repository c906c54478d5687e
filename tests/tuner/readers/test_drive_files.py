"""Files of drives: read in every form, repaired or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.cli import run
from tuner.consistency.score_drive import navigate_drive
from tuner.exporters import export
from tuner.formats import noise_yaml
from tuner.formats.digits import DEFAULT_DIGITS
from tuner.identification import identify
from tuner.readers.drive import read_drive
from tuner.readers.drive_tables import ordered
from tuner.readers.source_kind import source_name
from tuner.synthesis.from_drive import config_for_drive
from tuner.synthesis.load_config import load_config
from tuner.synthesis.projection import RTK, projected
from tuner.types import Compensation
from tuner.types.records import DataError, Record

LEVER = (0.5, -0.3, -1.2)
MOUNTING_RPY = (180.0, 3.0, 100.0)
SIX_DIGITS = 0.51 * 10.0 ** (1 - DEFAULT_DIGITS)
"""Relative rounding of an exported number."""


def write_folder(path, data, *, truth=True):
    path.mkdir()
    header = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    imu = np.column_stack([data["imu_t"], data["gyro"], data["accel"]])
    np.savetxt(path / "imu.csv", imu, delimiter=",", header=header, comments="")
    gnss = np.column_stack([data[f"gnss_{n}"] for n in ("t", "llh", "vned", "pstd", "vstd")])
    names = "t,lat [deg],lon [deg],height [m],vn,ve,vd,sd_n,sd_e,sd_d,sd_vn,sd_ve,sd_vd"
    np.savetxt(path / "gnss.csv", gnss, delimiter=",", header=names, comments="", fmt="%.12g")
    if truth:
        rows = np.column_stack([data[f"ref_{n}"] for n in ("t", "llh", "vned", "rpy")])
        names = "t,lat,lon,height,vn,ve,vd,roll,pitch,yaw [deg]"
        np.savetxt(path / "truth.csv", rows, delimiter=",", header=names, comments="", fmt="%.12g")
    return path


def test_folder_and_npz_are_one(data, file, tmp_path):
    a, b = read_drive(file), read_drive(write_folder(tmp_path / "drive", data))
    np.testing.assert_allclose(a.imu_t, b.imu_t, atol=1e-6)
    np.testing.assert_allclose(a.rates, b.rates, atol=1e-9)
    np.testing.assert_allclose(a.gnss.llh, b.gnss.llh, atol=1e-11)
    np.testing.assert_allclose(a.gnss.t, b.gnss.t, atol=1e-6)
    np.testing.assert_allclose(a.reference.rpy, b.reference.rpy, atol=1e-9)


def test_a_folder_given_as_a_dot_has_its_name(data, tmp_path, monkeypatch):
    folder = write_folder(tmp_path / "round-trip", data)
    (folder / "inside").mkdir()
    for here, given in ((folder, "."), (folder, "./"), (folder / "inside", "..")):
        monkeypatch.chdir(here)
        assert (read_drive(given).name, source_name(given)) == ("round-trip", "round-trip")
    gyro = Record(
        "gyro", np.arange(400.0), np.random.default_rng(1).normal(size=400), ("gyro_x",), "rad/s", 1.0
    )
    assert identify([replace(gyro, source="..")], arma=None).source["name"] == "round-trip"
    assert identify([gyro], arma=None).source["name"] == "gyro"


def test_stated_solutions_and_rounded_sds(saved, data, tmp_path):
    k = len(data["gnss_t"])
    sd = np.tile([0.0, 0.02, 0.04], (k, 1))
    sd[0] = 0.0
    q = np.where(np.arange(k) % 2, 1, 5)
    drive = read_drive(saved(tmp_path / "drive.npz", {**data, "gnss_q": q, "gnss_pstd": sd}))
    np.testing.assert_array_equal(drive.gnss.solution, np.where(q == 1, 4.0, 1.0))
    np.testing.assert_array_equal(drive.gnss.position_sd[1], [0.01, 0.02, 0.04])
    np.testing.assert_array_equal(drive.gnss.position_sd[0], 0.0)
    folder = write_folder(tmp_path / "folder", data, truth=False)
    header, *lines = (folder / "gnss.csv").read_text().splitlines()
    rows = [f"{line},{one}" for line, one in zip(lines, np.where(q == 1, 4, 1), strict=True)]
    (folder / "gnss.csv").write_text("\n".join([f"{header},quality", *rows]))
    np.testing.assert_array_equal(read_drive(folder).gnss.solution, drive.gnss.solution)
    assert np.isnan(read_drive(saved(tmp_path / "none.npz", data)).gnss.solution).all()


def test_vertical_velocities_that_are_never_other_than_zero_are_not_measured(saved, data, tmp_path):
    # NMEA has none: receivers that write speed and course leave a zero.
    flat = data["gnss_vned"] * [1.0, 1.0, 0.0]
    drive = read_drive(saved(tmp_path / "drive.npz", {**data, "gnss_vned": flat}))
    assert np.isnan(drive.gnss.vel_n[:, 2]).all()
    assert np.isfinite(drive.gnss.vel_n[:, :2]).all()
    assert "vertical velocities are 0 in every fix: taken as not measured" in drive.notes
    standing = read_drive(saved(tmp_path / "standing.npz", {**data, "gnss_vned": 0.0 * flat}))
    assert (standing.gnss.vel_n == 0.0).all()  # a fault of another kind, which the examination names


def test_samples_that_lie_unevenly_keep_their_stamps(data, tmp_path):
    uneven = dict(data)
    step = np.random.default_rng(4).choice([0.6, 0.7, 0.9, 1.8], len(data["imu_t"]))
    uneven["imu_t"] = data["imu_t"][0] + np.cumsum(step) * np.median(np.diff(data["imu_t"]))
    drive = read_drive(write_folder(tmp_path / "drive", uneven, truth=False))
    np.testing.assert_allclose(drive.imu_t, uneven["imu_t"] - uneven["imu_t"][0], atol=1e-6)
    assert not any("scatter" in note or "even" in note for note in drive.notes)


def test_scatter_of_stamps_is_taken_out_and_told(saved, data, tmp_path):
    def late(seed, t, sd):
        return t + sd * np.random.default_rng(seed).standard_normal(len(t))

    steps = np.median(np.diff(data["imu_t"])), np.median(np.diff(data["gnss_t"]))
    sds = 0.1 * steps[0], 0.05 * steps[1]
    imu_t, gnss_t = late(1, data["imu_t"], sds[0]), late(2, data["gnss_t"], sds[1])
    drive = read_drive(saved(tmp_path / "drive.npz", {**data, "imu_t": imu_t, "gnss_t": gnss_t}))
    for t, true, sd in ((drive.imu_t, data["imu_t"], sds[0]), (drive.gnss.t, data["gnss_t"], sds[1])):
        error = t + drive.origin - true[-len(t) :]
        assert np.sqrt(np.mean(error**2)) < 0.5 * sd
    assert sum("scatter by" in note for note in drive.notes) == 2


def write_kf_gins(folder, data, settings=""):
    """Files of KF-GINS: increments, positions, and the settings that name them."""
    dt = np.diff(data["imu_t"], prepend=1000.0)[:, None]
    np.savetxt(folder / "imu.txt", np.column_stack([data["imu_t"], data["gyro"] * dt, data["accel"] * dt]))
    columns = [data["gnss_t"], data["gnss_llh"], data["gnss_pstd"]]
    np.savetxt(folder / "gnss.txt", np.column_stack(columns), fmt="%.12f")
    path = folder / "kf-gins.yaml"
    names = 'imupath: "elsewhere/imu.txt"\ngnsspath: gnss.txt\nimudatarate: 50\nantlever: [0.5, -0.3, -1.2]\n'
    path.write_text(names + settings, encoding="utf-8")
    return path


def test_kf_gins_files_are_read(data, file, tmp_path):
    a, b = read_drive(file), read_drive(write_kf_gins(tmp_path, data))
    np.testing.assert_allclose(a.rates, b.rates, atol=1e-6)
    assert b.lever_arm == LEVER
    assert np.isnan(b.gnss.vel_n).all()


def test_what_is_taken_out_of_files_of_kf_gins_is_not_taken_out_again(data, configuration, tmp_path):
    """A delay was taken out in the export, and by `navigate kf-gins.yaml --config noise.yaml` again."""
    config = replace(configuration(), compensation=Compensation.parse({"time_offset.delay": 0.2}))
    for entry, left in (("", 1), ("compensated: true\n", 0)):
        drive = read_drive(write_kf_gins(tmp_path, data, entry))
        assert len(config_for_drive(drive, config).compensation) == left


def test_one_file_of_kf_gins_is_drive_and_configuration(configuration, arrays, tmp_path):
    config = configuration()
    exported = export(config, "kf-gins")
    settings = write_kf_gins(tmp_path, arrays(150.0), exported)
    theirs = load_config(settings)
    for name, ours in config.channels.items():
        channel = theirs.channels[name]
        expected = projected(ours, RTK)
        assert channel.white_density == pytest.approx(expected.white_density, rel=SIX_DIGITS)
        walk = channel.random_walk_density or channel.markov[0].driving_density
        assert walk == pytest.approx(expected.bias, rel=SIX_DIGITS)
        whole = np.sqrt(ours.constant_sd**2 + sum(m.sd**2 for m in ours.markov))
        found_sd = np.hypot(channel.constant_sd, sum(state.sd for state in channel.markov))
        assert found_sd == pytest.approx(whole, rel=SIX_DIGITS)
    found = navigate_drive(replace(read_drive(settings), mounting=None), theirs)
    assert not found.consistency.diverged
    assert found.consistency.gated < 0.01
    assert set(theirs.constants) == {"gyro_scale", "accel_scale"}
    assert noise_yaml.loads(noise_yaml.dumps(theirs)).constants == theirs.constants
    for name, sd in theirs.constants.items():
        np.testing.assert_array_equal(found.settings.initial_sd[found.settings.model.layout[name]], sd)
    broken = tmp_path / "broken.yaml"
    broken.write_text(exported.replace("corrtime", "correlation"), encoding="utf-8")
    with pytest.raises(DataError, match="corrtime"):
        load_config(broken)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"accel": 1e-4}, "specific force"),
        ({"gnss_pstd": -1.0}, "negative"),
        ({"gnss_llh": 1e7}, "degrees"),
        ({"gnss_t": 10.0}, "one clock"),
        ({"imu_t": 1e3, "gnss_t": 1e3}, "unit of time"),
    ],
)
def test_impossible_drives_are_refused_in_one_line(saved, data, tmp_path, capsys, change, words):
    wrong = {name: values * change.get(name, 1.0) for name, values in data.items()}
    path = saved(tmp_path / "wrong.npz", wrong)
    assert run(["navigate", str(path), "--config", "mpu9250", "--quiet"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert words in err


@pytest.mark.parametrize("name", ["imu_t", "gnss_t", "ref_t"])
def test_a_clock_that_runs_backwards_is_refused(saved, data, tmp_path, name):
    path = saved(tmp_path / "back.npz", {**data, name: data[name][::-1]})
    with pytest.raises(DataError, match="runs backwards at row 2") as refused:
        read_drive(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", ["imu", "gnss"])
def test_an_empty_table_is_refused(saved, data, tmp_path, kind):
    names = ("imu_t", "gyro", "accel") if kind == "imu" else [n for n in data if n.startswith("gnss_")]
    path = saved(tmp_path / "empty.npz", {**data, **{name: data[name][:0] for name in names}})
    with pytest.raises(DataError, match="no rows"):
        read_drive(path)


def test_repairs_are_counted(saved, data, tmp_path):
    dirty = {name: values.copy() for name, values in data.items()}
    dirty["gyro"][5] = np.nan
    for name in ("imu_t", "gyro", "accel"):
        dirty[name] = np.insert(dirty[name], 100, dirty[name][99], axis=0)
        dirty[name][[200, 201]] = dirty[name][[201, 200]]
    dirty["gnss_t"] = np.concatenate([[900.0], dirty["gnss_t"]])
    for name in ("gnss_llh", "gnss_vned", "gnss_pstd", "gnss_vstd"):
        dirty[name] = np.concatenate([dirty[name][:1], dirty[name]])
    drive = read_drive(saved(tmp_path / "dirty.npz", dirty))
    said = "; ".join(drive.notes)
    for words in (
        "1 unreadable IMU",
        "1 IMU rows out of order",
        "1 IMU rows with a doubled",
        "1 fixes outside",
    ):
        assert words in said
    dirty["gyro"][: len(dirty["gyro"]) // 10] = np.nan
    with pytest.raises(DataError, match="at most 1 %"):
        read_drive(saved(tmp_path / "worse.npz", dirty))


@pytest.mark.parametrize("name", ["nothing", "empty", "drive.txt"])
def test_what_is_no_drive_is_refused(tmp_path, name):
    (tmp_path / "empty").mkdir()
    (tmp_path / "drive.txt").write_text("1 2 3\n", encoding="utf-8")
    with pytest.raises(DataError):
        read_drive(tmp_path / name)


def test_a_constant_axis_is_kept_and_reported(data, tmp_path):
    still = {**data, "gyro": data["gyro"] * [1.0, 0.0, 1.0]}
    drive = read_drive(write_folder(tmp_path / "drive", still, truth=False))
    assert not drive.rates[:, 1].any()
    assert any("constant from first to last sample and kept: gyro_y" in note for note in drive.notes)


@pytest.mark.parametrize(
    "option", ["--non-holonomic", "--zero-velocity", "--lever-arm", "--mounting-rpy", "--state"]
)
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_numbers_that_are_none_are_refused(file, capsys, option, value):
    text = {"--state": f"lever_arm={value}"}.get(
        option, f"{value},0,0" if "arm" in option or "rpy" in option else value
    )
    assert run(["navigate", str(file), "--config", "mpu9250", option, text]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert option in err


@pytest.mark.parametrize(
    "wrong",
    [
        {"gyro": np.zeros((5, 3))},
        {"meta": "{not json"},
        {"meta": '{"lever_arm_frd_m": [1, 2]}'},
        {"meta": "[1, 2]"},
        {"gnss_llh": np.full((3, 3), "x")},
    ],
)
def test_malformed_arrays_are_refused_in_one_line(data, tmp_path, wrong):
    np.savez(tmp_path / "wrong.npz", **{**data, **wrong})
    with pytest.raises(DataError, match="wrong") as caught:
        read_drive(tmp_path / "wrong.npz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["imupath: [", "imupath: i.txt\ngnsspath: i.txt\nimudatarate: 0\n"])
def test_malformed_settings_are_refused_in_one_line(tmp_path, text):
    np.savetxt(tmp_path / "i.txt", np.ones((5, 7)))
    (tmp_path / "wrong.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match="wrong") as caught:
        read_drive(tmp_path / "wrong.yaml")
    assert "\n" not in str(caught.value)


def test_a_clock_that_was_set_back_goes_on(tmp_path):
    # Seen: samples of two times sorted into one another, as if packets had come late.
    t = 0.01 * np.arange(1, 6001)
    rows = np.column_stack(
        [np.where(t > 40.0, t - 1.1, t), np.random.default_rng(0).standard_normal((6000, 6))]
    )
    repairs = []
    found = ordered(tmp_path, "IMU", rows.copy(), rows, [], repairs)
    np.testing.assert_allclose(found[:, 0], t, atol=1e-9)
    assert [one.fault for one in repairs] == ["is set back by 1.100 s at row 4001"]
    late = np.column_stack([t, rows[:, 1:]])
    late[4000:4100, 0], late[4100:4120, 0] = t[4020:4120], t[4000:4020]  # packets in another order
    notes, repairs = [], []
    np.testing.assert_allclose(
        ordered(tmp_path, "IMU", late.copy(), late, notes, repairs)[:, 0], t, atol=1e-9
    )
    assert not repairs
