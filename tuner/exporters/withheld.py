"""What may be written for a program, and if not, why: the one place that decides it.

What is withheld is not written beside a warning: a file is loaded, its comments are not read.
"""

from __future__ import annotations

from typing import Literal

from tuner.exporters.triad_values import triad
from tuner.synthesis.sufficient import why_insufficient, why_undetermined
from tuner.types import FilterConfig
from tuner.types.borrowed import borrowed, white_is_measured

NATIVE_DIALECT = "native"
"""Name of our own dialect, the only one whose file marks what is assumed."""
AutopilotSetting = Literal["white", "walk", "turn_on"]
"""What a parameter of an autopilot is made from: white noise, wander of the bias, its sd at switch-on."""


def withheld(config: FilterConfig, dialect: str = NATIVE_DIALECT) -> str | None:
    """Return why no settings may be written from a configuration, in one line; None where they may.

    Parameters
    ----------
    config : FilterConfig
        What is to be written.
    dialect : str, optional
        For which program: what is ASSUMED of a bias that no log or sheet shows is written in our own file alone.
    """
    return why_insufficient(config) or (None if dialect == NATIVE_DIALECT else why_undetermined(config))


def keep_stock(
    config: FilterConfig, sensor: str, setting: AutopilotSetting, value: float, stock: float
) -> str | None:
    """Return why a parameter of an autopilot keeps its stock value; None where that of the configuration is loaded.

    Stock values leave room for the vibration and the temperatures of a flight. A smaller one is loaded only where
    the noise was measured in motion; a larger one where it was measured at all.

    Parameters
    ----------
    config : FilterConfig
        Settings.
    sensor : str
        ``gyro`` or ``accel``.
    setting : str
        What the parameter is made from.
    value, stock : float
        As the configuration has it, and as the autopilot does.
    """
    channels = triad(config, sensor)
    lent = {borrowed(config).get(channel.axis) for channel in channels} - {None}
    if lent and (setting != "white" or not all(white_is_measured(config, c.axis) for c in channels)):
        return f"assumed from {', '.join(sorted(map(str, lent)))}, not measured on this unit"
    if setting == "white" and any("white_density" in config.on_limit(channel.axis) for channel in channels):
        return "the log shows a limit alone"
    if setting == "walk" and any(config.bias_on_limit(channel.axis) for channel in channels):
        return "the log shows a limit alone"
    if value >= stock:
        return None
    if setting == "turn_on":
        return "one switch-on does not show how far others differ"
    if any(channel.axis in config.noise_in_motion for channel in channels):
        return None
    if setting == "white":
        return "at rest; a bench log has no vibration of a flight"
    return "at rest; a bench log has no vibration and no temperatures of a flight"
