"""Frozen readings are found whatever their value; a coarse quantizer is not taken for one.

Seeds are fixed and are the first that were tried. A clean record is called frozen with a chance below 1e-9.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from models.effects import Samples, hide
from models.effects.static.sampling import Duplicates, Quantizer
from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality import data_quality_tests
from tuner.segments.frozen import cut, frozen
from tuner.types.records import Record

INTERVAL, N = 0.01, 120_000
COLOURS = {
    "white": ([1.0], [1.0]),
    "strong low-pass": ([1.0], [1.0, -1.6, 0.7]),
    "quantization": ([1.0, -1.0], [1.0]),
    "narrow": butter(3, 0.03),
}


def noise(kind: str, k: int, seed: int, walk: float = 1e-4) -> np.ndarray:
    """Noise of unit sd on a level and a random walk of so many sd a step."""
    rng = np.random.default_rng(seed)
    w = lfilter(*COLOURS[kind], rng.standard_normal((N, k)), axis=0)
    return (
        w / w.std(axis=0) + walk * np.cumsum(rng.standard_normal((N, k)), axis=0) + rng.uniform(-3.0, 3.0, k)
    )


def rounded(y: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(y / step) if step else y


def record(y: np.ndarray, **options) -> Record:
    axes = tuple(f"gyro_{a}" for a in "xyz"[: y.shape[1]])
    return Record("gyro", INTERVAL * np.arange(len(y)), y, axes, "rad/s", INTERVAL, **options)


@pytest.mark.parametrize("kind", COLOURS)
@pytest.mark.parametrize("walk", [0.0, 1e-3, 1e-2])
def test_no_quantizer_is_frozen_however_coarse(kind, walk):
    """Up to 40 sd, where a record has a handful of codes and runs of half an hour."""
    y = noise(kind, 1, 1, walk)
    for step in (0.0, 0.1, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0):
        assert frozen(record(rounded(y, step)), "gyro_x") is None


def test_dead_bands_saturation_and_single_repeats_are_not_frozen():
    rng = np.random.default_rng(2)
    for walk in (1e-4, 1e-2):
        y = noise("white", 1, 3, walk)
        for half in (1.0, 2.0, 3.0, 5.0):
            dead = np.where(np.abs(y) < half, 0.0, rounded(y, 0.3))
            assert frozen(record(dead), "gyro_x") is None
        for rail in (0.0, 1.0, 3.0):
            assert frozen(record(np.clip(y, -rail - 0.5, rail)), "gyro_x") is None
        for share in (0.3, 0.9, 0.97):
            kept = np.where(rng.random(N) >= share, np.arange(N), 0)
            assert frozen(record(y[np.maximum.accumulate(kept)]), "gyro_x") is None


@pytest.mark.parametrize(
    ("kind", "step"),
    [
        ("white", 0.0),
        ("white", 0.01),
        ("white", 0.5),
        ("white", 2.0),
        ("strong low-pass", 0.3),
        ("quantization", 1.0),
    ],
)
def test_a_stuck_register_is_found_where_it_was(step, kind):
    """Intervals hold the truth but for chance beyond 97.5 % at either end: of nine, six and more do."""
    inside = 0
    for seed in range(3):
        y = rounded(noise(kind, 1, 10 + seed), step)
        y[40_000:43_000] = y[39_999]
        (test,) = [t for t in data_quality_tests(record(y)) if t.stretches]
        assert test.p_value < 1e-9
        for name, truth in (("start", 400.0), ("duration", 30.0), ("fraction", 3000 / N)):
            low, high = test.parameters[name].interval
            inside += low - 1e-9 <= truth <= high + 1e-9
            assert low <= test.parameters[name].value <= high
            assert test.parameters[name].value == pytest.approx(truth, rel=0.01)
        assert test.parameters["count"].value == 1.0
    assert inside >= 6


@pytest.mark.parametrize(
    ("level", "value"),
    [
        (0.0, None),
        (5.0, 0.0),
        (0.0, 32_768.0),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((0.0, 0.0), (2.0, -40.0), (0.0, 3.0))),
    ],
)
def test_one_axis_that_stands_still_is_one_finding_whatever_its_value(level, value):
    """A frozen reading, zero within the noise and beside it, the end of the range: no bursts, steps or rails."""
    y = rounded(noise("white", 2, 20)[:40_000], 0.05) + level
    y[20_000:22_000, 1] = y[20_000, 1] if value is None else value
    diagnosis = diagnose(record(y))
    assert [(f.cause, f.channels) for f in diagnosis.findings] == [("duplicates", ("gyro_y",))]
    assert diagnosis.unexplained == ()
    parameters = diagnosis.findings[0].parameters
    assert parameters["start"].value == pytest.approx(200.0, abs=2 * INTERVAL)
    assert parameters["duration"].value == pytest.approx(20.0, abs=3 * INTERVAL)
    assert "stuck" in diagnosis.findings[0].text


@pytest.mark.parametrize("share", [0.05, pytest.param(0.3, marks=pytest.mark.slow), 0.41])
def test_what_is_left_of_a_record_that_froze_for_long_is_judged_by_itself(share):
    y = noise("white", 1, 21)
    last = 70_000 + int(share * N)
    y[70_000:last] = y[70_000]
    (only,) = diagnose(record(y)).findings
    assert (
        only.parameters["duration"].interval[0]
        <= share * N * INTERVAL
        <= only.parameters["duration"].interval[1]
    )


def test_a_sensor_that_died_early_is_judged_by_what_it_said():
    y = noise("white", 1, 27)
    y[30_000:] = y[29_999]
    (only,) = diagnose(record(y)).findings
    assert only.parameters["fraction"].value == pytest.approx(0.75, abs=1e-3)


def test_axes_that_freeze_together_are_reported_once_and_others_apart():
    y = rounded(noise("white", 3, 22)[:60_000], 0.5)
    y[15_000:16_000, :2] = y[15_000, :2]
    y[45_000:45_500, 2] = 0.0
    found = diagnose(record(y)).findings
    assert {(f.cause, f.channels) for f in found} == {
        ("duplicates", ("gyro_x", "gyro_y")),
        ("duplicates", ("gyro_z",)),
    }


def test_many_stretches_are_counted_and_repeated_samples_reported_besides():
    """A hundred stretches of half a second, and 5 % of the others repeated: two findings."""
    rng = np.random.default_rng(23)
    block = Samples(INTERVAL * np.arange(N), noise("white", 1, 24), INTERVAL)
    y = hide(block, [(Duplicates(0.05), [0])], rng).y
    for first in range(500, N, 1200):
        y[first : first + 50] = y[first]
    found = diagnose(record(y)).findings
    assert [f.cause for f in found] == ["duplicates", "duplicates"]
    (stuck,) = [f for f in found if "count" in f.parameters]
    (repeated,) = [f for f in found if "count" not in f.parameters]
    assert stuck.parameters["count"].value == 100.0
    assert stuck.parameters["fraction"].value == pytest.approx(100 * 50 / N, rel=0.03)
    assert repeated.parameters["fraction"].value == pytest.approx(0.05, rel=0.1)


def test_what_is_hidden_is_what_is_found():
    effect = Duplicates(0.0, start=200.0, duration=60.0)
    block = Samples(INTERVAL * np.arange(60_000), noise("white", 3, 25)[:60_000], INTERVAL)
    y = hide(block, [(Quantizer(0.2), [0, 1, 2]), (effect, [1])], np.random.default_rng(26)).y
    (found,) = diagnose(record(y)).findings
    assert found.channels == ("gyro_y",)
    for name, truth in effect.parameters().items():
        if name != "fraction":
            assert found.parameters[name].value == pytest.approx(
                truth, abs=3.0 * INTERVAL
            )  # chance repeats: 0.2/(2√π) each


def test_segments_are_cut_by_stretches():
    assert cut([(0, 100), (110, 200)], [(50, 120), (60, 70), (199, 205)]) == ((0, 50), (120, 199))
    assert cut([(0, 10)], []) == ((0, 10),)
    assert cut([(0, 10)], [(1, 10)]) == ()
