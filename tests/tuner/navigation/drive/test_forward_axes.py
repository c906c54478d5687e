"""Axes of a vehicle by its motion: of one that moves along its axis, and none of one that flies to all sides."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from models import rotation
from tuner.navigation.drive.vehicle_constraints import forward_axes


@pytest.mark.parametrize(("spread", "known"), [(10.0, True), (70.0, False), (180.0, False)])
def test_a_vehicle_that_flies_to_all_sides_has_no_forward_axis(spread, known):
    rng = np.random.default_rng(4)
    course = np.linspace(0.0, 6.0, 400)
    yaw = course + np.radians(30.0) + np.radians(spread) * rng.uniform(-1.0, 1.0, 400)
    vel = 8.0 * np.column_stack([np.cos(course), np.sin(course), 0.0 * course])
    quat = rotation.quat_from_rpy(np.column_stack([0.0 * yaw, 0.0 * yaw, yaw]))
    axes = forward_axes(SimpleNamespace(state=SimpleNamespace(vel_n=vel, quat_nb=quat)))
    assert (axes is not None) == known
    if axes is not None:
        found = np.degrees(np.arctan2(axes[1, 0], axes[0, 0]))
        assert found == pytest.approx(-30.0, abs=2.0)  # half of the spread over the root of 400
