"""Noise of a unit from its own drive: white noise while the vehicle stands, vibration while it moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.noise import White
from tuner.catalogue.grades import load_grade
from tuner.synthesis.from_drive import (
    ALLAN_TAU,
    UNKNOWN_UNIT_GRADE,
    config_of_drive,
    identification_of_drive,
    nearest_grade,
    receiver_of,
    stationary_noise,
)
from tuner.types.borrowed import white_is_measured
from tuner.types.records import Drive, Gnss

INTERVAL, STOOD, MOVED = 0.02, 120.0, 60.0
DENSITY = np.array([1.0, 2.0, 3.0, 10.0, 20.0, 30.0]) * 1e-4


def drive(
    *,
    velocities: bool = True,
    vertical: float = 0.0,
    stood: float = STOOD,
    seed: int = 1,
) -> Drive:
    """White noise of `DENSITY`; the antenna stands, and then moves north at 10 m/s."""
    rng = np.random.default_rng(seed)
    t = INTERVAL * np.arange(1, round((stood + MOVED) / INTERVAL) + 1)
    rates = rng.standard_normal((len(t), 6)) * DENSITY / np.sqrt(INTERVAL)
    fix_t = np.arange(0.0, stood + MOVED + 1.0)
    way = 10.0 * np.maximum(fix_t - stood, 0.0)
    llh = np.column_stack(
        [0.8 + way / 6.37e6, np.full_like(way, 0.2), 100.0 + vertical * rng.standard_normal(len(way))]
    )
    vel = np.column_stack([10.0 * (fix_t > stood), 0.0 * way, 0.0 * way])
    if not velocities:
        vel[:] = np.nan
    sd = np.tile([1.0, 2.0, 3.0], (len(way), 1))
    return Drive("made", t, rates, Gnss(fix_t, llh, vel, sd, 0.1 * sd), (0.0, 0.0, 0.0), source="made")


def test_each_axis_has_its_own_white_noise():
    """N = σ(τ) √τ: with τ = 0.25 s and 120 s each axis has at least 240 degrees of freedom, 4.6 %: five of them."""
    found = stationary_noise(drive())
    assert found.seconds == pytest.approx(STOOD, abs=0.03 * STOOD)
    assert [one.value for one in found.white.values()] == pytest.approx(list(DENSITY), rel=0.23)
    written = config_of_drive(drive(), found).channels
    assert [one.white_density for one in written.values()] == [one.value for one in found.white.values()]


def test_interval_of_the_white_noise_is_that_of_its_degrees_of_freedom():
    """The relative sd of a root of a variance with ν degrees of freedom is 1/√(2ν), ν = 2 T/τ for three axes.

    Of 120 intervals 114 hold the truth; 106 and more with 99.9 %.
    """
    found = stationary_noise(drive())
    (white,) = [
        t for t in identification_of_drive(drive(), found).channels["gyro_y"].terms if t.name == "white"
    ]
    density = white.coefficients["density"]
    share = 1.96 / np.sqrt(4.0 * found.seconds / ALLAN_TAU / 3.0)
    assert density == found.white["gyro_y"]
    assert (density.unit,) == White(1.0).units("rad/s")  # as after a log
    assert density.interval == pytest.approx((density.value * (1.0 - share), density.value * (1.0 + share)))
    ends = [[c.interval for c in stationary_noise(drive(seed=seed)).white.values()] for seed in range(20)]
    low, high = np.moveaxis(np.array(ends), 2, 0)
    assert np.count_nonzero((low < DENSITY) & (high > DENSITY)) >= 106


def test_of_noise_below_the_step_of_a_quantizer_only_a_limit_is_known():
    """It was a number with an interval of 4 %, though the samples at rest kept to one code."""
    made, step = drive(), 0.01
    rounded = np.round(made.rates[:, :3] / step) * step
    coarse = replace(made, rates=np.hstack([rounded, made.rates[:, 3:]]))
    found = stationary_noise(coarse)
    assert [axis for axis, one in found.white.items() if one.value is None] == ["gyro_x", "gyro_y", "gyro_z"]
    config = config_of_drive(coarse, found)
    limit = found.white["gyro_x"].upper
    assert config.channels["gyro_x"].white_density == pytest.approx(limit)
    assert limit > 3e-4  # that of the noisiest axis, which the codes hide
    assert config.on_limit("gyro_x") == {"white_density": 1.0}
    assert white_is_measured(config, "gyro_x")


def test_noise_scales_with_the_samples():
    one = drive()
    ten = Drive(one.name, one.imu_t, 10.0 * one.rates, one.gnss, one.lever_arm, source=one.source)
    for axis, white in stationary_noise(one).white.items():
        assert stationary_noise(ten).white[axis].value == pytest.approx(10.0 * white.value, rel=1e-9)


def test_heights_do_not_count_where_positions_stand_for_a_speed():
    """Heights that scatter by 5 m, level positions that do not: the vehicle stands."""
    found = stationary_noise(drive(velocities=False, vertical=5.0))
    assert found.seconds == pytest.approx(STOOD, abs=0.05 * STOOD)


def test_a_few_seconds_of_standing_tell_nothing():
    made = drive(stood=4.0)
    found = stationary_noise(made)
    assert found.white == {}
    assert found.seconds < 5.0
    assert UNKNOWN_UNIT_GRADE in identification_of_drive(made, found).notes[0]


@pytest.mark.parametrize("name", ["mpu9250", "stim300", "adis16465"])
def test_the_nearest_grade_to_a_grade_is_itself(name):
    grade = load_grade(name)
    assert (
        nearest_grade({"gyro": 1.02 * grade.gyro.white.value, "accel": 0.98 * grade.accel.white.value})
        == name
    )


def test_a_receiver_that_reports_its_errors_is_what_it_reports():
    receiver = receiver_of(drive())
    assert receiver.position_sd == (1.0, 2.0, 3.0)
    assert receiver.velocity_sd == pytest.approx((0.1, 0.2, 0.3))
    assert receiver.interval == 1.0
    assert receiver.correlated == ()
