"""Exporters: one configuration in the dialects of many filters, each with its own units and step.

::

    text = export(config, "kalibr")
"""

from __future__ import annotations

from pathlib import Path

from models.registry import RegistryError
from tuner.exporters import (
    airsim,
    ardupilot,
    basalt,
    dm_vio,
    fast_livo2,
    fastlio,
    fifteen_state,
    gazebo,
    ginav,
    gnss_ins_sim,
    gtsam,
    isaac_visual_slam,
    kalibr,
    kf_gins,
    kimera_vio,
    liosam,
    lvi_sam,
    matlab,
    mins,
    navego,
    ob_gins,
    okvis2,
    openvins,
    orbslam3,
    point_lio,
    psins,
    px4,
    pyins,
    robot_localization,
    rotors,
    vins,
)
from tuner.exporters.dialect import DIALECTS, Dialect, Target
from tuner.exporters.header import SENSORS
from tuner.exporters.triad_values import triad
from tuner.exporters.withheld import NATIVE_DIALECT, withheld
from tuner.formats import noise_yaml
from tuner.synthesis.load_config import load_config
from tuner.types import FilterConfig
from tuner.types.number_ranges import Positive
from tuner.types.public import public
from tuner.types.records import DataError

__all__ = ["DIALECTS", "Dialect", "Target", "export", "lacking", "text_of", "withheld"]

_NATIVE = Dialect(
    NATIVE_DIALECT, "our own configuration", "SI", lambda config, _: noise_yaml.dumps(config), needs=()
)

DIALECTS.extend(
    (
        _NATIVE,
        kalibr.DIALECT,
        openvins.DIALECT,
        mins.DIALECT,
        vins.DIALECT,
        okvis2.DIALECT,
        basalt.DIALECT,
        isaac_visual_slam.DIALECT,
        kimera_vio.DIALECT,
        dm_vio.DIALECT,
        orbslam3.DIALECT,
        orbslam3.UNVERSIONED,
        liosam.DIALECT,
        liosam.ROS2,
        lvi_sam.LIDAR,
        lvi_sam.CAMERA,
        fastlio.DIALECT,
        fastlio.ROS2,
        fast_livo2.DIALECT,
        point_lio.DIALECT,
        kf_gins.DIALECT,
        ob_gins.DIALECT,
        ginav.DIALECT,
        psins.DIALECT,
        navego.DIALECT,
        gtsam.DIALECT,
        fifteen_state.DIALECT,
        px4.DIALECT,
        ardupilot.DIALECT,
        robot_localization.DIALECT,
        gnss_ins_sim.DIALECT,
        matlab.DIALECT,
        gazebo.DIALECT,
        rotors.DIALECT,
        airsim.DIALECT,
        pyins.DIALECT,
    )
)


@public("export")
def export(
    config: FilterConfig | str | Path,
    dialect: str,
    *,
    interval: Positive | None = None,
    step: Positive | None = None,
) -> str:
    """Return a configuration as text of a dialect.

    Parameters
    ----------
    config : FilterConfig, str or Path
        What to export: the settings, their file or the name of a built-in grade. A sensor it lacks is left out, with a
        comment that says so, where the settings of the other stand alone.
    dialect : str
        A key of `DIALECTS`.
    interval : float, optional
        Sampling interval of the IMU the target reads, s; default the interval of the log.
    step : float, optional
        Prediction step of the target, s, for filters that predict at another rate than the IMU's; default the
        target's own.

    Raises
    ------
    DataError
        For an unknown dialect, a sensor that the target cannot do without, an axis without white noise, settings that
        are `withheld`, and an interval or a step that is not positive.
    """
    if not isinstance(config, FilterConfig):
        config = load_config(config)
    declared = _expect_complete(config, dialect)
    if why := withheld(config, dialect):
        raise DataError(f"{config.name}: nothing is written for {dialect}: {why}")
    return declared.write(config, declared.target(config, interval, step))


def text_of(config: FilterConfig, dialect: str, interval: float | None = None) -> str:
    """Return a configuration as text for a program that is run at once and judged, whatever its numbers rest on."""
    declared = _expect_complete(config, dialect)
    return declared.write(config, declared.target(config, interval))


def _expect_complete(config: FilterConfig, name: str) -> Dialect:
    """Return a dialect; refuse a configuration that lacks a sensor it needs, or white noise."""
    declared = dialect_named(name)
    if missing := lacking(config, declared):
        raise DataError(
            f"{config.name}: {name} needs gyroscopes and accelerometers, found no {missing[0]}; "
            "`tuner tune LOG --complete GRADE` fills them in from a built-in grade"
        )
    silent = [axis for axis, channel in config.channels.items() if not channel.white_density > 0.0]
    if silent and name != NATIVE_DIALECT:
        raise DataError(
            f"{config.name}: {name}: expected white noise of {silent[0]} above 0, found 0, by which "
            "filters divide: set white_density in noise.yaml, at least to that of its data sheet"
        )
    return declared


def dialect_named(name: str) -> Dialect:
    """Return the dialect of a name; an unknown one is refused in one line that lists them."""
    try:
        return DIALECTS[name]
    except RegistryError as error:
        raise DataError(str(error)) from None


def lacking(config: FilterConfig, dialect: Dialect) -> list[str]:
    """Return the sensors, in words, that a dialect needs and a configuration lacks."""
    return [name for sensor, name in SENSORS.items() if sensor in dialect.needs and not triad(config, sensor)]
