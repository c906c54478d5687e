"""Known causes in real recordings are found, named, and have the values that others measured."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.readers import read
from tuner.types import Finding
from tuner.types.records import Record

DATA = Path(os.environ.get("TUNER_DATA", "")) / "static"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (DATA / "cats_tag_temperature.npz").exists(),
        reason="TUNER_DATA does not name a folder with recordings",
    ),
]


def alone(record: Record, axis: str) -> Record:
    """Return one axis of a record."""
    return replace(record, y=record.column(axis)[:, None], axes=(axis,))


def named(findings: tuple[Finding, ...], *causes: str) -> list[Finding]:
    return [finding for finding in findings if finding.cause in causes]


def test_the_resonance_of_a_gyro_is_no_line() -> None:
    """ADIS16405 gyro z: 19.3 … 20.3 Hz, about 1 Hz wide (recordings' index)."""
    gyro, _ = read(DATA / "adis16405_run1.npz")
    near = [
        finding.cause
        for finding in named(diagnose(alone(gyro, "gyro_z")).findings, "vibration", "line")
        if 19.0 < (finding.parameters["frequency"].value or 0.0) < 20.8
    ]
    assert near == ["vibration"]


def test_the_slow_resonance_of_the_accelerometers() -> None:
    """ADIS16405: a feature at 0.54 … 0.57 Hz."""
    _, accel = read(DATA / "adis16405_run1.npz")
    found = named(diagnose(alone(accel, "accel_x")).findings, "vibration", "line")
    assert any(0.53 < (finding.parameters["frequency"].value or 0.0) < 0.58 for finding in found)


def lines(record: Record, axis: str, parts: tuple[tuple[float, float], ...]) -> list[float]:
    """Return the slope over temperature of a straight line in each part, hours."""
    hours, kelvin = (record.t - record.t[0]) / 3600.0, record.covariates["temperature"]
    inside = [(hours > first) & (hours < last) for first, last in parts]
    return [float(np.polyfit(kelvin[part], record.column(axis)[part], 1)[0]) for part in inside]


def test_a_tag_in_a_refrigerator() -> None:
    """Slopes of two poses: gyro y 0.464 and 0.449 mrad/s/K, accel z 0.0239 and 0.0244 m/s²/K; moved at 38.4 h.

    Those are of straight lines over all of a pose. Of its three still parts the lines differ, accel z from 0.0224 to
    0.0301: what counts is a slope among them.
    """
    sensors = read(DATA / "cats_tag_temperature.npz")
    diagnosis = diagnose(sensors)
    slopes = {
        axis: finding.by_channel[axis]["slope"]
        for finding in named(diagnosis.findings, "temperature", "thermal_lag")
        for axis in finding.channels
    }
    still = ((0.2, 25.6), (26.1, 38.3), (38.5, 51.0))
    for record, axis, published in (
        (sensors[0], "gyro_y", (0.449e-3, 0.464e-3)),
        (sensors[1], "accel_z", (0.0239, 0.0244)),
    ):
        among = lines(record, axis, still)
        assert min(among) < np.mean(published) < max(among)
        assert slopes[axis].value is not None
        assert min(among) < slopes[axis].value < max(among)
    moves = [
        (finding.parameters["start"].value or 0.0) / 3600.0 for finding in named(diagnosis.findings, "motion")
    ]
    assert any(abs(hours - 38.4) < 0.1 for hours in moves)
