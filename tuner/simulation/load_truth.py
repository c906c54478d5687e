"""A simulated installation by the file of a configuration or by the name of a built-in grade."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_names, load_grade
from tuner.navigation.settings import filter_settings
from tuner.readers.source_kind import is_file
from tuner.simulation.imu import Sensor, sensor_of_config, sensor_of_grade
from tuner.synthesis.load_config import load_config
from tuner.types import Compensation, FilterConfig, GnssNoise
from tuner.types.compensation import Parameter


@dataclass(frozen=True)
class Truth:
    """What is simulated: a unit, a receiver, the start that an alignment gives, the installation.

    Attributes
    ----------
    sensor : Sensor
        The inertial unit.
    receiver : GnssNoise or None
        None where the source names none.
    start_sd : ndarray, shape (9,), or None
        Errors of position, velocity and attitude at the start, that an alignment with this unit and receiver leaves;
        None, or NaN, where the source does not say.
    compensation : Compensation or None
        What is known of lever arm and clock; None where the source says nothing of an installation.
    """

    sensor: Sensor
    receiver: GnssNoise | None = None
    start_sd: FloatArray | None = None
    compensation: Compensation | None = None


def load_truth(source: FilterConfig | Sensor | str | Path) -> Truth:
    """Return what a source stands for.

    Parameters
    ----------
    source : FilterConfig, Sensor, str or Path
        A configuration, a noise.yaml, a kf-gins.yaml, a datasheet, or the name of a built-in grade, or the unit itself.

    Raises
    ------
    DataError
        If the source is none of these.
    """
    if isinstance(source, Sensor):
        return Truth(source)
    if isinstance(source, str | Path) and source in grade_names() and not is_file(source):
        config = load_config(str(source))
        start = np.full(9, np.nan)
        start[6:] = config.initial.tilt, config.initial.tilt, config.initial.heading
        return Truth(sensor_of_grade(load_grade(str(source))), start_sd=start)
    config = (
        source if isinstance(source, FilterConfig) else load_config(source, default_gnss=DEFAULT_RECEIVER)
    )
    start = filter_settings(config).initial_sd[:9]
    return Truth(sensor_of_config(config), config.gnss, start, config.compensation)


def installation(
    truth: Compensation | None, configured: Compensation
) -> tuple[tuple[float, float, float], float]:
    """Return by how much lever arm, m, and delay of the fixes, s, of a truth are larger than those configured.

    A truth that says nothing of an installation has that of the configuration.
    """
    if truth is None:
        return (0.0, 0.0, 0.0), 0.0

    def more(cause: str, name: str) -> float:
        parameter = Parameter(cause, name)
        return truth.get(parameter, 0.0) - configured.get(parameter, 0.0)

    arm = (more("lever_arm", "x"), more("lever_arm", "y"), more("lever_arm", "z"))
    return arm, more("time_offset", "delay")
