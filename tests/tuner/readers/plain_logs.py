"""A small log of a unit at rest as rows of text, and what its readers say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tuner.readers import read
from tuner.types.records import DataError

COUNT = 1000
T = 0.01 * np.arange(COUNT)
_RNG = np.random.default_rng(2)
GYRO = _RNG.normal(0.0, 1e-2, (COUNT, 3))
ACCEL = _RNG.normal(0.0, 0.02, (COUNT, 3)) + np.array([0.1, -0.2, 9.8])
HEADER = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


def rows(t: np.ndarray = T, gyro: np.ndarray = GYRO, accel: np.ndarray = ACCEL) -> list[str]:
    return [",".join(repr(v) for v in row) for row in np.column_stack([t, gyro, accel]).tolist()]


def write(path: Path, lines: list[str], header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def refused(path: Path, pattern: str, **options: object) -> str:
    with pytest.raises(DataError, match=pattern) as caught:
        read(path, **options)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    return message


def notes(path: Path, **options: object) -> str:
    return "; ".join(read(path, **options)[0].notes)  # type: ignore[arg-type]
