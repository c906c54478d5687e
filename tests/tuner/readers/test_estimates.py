"""Outputs of filters in all their forms: the numbers written are the numbers read, in SI and in our axes."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy.io

from models import rotation
from models.earth import ecef_from_llh, mat_en, metres_per_radian
from tuner.cli import run
from tuner.consistency.output_errors import output_errors
from tuner.formats.file_set import stale_files
from tuner.readers.estimate import read_estimate
from tuner.types.records import DataError

N = 40
T = 100.0 + 0.5 * np.arange(N)
RPY = np.column_stack([2.0 * np.sin(T), 3.0 * np.cos(T), 170.0 + T])  # deg
LLH = np.column_stack([48.0 + 1e-5 * T, 11.0 - 2e-5 * T, 500.0 + T])
VEL = np.column_stack([np.sin(T), np.cos(T), 0.1 * T])
QUAT = rotation.quat_from_rpy(np.radians(RPY))


def csv(path, columns):
    lines = [",".join(columns)]
    lines += [",".join(f"{v:.12g}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


def same_attitude(q, p=QUAT):
    return np.abs(rotation.rotvec_from_quat(rotation.quat_multiply(q, rotation.quat_conjugate(p)))).max()


def full_csv(tmp_path, **more):
    columns = {"t": T, "lat [deg]": LLH[:, 0], "lon [deg]": LLH[:, 1], "height [m]": LLH[:, 2]}
    columns |= {"vn": VEL[:, 0], "ve": VEL[:, 1], "vd": VEL[:, 2]}
    columns |= {"roll": RPY[:, 0], "pitch": RPY[:, 1], "yaw [deg]": RPY[:, 2]}
    return csv(tmp_path / "a.csv", columns | more)


def test_csv_in_degrees_with_sds_in_their_units(tmp_path):
    one = np.ones(N)
    path = full_csv(
        tmp_path, sd_n=2 * one, sd_e=3 * one, sd_d=4 * one, **{"sd_vn [cm/s]": 10 * one, "sd_ve": one, "sd_vd": one},
        sd_roll=0.1 * one, sd_pitch=0.2 * one, sd_yaw=0.3 * one, **{"bg_x [deg/h]": 36 * one, "bg_y": one, "bg_z": one},
        **{f"sd_bg_{a}": 1e-3 * one for a in "xyz"},
    )  # fmt: skip
    found = read_estimate(path)
    assert np.degrees(found.llh[:, :2]) == pytest.approx(LLH[:, :2], abs=1e-9)
    assert same_attitude(found.quat_nb) < 1e-9
    sd = np.sqrt(np.einsum("kii->ki", found.covariance))
    assert sd[0, :6] == pytest.approx([2, 3, 4, 0.1, 1, 1])
    assert sd[0, 8] == pytest.approx(np.radians(np.hypot(0.3, 0.1 * np.sin(np.radians(RPY[0, 1])))), rel=1e-6)
    assert found.bias[0, 0] == pytest.approx(np.radians(36 / 3600))
    assert sd[0, 9] == pytest.approx(np.radians(1e-3 / 3600), rel=1e-6)
    assert not found.correlated
    assert np.isnan(sd[0, 12])


def test_sds_of_angles_stand_beside_quaternions(tmp_path):
    """They were dropped without a word, and an attitude 90° off was honest."""
    one = np.ones(N)
    angles = {"sd_roll": 0.1 * one, "sd_pitch": 0.2 * one, "sd_yaw": 0.3 * one}
    by_angles = read_estimate(full_csv(tmp_path, **angles))
    turned = dict(zip(("qw", "qx", "qy", "qz"), QUAT.T, strict=True))
    found = read_estimate(csv(tmp_path / "q.csv", {"t": T, **turned, **angles}))
    assert found.covariance[:, 6:9, 6:9] == pytest.approx(by_angles.covariance[:, 6:9, 6:9], abs=1e-12)


@pytest.mark.parametrize("unit", ["m", "deg", None])
def test_sds_of_latitude_in_metres_and_in_degrees_are_the_same(tmp_path, unit):
    metres = metres_per_radian(np.array([np.radians(48.0), 0.0, 500.0]))
    lat, lon = (2.0, 3.0) if unit == "m" else np.degrees([2.0 / metres[0], 3.0 / metres[1]])
    bracket = "" if unit is None else f" [{unit}]"
    one = np.ones(N)
    path = full_csv(
        tmp_path, **{f"sd_lat{bracket}": lat * one, f"sd_lon{bracket}": lon * one, "sd_height": 4 * one}
    )
    found = read_estimate(path)
    assert np.sqrt(np.einsum("kii->ki", found.covariance))[0, :3] == pytest.approx([2, 3, 4], rel=1e-3)
    assert any("by its size" in note for note in found.notes) is (unit is None)


def test_full_covariance_of_angles_becomes_that_of_the_rotation_vector(tmp_path):
    rng = np.random.default_rng(1)
    a = rng.standard_normal((3, 3))
    p = a @ a.T
    names = ("roll", "pitch", "yaw")
    cov = {
        f"cov_{m}_{n}": p[i, j] * np.ones(N)
        for i, m in enumerate(names)
        for j, n in enumerate(names)
        if i <= j
    }
    found = read_estimate(full_csv(tmp_path, **cov))
    assert found.correlated
    # by differences: δ = log(R(rpy + ε) R(rpy)ᵀ)
    rpy, eps = np.radians(RPY[3]), 1e-6
    base = rotation.mat_from_rpy(rpy)
    jac = np.column_stack(
        [rotation.rotvec_from_mat(rotation.mat_from_rpy(rpy + eps * row) @ base.T) / eps for row in np.eye(3)]
    )
    want = jac @ (np.radians(1.0) ** 2 * p) @ jac.T
    assert found.covariance[3, 6:9, 6:9] == pytest.approx(want, rel=1e-4)


def test_axes_by_option_and_ecef_are_put_into_ours(tmp_path):
    enu = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])  # to north-east-down
    flu = np.diag([1.0, -1, -1])
    ned = np.column_stack([T, 2 * T, -T])
    mat = enu.T @ rotation.mat_from_quat(QUAT) @ flu
    q = rotation.quat_from_mat(mat)
    columns = {"t": T, **{a: (ned @ enu)[:, i] for i, a in enumerate("xyz")}}
    columns |= {f"v{a}": (VEL @ enu)[:, i] for i, a in enumerate("xyz")}
    columns |= {f"q{a}": q[:, i] for i, a in enumerate("wxyz")}
    found = read_estimate(csv(tmp_path / "e.csv", columns), frame="ENU", body="FLU")
    assert found.local == pytest.approx(ned)
    assert found.vel_n == pytest.approx(VEL)
    assert same_attitude(found.quat_nb) < 1e-9
    llh = np.column_stack([np.radians(LLH[:, :2]), LLH[:, 2]])
    to_e = mat_en(llh[:, 0], llh[:, 1])
    vel_e = np.einsum("nij,nj->ni", to_e, VEL)
    columns = {"t": T, **{a: ecef_from_llh(llh)[:, i] for i, a in enumerate("xyz")}}
    columns |= {f"v{a}": vel_e[:, i] for i, a in enumerate("xyz")}
    columns |= {"sd_x": 2.0 + 0 * T, "sd_y": 2.0 + 0 * T, "sd_z": 2.0 + 0 * T}
    found = read_estimate(csv(tmp_path / "c.csv", columns), frame="ECEF")
    assert found.llh == pytest.approx(llh, abs=1e-4)  # the file has 0.01 mm
    assert found.vel_n == pytest.approx(VEL, abs=1e-6)
    assert found.covariance[0, :3, :3] == pytest.approx(4.0 * np.eye(3), abs=1e-9)


def test_tum_kitti_and_euroc(tmp_path):
    ned = np.column_stack([T, 2 * T, -T])
    tum = tmp_path / "tum.txt"
    np.savetxt(
        tum, np.column_stack([T, ned, np.roll(QUAT, -1, axis=1)]), header="timestamp tx ty tz qx qy qz qw"
    )
    found = read_estimate(tum, frame="NED")
    assert found.local == pytest.approx(ned)
    assert same_attitude(found.quat_nb) < 1e-9
    kitti = tmp_path / "poses.txt"
    pose = np.concatenate([rotation.mat_from_quat(QUAT), ned[:, :, None]], axis=2)
    np.savetxt(kitti, pose.reshape(N, 12))
    np.savetxt(tmp_path / "times.txt", T)
    found = read_estimate(kitti, frame="NED", body="FRD")
    assert found.t == pytest.approx(T)
    assert same_attitude(found.quat_nb) < 1e-9
    euroc = tmp_path / "data.csv"
    names = [
        "#timestamp",
        "p_RS_R_x [m]",
        "p_RS_R_y [m]",
        "p_RS_R_z [m]",
        "q_RS_w []",
        "q_RS_x []",
        "q_RS_y []",
    ]
    names += ["q_RS_z []", "v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"]
    names += [f"b_w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"b_a_RS_S_{a} [m s^-2]" for a in "xyz"]
    rows = np.column_stack([1e9 * T, ned, QUAT, VEL, np.full((N, 6), 0.01)])
    np.savetxt(euroc, rows, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    found = read_estimate(euroc, frame="NED")
    assert found.t == pytest.approx(T)
    assert found.vel_n == pytest.approx(VEL)
    assert found.bias == pytest.approx(np.full((N, 6), 0.01))


def test_kf_gins_with_its_sds_and_biases(tmp_path):
    nav = np.column_stack([np.zeros(N), T, LLH, VEL, RPY])
    np.savetxt(tmp_path / "KF_GINS_Navresult.nav", nav, fmt="%.9f")
    sd = np.tile([1, 2, 3, 0.1, 0.2, 0.3, 0.5, 0.5, 1, 36, 36, 36, 100, 100, 100, *[50] * 6], (N, 1))
    np.savetxt(tmp_path / "KF_GINS_STD.txt", np.column_stack([T, sd]), fmt="%.9f")
    np.savetxt(tmp_path / "KF_GINS_IMU_ERR.txt", np.column_stack([T, np.full((N, 12), 10.0)]), fmt="%.9f")
    found = read_estimate(tmp_path)
    variance = np.einsum("kii->ki", found.covariance)[5]
    assert np.sqrt(variance[:3]) == pytest.approx([1, 2, 3])
    assert np.sqrt(variance[8]) == pytest.approx(np.radians(1.0))
    assert np.sqrt(variance[9]) == pytest.approx(np.radians(0.01))
    assert np.sqrt(variance[12]) == pytest.approx(1e-3)
    assert found.bias[0] == pytest.approx([*[np.radians(10 / 3600)] * 3, *[1e-4] * 3])
    (tmp_path / "KF_GINS_STD.txt").write_text("1 2 3\n4 5 6\n")
    with pytest.raises(DataError, match="expected 16 columns"):
        read_estimate(tmp_path)


def test_navego_states_in_our_order_and_metres(tmp_path):
    llh = np.column_stack([np.radians(LLH[:, :2]), LLH[:, 2]])
    metres = np.abs(metres_per_radian(llh[0]))
    sd = np.array(
        [0.01, 0.01, 0.02, 0.1, 0.1, 0.1, 2 / metres[0], 3 / metres[1], 4, *[1e-3] * 3, *[0.02] * 3]
    )
    nav = {
        "t": T, "tg": T[::2], **{name: np.radians(RPY[:, i]) for i, name in enumerate(("roll", "pitch", "yaw"))},
        "vel": VEL, "lat": llh[:, 0], "lon": llh[:, 1], "h": llh[:, 2],
        "Pp": np.tile(np.diag(sd**2).ravel(), (N // 2, 1)),
        "b": np.full((N // 2, 6), 1e-3), "v": np.tile([0.1, 0, 0, 1.0, 2.0, 3.0], (N // 2, 1)),
        "S": np.tile(np.diag([1.0, 1, 1, 4, 4, 4]).ravel(), (N // 2, 1)),
    }  # fmt: skip
    scipy.io.savemat(tmp_path / "nav.mat", {"nav_e": nav})
    found = read_estimate(tmp_path / "nav.mat")
    assert found.t == pytest.approx(T[::2])
    own = np.sqrt(np.einsum("kii->ki", found.covariance))[0]
    assert own[:9] == pytest.approx([2, 3, 4, 0.1, 0.1, 0.1, 0.01, 0.01, 0.02], rel=1e-6)
    assert found.innovation[0] == pytest.approx([-1, -2, -3, -0.1, 0, 0])
    assert found.innovation_covariance[0, 0, 0] == 4.0


def test_a_drive_without_a_reference_is_no_truth(tmp_path):
    np.savez(tmp_path / "drive.npz", imu_t=T, imu_gyro=np.zeros((len(T), 3)))
    with pytest.raises(DataError, match="this drive has no reference"):
        read_estimate(tmp_path / "drive.npz")


def test_npz_of_vectors_and_matrices(tmp_path):
    cov = np.tile(np.eye(9), (N, 1, 1))
    np.savez(tmp_path / "a.npz", t=T, llh=LLH, vned=VEL, rpy=RPY, covariance=cov, outages=[[110.0, 115.0]])
    found = read_estimate(tmp_path / "a.npz")
    assert same_attitude(found.quat_nb) < 1e-9
    assert found.covariance[0, :9, :9] == pytest.approx(np.eye(9))
    assert found.outages.tolist() == [[110.0, 115.0]]


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"t": T, "lat": LLH[:, 0], "lon": LLH[:, 1]}, "height missing"),
        ({"t": T, "x": T, "y": T, "z": T}, "--frame"),
        ({"t": T, "n [kg]": T, "e": T, "d": T}, "expected a unit such as m"),
        ({"t": T[::-1], "n": T, "e": T, "d": T}, "times that rise"),
        ({"t": T, "qw": T, "qx": T, "qy": T, "qz": T}, "unit quaternions"),
        ({"t": T, "n": T, "e": T, "d": T, "sd_n": -T, "sd_e": T, "sd_d": T}, "expected sds"),
        ({"t": T, "roll [rad]": T, "pitch [rad]": RPY[:, 1], "yaw [rad]": T}, "pitch within ±90 deg"),
        ({"a": T, "b": T}, "name them"),
    ],
)
def test_bad_columns_are_refused_in_one_line(tmp_path, capsys, columns, words):
    path = csv(tmp_path / "bad.csv", columns)
    assert run(["score", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert "bad.csv" in line


ENU, FLU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1.0, -1, -1])
ESTIMATED = ("n", "e", "d", "vn", "ve", "vd", "phi_n", "phi_e", "phi_d")


def containers(folder, ned, vel, quat, cov):
    """Write one estimate with the covariance (9, 9) of its errors in every form that can hold it; yield each read."""
    pairs = [(i, j) for i in range(9) for j in range(i, 9)]
    factor = np.repeat([1.0, 1.0, np.degrees(1.0)], 3)
    stated = {
        f"cov_{ESTIMATED[i]}_{ESTIMATED[j]}": cov[i, j] * factor[i] * factor[j] + 0 * T for i, j in pairs
    }
    place = {"t": T, **{name: ned[:, i] for i, name in enumerate("ned")}}
    speed = {f"v{name}": vel[:, i] for i, name in enumerate("ned")}
    rpy = np.degrees(rotation.rpy_from_quat(quat))
    angles = {name: rpy[:, i] for i, name in enumerate(("roll", "pitch", "yaw"))}
    numbers = {f"q{name}": quat[:, i] for i, name in enumerate("wxyz")}
    yield "angles", read_estimate(csv(folder / "a.csv", place | speed | angles | stated))
    yield "quaternions", read_estimate(csv(folder / "q.csv", place | speed | numbers | stated))
    tsv = csv(folder / "t.tsv", place | speed | numbers | stated)
    tsv.write_text(tsv.read_text().replace(",", "\t"))
    yield "tabs", read_estimate(tsv)
    other = rotation.quat_from_mat(ENU @ rotation.mat_from_quat(quat) @ FLU)
    turned = {"t": T, **{name: (ned @ ENU)[:, i] for i, name in enumerate("xyz")}}
    turned |= {f"v{name}": (vel @ ENU)[:, i] for i, name in enumerate("xyz")}
    turned |= {f"q{name}": other[:, i] for i, name in enumerate("wxyz")}
    yield "ENU", read_estimate(csv(folder / "e.csv", turned | stated), frame="ENU", body="FLU")
    whole = np.tile(cov, (N, 1, 1))
    np.savez(folder / "m.npz", t=T, ned=ned, vned=vel, quat=quat, covariance=whole)
    yield "matrices", read_estimate(folder / "m.npz")
    np.savez(folder / "c.npz", **place, **speed, **numbers, **stated)
    yield "columns in NPZ", read_estimate(folder / "c.npz")


def test_one_estimate_has_the_same_score_in_every_container(tmp_path):
    rng = np.random.default_rng(4)
    root = rng.standard_normal((9, 9)) * np.repeat([0.5, 0.1, 0.01], 3)[:, None]
    cov = root @ root.T + 1e-6 * np.eye(9)
    error = rng.standard_normal((N, 9)) @ np.linalg.cholesky(cov).T
    ned = np.column_stack([np.cumsum(0.5 * VEL[:, i]) for i in range(3)])
    truth = csv(
        tmp_path / "truth.csv",
        {"t": T, **{name: ned[:, i] for i, name in enumerate("ned")}}
        | {f"v{name}": VEL[:, i] for i, name in enumerate("ned")}
        | {f"q{name}": QUAT[:, i] for i, name in enumerate("wxyz")},
    )
    quat = rotation.quat_multiply(rotation.quat_from_rotvec(-error[:, 6:]), QUAT)
    want = np.einsum("ki,ij,kj->k", error, np.linalg.inv(cov), error)
    for name, found in containers(tmp_path, ned - error[:, :3], VEL - error[:, 3:6], quat, cov):
        run_errors = output_errors(found, read_estimate(truth))
        e, p = run_errors.error[:, :9], run_errors.covariance[:, :9, :9]
        assert np.einsum("ki,kij,kj->k", e, np.linalg.inv(p), e) == pytest.approx(want, rel=1e-4), name


def test_columns_by_other_names_and_units_are_mapped(tmp_path):
    path = csv(
        tmp_path / "m.csv", {"stamp_ms": 1e3 * T, "N": T, "E": T, "D": T, "stdN": 0 * T + 5, "s": 0 * T + 1}
    )
    names = {"t [ms]": "stamp_ms", "sd_n [cm]": "stdN", "sd_e": "s", "sd_d": "s"}
    found = read_estimate(path, columns=names)
    assert found.t == pytest.approx(T)
    assert np.sqrt(found.covariance[0, 0, 0]) == pytest.approx(0.05)


def test_the_command_writes_page_figure_and_json(tmp_path, capsys):
    rng = np.random.default_rng(2)
    t = np.arange(300.0)
    zero, one = np.zeros(300), np.ones(300)
    truth = csv(tmp_path / "t.csv", {"t": t, "n": 5 * t, "e": zero, "d": zero})
    e = rng.standard_normal((300, 3))
    columns = {
        "t": t,
        "n": 5 * t + e[:, 0],
        "e": e[:, 1],
        "d": e[:, 2],
        "sd_n": one,
        "sd_e": one,
        "sd_d": one,
    }
    estimate = csv(tmp_path / "e.csv", columns)
    out = tmp_path / "out"
    arguments = [
        "score",
        str(estimate),
        "--truth",
        str(truth),
        "--quiet",
        "-o",
        str(out),
        "--json",
        "-",
        "--strict",
    ]
    assert run(arguments) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["schema"] == "tuner.consistency/1"
    assert content["consistent"] is True
    assert content["blocks"]["position"]["ratio"] == pytest.approx(1.0, abs=0.12)  # five sds of 900 errors
    assert content["causes"] == []
    written = json.loads((out / "score.json").read_text())
    assert set(written.pop("files")) == {"report.html", "score.png", "score.svg"}
    assert (written, stale_files(out / "score.json")) == (content, [])
    assert (out / "report.html").read_text().count("data:image/svg") == 1
    columns |= {f"sd_{a}": 0.5 * one for a in "ned"}
    assert run(["score", str(csv(estimate, columns)), "--truth", str(truth), "--quiet", "--strict"]) == 1


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"frame": "FOO"}, "--frame FOO: expected three letters"),
        ({"frame": "ENU"}, "--frame ENU: expected columns x, y, z"),
        ({"frame": "ECEF"}, "--frame ECEF: expected columns x, y, z"),
        ({"body": "FLU"}, "--body FLU: expected an attitude or biases"),
    ],
)
def test_axes_that_turn_nothing_are_refused(stated, said, tmp_path):
    path = tmp_path / "local.csv"
    path.write_text("t,n,e,d\n0,1,2,3\n1,2,3,4\n")
    with pytest.raises(DataError, match=said):
        read_estimate(path, **stated)
    assert len(read_estimate(path, frame="NED")) == 2
