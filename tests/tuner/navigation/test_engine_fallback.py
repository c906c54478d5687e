"""Without numba the reference filter answers, with a message."""

from __future__ import annotations

import sys

import numpy as np

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation import engine, reference_filter
from tuner.navigation.data import Fixes
from tuner.navigation.settings import filter_settings
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize


def test_reference_filter_answers_where_numba_is_missing(monkeypatch, caplog):
    for name in [m for m in sys.modules if m == "numba" or m.startswith("tuner.navigation.engine.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "numba", None)  # what makes `import numba` fail
    engine._compiled.cache_clear()
    receiver = load_gnss("spp")
    settings = filter_settings(synthesize(grade_identification(load_grade("mpu9250")), gnss=receiver))
    plan = scenario(TRAJECTORIES["city"](2.0), receiver, 0.01)
    sd = np.tile([1.5, 1.5, 3.0, 0.05, 0.05, 0.1], (len(plan.times), 1))
    fixes = Fixes(plan.times, plan.after, plan.truth.llh, plan.truth.vel_n, sd)
    try:
        found = engine.run(settings, plan.start, plan.steps, fixes)
        (together,) = engine.run_together(settings, [plan.start], plan.steps, [fixes])
    finally:
        engine._compiled.cache_clear()
    expected = reference_filter.run(settings, plan.start, plan.steps, fixes)
    np.testing.assert_array_equal(found.final_covariance, expected.final_covariance)
    np.testing.assert_array_equal(together.final_covariance, expected.final_covariance)
    assert caplog.text.count("the reference filter runs instead") == 1
