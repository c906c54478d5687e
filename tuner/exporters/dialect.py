"""What a dialect is: its name, what it is for, its units, and the function that writes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tuner.synthesis.equivalent_models import MEMORY
from tuner.types import FilterConfig


@dataclass(frozen=True)
class Target:
    """The filter that will read an export.

    Attributes
    ----------
    interval : float
        Sampling interval of the IMU it reads, s.
    step : float
        Prediction step of the filter, s, where it differs.
    memory : float
        Time over which it renews its biases, s.
    """

    interval: float
    step: float = 0.01
    memory: float = MEMORY


@dataclass(frozen=True)
class Exporter:
    """A dialect: its name, what it is for, its units, and the function that writes it."""

    name: str
    title: str
    units: str
    write: Callable[[FilterConfig, Target], str]
