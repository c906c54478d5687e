"""Built-in trajectories by name."""

from __future__ import annotations

from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import Trajectory
from tuner.types.records import DataError


def load_trajectory(name: str, duration: float) -> Trajectory:
    """Return a built-in trajectory of a duration, s.

    Raises
    ------
    DataError
        For an unknown name.
    """
    if name not in TRAJECTORIES:
        raise DataError(f"trajectory {name}: expected one of {' '.join(TRAJECTORIES)}")
    return TRAJECTORIES[name](duration)
