"""Exporters: one configuration in the dialects of many filters, each with its own units and step.

::

    text = export(config, "kalibr")
"""

from __future__ import annotations

from models.registry import RegistryError
from tuner.exporters import (
    ardupilot,
    fastlio,
    gazebo,
    gnss_ins_sim,
    gtsam,
    kalibr,
    kf_gins,
    liosam,
    matlab,
    navego,
    openvins,
    orbslam3,
    px4,
    pyins,
    robot_localization,
    vins,
)
from tuner.exporters.dialect import DIALECTS, Dialect, Target
from tuner.formats import noise_yaml
from tuner.synthesis.equivalent_models import FILTER_MEMORY
from tuner.types import FilterConfig
from tuner.types.records import DataError

__all__ = ["DIALECTS", "Dialect", "Target", "export"]

_NATIVE = Dialect("native", "our own configuration", "SI", lambda config, _: noise_yaml.dumps(config))

DIALECTS.extend(
    (
        _NATIVE,
        kalibr.DIALECT,
        openvins.DIALECT,
        vins.DIALECT,
        orbslam3.DIALECT,
        liosam.DIALECT,
        fastlio.DIALECT,
        kf_gins.DIALECT,
        navego.DIALECT,
        gtsam.DIALECT,
        px4.DIALECT,
        ardupilot.DIALECT,
        robot_localization.DIALECT,
        gnss_ins_sim.DIALECT,
        matlab.DIALECT,
        gazebo.DIALECT,
        pyins.DIALECT,
    )
)


def export(
    config: FilterConfig,
    dialect: str,
    *,
    interval: float | None = None,
    step: float = 0.01,
    memory: float = FILTER_MEMORY,
) -> str:
    """Return a configuration as text of a dialect.

    Parameters
    ----------
    config : FilterConfig
        What to export; a sensor it lacks is left out, with a comment that says so.
    dialect : str
        A key of `DIALECTS`.
    interval : float, optional
        Sampling interval of the IMU the target reads, s; default the interval of the log.
    step : float, optional
        Prediction step of the target, s, for filters that predict at another rate than the IMU's.
    memory : float, optional
        Time over which the target renews its biases, s: where a random walk or one state stands for more.

    Raises
    ------
    DataError
        For an unknown dialect.
    """
    try:
        declared = DIALECTS[dialect]
    except RegistryError as error:
        raise DataError(str(error)) from None
    return declared.write(config, Target(interval or config.interval, step, memory))
