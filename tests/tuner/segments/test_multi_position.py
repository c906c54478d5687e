"""Calibration from several positions: scale, misalignment and bias come back; too few positions are refused."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.stats import binom

import tuner
from models.units import STANDARD_GRAVITY as G
from tuner.formats import noise_yaml
from tuner.report.calibration_text import calibration_lines
from tuner.report.result_set import tune_json
from tuner.segments.multi_position import (
    BIAS_AND_SCALE,
    MISALIGNMENTS,
    calibrate,
    different_poses,
    find_poses,
    fit_accel,
)
from tuner.types.records import Record

BIAS = np.array([0.12, -0.2, 0.35])
MATRIX = np.array([[1.01, 0.0, 0.0], [0.006, 0.985, 0.0], [-0.009, 0.004, 1.02]])
TRUTH = dict(
    zip((*BIAS_AND_SCALE, *MISALIGNMENTS), [*BIAS, 0.01, -0.015, 0.02, 0.006, -0.009, 0.004], strict=True)
)
GYRO_BIAS = np.array([2e-3, -1e-3, 5e-4])
RATE = 50.0


def directions(rng, n):
    f = rng.standard_normal((n, 3))
    return G * f / np.linalg.norm(f, axis=1)[:, None]


def turned(poses, rng, sd=0.02, seconds=8):
    """A log of stand-stills with turns between them; gyros before accelerometers."""
    still, turn = int(seconds * RATE), int(2 * RATE)
    n = len(poses) * (still + turn)
    gyro = GYRO_BIAS + 1e-3 * rng.standard_normal((n, 3))
    accel = sd * rng.standard_normal((n, 3))
    for k, pose in enumerate(poses):
        a = k * (still + turn)
        accel[a : a + still] += MATRIX @ pose + BIAS
        way = np.linspace(0.0, 1.0, turn)[:, None]
        following = poses[min(k + 1, len(poses) - 1)]
        accel[a + still : a + still + turn] += (
            (1 - way) * pose + way * following + rng.standard_normal((turn, 3))
        )
        gyro[a + still : a + still + turn] += rng.standard_normal((turn, 3))
    t = np.arange(n) / RATE
    names = ("x", "y", "z")
    return (
        Record("gyro", t, gyro, tuple(f"gyro_{a}" for a in names), "rad/s", 1 / RATE, source="poses.csv"),
        Record("accel", t, accel, tuple(f"accel_{a}" for a in names), "m/s^2", 1 / RATE, source="poses.csv"),
    )


def test_exact_poses_give_exact_parameters():
    force = directions(np.random.default_rng(1), 20) @ MATRIX.T + BIAS
    found, misfit, _ = fit_accel(force, np.full(force.shape, 1e-3), gravity=G)
    for name, value in TRUTH.items():
        assert found[name].value == pytest.approx(value, abs=1e-8)
    assert misfit < 1e-4


def test_intervals_cover_at_95_percent():
    rng = np.random.default_rng(2)
    inside, total, sd = 0, 0, 2e-3
    for _ in range(100):
        force = directions(rng, 24) @ MATRIX.T + BIAS + sd * rng.standard_normal((24, 3))
        found, _, _ = fit_accel(force, np.full(force.shape, sd), gravity=G, different=24)
        for name, value in TRUTH.items():
            low, high = found[name].interval
            inside += low <= value <= high
            total += 1
    # Nine parameters of a fit are dependent: the bound is that of a ninth as many trials.
    share = inside / total
    n = total // 9
    assert binom.ppf(1e-4, n, 0.95) / n <= share <= 0.995


def bounds(poses, sd):
    """Sds of the nine parameters where only the length of gravity is known: linear least squares about the truth.

    The length of M⁻¹(f − b) changes with b by −uᵀM⁻¹ and with M_ij by −uᵀM⁻¹ e_i g_j, u along g; noise |M⁻ᵀu| sd.
    """
    inverse = np.linalg.inv(MATRIX)
    rows = []
    for g in poses:
        by_force = g / np.linalg.norm(g) @ inverse
        entries = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))
        rows.append([*-by_force, *(-by_force[i] * g[j] for i, j in entries)] / np.linalg.norm(by_force))
    return sd * np.sqrt(np.diag(np.linalg.inv(np.transpose(rows) @ rows)))


def test_a_log_of_poses_is_calibrated():
    rng = np.random.default_rng(3)
    found = calibrate(turned(directions(rng, 16), rng))
    assert found.poses >= 16
    for (name, value), sd in zip(
        TRUTH.items(), bounds(directions(np.random.default_rng(3), 16), 0.02 / 20.0), strict=True
    ):
        c = found.accel[name]
        assert abs(c.value - value) < 6.0 * sd, name
        assert c.interval[1] - c.interval[0] == pytest.approx(2.0 * 1.96 * sd, rel=0.5), name
    for axis, value in zip("xyz", GYRO_BIAS, strict=True):
        assert found.gyro[f"bias_{axis}"].value == pytest.approx(value, abs=1e-4)


def test_what_too_few_poses_do_not_show_is_not_given():
    rng = np.random.default_rng(4)
    sides = G * np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.6, 0.6, 0.53]]
    )
    for n, names in ((5, ()), (7, BIAS_AND_SCALE)):
        force = sides[:n] + 1e-3 * rng.standard_normal((n, 3))
        found, _, notes = fit_accel(force, np.full(force.shape, 1e-3), gravity=G)
        assert tuple(found) == names
        assert notes


def test_poses_about_one_axis_hardly_show_anything():
    # A constant along z trades against the length of gravity in the plane: not even scale x is known.
    angle = np.linspace(0.0, 2.0 * np.pi, 18, endpoint=False)
    force = G * np.column_stack((np.cos(angle), np.sin(angle), 1e-3 * np.sin(3 * angle)))
    force += 1e-3 * np.random.default_rng(5).standard_normal(force.shape)
    found, _, notes = fit_accel(force, np.full(force.shape, 1e-3), gravity=G)
    (note,) = [note for note in notes if "hardly visible" in note]
    for name in ("scale_x", "scale_y", "scale_z", "bias_z"):
        assert name in note
        assert found[name].interval[0] < -0.05


def test_a_log_at_rest_is_none_of_several_poses():
    rng = np.random.default_rng(6)
    assert calibrate(turned(np.tile(directions(rng, 1), (5, 1)), rng)) is None


def test_tune_writes_the_calibration():
    rng = np.random.default_rng(7)
    result = tuner.tune(turned(directions(rng, 14), rng))
    calibration = json.loads(json.dumps(tune_json(result)))["calibration"]
    assert calibration["accel"]["bias_x"]["value"] == pytest.approx(BIAS[0], abs=0.03)
    config = yaml.safe_load(noise_yaml.dumps(result.config))
    stored = config["provenance"]["calibration"]
    assert stored.keys() == calibration.keys()
    for sensor in ("gyro", "accel"):
        assert stored[sensor].keys() == calibration[sensor].keys()
        for name, exact in calibration[sensor].items():
            low, high = exact["interval"]
            rounded = stored[sensor][name]
            assert rounded["value"] == pytest.approx(exact["value"], abs=0.01 * (high - low))
            assert rounded["interval"] == pytest.approx([low, high], abs=0.01 * (high - low))
    assert config["sensors"]["accel"]["accel_z"]["filter"]["constant_sd"] == pytest.approx(BIAS[2], rel=0.2)
    assert "from 14 stand-stills;" in config["initial"]["reasons"]["accel_z"]
    assert (
        calibration_lines(result.calibration)[0] == "calibration from 14 stand-stills in 11 poses (± 95 %):"
    )
    assert config["initial"]["tilt"] == pytest.approx(BIAS[2] / G, rel=0.2)


def measured(name):
    folder = os.environ.get("TUNER_DATA")
    path = Path(folder or ".") / "static" / name
    if folder is None or not path.exists():
        pytest.skip("TUNER_DATA names no folder with this recording")
    return np.load(path)


def of_arrays(accel, gyro, rate):
    t = np.arange(len(accel)) / rate
    names = ("x", "y", "z")
    return (
        Record("gyro", t, gyro.astype(float), tuple(f"gyro_{a}" for a in names), "rad/s", 1 / rate),
        Record("accel", t, accel.astype(float), tuple(f"accel_{a}" for a in names), "m/s^2", 1 / rate),
    )


def test_five_units_turned_by_hand():
    data = measured("mpu9150_multipos.npz")
    for name in (f"imu{i}" for i in range(5)):
        samples = data[name]
        found = calibrate(of_arrays(samples[:, :3], samples[:, 3:], 100.0))
        assert found is not None
        assert found.different > 9
        # The datasheet of the MPU-9150 allows 3 % of scale, 2 % across and 0.15 g of zero offset: twice that.
        for key, c in found.accel.items():
            assert abs(c.value) < (3.0 if key.startswith("bias") else 0.06)


def test_counts_of_a_unit_in_forty_poses():
    data = measured("imu_tk_xsens_multipos.npz")
    accel = (data["accel_counts"].astype(float) - 32768.0) * 2.4e-3
    gyro = (data["gyro_counts"].astype(float) - 32768.0) * 2.1e-4
    found = calibrate(of_arrays(accel, gyro, 100.0))
    assert found.different > 9
    assert set(found.accel) == {*BIAS_AND_SCALE, *MISALIGNMENTS}
    before, after = (spread(of_arrays(accel, gyro, 100.0), c) for c in (None, found))
    assert after < 0.1 * before


def spread(records, calibration):
    """Return the relative scatter of the length of gravity over the poses."""
    mean = np.array([p.mean[3:] for p in find_poses(records)])
    if calibration is not None:
        v = {k: c.value for k, c in calibration.accel.items()}
        a = np.diag([1 + v["scale_x"], 1 + v["scale_y"], 1 + v["scale_z"]])
        a[1, 0], a[2, 0], a[2, 1] = (v[k] for k in MISALIGNMENTS)
        mean = np.linalg.solve(a, (mean - [v["bias_x"], v["bias_y"], v["bias_z"]]).T).T
    length = np.linalg.norm(mean, axis=1)
    assert different_poses(mean) > 9
    return float(np.std(length) / np.mean(length))
