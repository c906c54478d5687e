"""Quality of time stamps: gaps, jitter, wrong clock rate, rounding. Seeds are fixed."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import NoiseModel, White
from tuner.diagnosis.data_quality import data_quality_tests
from tuner.readers.time_base import stamped_timebase
from tuner.simulation.static import Channel, simulate
from tuner.types.records import Record


def test_stamps_that_are_even_are_quiet_and_others_are_found():
    clean = {"gyro_x": Channel(NoiseModel([White(1.0)]))}
    for text, said in (
        ("timing:gap_count=3", {"gap_count": 3.0}),
        ("timing:jitter_sd=5e-4", {"jitter_sd": 5e-4}),
        ("timing:clock_ratio=1.0001", {"clock_ratio": 1.0001}),
        ("line:frequency=1,amplitude=0.1", {}),
    ):
        (gyro,), _ = simulate(clean, duration=200.0, rate=100.0, seed=11, effects=[text])
        test = data_quality_tests(gyro)[0]
        assert test.cause == "timing"
        assert (test.p_value == 0.0) is bool(said)
        for name, value in said.items():
            # Gaps are counted, a clock without jitter is exact; an sd from n = 20000 has the relative sd 1/√(2 n).
            tolerance = {"gap_count": 0.0, "clock_ratio": 1e-9, "jitter_sd": 5.0 * value / np.sqrt(40_000)}[
                name
            ]
            assert test.parameters[name].value == pytest.approx(value, abs=tolerance, rel=0.0)


def test_the_rate_of_a_clock_is_as_uncertain_as_the_slopes_between_gaps():
    """Before, its interval was that of one slope: twelve times too short beside a hundred gaps."""
    clean = {"gyro_x": Channel(NoiseModel([White(1.0)]))}
    error = []
    for seed in range(8):
        text = "timing:gap_count=100,gap_samples=3,jitter_sd=5e-4,clock_ratio=1.0001"
        (gyro,), _ = simulate(clean, duration=200.0, rate=100.0, seed=seed, effects=[text])
        found = data_quality_tests(gyro)[0].parameters["clock_ratio"]
        error.append((found.value - 1.0001) / (found.interval[1] - found.value) * 1.96)
    assert 0.4 < np.sqrt(np.mean(np.square(error))) < 1.7  # χ²₈ at 1e-4 and 0.999


@pytest.mark.parametrize("rate", [130.0, 400.0, 100.0 / 1.00003])
def test_rounded_stamps_are_reported_with_their_unit_and_are_no_jitter(rate):
    clean = {"gyro_x": Channel(NoiseModel([White(1.0)]))}
    (gyro,), _ = simulate(clean, duration=100.0, rate=rate, seed=11, effects=["timing:rounding=1e-3"])
    test = data_quality_tests(gyro)[0]
    assert test.note
    assert test.parameters["rounding"].value == pytest.approx(1e-3, rel=1e-6)
    assert "jitter_sd" not in test.parameters
    (gyro,), _ = simulate(
        clean, duration=100.0, rate=rate, seed=11, effects=["timing:rounding=2e-4,jitter_sd=5e-4"]
    )
    test = data_quality_tests(gyro)[0]
    assert test.p_value == 0.0
    assert not test.note
    assert test.parameters["rounding"].value == pytest.approx(2e-4, rel=1e-6)
    assert test.parameters["jitter_sd"].value == pytest.approx(5e-4, rel=0.05)


@pytest.mark.parametrize("start", [0.0, 86_400.0, 1.7e9])
@pytest.mark.parametrize("decimals", [None, 6, 9])
def test_scatter_below_the_resolution_of_the_stamps_is_not_reported(start, decimals):
    """Beside gaps, which are reported: the last places of a number, or a decimal of the text, are no jitter."""
    grid = np.delete(np.arange(20_000), [5000, 5001, 5002, 9000, 9001, 9002, 9003])
    stamps = start + grid / 130.0
    stamps = stamps if decimals is None else np.round(stamps, decimals)
    base = stamped_timebase(stamps - start)
    assert base.jitter == 0.0
    y = np.random.default_rng(3).standard_normal((len(base.t), 1))
    timing = {"gap_count": float(base.gaps), "jitter_sd": base.jitter, "rounding": base.rounding}
    axis = ("gyro_x",)
    test = data_quality_tests(
        Record("gyro", 0.01 * np.arange(len(y)), y, axis, "rad/s", 0.01, timing=timing)
    )[0]
    assert "jitter_sd" not in test.parameters
    assert "scatter" not in test.text
    trembling = stamped_timebase(
        start + grid / 130.0 + 1e-4 * np.random.default_rng(4).standard_normal(len(grid))
    )
    assert trembling.jitter == pytest.approx(1e-4, rel=0.1)
