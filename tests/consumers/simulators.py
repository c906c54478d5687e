"""What each simulator that reads an export draws from its numbers: Allan variances of its samples, from its source."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.noise import BiasInstability, GaussMarkov
from models.units import to_si
from tests.consumers.filters import STEP
from tests.consumers.numbers import from_assignments, from_json, from_xml


@dataclass(frozen=True)
class Simulator:
    """A program that draws: from the text of an export and a sensor to the Allan variance of its samples."""

    dialect: str
    keys: str
    use: str
    allan_variance: Callable[[str, str, np.ndarray], np.ndarray]
    run: str = ""


def _one_state(density: float, driving: float, time: float, tau: np.ndarray) -> np.ndarray:
    state = GaussMarkov(driving * math.sqrt(time / 2.0), time)
    return density**2 / tau + state.allan_variance(tau, interval=STEP)


def _gnss_ins_sim(text: str, sensor: str, tau: np.ndarray) -> np.ndarray:
    v = from_assignments(text)
    if sensor == "gyro":
        n, sd = to_si(v["gyro_arw"][0], "deg/sqrt(h)"), to_si(v["gyro_b_stability"][0], "deg/h")
    else:
        n, sd = v["accel_vrw"][0] / 60.0, v["accel_b_stability"][0]
    time = v[f"{sensor}_b_corr"][0]
    return _one_state(n, sd * math.sqrt(2.0 / time), time, tau)


def _gazebo(text: str, sensor: str, tau: np.ndarray) -> np.ndarray:
    element = {"gyro": "angular_velocity", "accel": "linear_acceleration"}[sensor]
    v = from_xml(text, f"{element}/x/noise")
    density = v["stddev"] * math.sqrt(STEP)
    return _one_state(density, v["dynamic_bias_stddev"], v["dynamic_bias_correlation_time"], tau)


def _rotors(text: str, sensor: str, tau: np.ndarray) -> np.ndarray:
    v, name = from_xml(text, "."), {"gyro": "gyroscope", "accel": "accelerometer"}[sensor]
    return _one_state(v[f"{name}NoiseDensity"], v[f"{name}RandomWalk"], v[f"{name}BiasCorrelationTime"], tau)


def _airsim(text: str, sensor: str, tau: np.ndarray) -> np.ndarray:
    v, g = from_json(text, "DefaultSensors", "Imu"), 9.80665
    if sensor == "gyro":
        n, sd = to_si(v["AngularRandomWalk"], "deg/sqrt(h)"), to_si(v["GyroBiasStability"], "deg/h")
        walk = sd / math.sqrt(v["GyroBiasStabilityTau"])
    else:
        n = v["VelocityRandomWalk"] * g / 1e3
        walk = v["AccelBiasStability"] * 1e-6 * g / math.sqrt(v["AccelBiasStabilityTau"])
    return n**2 / tau + walk**2 * tau / 3.0


def _matlab(text: str, sensor: str, tau: np.ndarray) -> np.ndarray:
    v = from_assignments(text.split("imu.Accelerometer")[0 if sensor == "gyro" else 1])
    found = v["NoiseDensity"][0] ** 2 / tau + v["RandomWalk"][0] ** 2 * tau / 3.0
    if v["BiasInstability"][0]:
        found = found + BiasInstability(v["BiasInstability"][0]).allan_variance(tau)
    return found


SIMULATORS = (
    Simulator(
        "gnss-ins-sim",
        "gyro_arw gyro_b_stability gyro_b_corr accel_vrw accel_b_stability accel_b_corr",
        "Aceinna/gnss-ins-sim gnss_ins_sim/pathgen/pathgen.py:496, 583–590",
        _gnss_ins_sim,
        run="its gyro_gen, acc_gen: 0.98 to 1.01 of the formula, 1 to 30 s; test_python.py",
    ),
    Simulator(
        "gazebo",
        "stddev dynamic_bias_stddev dynamic_bias_correlation_time",
        "gazebosim/gz-sensors src/GaussianNoiseModel.cc:114–139",
        _gazebo,
    ),
    Simulator(
        "rotors",
        "gyroscopeNoiseDensity gyroscopeBiasRandomWalk gyroscopeBiasCorrelationTime "
        "accelerometerNoiseDensity accelerometerRandomWalk accelerometerBiasCorrelationTime",
        "ethz-asl/rotors_simulator gazebo_imu_plugin.cpp:95, 221–239",
        _rotors,
    ),
    Simulator(
        "airsim",
        "AngularRandomWalk GyroBiasStability GyroBiasStabilityTau "
        "VelocityRandomWalk AccelBiasStability AccelBiasStabilityTau",
        "microsoft/AirSim AirLib/include/sensors/imu/ImuSimple.hpp (addNoise)",
        _airsim,
    ),
    Simulator(
        "matlab",
        "NoiseDensity BiasInstability RandomWalk",
        "MathWorks imuSensor, reference page (code not public)",
        _matlab,
    ),
)
"""Every simulator a dialect is written for."""
