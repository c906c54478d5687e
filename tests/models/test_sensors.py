"""Sensor grades name their sources and give the noise of an axis."""

from __future__ import annotations

import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, White
from models.sensors import SensorGrade, Sourced, TriadGrade

SHEET = "made-up data sheet, table 1"
GYRO = TriadGrade(
    "gyro",
    white=Sourced(1e-4, SHEET),
    bias_instability=Sourced(2e-5, SHEET),
    gauss_markov=(Sourced(GaussMarkov(1e-4, 300.0), SHEET),),
    turn_on_sd=Sourced(1e-2, SHEET),
)
ACCEL = TriadGrade("accel", white=Sourced(1e-3, SHEET))


def test_noise_of_an_axis():
    grade = SensorGrade("example1", "Example", Sourced(100.0, SHEET), GYRO, ACCEL)
    assert grade.noise_model("gyro") == White(1e-4) + BiasInstability(2e-5) + GaussMarkov(1e-4, 300.0)
    assert grade.noise_model("accel") == NoiseModel([White(1e-3)])
    assert (GYRO.unit, ACCEL.unit) == ("rad/s", "m/s^2")


def test_no_number_without_a_source():
    with pytest.raises(ValueError, match="'reference' must name the source"):
        Sourced(1.0, " ")
    with pytest.raises(ValueError, match="'reference' must name the source"):
        Sourced(GaussMarkov(1.0, 1.0), "")


def test_errors_say_what_was_expected():
    with pytest.raises(ValueError, match="'kind' must be one of gyro, accel, got 'magnetometer'"):
        TriadGrade("magnetometer")
    with pytest.raises(ValueError, match="'key' must be lower-case letters and digits"):
        SensorGrade("MPU-9250", "x", Sourced(100.0, SHEET), GYRO, ACCEL)
    with pytest.raises(ValueError, match="'gyro' must hold a triad of that kind"):
        SensorGrade("x1", "x", Sourced(100.0, SHEET), ACCEL, GYRO)
