"""Outputs in other axes or units than they were taken in are refused with what to do; right ones are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from tuner.consistency.output_errors import output_errors
from tuner.consistency.score_output import score_outputs
from tuner.readers.estimate_columns import Frames, assemble
from tuner.report.output_cause_text import change_text
from tuner.types.filter_output import filter_output
from tuner.types.records import DataError

T = np.arange(0.0, 60.0, 0.5)
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
VEL = np.column_stack([8.0 * np.cos(0.1 * T), 8.0 * np.sin(0.1 * T), 0.5 * np.sin(0.3 * T)])
LOCAL = np.column_stack([80.0 * np.sin(0.1 * T), -80.0 * np.cos(0.1 * T), -np.cos(0.3 * T) / 0.6])
RPY = np.column_stack([0.03 * np.sin(T), 0.05 * np.cos(T), 0.1 * T - 2.0])
TRUTH = filter_output("truth", T, local=LOCAL, vel_n=VEL, quat_nb=rotation.quat_from_rpy(RPY))
LLH = np.column_stack([0.8 + LOCAL[:, 0] / 6.37e6, 0.2 + LOCAL[:, 1] / 4.4e6, 300.0 - LOCAL[:, 2]])


def estimate():
    """Return the truth with errors of a good filter."""
    rng = np.random.default_rng(0)
    small = rotation.quat_from_rotvec(0.01 * rng.standard_normal((len(T), 3)))
    return replace(
        TRUTH,
        name="e",
        local=LOCAL + 0.3 * rng.standard_normal((len(T), 3)),
        vel_n=VEL + 0.05 * rng.standard_normal((len(T), 3)),
        quat_nb=rotation.quat_multiply(small, TRUTH.quat_nb),
    )


Q = estimate().quat_nb
MAT = rotation.mat_from_quat(Q)
WRONG = {
    "inverse": ({"quat_nb": rotation.quat_conjugate(Q)}, "as world to body .* signs of qx, qy, qz"),
    "scalar last": ({"quat_nb": Q[:, [3, 0, 1, 2]]}, "another order of the quaternion"),
    "JPL": ({"quat_nb": rotation.quat_conjugate(Q)[:, [1, 2, 3, 0]]}, "JPL's order and sense"),
    "FLU": ({"quat_nb": rotation.quat_from_mat(MAT @ np.diag([1.0, -1.0, -1.0]))}, "--frame NED --body FLU"),
    "rad": ({"quat_nb": rotation.quat_from_rpy(np.radians(rotation.rpy_from_quat(Q)))}, r"'roll \[rad\]'"),
    "positions ENU": ({"local": LOCAL @ ENU, "vel_n": VEL @ ENU}, "positions fit the truth .* --frame ENU"),
    "n and e": ({"local": LOCAL[:, [1, 0, 2]]}, "positions fit the truth .* exchange n and e"),
    "velocities ENU": ({"vel_n": VEL @ ENU}, "velocities fit their own positions .* --frame ENU"),
    "km/h": ({"vel_n": 3.6 * VEL}, r"'vn \[km/h\]'"),
    "body": ({"vel_n": np.einsum("nji,nj->ni", MAT, VEL)}, "along the axes of the body"),
}


@pytest.mark.parametrize("wrong", list(WRONG))
def test_another_convention_is_told_with_its_cure(wrong):
    changed, words = WRONG[wrong]
    with pytest.raises(DataError, match=f"^e: .*{words}"):
        output_errors(replace(estimate(), **changed), TRUTH)


@pytest.mark.parametrize("angles", [True, False])
def test_options_that_are_wrong_are_not_asked_for_again(angles):
    wide = [VEL.T, rotation.rpy_from_quat(Q).T if angles else Q.T]
    names = ("vx", "vy", "vz", *(("roll", "pitch", "yaw") if angles else ("qw", "qx", "qy", "qz")))
    columns = {name: (column, None) for name, column in zip(names, np.vstack(wide), strict=True)}
    if angles:
        columns |= {name: (np.degrees(columns[name][0]), None) for name in names[3:]}
    columns["t"] = (T, None)
    for world, body, cure in (
        (
            "NED",
            "RFU",
            "pass --body FRD, not RFU" if angles else "pass --frame NED --body FRD, not NED and RFU",
        ),
        ("ENU", "FRD", "name the columns vx, vy, vz with --frame NED"),
    ):
        with pytest.raises(DataError, match=f"{cure}$"):
            output_errors(assemble("e", columns, Frames(world, body)), TRUTH)
    assert len(output_errors(assemble("e", columns, Frames("NED", "FRD")), TRUTH)) == len(T)


def test_radians_taken_as_degrees_and_exchanged_columns_of_latitude_are_told():
    truth = replace(TRUTH, llh=LLH, local=None, vel_n=np.full_like(VEL, np.nan))
    for llh, words in (
        (np.column_stack([np.radians(LLH[:, :2]), LLH[:, 2]]), r"'lat \[rad\]'"),
        (LLH[:, [1, 0, 2]], "exchange lat and lon"),
    ):
        with pytest.raises(DataError, match=words):
            output_errors(replace(truth, name="e", llh=llh), truth)


@pytest.mark.parametrize(("factor", "unit"), [(180.0 / np.pi, "deg"), (np.pi / 180.0, "rad")])
def test_sds_of_the_attitude_in_another_unit_are_told(factor, unit):
    cov = np.full((len(T), 15, 15), np.nan)
    cov[:, 6:9, 6:9] = (0.01 * factor) ** 2 * np.eye(3)
    (cause,) = score_outputs([replace(estimate(), covariance=cov)], [TRUTH]).causes
    assert cause.cause == "unit_of_sds"
    assert change_text(cause) == f"name the columns 'sd_roll [{unit}]', …"


def test_a_file_scored_against_itself_has_no_errors():
    cov = np.full((len(T), 15, 15), np.nan)
    cov[:, 6:9, 6:9] = 1e-4 * np.eye(3)
    found = score_outputs([replace(TRUTH, covariance=cov)], [TRUTH])
    assert found.consistency.blocks[0].ratio == pytest.approx(0.0, abs=1e-6)


def test_right_conventions_and_large_errors_pass():
    assert len(output_errors(estimate(), TRUTH)) == len(T)
    turned = rotation.quat_multiply(rotation.quat_from_rotvec([0.0, 0.0, 0.7]), Q)
    wrong = replace(estimate(), quat_nb=turned, vel_n=1.3 * VEL, local=1.3 * LOCAL)
    assert len(output_errors(wrong, TRUTH)) == len(T)


def test_an_offset_of_the_height_is_no_other_sense_of_it():
    level = replace(TRUTH, local=LOCAL * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.5], vel_n=VEL * [1.0, 1.0, 0.0])
    found = replace(level, local=level.local - [0.0, 0.0, 1.0])
    assert len(output_errors(found, level)) == len(T)
    upwards = replace(TRUTH, local=LOCAL * [1.0, 1.0, -1.0], vel_n=np.full_like(VEL, np.nan))
    with pytest.raises(DataError, match="change the sign of d"):
        output_errors(upwards, TRUTH)


def test_noise_of_a_vehicle_at_rest_is_in_no_other_unit():
    rng = np.random.default_rng(1)
    still = np.zeros_like(VEL)
    truth = replace(TRUTH, local=still, vel_n=1e-4 * rng.standard_normal(VEL.shape))
    found = replace(truth, local=1e-3 * rng.standard_normal(VEL.shape), vel_n=rng.standard_normal(VEL.shape))
    assert len(output_errors(found, truth)) == len(T)
