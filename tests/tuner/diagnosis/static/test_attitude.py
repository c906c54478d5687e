"""A mount that tilts during a part of a record: found, named, distinguished from a change of scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes import attitude, mount_tilt
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.simulation.static import Channel, simulate
from tuner.types.records import Record

SPAN, RATE = 1200.0, 25.0
NOISE = NoiseModel((White(1e-3), BiasInstability(1e-4), RandomWalk(3e-6)))
AXES = ("accel_x", "accel_y", "accel_z")
BEGIN, LENGTH = 400.0, 300.0


def record(rest: tuple[float, float, float], change: tuple[float, float, float], seed: int = 5) -> Record:
    """Three accelerometers at rest whose level moves by `change` between two times."""
    clean = simulate(dict.fromkeys(AXES, Channel(NOISE)), duration=SPAN, rate=RATE, seed=seed)[0][0]
    course = np.clip((clean.t - clean.t[0] - BEGIN) / LENGTH, 0.0, 1.0)
    return replace(
        clean, y=clean.y - clean.y.mean(axis=0) + np.array(rest) + course[:, None] * np.array(change)
    )


def test_a_tilt_is_named_and_measured():
    # 3 mrad are some 250 nats: the chance to miss them is far below 1e-6
    diagnosis = diagnose(record((0.1, 0.2, 9.8), (0.0, 0.03, 0.0)))
    (finding,) = diagnosis.findings
    assert (finding.cause, finding.channels) == ("attitude", ("accel_y",))
    assert not diagnosis.unexplained
    truth = {"tilt": 0.03 / mount_tilt.STANDARD_GRAVITY, "start": BEGIN, "duration": LENGTH}
    for name, value in truth.items():
        low, high = finding.parameters[name].interval
        # three times the 95 % interval about the estimate: 6 sd
        assert abs(finding.parameters[name].value - value) < 1.5 * (high - low), name


def test_an_oblique_mount_turns_in_two_axes_at_once():
    turn = 4e-3 * 9.8 * np.sqrt(0.5)
    diagnosis = diagnose(record((0.1, 6.93, 6.93), (0.0, turn, -turn)))
    (finding,) = diagnosis.findings
    assert (finding.cause, finding.channels) == ("attitude", ("accel_y", "accel_z"))
    assert not diagnosis.unexplained


def test_a_force_that_grows_is_no_tilt():
    # the same move in both axes: 0.04 m/s² along gravity, deviation below 2e-3
    diagnosis = diagnose(record((0.1, 6.93, 6.93), (0.0, 0.028, 0.028)))
    assert "attitude" not in {f.cause for f in diagnosis.findings}
    assert any("changes its length" in u.statistic for u in diagnosis.unexplained)


def test_a_gyro_has_no_tilt():
    clean = simulate({"gyro_x": Channel(NOISE)}, duration=SPAN, rate=RATE, seed=5)[0][0]
    assert mount_tilt.MountTilt.test(fit_channel(channel(clean, "gyro_x"))) is None


@pytest.mark.parametrize("walk", [0.0, 2e-5])
def test_chance_of_a_tilt_in_clean_records(walk):
    # 24 records at p < 1e-3: four rejections have a chance of 1e-8
    noise = NoiseModel((White(1e-3), BiasInstability(1e-4), *((RandomWalk(walk),) if walk else ())))
    low = 0
    for seed in range(24):
        clean = simulate({"accel_x": Channel(noise)}, duration=600.0, rate=RATE, seed=seed)[0][0]
        result = mount_tilt.MountTilt.test(fit_channel(channel(clean, "accel_x")))
        low += result is not None and result.p_value < 1e-3
    assert low < 4


def test_the_angle_of_an_even_tilt_is_as_well_known_as_its_ramps():
    """White noise N holds a change over a span T with the variance 12 N²/T; slow noise unseen adds to it."""
    density, changes = 1e-3, np.array([0.4, 0.3])
    sensor = Channel(NoiseModel((White(density),)))
    clean = simulate(dict.fromkeys(AXES, sensor), duration=SPAN, rate=RATE, seed=5)[0][0]
    place = (clean.t - clean.t[0]) / SPAN - 0.5
    across = place[:, None] * changes
    along = np.sqrt(9.8**2 - np.sum(across**2, axis=1))
    tilted = replace(clean, y=clean.y - clean.y.mean(axis=0) + np.column_stack((across, along)))
    found = attitude.test({axis: fit_channel(channel(tilted, axis)) for axis in AXES}, 1e-3)
    low, high = found.tilt.interval
    assert abs(found.tilt.value - 0.5 / 9.8) < 1e-3 * 0.5 / 9.8 + high - low
    least = 2.0 * 1.96 * np.sqrt(2.0 * 12.0 / SPAN) * density / 9.8
    assert 0.8 * least < high - low < 4.0 * least
