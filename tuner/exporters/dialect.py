"""What a dialect is, and the registry of all dialects, open to other packages.

A dialect is one file that ends with one declaration::

    DIALECT = Dialect("mine", "My filter's settings", "rad/s/√Hz, m/s²/√Hz", write)

Another package names it in its ``pyproject.toml``::

    [project.entry-points."tuner.dialects"]
    mine = "my_package.mine:DIALECT"
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from models.registry import Registry
from tuner.formats.digits import CLOCK_DIGITS, rounded
from tuner.synthesis.equivalent_models import FILTER_MEMORY
from tuner.types import FilterConfig


@dataclass(frozen=True)
class Target:
    """The filter that will read an export.

    Attributes
    ----------
    interval : float
        Sampling interval of the IMU it reads, s.
    step : float, optional
        Prediction step of the filter, s, where it was named; a dialect knows its filter's own.
    memory : float
        Time over which it renews its biases, s.
    rate_named : bool
        Whether `interval` was named, or is that of the log.
    """

    interval: float
    step: float | None = None
    memory: float = FILTER_MEMORY
    rate_named: bool = False

    @property
    def rate(self) -> float:
        """Sampling rate of the IMU it reads, Hz."""
        return rounded(1.0 / self.interval, digits=CLOCK_DIGITS)


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
    """

    name: str
    title: str
    units: str
    write: Callable[[FilterConfig, Target], str]
    needs: tuple[str, ...] = ("gyro", "accel")


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
