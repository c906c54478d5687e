"""Exporters: one configuration in the dialects of many filters, each with its own units and step.

::

    text = export(config, "kalibr")
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from tuner.exporters import kalibr, kf_gins, native
from tuner.exporters.figures import Target
from tuner.records import DataError
from tuner.results import FilterConfig
from tuner.synthesis.equivalents import MEMORY

__all__ = ["DIALECTS", "Exporter", "Target", "export"]


@dataclass(frozen=True)
class Exporter:
    """A dialect: what it is for, its units, and the function that writes it."""

    name: str
    title: str
    units: str
    write: Callable[[FilterConfig, Target], str]


DIALECTS: Mapping[str, Exporter] = MappingProxyType(
    {
        exporter.name: exporter
        for exporter in (
            Exporter("native", "our own configuration", "SI", lambda config, _: native.dumps(config)),
            Exporter("kalibr", "Kalibr imu.yaml", kalibr.UNITS, kalibr.write),
            Exporter("kf-gins", "KF-GINS kf-gins.yaml", kf_gins.UNITS, kf_gins.write),
        )
    }
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
        Time over which the target renews its biases, s: where a random walk or one state stands for richer
        models.

    Raises
    ------
    DataError
        For an unknown dialect.
    """
    if dialect not in DIALECTS:
        msg = f"dialect: expected one of {' '.join(DIALECTS)}, got {dialect!r}"
        raise DataError(msg)
    return DIALECTS[dialect].write(config, Target(interval or config.interval, step, memory))
