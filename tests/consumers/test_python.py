"""Simulators and filters in Python on their exports, where they are installed: gnss-ins-sim, pyins."""

from __future__ import annotations

import numpy as np
import pytest

from tests.consumers.examples import EXAMPLES, text_of
from tests.consumers.filters import STEP
from tests.consumers.simulators import SIMULATORS
from tuner.curves.allan import overlapping_allan


@pytest.mark.parametrize("example", list(EXAMPLES))
def test_gnss_ins_sim_draws_the_allan_deviation_of_its_formula(example: str) -> None:
    pytest.importorskip("gnss_ins_sim", reason="gnss-ins-sim is not installed")
    from gnss_ins_sim.pathgen import pathgen
    from gnss_ins_sim.sim import imu_model

    exported: dict = {}
    text = text_of(example, "gnss-ins-sim")
    exec(text, exported)
    imu = imu_model.IMU(accuracy=exported["imu_err"], axis=6, gps=False)
    np.random.seed(1)  # noqa: NPY002  its own generator
    sizes, n = np.array([100, 300, 1000, 3000]), 200_000
    samples = pathgen.gyro_gen(1.0 / STEP, np.zeros((n, 3)), imu.gyro_err)
    drawn = np.mean([overlapping_allan(column - column.mean(), sizes) for column in samples.T], axis=0)
    formula = next(s for s in SIMULATORS if s.dialect == "gnss-ins-sim").allan_variance(
        text, "gyro", sizes * STEP
    )
    # Three columns with n/m degrees of freedom each: a relative sd of √(m/(6n)) of the deviation, five of them.
    assert np.all(np.abs(np.sqrt(drawn / formula) - 1.0) < 5.0 * np.sqrt(sizes / (6.0 * n)))


def test_pyins_takes_densities_and_initial_sds() -> None:
    pytest.importorskip("pyins", reason="pyins is not installed")
    exported: dict = {}
    exec(text_of("walk", "pyins"), exported)
    for sensor in ("gyro", "accel"):
        model, channel = exported[f"{sensor}_model"], EXAMPLES["walk"]().channels[f"{sensor}_x"]
        assert model.q == pytest.approx([channel.random_walk_density] * 3)
        assert model.v == pytest.approx([channel.white_density] * 3)
        assert np.sqrt(np.diag(model.P)) == pytest.approx([channel.constant_sd] * 3)
