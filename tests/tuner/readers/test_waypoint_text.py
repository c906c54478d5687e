"""Exports of Inertial Explorer in layouts that published data sets and readers have: numbers, clocks, roles, refusals.

Layouts: truth of the UrbanNav data set; sample data of GREAT-FGO; airborne surveys of CReSIS; decimal degrees as in the
fixtures of GICI. All describe one drive.
"""

import numpy as np
import pytest

from models import rotation
from models.earth import ecef_from_llh, mat_en
from tuner.cli import run
from tuner.readers.drive import read_drive
from tuner.readers.estimate import read_estimate
from tuner.types.records import DataError

N, WEEK, SECOND, LEAP = 60, 2158, 455342.0, 18
UNIX = 315964800 + WEEK * 604800 + SECOND - LEAP
LAT, LON, HEIGHT = -0.0004 - 1e-6 * np.arange(N), -112.05 + 2e-6 * np.arange(N), 3.0 + 0.1 * np.arange(N)
RPY = np.column_stack([1.0 + 0.01 * np.arange(N), -2.0 + 0 * LAT, 350.0 + 0.3 * np.arange(N)])
FORWARD = np.array([5.0, 0.2, -0.1])  # along forward, right, down
VEL = np.einsum("nij,j->ni", rotation.mat_from_rpy(np.radians(RPY)), FORWARD)
ECEF = ecef_from_llh(np.column_stack([np.radians(LAT), np.radians(LON), HEIGHT]))
VEL_ECEF = np.einsum("nij,nj->ni", mat_en(np.radians(LAT), np.radians(LON)), VEL)
SETTINGS = """
Project:     survey
Program:     Inertial Explorer Version 8.90.6611
Source:      GNSS/INS Epochs(Smoothed TC Combined)
SD Scaling Settings:
  Position: 2.0000
  Velocity: 1.0000
  Attitude: 1.0000

"""


def dms(value):
    seconds = round(abs(value) * 3600, 5)
    sign = "-" if value < 0 else ""
    return f"{sign}{int(seconds // 3600)} {int(seconds // 60 % 60):02d} {seconds % 60:08.5f}"


def table(columns, settings=""):
    """Names and units right-aligned above the rows, as the program writes them."""
    wide = [max(len(name), len(unit), *map(len, cells)) + 2 for name, unit, cells in columns]
    lines = ["".join(f"{c[0]:>{w}}" for c, w in zip(columns, wide, strict=True))]
    lines += ["".join(f"{c[1]:>{w}}" for c, w in zip(columns, wide, strict=True))]
    lines += ["".join(f"{c[2][k]:>{w}}" for c, w in zip(columns, wide, strict=True)) for k in range(N)]
    return settings + "\n".join(lines) + "\n\n"


def fixed(values, digits):
    return [f"{v:.{digits}f}" for v in np.broadcast_to(values, N)]


SOW = ("GPSTime", "(sec)", fixed(SECOND + np.arange(N), 2))
WEEKS = ("Week", "(weeks)", fixed(WEEK, 5))
PLACE = [("Latitude", "(+/-D M S)", list(map(dms, LAT))), ("Longitude", "(+/-D M S)", list(map(dms, LON)))]
ATTITUDE = [(name, "(deg)", fixed(RPY[:, j], 10)) for j, name in ((0, "Roll"), (1, "Pitch"), (2, "Heading"))]
QUALITY = ("Q", "", fixed(1, 0))
H_ELL = ("H-Ell", "(m)", fixed(HEIGHT, 3))


def urbannav():
    body = [
        (f"VelBdy{a}", "(m/s)", fixed(v, 6))
        for a, v in zip("XYZ", (FORWARD[1], FORWARD[0], -FORWARD[2]), strict=True)
    ]
    utc = ("UTCTime", "(sec)", fixed(UNIX + np.arange(N), 2))
    return table([utc, WEEKS, SOW, *PLACE, H_ELL, *body, *ATTITUDE, QUALITY])


def great():
    earth = [(f"{a}-ECEF", "(m)", fixed(ECEF[:, j], 4)) for j, a in enumerate("XYZ")]
    speed = [(f"V{a}-ECEF", "(m/s)", fixed(VEL_ECEF[:, j], 6)) for j, a in enumerate("XYZ")]
    state = ("AmbStatus", "", ["Fixed"] * N)
    clock = ("UTCTime", "(HMS)", ["06:28:44.00"] * N)
    return table([WEEKS, SOW, *earth, *PLACE, H_ELL, *speed, *ATTITUDE[::-1], state, QUALITY, clock])


def cresis():
    date = ("Date", "(MDY)", ["5/21/2021"] * N)
    sds = [(name, "(Deg)", fixed(0.02, 10)) for name in ("HdngSD", "PitchSD", "RollSD")]
    spread = [("SDHoriz", "(m)", fixed(0.2, 3)), ("SDHeight", "(m)", fixed(0.3, 3))]
    corrected = ("CorrTime", "(sec)", SOW[2])
    return table([corrected, date, *PLACE, H_ELL, *ATTITUDE, *sds, *spread], SETTINGS)


def decimal():
    place = [("Longitude", "(deg)", fixed(LON, 10)), ("Latitude", "(deg)", fixed(LAT, 10))]
    rows = table([("Week", "week", fixed(WEEK, 0)), SOW, *place, H_ELL, *ATTITUDE], SETTINGS).splitlines()
    return "\n".join([*rows[:15], "", *rows[15:]])


def commas():
    columns = [WEEKS, SOW, *PLACE, H_ELL, *ATTITUDE]
    return "\n".join(
        ",".join(cells)
        for cells in zip(
            *([name, unit, *(c.replace(",", " ") for c in cells)] for name, unit, cells in columns),
            strict=True,
        )
    )


LAYOUTS = {f.__name__: f for f in (urbannav, great, cresis, decimal, commas)}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_numbers_that_were_written(layout, tmp_path):
    (tmp_path / "ie.txt").write_text(LAYOUTS[layout]())
    found = read_estimate(tmp_path / "ie.txt")
    np.testing.assert_allclose(found.t, SECOND + np.arange(N), atol=1e-9)
    np.testing.assert_allclose(np.degrees(found.llh[:, :2]), np.column_stack([LAT, LON]), atol=2e-9)
    np.testing.assert_allclose(found.llh[:, 2], HEIGHT, atol=1e-9)
    turn = rotation.quat_multiply(
        found.quat_nb, rotation.quat_conjugate(rotation.quat_from_rpy(np.radians(RPY)))
    )
    assert np.abs(rotation.rotvec_from_quat(turn)).max() < 1e-8
    if layout in ("urbannav", "great"):
        np.testing.assert_allclose(found.vel_n, VEL, atol=2e-6)
    if layout == "cresis":  # positions were enlarged twice on export; SDHoriz is of north and east together
        sd = np.sqrt(np.einsum("nii->ni", found.covariance))
        np.testing.assert_allclose(sd[0, :3], [0.1 / np.sqrt(2), 0.1 / np.sqrt(2), 0.15], rtol=1e-9)


def test_beside_an_estimate_in_unix_time_the_truth_is_on_its_clock(tmp_path):
    (tmp_path / "truth.txt").write_text(urbannav())
    rng = np.random.default_rng(3)
    rows = np.column_stack(
        [UNIX + np.arange(N), LAT, LON, HEIGHT + rng.normal(0.0, 0.5, N), np.full((N, 3), 0.5)]
    )
    header = "t,lat,lon,height,sd_n,sd_e,sd_d"
    np.savetxt(tmp_path / "mine.csv", rows, delimiter=",", header=header, comments="", fmt="%.12g")
    estimate = read_estimate(tmp_path / "mine.csv")
    truth = read_estimate(tmp_path / "truth.txt", beside=estimate)
    np.testing.assert_allclose(truth.t, estimate.t, atol=1e-6)
    assert any("the estimate counts UNIX time" in note for note in truth.notes)
    assert run(["score", str(tmp_path / "mine.csv"), "--truth", str(tmp_path / "truth.txt"), "--quiet"]) == 0


def test_rows_with_too_many_numbers_are_refused_where_they_are_more_than_one_in_a_hundred(tmp_path):
    lines = decimal().splitlines()
    torn = [*lines[:30], lines[30] + " 1 2 3", *lines[31:]]
    (tmp_path / "torn.txt").write_text("\n".join(torn) + "\n")
    with pytest.raises(DataError, match="found 1 of 60 with more"):
        read_estimate(tmp_path / "torn.txt")


def imu(folder, first):
    t = first + np.arange(N * 20) / 20
    rng = np.random.default_rng(2)
    still = np.array([0, 0, 0, 0, 0, -9.80665])
    rows = np.column_stack([t, still + rng.normal(0, [1e-3] * 3 + [1e-2] * 3, (len(t), 6))])
    names = "t [s]," + ",".join(f"gyro_{a} [rad/s]" for a in "xyz") + ","
    names += ",".join(f"accel_{a} [m/s^2]" for a in "xyz")
    np.savetxt(folder / "imu.csv", rows, delimiter=",", header=names, comments="", fmt="%.6f")


def test_in_a_drive_the_solution_with_attitude_is_the_reference_and_the_one_without_the_fixes(tmp_path):
    imu(tmp_path, UNIX)
    (tmp_path / "ie.txt").write_text(cresis())
    with pytest.raises(DataError, match=r"ie\.txt has attitude: it is a reference, export the GNSS epochs"):
        read_drive(tmp_path)
    up = [("VEast", "(m/s)", fixed(1, 3)), ("VNorth", "(m/s)", fixed(2, 3)), ("VUp", "(m/s)", fixed(3, 3))]
    (tmp_path / "gnss.txt").write_text(table([SOW, WEEKS, *PLACE, H_ELL, *up, QUALITY]))
    drive = read_drive(tmp_path)
    assert len(drive.gnss) == N
    np.testing.assert_allclose(drive.gnss.vel_n[0], [2.0, 1.0, -3.0])
    assert drive.reference is not None
    np.testing.assert_allclose(np.degrees(drive.reference.rpy[0]), RPY[0], atol=1e-9)
    assert any("UNIX time" in note for note in drive.notes)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda s: s.replace("GPSTime", "  Epoch"), "expected a column Date beside utctime in hours"),
        (lambda s: s.replace(" Fixed", " "), r"expected \d+ numbers a row below \d+ names, found \d+"),
        (lambda s: s.replace("Latitude", "Northing").replace("X-ECEF", "X-Other"), "expected Latitude"),
        (lambda s: s.replace("H-Ell", "H-Abc"), None),  # X, Y, Z say it as well
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(change, expected, tmp_path):
    (tmp_path / "ie.txt").write_text(change(great()))
    if expected is None:
        np.testing.assert_allclose(read_estimate(tmp_path / "ie.txt").llh[:, 2], HEIGHT, atol=1e-3)
        return
    with pytest.raises(DataError, match=expected):
        read_estimate(tmp_path / "ie.txt")
