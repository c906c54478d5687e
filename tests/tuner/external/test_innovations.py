"""Innovations that a filter does not state follow from its output: those of a filter whose own are known."""

from __future__ import annotations

import numpy as np
import pytest

from models.earth import metres_per_radian
from tuner.external.innovations import common, deviations_of
from tuner.external.inputs import Fixes
from tuner.types.filter_output import filter_output
from tuner.types.records import DataError

STEP, FIX_STEPS, COUNT = 0.1, 10, 150
R, Q = 0.1, 0.1
PLACE = np.array([0.8, 0.2, 100.0])


def filtered():
    """Return output and fixes of a filter of position and velocity, and its innovations with their variance."""
    rng = np.random.default_rng(0)
    phi = np.array([[1.0, STEP], [0.0, 1.0]])
    noise = Q**2 * np.array([[STEP**3 / 3.0, STEP**2 / 2.0], [STEP**2 / 2.0, STEP]])
    root = np.linalg.cholesky(noise)
    truth, x, p = np.zeros((2, 3)), np.zeros((2, 3)), np.diag([1.0, 0.1])
    rows, fixes, innovations = [], [], []
    for k in range(1, COUNT * FIX_STEPS + 1):
        truth = phi @ truth + root @ rng.normal(size=(2, 3))
        x, p = phi @ x, phi @ p @ phi.T + noise
        if k % FIX_STEPS == 0:
            z = truth[0] + R * rng.normal(size=3)
            s = p[0, 0] + R**2
            fixes.append((k * STEP, *z))
            innovations.append((*(z - x[0]), s))
            gain = p[:, 0] / s
            x, p = x + gain[:, None] * (z - x[0]), p - np.outer(gain, p[0])
        rows.append((k * STEP, *x.ravel(), p[0, 0], p[1, 1]))
    return np.array(rows), np.array(fixes), np.array(innovations)


def llh_of(ned):
    return PLACE + ned / metres_per_radian(PLACE)


def output_of(rows, *, every=1):
    rows = rows[every - 1 :: every]
    sds = np.sqrt(np.repeat(rows[:, 7:9], 3, axis=1))
    cov = np.full((len(rows), 15, 15), np.nan)
    cov[:, :6, :6] = sds[:, :, None] ** 2 * np.eye(6)
    return filter_output("toy", rows[:, 0], llh=llh_of(rows[:, 1:4]), vel_n=rows[:, 4:7], covariance=cov)


def test_predictions_of_fixes_are_the_innovations_of_the_filter():
    rows, fixes, innovations = filtered()
    given = Fixes(fixes[:, 0], llh_of(fixes[:, 1:]), np.full((COUNT, 3), R), np.zeros(3))
    found = deviations_of(output_of(rows), given, 1.0, None)
    assert found.kind == "predictions of fixes"
    at = np.searchsorted(fixes[:, 0], found.t - 1e-6)
    assert found.z == pytest.approx(innovations[at, :3], abs=0.01)  # one step of acceleration noise: 0.003 m
    assert found.s[:, 0, 0] == pytest.approx(innovations[at, 3], rel=0.01)
    doubled = deviations_of(output_of(rows), given, 2.0, None)
    assert doubled.s[:, 1, 1] - found.s[:, 1, 1] == pytest.approx(3.0 * R**2)


def test_an_output_at_the_fixes_alone_needs_innovations_or_a_truth():
    rows, fixes, _ = filtered()
    given = Fixes(fixes[:, 0], llh_of(fixes[:, 1:]), np.full((COUNT, 3), R), np.zeros(3))
    seldom = output_of(rows, every=FIX_STEPS)
    with pytest.raises(DataError, match="expected 60 innovations, or positions with sds"):
        deviations_of(seldom, given, 1.0, None)
    found = deviations_of(seldom, given, 1.0, output_of(rows))
    assert found.kind == "errors"


def test_rows_of_one_instant_are_found():
    rows, fixes, _ = filtered()
    given = Fixes(fixes[:, 0], llh_of(fixes[:, 1:]), np.full((COUNT, 3), R), np.zeros(3))
    found = deviations_of(output_of(rows), given, 1.0, None)
    some = found.rows(np.arange(3, 20, 2))
    mine, theirs = common(some, found)
    assert np.array_equal(some.t[mine], found.t[theirs])
    assert len(mine) == len(some.t)
