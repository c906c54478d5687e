"""What real recordings are known to hide is found in them, named, and has the figures that others measured."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.readers import read
from tuner.records import Record
from tuner.results import Finding

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


def test_the_hump_of_a_gyro_is_no_line() -> None:
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


def test_a_tag_in_a_refrigerator() -> None:
    """Slopes of two poses: gyro y 0.464 and 0.449 mrad/s/K, accel z 0.0239 and 0.0244 m/s²/K; moved at 38.4 h.

    Those are of straight lines; within 15 %, as far as slopes of its still parts differ among themselves.
    """
    diagnosis = diagnose(read(DATA / "cats_tag_temperature.npz"))
    slopes = {
        axis: finding.by_channel[axis]["slope"]
        for finding in named(diagnosis.findings, "temperature", "thermal_lag")
        for axis in finding.channels
    }
    for axis, published in (("gyro_y", (0.449e-3, 0.464e-3)), ("accel_z", (0.0239, 0.0244))):
        assert slopes[axis].value is not None
        assert slopes[axis].value == pytest.approx(np.mean(published), rel=0.15)
    moves = [
        (finding.parameters["start"].value or 0.0) / 3600.0 for finding in named(diagnosis.findings, "motion")
    ]
    assert any(abs(hours - 38.4) < 0.1 for hours in moves)
