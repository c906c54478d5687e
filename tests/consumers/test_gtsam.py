"""GTSAM itself: its preintegration with an exported script, against closed forms and against a Monte Carlo."""

from __future__ import annotations

from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from models.units import STANDARD_GRAVITY as G
from tests.consumers.examples import EXAMPLES, text_of
from tests.consumers.filters import FILTERS, STEP

gtsam = pytest.importorskip("gtsam", reason="GTSAM is not installed (pip install gtsam)")
REST = np.array([0.0, 0.0, G])


def script(example: str) -> SimpleNamespace:
    """Run the exported Python."""
    module = ModuleType("exported")
    exec(text_of(example, "gtsam"), module.__dict__)
    return SimpleNamespace(**module.__dict__)


def at_rest(example: str, horizon: float) -> np.ndarray:
    """Return the covariance that GTSAM predicts after some time at rest: rotation, position, velocity, biases."""
    measured = gtsam.PreintegratedCombinedMeasurements(script(example).params(), gtsam.imuBias.ConstantBias())
    for _ in range(round(horizon / STEP)):
        measured.integrateMeasurement(REST, np.zeros(3), STEP)
    return measured.preintMeasCov()


@pytest.mark.parametrize("horizon", [1.0, 10.0, 60.0])
def test_predicted_variances_are_those_of_white_noise_and_walk(horizon: float) -> None:
    covariance = at_rest("walk", horizon)
    gyro, accel = (EXAMPLES["walk"]().channels[name] for name in ("gyro_z", "accel_z"))
    n_g, k_g = gyro.white_density**2, gyro.random_walk_density**2
    n_a, k_a = accel.white_density**2, accel.random_walk_density**2
    t = horizon
    angle = n_g * t + k_g * t**3 / 3.0
    down = n_a * t + k_a * t**3 / 3.0
    sideways = down + G**2 * (n_g * t**3 / 3.0 + k_g * t**5 / 20.0)
    height = n_a * t**3 / 3.0 + k_a * t**5 / 20.0
    assert np.sqrt(np.diag(covariance)[:3] / angle) == pytest.approx(np.ones(3), abs=0.03)
    # GTSAM orders rotation, position, velocity; sums over steps differ from integrals by dt/t.
    assert np.sqrt(covariance[8, 8] / down) == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(np.diag(covariance)[6:8] / sideways) == pytest.approx(np.ones(2), abs=0.03)
    assert np.sqrt(covariance[5, 5] / height) == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(np.diag(covariance)[9:12] / (k_a * t)) == pytest.approx(np.ones(3), abs=1e-3)
    assert np.sqrt(np.diag(covariance)[12:15] / (k_g * t)) == pytest.approx(np.ones(3), abs=1e-3)


def test_predicted_spread_is_that_of_integrated_noise() -> None:
    params, runs, steps = script("walk").params(), 300, 200
    rng = np.random.default_rng(3)
    gyro, accel = (EXAMPLES["walk"]().channels[name] for name in ("gyro_z", "accel_z"))

    def noise(channel) -> np.ndarray:
        walk = (
            channel.random_walk_density * np.sqrt(STEP) * rng.standard_normal((runs, steps, 3)).cumsum(axis=1)
        )
        return walk + channel.white_density / np.sqrt(STEP) * rng.standard_normal((runs, steps, 3))

    turning, pushing = noise(gyro), noise(accel)
    found = []
    for run in range(runs):
        measured = gtsam.PreintegratedCombinedMeasurements(params, gtsam.imuBias.ConstantBias())
        for rate, force in zip(turning[run], pushing[run], strict=True):
            measured.integrateMeasurement(REST + force, rate, STEP)
        # A frame that rests: the increments that gravity makes are G t and G t²/2 upwards.
        rotation = gtsam.Rot3.Logmap(measured.deltaRij())
        found.append(np.concatenate([rotation, measured.deltaPij(), measured.deltaVij()]))
    t = steps * STEP
    truth = np.array([0.0, 0.0, 0.0, 0.0, 0.0, G * t**2 / 2.0, 0.0, 0.0, G * t])
    drawn = ((np.array(found) - truth) ** 2).mean(axis=0)
    predicted = np.diag(at_rest("walk", t))[:9]
    # A variance from 300 runs has a relative sd of √(2/300): its root 4 %, five of them 20 %.
    assert np.sqrt(predicted / drawn) == pytest.approx(np.ones(9), abs=5.0 / np.sqrt(2.0 * runs))


@pytest.mark.parametrize("dialect", ["liosam", "liosam-ros2", "lvi-sam", "kimera-vio", "dm-vio"])
@pytest.mark.parametrize("horizon", [0.1, 0.5])
def test_programs_on_its_imu_factor_predict_as_modelled(dialect: str, horizon: float) -> None:
    # They set N² as covariances, and between two frames a walk of the bias of K √Δt: the horizon is that of frames.
    program = next(program for program in FILTERS if program.dialect == dialect)
    gyro, accel = (program.step(text_of("walk", dialect), sensor) for sensor in ("gyro", "accel"))
    params = gtsam.PreintegrationParams.MakeSharedU(G)
    params.setGyroscopeCovariance(gyro.angle / STEP * np.eye(3))
    params.setAccelerometerCovariance(accel.angle / STEP * np.eye(3))
    params.setIntegrationCovariance(1e-12 * np.eye(3))
    measured = gtsam.PreintegratedImuMeasurements(params, gtsam.imuBias.ConstantBias())
    for _ in range(round(horizon / STEP)):
        measured.integrateMeasurement(REST, np.zeros(3), STEP)
    predicted = np.diag(measured.preintMeasCov())
    channels = EXAMPLES["walk"]().channels
    assert np.sqrt(predicted[2] / (channels["gyro_z"].white_density ** 2 * horizon)) == pytest.approx(
        1.0, abs=0.03
    )
    assert np.sqrt(predicted[8] / (channels["accel_z"].white_density ** 2 * horizon)) == pytest.approx(
        1.0, abs=0.03
    )
    assert np.sqrt(gyro.bias / STEP) == pytest.approx(channels["gyro_z"].random_walk_density, rel=1e-5)


def test_the_turn_on_is_a_prior_of_the_first_bias() -> None:
    prior = script("walk").bias_prior()
    channels = EXAMPLES["walk"]().channels
    expected = [channels[f"{sensor}_{axis}"].constant_sd for sensor in ("accel", "gyro") for axis in "xyz"]
    assert prior.sigmas() == pytest.approx(expected)
