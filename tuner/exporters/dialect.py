"""What a dialect is, and the registry of all dialects, open to other packages.

A dialect is one file that ends with one declaration::

    DIALECT = Dialect("mine", "My filter's settings", "rad/s/√Hz, m/s²/√Hz", write)

Another package names it in its ``pyproject.toml``::

    [project.entry-points."tuner.dialects"]
    mine = "my_package.mine:DIALECT"
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from models.registry import Registry
from tuner.formats.digits import CLOCK_DIGITS, rounded
from tuner.synthesis.projection import (
    GNSS,
    HORIZONS,
    Aiding,
    Projected,
    errors_by_prediction,
    pooled,
    projected,
)
from tuner.types import ChannelNoise, FilterConfig

DEFAULT_TIME_CONSTANT = 3600.0
"""Time constant, s, of simulators with one state where the configuration has no Gauss–Markov state."""
LASTING_TIME = 86400.0
"""Time constant, s, with which the one state of a filter is a random walk: a day is longer than drives."""
WALK_SD = math.sqrt(0.5 * LASTING_TIME)
"""σ of that state ÷ K of the random walk that it is, √s."""


@dataclass(frozen=True)
class Target:
    """The filter that will read an export.

    Attributes
    ----------
    interval : float
        Sampling interval of the IMU it reads, s.
    step : float, optional
        Prediction step of the filter, s, where it was named; a dialect knows its filter's own.
    aiding : Aiding
        Fixes that it usually gets.
    rate_named : bool
        Whether `interval` was named, or is that of the log.
    shared : bool
        Whether the axes of a sensor have one number.
    """

    interval: float
    step: float | None = None
    aiding: Aiding = GNSS
    rate_named: bool = False
    shared: bool = False

    @property
    def rate(self) -> float:
        """Sampling rate of the IMU it reads, Hz."""
        return rounded(1.0 / self.interval, digits=CLOCK_DIGITS)

    def pair(self, channel: ChannelNoise) -> Projected:
        """Return the two numbers of an axis with which it predicts best."""
        return projected(channel, self.aiding)

    def pairs(self, channels: tuple[ChannelNoise, ...]) -> tuple[Projected, ...]:
        """Return the two numbers that it is given for each axis of a sensor."""
        if self.shared:
            return (self.pair(pooled(channels)),) * len(channels)
        return tuple(map(self.pair, channels))

    def errors(self, channel: ChannelNoise, pair: Projected) -> dict[str, float]:
        """Return true ÷ predicted sd of each quantity with two numbers of an axis, by its name."""
        return errors_by_prediction(channel, self.aiding, pair)

    def white_density(self, channel: ChannelNoise) -> float:
        """Return the white noise with which it predicts best, unit/√Hz."""
        return self.pair(channel).white_density

    def bias(self, channel: ChannelNoise) -> float:
        """Return the density of the random walk with which it predicts best, unit/√s."""
        return self.pair(channel).bias


@dataclass(frozen=True)
class Dialect:
    """The settings of another program: how to write a configuration as it reads them.

    Attributes
    ----------
    name : str
        Name for ``tuner export --to``: lower-case letters, digits and hyphens.
    title : str
        What is written, and for which program.
    units : str
        Units of its numbers, in order of appearance.
    write : callable
        Returns the text; `tuner.exporters.triad_values` has the numbers, `tuner.exporters.header` the comments.
    needs : tuple of str
        Sensors without which the program would go on with numbers of its own: a configuration that lacks one of
        them is refused. Empty where the settings of one sensor stand alone.
    aiding : Aiding
        Fixes that the program usually gets, by its documentation or its examples.
    shared : bool
        Whether it has one number for the axes of a sensor.
    """

    name: str
    title: str
    units: str
    write: Callable[[FilterConfig, Target], str]
    needs: tuple[str, ...] = ("gyro", "accel")
    aiding: Aiding = GNSS
    shared: bool = False

    def target(
        self, config: FilterConfig, interval: float | None = None, step: float | None = None
    ) -> Target:
        """Return the filter that reads the settings, at the rate of the log unless another is named."""
        named = interval is not None
        return Target(interval or config.interval, step, self.aiding, named, self.shared)


def longest_time(config: FilterConfig) -> float:
    """Return the longest time constant of the configuration, s, for simulators with one.

    It is 1 h without states that outlast the longest time without fixes: shorter ones act as white noise.
    """
    times = (state.time_constant for channel in config.channels.values() for state in channel.markov)
    return rounded(max((time for time in times if time > HORIZONS[-1]), default=DEFAULT_TIME_CONSTANT))


def _check(dialect: object) -> None:
    if not isinstance(dialect, Dialect):
        raise TypeError(f"expected a Dialect, got {type(dialect).__name__}")
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", dialect.name):
        raise ValueError("expected a name of lower-case letters, digits and hyphens")
    if not (dialect.title and dialect.units and callable(dialect.write)):
        raise ValueError("expected a title, units and a function 'write'")


DIALECTS: Registry[Dialect] = Registry(
    "dialect",
    "tuner.dialects",
    name_of=lambda dialect: str(getattr(dialect, "name", dialect)),
    check=_check,
)
"""Every dialect by name; `tuner.exporters` adds the built-in ones."""
