"""What every effect of the generator provides, and how its size is chosen for a wanted detectability.

A record is made in this order: ``white`` noise is changed, the ``signal`` is added, ``codes`` are written,
``rows`` are held or lost, ``stamps`` are given. An effect acts where it overrides the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from challenge.generator.oracle import Oracle
from challenge.generator.scene import Scene
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Truth = dict[str, float | list[float]]


class UnreachableError(ValueError):
    """No size of the effect has the wanted detectability."""


@dataclass
class Place:
    """Where an effect is to be hidden.

    Attributes
    ----------
    scene : Scene
    axis : str
        The axis whose detectability counts.
    felt : ndarray, shape (n,)
        Temperature of the sensor in the record to be analysed, °C.
    rng : numpy.random.Generator
        For the draw of the effect.
    """

    scene: Scene
    axis: str
    felt: FloatArray
    rng: np.random.Generator
    oracle: Oracle = field(init=False)

    def __post_init__(self) -> None:
        self.oracle = Oracle(self.scene.axes[self.axis], self.scene.samples, self.scene.interval)

    @property
    def white(self) -> float:
        """White sd of the axis, unit, with that of the lattice."""
        noise = self.scene.axes[self.axis]
        return float(np.hypot(noise.white, noise.step / np.sqrt(12.0)))


class Effect:
    """One effect on one or more axes; amplitudes are in white sd of each axis."""

    cause: ClassVar[str]
    nats: float
    shared: ClassVar[bool] = False
    """Whether it takes all the axes of a sensor."""
    alone: ClassVar[bool] = False
    """Whether it takes one axis only."""
    needs: ClassVar[str] = ""
    """``temperature`` or ``accel`` or ``triad``, where the scene must have that."""

    def begin(self, n: int, rng: np.random.Generator) -> None:
        """Draw what the axes of one record share."""

    def white(self, w: FloatArray, sd: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
        """Return the white noise changed."""
        return w

    def signal(
        self, axis: str, felt: FloatArray, scene: Scene, rng: np.random.Generator
    ) -> FloatArray | float:
        """Return what is added, unit."""
        return 0.0

    def codes(self, y: FloatArray, axis: str, scene: Scene) -> FloatArray:
        """Return the samples as written."""
        return y

    def rows(self, n: int, rng: np.random.Generator) -> IntArray | None:
        """Return which sample stands in each row of the file, or None for one after the other."""
        return None

    def stamps(self, t: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        """Return the stamps written."""
        return t

    def truth(self, axis: str, scene: Scene) -> Truth:
        """Return the parameters on an axis, SI."""
        raise NotImplementedError


def sized(nats: Callable[[float], float], target: float, low: float, high: float) -> tuple[float, float]:
    """Return the size at which the detectability is `target`, and what it is there.

    Raises
    ------
    UnreachableError
        Where neither `low` nor `high` leaves `target` between them.
    """
    at_low, at_high = nats(low), nats(high)
    if at_high < at_low:
        low, high, at_low, at_high = high, low, at_high, at_low
    if not at_low < target < at_high:
        msg = f"{target:.1f} nats lie outside {at_low:.1f} … {at_high:.1f}"
        raise UnreachableError(msg)
    size, reached = high, at_high
    for _ in range(40):
        size = float(np.sqrt(low * high))
        reached = nats(size)
        if abs(reached - target) < 0.02 * target:
            break
        if reached < target:
            low = size
        else:
            high = size
    return size, reached
