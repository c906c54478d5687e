"""Comparison of coefficients: which differ significantly and which do not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from tuner.catalogue.grades import grade_identification, load_grade
from tuner.identification import identify
from tuner.identification.comparison import compare_identifications, limit_checks
from tuner.report.sensor_answers import limit_text
from tuner.types import Coefficient, Identification, TermEstimate
from tuner.types.records import Record


def white_log(density, seed, n=4000, interval=0.01):
    y = density / np.sqrt(interval) * np.random.default_rng(seed).standard_normal((n, 1))
    return identify(
        [Record("gyro", np.arange(n) * interval, y, ("gyro_x",), "rad/s", interval)],
        terms=["white"],
        arma=None,
    )


def test_a_grade_agrees_with_itself():
    grade = grade_identification(load_grade("stim300"))
    comparison = compare_identifications(["a", "b"], [grade, grade])
    for rows in comparison.axes.values():
        for row in rows:
            assert row.ratio in (None, pytest.approx(1.0))
            assert row.differs is None


def row_of(comparison, name):
    return next(row for row in comparison.axes["gyro_x"] if row.name == name)


def test_a_real_difference_is_reported():
    row = row_of(compare_identifications(["a", "b"], [white_log(1.0, 1), white_log(2.0, 2)]), "white.density")
    assert row.differs
    assert row.ratio_interval[0] < row.ratio < row.ratio_interval[1]
    assert row.ratio == pytest.approx(2.0, rel=0.06)


def test_equal_sensors_differ_at_the_stated_rate():
    runs = [white_log(1.0, seed) for seed in range(60)]
    found = [
        row_of(compare_identifications(["a", "b"], [runs[i], runs[i + 1]]), "white.density").differs
        for i in range(0, 60, 2)
    ]
    assert sum(found) <= binom.ppf(1 - 1e-5, 30, 0.05)


def test_a_measured_interval_above_what_is_stated_fails():
    sheet = grade_identification(load_grade("icm20602"))
    axis = sheet.channels["gyro_x"]
    for factor, passes in ((0.9, True), (1.04, True), (1.2, False)):
        density = factor * axis.term("white").coefficients["density"].value
        white = Coefficient.known(density, 0.99 * density, 1.01 * density, "rad/s/√Hz")
        measured = replace(axis, span=3600.0, terms=(TermEstimate("white", {"density": white}),))
        both = compare_identifications(["sheet", "log"], [sheet, Identification({}, {"gyro_x": measured})])
        (check,) = limit_checks(both)
        assert check.passes is passes
        assert check.measured == "log"
        if not passes:
            assert check.exceeded == (("gyro_x", "white.density", pytest.approx(factor)),)
            assert "white noise of gyro x 1.20 ×" in limit_text(check)
            worse = replace(check, exceeded=(*check.exceeded, ("gyro_z", "white.density", 15.1)))
            assert "white noise of gyro x z 1.20 to 15.1 × what is stated" in limit_text(worse)
