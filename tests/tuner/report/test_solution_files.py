"""What `navigate` writes of a drive says what the filter estimated."""

import csv
import io
import json
import os
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from models.rotation import mat_from_rotvec, mat_from_rpy, quat_from_mat, rpy_from_mat, rpy_from_quat
from models.trajectory.catalogue import TRAJECTORIES
from tuner import navigate
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.formats.logs import write_drive
from tuner.navigation.settings import total_bias
from tuner.readers.estimate_column_names import canonical_name
from tuner.report.solution_figures import solution_pictures
from tuner.report.solution_files import _angle_sds, solution_csv, track_gpx, track_kml, tracks
from tuner.report.solution_set import attitude_text, write_solution
from tuner.simulation.drive import simulate_drive


@pytest.fixture(scope="module")
def drive():
    made, _ = simulate_drive(
        load_grade("mpu9250"), TRAJECTORIES["city"](200.0), load_gnss("spp"), rate=25.0, seed=5
    )
    return made


@pytest.fixture(scope="module")
def found(drive):
    return navigate(drive, "mpu9250")


def test_the_csv_holds_the_solution_to_a_tenth_of_a_millimetre(found):
    rows = list(csv.DictReader(io.StringIO(solution_csv(found, origin=1000.0))))
    (solution,) = found.solutions
    assert len(rows) == len(solution.t)

    def column(name):
        return np.array([float(row[name]) for row in rows])

    np.testing.assert_allclose(column("t [s]"), solution.t + 1000.0, atol=1e-6)
    north = np.radians(column("lat [deg]")) - solution.state.llh[:, 0]
    assert np.abs(north).max() * 6.4e6 < 1e-4
    np.testing.assert_allclose(column("ve [m/s]"), solution.state.vel_n[:, 1], atol=1e-5)
    np.testing.assert_allclose(
        np.radians(column("yaw [deg]")), rpy_from_quat(solution.state.quat_nb)[:, 2], atol=1e-7
    )
    biases = solution.parameters @ total_bias(found.settings.model).T
    np.testing.assert_allclose(column("ba_z [m/s^2]"), biases[:, 14], rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(column("sd_d [m]") ** 2, solution.covariance[:, 2, 2], rtol=1e-3)
    np.testing.assert_allclose(column("sd_bg_x [rad/s]") ** 2, solution.covariance[:, 9, 9], rtol=1e-3)


def test_angles_of_a_unit_whose_mounting_is_unknown_are_named_so_and_read_again(found, drive):
    of_vehicle, of_unit = (solution_csv(found, mounted=mounted).splitlines()[0] for mounted in (True, False))
    assert {"roll [deg]", "sd_yaw [deg]"} <= set(of_vehicle.split(","))
    assert {"imu_roll [deg]", "sd_imu_yaw [deg]"} <= set(of_unit.split(","))
    assert [canonical_name(name) for name in of_unit.split(",")] == [
        canonical_name(name) for name in of_vehicle.split(",")
    ]
    assert "of the vehicle" in attitude_text(replace(drive, mounting=np.eye(3)))
    assert "its mounting is not stated" in attitude_text(replace(drive, mounting=None))


def test_angle_sds_are_those_of_sampled_attitude_errors(found):
    """The sds of roll, pitch and yaw are the spread of the angles of attitudes turned by drawn errors."""
    rng = np.random.default_rng(7)
    covariance = np.zeros((1, 15, 15))
    root = 1e-4 * rng.normal(size=(3, 3))
    covariance[0, 6:9, 6:9] = root @ root.T
    mat = mat_from_rpy(np.array([0.4, -0.9, 2.2]))
    (solution,) = found.solutions
    turned_by = replace(solution.state, quat_nb=np.asarray(quat_from_mat(mat))[None])
    one = replace(solution, state=turned_by, covariance=covariance)
    turned = rpy_from_mat(mat_from_rotvec(rng.normal(size=(200_000, 3)) @ root.T) @ mat)
    # 200 000 draws give an sd to 0.16 %.
    np.testing.assert_allclose(_angle_sds(one)[0], turned.std(axis=0), rtol=0.01)


def test_kml_and_gpx_hold_every_track(found, drive):
    lines = tracks(found, drive.reference)
    assert set(lines) == {"filter", "fixes", "reference"}
    kml = ET.fromstring(track_kml(lines, "a < b"))
    space = {"k": "http://www.opengis.net/kml/2.2"}
    assert kml.find("k:Document/k:name", space).text == "a < b"
    first = kml.findall(".//k:coordinates", space)[0].text.split()[0].split(",")
    np.testing.assert_allclose(
        np.radians([float(first[1]), float(first[0])]), found.solutions[0].state.llh[0, :2], atol=1e-10
    )
    gpx = ET.fromstring(track_gpx(lines, "drive"))
    points = gpx.findall(".//{http://www.topografix.com/GPX/1/1}trkpt")
    assert len(points) == sum(len(part) for parts in lines.values() for part in parts)


def test_navigate_writes_its_folder(drive, tmp_path, capsys):
    file = tmp_path / os.fsdecode(b"dr\xe9\x1b.npz")  # no text in UTF-8
    write_drive(drive, file)
    where = ["-o", str(tmp_path / "out"), "--page", str(tmp_path / "page.html")]
    assert run(["navigate", str(file), "--config", "mpu9250", *where]) == 0
    assert "Innovations: fixes less their prediction" in (tmp_path / "page.html").read_text()
    names = {path.name for path in (tmp_path / "out").iterdir()}
    pictures = {f"{name}.{kind}" for name in ("track", "innovations", "errors") for kind in ("png", "svg")}
    assert names == {"solution.csv", "track.kml", "track.gpx", *pictures}
    assert str(tmp_path / "out") in capsys.readouterr().out


def test_every_panel_over_time_says_when_its_time_begins(found, drive):
    """On a page each panel stands alone."""
    files = solution_pictures(found, replace(drive, origin=1.7e9), (".json",))
    panels = [one for name in ("errors.json", "innovations.json") for one in json.loads(files[name])]
    assert {one["x"] for one in panels} == {"time since 1700000000 s, s"}


def test_a_folder_is_written_whole_or_not_at_all(found, drive, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tuner.report.solution_set.solution_pictures", full)
    with pytest.raises(OSError, match="No space"):
        write_solution(found, drive, tmp_path / "out")
    assert not list(tmp_path.iterdir())
