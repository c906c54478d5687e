"""A register that wraps around is found with its range, and put back; rails, glitches and error codes are none."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.effects.static.base import Samples
from models.effects.static.sampling import Overflow
from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality import data_quality_tests
from tuner.diagnosis.data_quality.overflow import find_overflow, unwrapped
from tuner.diagnosis.static.channel_preparation import prepared_axis
from tuner.types.records import Record

COUNT = 40_000
ALIKE = 1e-4
"""P-value that decides (`tuner.diagnosis.data_quality.DECISIVE_P_VALUE`)."""


def white(seed: int) -> np.ndarray:
    rng = np.random.default_rng([97, seed])
    return rng.standard_normal(COUNT) + 0.5 * np.linspace(0.0, 1.0, COUNT)


def wrap(y: np.ndarray, low: float, width: float) -> np.ndarray:
    return low + np.mod(y - low, width)


@pytest.mark.parametrize(("top", "width"), [(3.3, 12.0), (3.0, 400.0), (1.35, 9.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_range_of_a_register_is_found_and_samples_put_back(top, width, sign):
    """The interval holds both ends; every sample comes back to its place but for the gap to the outermost one."""
    y = sign * white(1)
    low = top - width if sign > 0.0 else -top
    samples = Samples(np.arange(COUNT), wrap(y, low, width)[:, None], 1.0)
    effect = Overflow(low, low + width)
    np.testing.assert_array_equal(effect.apply(samples, np.random.default_rng(0)).y, samples.y)
    again = effect.apply(replace(samples, y=y[:, None]), np.random.default_rng(0)).y
    np.testing.assert_allclose(again, samples.y, atol=1e-12)
    found = find_overflow([wrap(y, low, width)], 0.0)
    assert found.p_value < ALIKE
    assert found.low - found.slack < low <= found.low
    assert found.high <= low + width < found.high + found.slack
    back = unwrapped(wrap(y, low, width), found.high - found.low)
    assert np.abs(back - y).max() <= 2.0 * found.slack


def test_a_sixteen_bit_register_is_named_and_leaves_nothing_else():
    """Codes near 32767 that come out near −32768: neither spikes nor rails; the samples are those before."""
    code = np.round(32_700.0 + 20.0 * white(2))
    y = 1e-5 * wrap(code, -32_768.0, 65_536.0)
    record = Record("gyro", 0.01 * np.arange(COUNT), y[:, None], ("gyro_x",), "rad/s", 0.01)
    diagnosis = diagnose(record)
    assert [f.cause for f in diagnosis.findings] == ["overflow"]
    assert not diagnosis.unexplained
    assert diagnosis.findings[0].parameters["high"].value == pytest.approx(0.327675, abs=2e-5)
    assert diagnosis.findings[0].extension["level"] == pytest.approx(0.32705, abs=5e-5)
    assert diagnosis.models["gyro_x"].white_density() == pytest.approx(2e-5, rel=0.02)  # as put back


def test_samples_are_put_back_between_gaps_whose_level_differs():
    """A level that changes by 0.7 of the range at a gap, which holds no number: only wrapped samples are moved."""
    width, at = 12.0, 20_016  # a quarter of a block after the gap
    y = np.where(np.arange(COUNT) < at, 3.0, -5.4) + np.random.default_rng(99).standard_normal(COUNT)
    wrapped = wrap(y, -6.0, width)
    wrapped[at - 8 : at] = np.nan
    t, segments = 0.01 * np.arange(COUNT), ((0, at - 8), (at, COUNT))
    record = Record("gyro", t, wrapped[:, None], ("gyro_x",), "rad/s", 0.01, segments)
    tests = data_quality_tests(record)
    (found,) = (one for one in tests if one.cause == "overflow")
    assert found.p_value < ALIKE
    one = prepared_axis(record, "gyro_x", tests, ALIKE, 0)
    assert np.isfinite(one.y).all()
    for start, stop in segments:
        off = one.y[start:stop] * one.scale - y[start:stop]
        assert np.abs(off - np.median(off)).max() < 0.5


def test_rails_glitches_and_error_codes_are_no_overflow():
    """Glitches of like size, of any size, one value for an error, and rails with as many glitches as they cut off."""
    rng = np.random.default_rng(98)
    few = rng.random(COUNT) < 3e-4
    alike, any_size, error, rail = (white(seed) for seed in range(3, 7))
    alike[few] -= 20.0
    any_size[few] -= rng.uniform(5.0, 40.0, int(few.sum()))
    error[few] = -20.0
    rail = np.minimum(rail, 3.0)
    rail[few] -= 20.0
    for y in (white(7), alike, any_size, error, rail, 0.1 * np.round(10.0 * error)):
        record = Record("gyro", 0.01 * np.arange(COUNT), y[:, None], ("gyro_x",), "rad/s", 0.01)
        (test,) = (one for one in data_quality_tests(record) if one.cause == "overflow")
        assert test.p_value > ALIKE


def held(seed: int, share: float, sd: float) -> np.ndarray:
    """White noise in which for a share of the time readings of another sd are held for 8 to 19 samples."""
    rng, count = np.random.default_rng(seed), 200_000
    y, at = rng.standard_normal(count), 0
    while True:
        at += int(rng.exponential(14 * (1 - share) / share)) + 1
        size = int(rng.integers(8, 20))
        if at + size >= count:
            return y
        y[at : at + size] = sd * rng.standard_normal() + 0.02 * rng.standard_normal(size)
        at += size


@pytest.mark.parametrize(("seed", "share", "sd"), [(7, 0.1, 1.4), (7, 0.1, 1.6), (3, 0.2, 1.4)])
def test_readings_that_are_held_are_no_overflow(seed, share, sd):
    """They come in runs, and nothing is cut off at the other end."""
    assert find_overflow([held(seed, share, sd)], 0.0).p_value > ALIKE


def test_runs_of_a_phone_far_from_its_other_end_are_no_overflow():
    """Held stretches at one end of a log, of whose other end samples lie far apart."""
    name = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static" / "galaxy_s5_static.npz"
    if not name.is_file():
        pytest.skip("TUNER_DATA does not name a folder with recordings")
    with np.load(name) as arrays:
        assert find_overflow([np.asarray(arrays["gyro_raw"][:, 0], dtype=float)], 0.0).p_value > ALIKE
