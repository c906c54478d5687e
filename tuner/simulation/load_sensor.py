"""A simulated inertial unit by the file of a configuration or by the name of a built-in grade."""

from __future__ import annotations

from pathlib import Path

from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_names, load_grade
from tuner.readers.source_kind import is_file
from tuner.simulation.imu import Sensor, sensor_of_config, sensor_of_grade
from tuner.synthesis.load_config import load_config
from tuner.types import GnssNoise


def load_sensor(source: str | Path) -> tuple[Sensor, GnssNoise | None]:
    """Return the inertial unit a source stands for, and the receiver where the source names one.

    Parameters
    ----------
    source : str or Path
        A noise.yaml, a kf-gins.yaml, a datasheet, or the name of a built-in grade.

    Raises
    ------
    DataError
        If the source is none of these.
    """
    if source in grade_names() and not is_file(source):
        return sensor_of_grade(load_grade(str(source))), None
    config = load_config(source, default_gnss=DEFAULT_RECEIVER)
    return sensor_of_config(config), config.gnss
