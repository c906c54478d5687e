"""Runs beside poses: white noise, errors of scale, delays and turns that were planted are found, nothing else.

The motion is that of a hand, the unit one of consumer grade, the poses those of a good motion capture.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models import rotation
from tests.tuner.poses.simulated_run import RATE, REST, simulated_run
from tuner.poses.misfit import Poses
from tuner.poses.run_with_poses import compare_with_poses, with_run
from tuner.report.pose_run_answer import pose_run_lines
from tuner.types import ChannelNoise, FilterConfig, InitialUncertainty
from tuner.types.records import DataError

CONFIG = FilterConfig(
    "made by hand",
    0.005,
    {
        f"{sensor}_{x}": ChannelNoise(f"{sensor}_{x}", unit, REST[sensor][0], (), REST[sensor][1], 0.01)
        for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s^2"))
        for x in "xyz"
    },
    InitialUncertainty(1.0, 1.0, 0.1, 1.0),
    None,
)


def compared(seed, **planted):
    records, poses = simulated_run(seed, **planted)
    return compare_with_poses(records, poses, CONFIG, "run")


def holds(coefficient, value):
    """Tell whether an interval or a limit holds a value."""
    if coefficient.interval is None:
        return coefficient.upper >= value
    return coefficient.interval[0] <= value <= coefficient.interval[1]


def test_of_a_sound_unit_the_numbers_at_rest_stay_however_it_is_mounted_and_stamped():
    run = compared(1, delay=-0.2, turn=(0.4, -1.0, 2.0), arm=(0.1, -0.05, 0.2))
    missed = [not holds(one.factors[name], 1.0) for one in run.sensors for name in ("white", "walk")]
    assert sum(missed) <= 1  # four intervals of 95 %
    assert not any(one.larger or one.unexplained or one.causes for one in run.sensors)
    assert holds(run.delay, 0.2)  # what is to be added to the stamps
    assert run.gyro.beside.reference.value == pytest.approx(3e-4, rel=0.1)
    assert run.accel.beside.reference.value == pytest.approx(3e-4, rel=0.1)
    assert with_run(CONFIG, run) is CONFIG


def test_a_clock_that_drifts_is_no_noise():
    run = compared(8, drift=1e-4, delay=0.05)
    assert holds(run.drift, -1e-4 / (1.0 + 1e-4))
    assert holds(run.gyro.factors["white"], 1.0)
    assert not any(one.larger or one.unexplained for one in run.sensors)
    assert re.search(r"their clock faster by \d+ ± \d+ ppm", pose_run_lines(run)[0].replace(".", ""))


def test_vibration_is_measured_and_written_for_the_sensor_that_has_it():
    run = compared(2, factors=(4.0, 1.0))
    assert holds(run.gyro.factors["white"], 4.0)
    assert run.gyro.shaken
    assert run.gyro.scatter == pytest.approx(4.0, rel=0.2)
    config = with_run(CONFIG, run)
    factor = config.channels["gyro_x"].white_density / REST["gyro"][0]
    assert factor == pytest.approx(run.gyro.larger["white"])
    assert config.channels["accel_x"] == CONFIG.channels["accel_x"]
    assert config.inflations[0].causes == ("vibration",)
    assert config.noise["gyro_x"] == REST["gyro"][0]  # at rest, beside that in motion


def test_errors_of_scale_are_named_with_their_size_and_make_the_number_of_a_filter_without_them():
    scale = np.diag([0.008, 0.0, 0.0])
    run = compared(3, scales=(scale, np.zeros((3, 3))))
    (cause,) = run.gyro.causes
    assert cause.name == "scale"
    assert holds(cause.size, 0.008 / 1.008)  # of the measured rate
    assert holds(run.gyro.factors["white"], 1.0)
    assert run.gyro.larger["white"] > 2.0
    # A filter with that number predicts the errors of the axis that has it, in the mean of all windows and axes.
    ratios = np.array(list(run.gyro.growth.values()))
    assert ratios[:, 0].max() > 2.0
    assert (
        np.abs(np.log(ratios[:2, 1:])).max() < 0.2
    )  # two axes without, where their own noise does not count yet


def test_axes_of_accelerometers_turned_against_the_gyroscopes_are_named():
    turn = rotation.skew([0.0, 0.01, 0.0])
    run = compared(4, scales=(np.zeros((3, 3)), turn))
    (cause,) = run.accel.causes
    assert (cause.name, run.gyro.causes) == ("turn", ())
    assert holds(cause.size, 0.01)


def test_poses_that_were_made_with_the_unit_say_nothing_of_it():
    records, poses = simulated_run(5, sds=(1e-4, 1e-5))
    stated = {
        axis: replace(one, white_density=4.0 * one.white_density) for axis, one in CONFIG.channels.items()
    }
    config = replace(CONFIG, channels=stated)
    run = compare_with_poses(records, poses, config, "run")
    assert run.dependent
    assert with_run(config, run) is config


def test_errors_of_poses_that_last_are_written_in_no_setting():
    records, poses = simulated_run(6)
    rng = np.random.default_rng(6)
    drift = np.cumsum(2e-3 * rng.normal(size=(len(poses.t), 3)), axis=0)
    lasting = replace(poses, quat=rotation.quat_multiply(rotation.quat_from_rotvec(drift), poses.quat))
    run = compare_with_poses(records, lasting, CONFIG, "run")
    assert "white" in run.gyro.unexplained
    assert not run.gyro.larger


def mended(poses, rng):
    """Yield poses as recordings have them, of which the good part must be used as if nothing were."""
    place, quat = poses.place.copy(), poses.quat.copy()
    lost = slice(800, 850)
    place[lost], quat[lost] = place[800], quat[800]
    yield "frozen", replace(poses, place=place, quat=quat)
    kept = rng.random(len(poses.t)) > 0.02
    yield "dropped", Poses(poses.t[kept], poses.place[kept], poses.quat[kept])
    place, quat = poses.place.copy(), poses.quat.copy()
    flip = rotation.quat_from_rotvec(np.array([np.pi / 2.0, 0.0, 0.0]))
    place[1000, 0] += 0.2
    quat[1000] = rotation.quat_multiply(quat[1000], flip)
    yield "wild", replace(poses, place=place, quat=quat)
    quat = poses.quat.copy()
    quat[100:2300:220] = rotation.quat_multiply(quat[100:2300:220], flip)
    yield "flips", replace(poses, quat=quat)
    signs = np.where(rng.random(len(poses.t)) > 0.5, 1.0, -1.0)
    yield "signs", replace(poses, quat=signs[:, None] * poses.quat)
    yield (
        "metric",
        replace(poses, place=4.0 * poses.place + [5e5, 5e6, 0.0]),
    )  # a single camera, far from the origin


def test_wrong_poses_are_left_out_and_their_scale_is_taken_out():
    records, poses = simulated_run(9)
    for name, spoiled in mended(poses, np.random.default_rng(9)):
        run = compare_with_poses(records, spoiled, CONFIG, "run")
        assert not any(one.larger or one.causes or one.unexplained for one in run.sensors), name
        assert run.gyro.beside.reference.value == pytest.approx(3e-4, rel=0.1), name
        assert run.size.value == pytest.approx(4.0 if name == "metric" else 1.0, rel=0.01), name


def test_missing_samples_are_bridged_by_nothing():
    records, poses = simulated_run(10)
    kept = ~((records[0].t > 50.0) & (records[0].t < 50.5))
    gap = int(np.flatnonzero(~kept)[0])
    parts = ((0, gap), (gap, int(kept.sum())))
    cut = [replace(one, t=one.t[kept], y=one.y[kept], segments=parts) for one in records]
    run = compare_with_poses(cut, poses, CONFIG, "run")
    assert not any(one.larger or one.unexplained for one in run.sensors)


def test_a_run_that_turns_about_one_axis_is_refused():
    records, poses = simulated_run(11, axes=(0.0, 0.0, 1.0))
    with pytest.raises(DataError, match="about two axes or more"):
        compare_with_poses(records, poses, CONFIG, "run")


def test_stamps_that_jitter_are_no_error_of_scale():
    records, poses = simulated_run(12)
    jitter = 2e-3 * np.random.default_rng(12).normal(size=len(poses.t))
    run = compare_with_poses(records, replace(poses, t=poses.t + jitter), CONFIG, "run")
    assert run.gyro.unexplained
    assert not any(one.larger or one.causes for one in run.sensors)


def test_a_line_of_vibration_is_no_white_noise():
    records, poses = simulated_run(13)
    line = np.sin(2.0 * np.pi * 61.3 * records[0].t)[:, None]
    shaken = [replace(one, y=one.y + size * line) for one, size in zip(records, (0.05, 3.0), strict=True)]
    run = compare_with_poses(shaken, poses, CONFIG, "run")
    assert all(one.scatter == pytest.approx(1.0, abs=0.05) for one in run.sensors)
    assert not any(one.larger for one in run.sensors)


def test_a_low_pass_of_the_gyroscopes_is_named_with_its_time_constant():
    records, poses = simulated_run(14)
    share = 1.0 - np.exp(-1.0 / (RATE * 0.016))
    gyro = replace(records[0], y=lfilter([share], [1.0, share - 1.0], records[0].y, axis=0))
    run = compare_with_poses((gyro, records[1]), poses, CONFIG, "run")
    (low_pass,) = run.gyro.causes
    assert low_pass.name == "filter"
    assert np.sqrt(2.0 * low_pass.size.value) == pytest.approx(0.016, rel=0.15)
    (delay,) = run.accel.causes
    late = (1.0 - share) / share / RATE  # of the filter at low frequencies
    assert (delay.name, delay.size.value) == ("delay", pytest.approx(late, rel=0.02))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda r, p: (r[:1], p), "found no accel"),
        (lambda r, p: (r, replace(p, t=p.t + 1e4)), "samples from"),
        (lambda r, p: (r, replace(p, t=p.t[::10], place=p.place[::10], quat=p.quat[::10])), "found 235"),
        (lambda r, p: (r, replace(p, quat=p.quat[::-1])), "expected gyroscopes that turn as the poses do"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(spoil, said):
    records, poses = spoil(*simulated_run(7))
    with pytest.raises(DataError, match=said) as error:
        compare_with_poses(records, poses, CONFIG, "run")
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_intervals_hold_what_was_planted_and_sound_runs_have_no_cause():
    misses, false = 0, 0
    for seed in range(50):
        rng = np.random.default_rng(1000 + seed)
        factors = 10.0 ** rng.uniform(0.3, 1.0, 2) if seed % 2 else np.ones(2)
        run = compared(
            seed,
            factors=factors,
            sds=10.0 ** rng.uniform(-3.7, -2.3, 2),
            pose_rate=float(rng.choice([10, 20, 50, 100])),
            delay=float(rng.uniform(-0.3, 0.3)),
            turn=rng.normal(size=3),
            arm=0.1 * rng.normal(size=3),
        )
        for one, factor in zip(run.sensors, factors, strict=True):
            misses += not holds(one.factors["white"], factor) or not holds(one.factors["walk"], 1.0)
            false += bool(one.causes)
    assert misses <= 15  # of 100 pairs with two intervals of 95 % each, 10 expected
    assert false <= 2
