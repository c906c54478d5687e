"""Axes in few words."""

from __future__ import annotations

from collections.abc import Sequence


def axes_text(axes: Sequence[str]) -> str:
    """Return axes in few words: ``gyro x y``, ``gyro x, accel z``."""
    sensors: dict[str, list[str]] = {}
    for axis in axes:
        sensor, _, letter = axis.rpartition("_")
        sensors.setdefault(sensor or letter, []).append(letter if sensor else "")
    return ", ".join(" ".join([sensor, *letters]).strip() for sensor, letters in sensors.items())
