"""What the model of a channel may be extended by: each accepted cause is a better map to white residuals.

A channel passes the extensions in this order::

    repair      samples → samples without lines, spikes, stretches of motion
    columns     templates that are fitted together with the noise (temperature, step, …)
    gain, power shape of the white noise, and power besides (filter, colour, resonance)
    whiten      residuals → residuals of unit variance and normal law (burst, drift, tails)

An extension that does not act at a stage inherits the map that changes nothing.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from models.noise import Term
from tuner.diagnosis.static.channel import Channel
from tuner.types import Coefficient

if TYPE_CHECKING:
    from tuner.diagnosis.static.model.residual import Residual

FloatArray = NDArray[np.float64]

MOST = 20.0
"""Logarithm of the largest factor that an interval reaches to."""


@dataclass(frozen=True)
class Value:
    """A parameter in the units of the residual: its 95 % interval, and how it becomes SI.

    Attributes
    ----------
    value, lower, upper : float
        Estimate and interval.
    unit : str
        SI unit; ``{u}`` stands for the unit of the channel, and then the numbers are in its scale.
    """

    value: float
    lower: float
    upper: float
    unit: str = "1"

    @classmethod
    def of(cls, value: float, sd: float, unit: str = "1") -> Value:
        """Make a value with a normal interval."""
        return cls(value, value - 1.96 * sd, value + 1.96 * sd, unit)

    @classmethod
    def log(cls, value: float, relative_sd: float, unit: str = "1") -> Value:
        """Make a positive value with an interval that is even in its logarithm."""
        factor = float(np.exp(1.96 * min(relative_sd, 5.0)))
        return cls(value, value / factor, value * factor, unit)

    def owing(self, drift: float) -> Value:
        """Return the value with an interval that reaches, in quadrature, `drift` further on either side.

        One that is all positive stays so: there the reach is that of the logarithm.
        """
        if self.lower > 0.0:
            below, above = (
                float(np.exp(min(np.hypot(np.log(ratio), drift / self.value), MOST)))
                for ratio in (self.value / self.lower, self.upper / self.value)
            )
            return replace(self, lower=self.value / below, upper=self.value * above)
        below = float(np.hypot(self.value - self.lower, drift))
        above = float(np.hypot(self.upper - self.value, drift))
        return replace(self, lower=self.value - below, upper=self.value + above)

    def reaching(self, other: Value) -> Value:
        """Return the value with an interval that reaches to the ends of another one."""
        return replace(self, lower=min(self.lower, other.lower), upper=max(self.upper, other.upper))

    @property
    def positive(self) -> Value:
        """The same of a size that cannot be negative: the interval ends at 0."""
        return replace(self, lower=max(self.lower, 0.0))

    def coefficient(self, unit: str, scale: float) -> Coefficient:
        """Return the parameter in SI, for a channel of this unit and scale."""
        factor = scale if "{u}" in self.unit else 1.0
        low, high = sorted((factor * self.lower, factor * self.upper))
        return Coefficient.known(factor * self.value, low, high, self.unit.replace("{u}", unit))


@dataclass(frozen=True)
class Extension(ABC):
    """One accepted cause; amplitudes are in units of the channel's scale.

    Attributes
    ----------
    values : mapping of str to Value
        Parameters by the names of `models.effects`.
    """

    cause: ClassVar[str]
    named: ClassVar[bool] = True
    """Whether the catalogue has a name for it; what has none is told as unexplained."""
    repeats: ClassVar[int] = 1
    """How often the cause may be found in one channel."""
    meaning: ClassVar[str]
    """What the cause is and how it shows, in one sentence."""
    consequence: ClassVar[str]
    """What it asks of a filter, in one sentence."""
    values: Mapping[str, Value] = field(compare=False, kw_only=True, default_factory=dict)

    def repair(self, channel: Channel) -> Channel:
        """Return the channel without the effect, as far as that is a matter of samples."""
        return channel

    def columns(self, channel: Channel) -> FloatArray:
        """Return templates on the blocks, shape (M, p)."""
        return np.empty((channel.blocks, 0))

    def gain(self, f: FloatArray, interval: float) -> FloatArray | float:  # noqa: ARG002
        """Return the factor on the spectrum of the white noise at frequencies `f`, Hz."""
        return 1.0

    def power(self, f: FloatArray, interval: float) -> FloatArray | float:  # noqa: ARG002
        """Return the power added at frequencies `f`, Hz, scale²/Hz."""
        return 0.0

    def whiten(self, e: FloatArray) -> FloatArray:
        """Return residuals, shape (n,), whose law is closer to the standard normal one."""
        return e

    def terms(self, interval: float) -> tuple[Term, ...]:  # noqa: ARG002
        """Return what the extension adds to the noise model, in units of the scale."""
        return ()

    def polished(self, found: Residual, index: int) -> Extension:  # noqa: ARG002
        """Return the extension, number `index` of a residual that has it, with its parameters fitted again."""
        return self

    def refined(self, found: Residual, index: int, size: Value) -> Extension:  # noqa: ARG002
        """Return the extension with its parameters from the joint fit.

        Parameters
        ----------
        found : Residual
            The final residual, which has the extension.
        index : int
            Its place there.
        size : Value
            Size of its first template in scales, with the 95 % interval at noise refitted.
        """
        return self
