"""Exporters: one configuration in the dialects of many filters, each with its own units and step.

::

    text = export(config, "kalibr")
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

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
from tuner.exporters.dialect import Exporter, Target
from tuner.formats import native
from tuner.synthesis.equivalent_models import MEMORY
from tuner.types import FilterConfig
from tuner.types.records import DataError

__all__ = ["DIALECTS", "Exporter", "Target", "export"]

_NATIVE = Exporter("native", "our own configuration", "SI", lambda config, _: native.dumps(config))
_OTHERS = (
    kalibr,
    openvins,
    vins,
    orbslam3,
    liosam,
    fastlio,
    kf_gins,
    navego,
    gtsam,
    px4,
    ardupilot,
    robot_localization,
    gnss_ins_sim,
    matlab,
    gazebo,
    pyins,
)

DIALECTS: Mapping[str, Exporter] = MappingProxyType(
    {exporter.name: exporter for exporter in (_NATIVE, *(module.EXPORTER for module in _OTHERS))}
)
"""Every dialect by name."""


def export(
    config: FilterConfig,
    dialect: str,
    *,
    interval: float | None = None,
    step: float = 0.01,
    memory: float = MEMORY,
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
    if dialect not in DIALECTS:
        msg = f"dialect: expected one of {' '.join(DIALECTS)}, got {dialect!r}"
        raise DataError(msg)
    return DIALECTS[dialect].write(config, Target(interval or config.interval, step, memory))
