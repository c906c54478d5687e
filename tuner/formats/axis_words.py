"""Axes in few words."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.formats.grouping import gathered


def axes_text(axes: Sequence[str]) -> str:
    """Return axes in few words: ``gyro x y``, ``gyro x, accel z``."""
    parts = (axis.rpartition("_") for axis in axes)
    sensors = gathered((sensor or letter, letter if sensor else "") for sensor, _, letter in parts)
    return ", ".join(" ".join([sensor, *letters]).strip() for sensor, letters in sensors.items())
