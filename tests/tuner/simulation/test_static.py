"""Simulated logs: reproducible, additive, with all hidden effects in the ground truth. Seeds are fixed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from models.effects import EFFECTS
from models.effects.static.events import Step
from models.effects.static.temperature_profiles import Diurnal
from models.noise import BiasInstability, NoiseModel, Quantization, RandomWalk, White
from models.sensors import SensorGrade, Sourced, TriadGrade
from tuner.simulation.effect_spec import PlacedEffect, noise_scale, read_effect
from tuner.simulation.static import GRAVITY, Channel, demo, grade_channels, simulate
from tuner.types.records import DataError

GYRO = NoiseModel([White(1e-4), BiasInstability(1e-5), RandomWalk(1e-7), Quantization(1e-8)])
ACCEL = NoiseModel([White(1e-3), BiasInstability(1e-4)])
SIX = {f"gyro_{a}": Channel(GYRO, 1e-3) for a in "xyz"} | {f"accel_{a}": Channel(ACCEL, 1e-2) for a in "xyz"}
AXES = tuple(SIX)


def run(*hidden, seed=3, duration=60.0, sensor=SIX, **options):
    return simulate(sensor, duration=duration, rate=100.0, seed=seed, effects=hidden, **options)


def test_a_six_axis_log_with_gravity_and_temperature():
    (gyro, accel), key = run()
    assert (gyro.name, accel.name) == ("gyro", "accel")
    assert gyro.axes == ("gyro_x", "gyro_y", "gyro_z")
    assert (gyro.unit, accel.unit) == ("rad/s", "m/s^2")
    assert gyro.y.shape == accel.y.shape == (6000, 3)
    np.testing.assert_allclose(accel.y.mean(axis=0), [0.0, 0.0, -GRAVITY], atol=0.06)
    assert gyro.segments == ((0, 6000),)
    read = gyro.covariates["temperature"]
    assert read[0] == pytest.approx(25.0, abs=0.2)
    assert read[-1] == pytest.approx(33.0, abs=0.2)
    np.testing.assert_array_equal(read, np.round(read / 0.125) * 0.125)
    assert key["schema"] == "tuner.key/1"
    assert key["hidden"] == []


def test_seed_decides_everything():
    for seed in (0, 1):
        one, two = run("line", "spikes@accel", seed=seed), run("line", "spikes@accel", seed=seed)
        assert one[1] == two[1]
        for a, b in zip(one[0], two[0], strict=True):
            np.testing.assert_array_equal(a.y, b.y)
    assert np.any(run(seed=0)[0][0].y != run(seed=1)[0][0].y)


def test_an_effect_leaves_noise_biases_and_thermometer_as_they_were():
    (gyro, accel), _ = run()
    (with_step, same), _ = run("step@gyro_y:time=20,size=0.5")
    np.testing.assert_array_equal(accel.y, same.y)
    np.testing.assert_array_equal(gyro.y[:, [0, 2]], with_step.y[:, [0, 2]])
    np.testing.assert_allclose(
        with_step.y[:, 1] - gyro.y[:, 1], np.where(gyro.t >= 20.0, 0.5, 0.0), atol=1e-15
    )
    np.testing.assert_array_equal(gyro.covariates["temperature"], with_step.covariates["temperature"])


def test_axes_are_independent():
    """Correlation of white axes of n = 60000 samples: 5/√n."""
    (gyro, accel), _ = run(duration=600.0, sensor={a: Channel(NoiseModel([White(1.0)])) for a in AXES})
    correlation = np.corrcoef(np.hstack([gyro.y, accel.y]).T)[np.triu_indices(6, 1)]
    assert np.abs(correlation).max() < 5.0 / np.sqrt(60000)


def test_noise_has_the_allan_variance_of_its_model():
    """Overlapping Allan variance of 24 axes at 1 s (≥ 150 degrees of freedom each): 5 sd of the mean."""
    sensor = {f"gyro_{i}": Channel(GYRO) for i in range(24)}
    (record,), _ = run(duration=300.0, sensor=sensor)
    x = np.vstack([np.zeros(24), np.cumsum(record.y, axis=0)])
    m = 100
    z = x[2 * m :] - 2 * x[m:-m] + x[: -2 * m]
    variance = np.mean(z**2, axis=0) / (2.0 * m * m)
    expected = GYRO.allan_variance(np.array([1.0]), interval=0.01)[0]
    assert variance.mean() == pytest.approx(expected, rel=5.0 * np.sqrt(2.0 / 150 / 24))


def test_turn_on_biases_are_in_the_key_and_scatter_as_stated():
    constants = np.array(
        [[run(seed=s, duration=0.1)[1]["channels"][a]["constant"] for a in AXES] for s in range(150)]
    )
    assert constants[:, :3].std() == pytest.approx(1e-3, rel=0.2)  # 450 draws: 6 sd
    assert constants[:, 3:5].std() == pytest.approx(1e-2, rel=0.25)


@pytest.mark.parametrize("code", EFFECTS)
def test_every_cause_can_be_hidden_by_its_name_and_is_in_the_key(code):
    records, key = run(code)
    (entry,) = key["hidden"]
    assert entry["cause"] == code
    assert set(entry["parameters"]) <= set(EFFECTS[code].__dataclass_fields__)
    assert json.loads(json.dumps(key, allow_nan=False)) == json.loads(json.dumps(key))
    for record in records:
        assert np.all(np.isfinite(record.y))
        assert np.all(np.diff(record.t) > 0)


def test_records_say_what_their_stamps_say():
    """Robust scale of 6000 differences (relative sd about 0.015): 5 sd."""
    (gyro, accel), _ = run("timing:gap_count=4,jitter_sd=2e-4,clock_ratio=1.0005")
    assert gyro.timing == accel.timing
    assert gyro.timing["gap_count"] == 4
    assert gyro.timing["jitter_sd"] == pytest.approx(2e-4, rel=0.08)
    assert gyro.timing["clock_ratio"] == pytest.approx(1.0005, abs=1e-6)
    even = run()[0][0].timing
    assert even["gap_count"] == 0
    assert even["jitter_sd"] < 1e-12
    assert even["clock_ratio"] == pytest.approx(1.0, abs=1e-12)


def test_gaps_end_segments():
    (gyro, accel), _ = run("timing:gap_count=4,gap_samples=10")
    assert len(gyro.segments) == 5
    assert gyro.segments == accel.segments
    assert len(gyro) == 5960
    for start, stop in gyro.segments:
        np.testing.assert_allclose(np.diff(gyro.t[start:stop]), 0.01, rtol=1e-9)


def test_an_effect_can_be_handed_over_and_the_temperature_chosen():
    (gyro, _), key = run(PlacedEffect(Step(1.0, 2.0), ("gyro_x",)), temperature=Diurnal(40.0, 0.0))
    assert key["hidden"] == [
        {"cause": "step", "channels": ["gyro_x"], "parameters": {"time": 1.0, "size": 2.0}}
    ]
    profile = {"profile": "diurnal", "mean": 40.0, "amplitude": 0.0, "period": 86400.0, "phase": 0.0}
    assert key["temperature"] == profile
    assert np.abs(gyro.covariates["temperature"] - 40.0).max() <= 0.125


@pytest.mark.parametrize(
    ("text", "effect", "axes"),
    [
        ("line", "line", AXES[:3]),
        ("attitude:tilt=1", "attitude:tilt=1", AXES[3:]),
        ("timing", "timing", AXES),
        ("line@accel_z", "line", ("accel_z",)),
        (
            "line@accel_z+gyro_x:frequency=1,amplitude=2",
            "line:frequency=1,amplitude=2",
            ("gyro_x", "accel_z"),
        ),
        ("duplicates@imu", "duplicates", AXES),
        ("step@accel+gyro_y", "step", ("gyro_y", *AXES[3:])),
    ],
)
def test_the_text_of_what_to_hide(text, effect, axes):
    assert read_effect(text, AXES) == (effect, axes)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lin", "effect 'lin': an effect must be one of line"),
        ("line:frequency=x,amplitude=1", "'frequency' of 'line' must be a number"),
        ("line@gyro_w", "expected channels out of gyro_x .* imu gyro accel, got 'gyro_w'"),
        ("timing@gyro", "'timing' acts on all 6 channels at once"),
        ("attitude@gyro_x:tilt=1", "needs the three channels of a triad"),
    ],
)
def test_what_cannot_be_hidden_is_said_in_one_line(text, says):
    with pytest.raises(DataError, match=f"^.*{says}.*$"):
        run(text)


def test_too_short_a_log_is_refused():
    with pytest.raises(DataError, match="must give two samples or more"):
        run(duration=0.01)
    with pytest.raises(DataError, match="at None Hz"):
        simulate(SIX, duration=1.0, seed=0)


def test_a_grade_brings_its_rate_noise_and_biases():
    said = "this test"
    grade = SensorGrade(
        "toy",
        "A toy",
        Sourced(50.0, said),
        TriadGrade("gyro", white=Sourced(1e-3, said), turn_on_sd=Sourced(0.1, said)),
        TriadGrade("accel", white=Sourced(1e-2, said)),
    )
    channels = grade_channels(grade)
    assert channels["gyro_z"] == Channel(NoiseModel([White(1e-3)]), 0.1)
    assert channels["accel_x"].bias_sd == 0.0
    (gyro, accel), key = simulate(grade, duration=10.0, seed=0)
    assert gyro.interval == accel.interval == pytest.approx(0.02)
    assert gyro.source == key["source"] == "toy"
    assert key["channels"]["gyro_x"]["terms"] == {"white": {"density": 1e-3}}


def test_models_alone_are_axes_without_a_turn_on_bias():
    models = {f"gyro_{a}": GYRO for a in "xyz"}
    (plain,), key = run(sensor=models)
    (same,), _ = run(sensor={axis: Channel(model) for axis, model in models.items()})
    np.testing.assert_array_equal(plain.y, same.y)
    assert {c["constant"] for c in key["channels"].values()} == {0.0}


def test_scale_of_white_noise():
    white_sd, floor = noise_scale(NoiseModel([White(1.0)]), 0.01, 1000.0)
    assert white_sd == pytest.approx(10.0)
    assert floor == pytest.approx(0.1)


def test_demo_hides_one_effect_of_its_seed():
    causes = set()
    for seed in (2, 3):
        (gyro, accel), key = demo(seed)
        assert len(gyro) == len(accel) == 360_000
        (entry,) = key["hidden"]
        causes.add(entry["cause"])
    assert len(causes) > 1
    again = demo(3)
    assert again[1] == key
    np.testing.assert_array_equal(again[0][0].y, gyro.y)
