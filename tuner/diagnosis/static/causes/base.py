"""Extensions of the model of a channel: each accepted cause makes its residuals closer to white noise.

A channel passes the extensions in this order::

    clean_samples  samples → samples without lines, spikes, stretches of motion
    columns        templates that are fitted together with the noise (temperature, step, …)
    gain, power    shape of the white noise, and power besides (filter, colour, resonance)
    whiten         residuals → residuals of unit variance and normal law (burst, drift, tails)

An extension that does not act at a stage inherits the map that changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from models.arrays import BoolArray, FloatArray
from models.noise import Term
from models.probability import REACH_95
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.static.channel import Channel
from tuner.types import Coefficient

if TYPE_CHECKING:
    from tuner.diagnosis.static.model.fitted_channel import FittedChannel
    from tuner.diagnosis.static.outcome import TestResult


MAX_LOG_FACTOR = 20.0
"""Logarithm of the largest factor that an interval reaches to: beyond, products would overflow."""


@dataclass(frozen=True)
class Value:
    """A parameter in the units of the channel: its 95 % interval, and how it becomes SI.

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
        return cls(value, value - REACH_95 * sd, value + REACH_95 * sd, unit)

    @classmethod
    def log(cls, value: float, relative_sd: float, unit: str = "1") -> Value:
        """Make a positive value with an interval that is even in its logarithm."""
        factor = float(np.exp(REACH_95 * min(relative_sd, 5.0)))
        return cls(value, value / factor, value * factor, unit)

    def widened_by(self, drift: float) -> Value:
        """Return the value with an interval that reaches, in quadrature, `drift` further on either side.

        One that is all positive stays so: there the reach is that of the logarithm.
        """
        if self.lower > 0.0:
            below, above = (
                float(np.exp(min(np.hypot(np.log(ratio), drift / self.value), MAX_LOG_FACTOR)))
                for ratio in (self.value / self.lower, self.upper / self.value)
            )
            return replace(self, lower=self.value / below, upper=self.value * above)
        below = float(np.hypot(self.value - self.lower, drift))
        above = float(np.hypot(self.upper - self.value, drift))
        return replace(self, lower=self.value - below, upper=self.value + above)

    def union(self, other: Value) -> Value:
        """Return the value with an interval that reaches to the ends of another one."""
        return replace(self, lower=min(self.lower, other.lower), upper=max(self.upper, other.upper))

    @classmethod
    def moment(cls, channel: Channel, at: float, first: float, last: float) -> Value:
        """Make the time, s, of a place among the samples, that lies between two others."""
        return cls(channel.time(at), channel.time(first), channel.time(last), "s")

    @property
    def positive(self) -> Value:
        """Value of a size that cannot be negative: the interval ends at 0."""
        return replace(self, lower=max(self.lower, 0.0))

    def coefficient(self, unit: str, scale: float) -> Coefficient:
        """Return the parameter in SI, for a channel of this unit and scale."""
        factor = scale if "{u}" in self.unit else 1.0
        low, high = sorted((factor * self.lower, factor * self.upper))
        return Coefficient.known(factor * self.value, low, high, self.unit.replace("{u}", unit))


def stretch_times(
    channel: Channel, likely: tuple[float, float], outer: tuple[float, float], inner: tuple[float, float]
) -> dict[str, Value]:
    """Return start and duration, s, of a stretch by its likely ends among the samples, its farthest and its nearest."""
    duration, longest, shortest = (
        max(channel.time(last) - channel.time(first), 0.0) for first, last in (likely, outer, inner)
    )
    return {
        "start": Value.moment(channel, likely[0], outer[0], inner[0]),
        "duration": Value(duration, shortest, longest, "s"),
    }


@dataclass(frozen=True)
class Extension(Cause):
    """A cause of one channel: what it adds to the model; amplitudes are in units of the channel's scale.

    Attributes
    ----------
    values : mapping of str to Value
        Parameters by the names of `models.effects`.
    """

    repeats: ClassVar[int] = 1
    """How often the cause may be found in one channel."""
    excludes: ClassVar[tuple[str, ...]] = ()
    """Other causes of which, and of this one, a channel has one at most."""
    supersedes: ClassVar[tuple[str, ...]] = ()
    """Causes that wait for another pass where this one is found: it explains the same with fewer assumptions."""
    contained_in: ClassVar[tuple[str, ...]] = ()
    """Causes after which this one is not tested any more: what they leave would be taken for it."""
    needs_fine_quantizer: ClassVar[bool] = False
    """Whether samples outside a dead band about zero could be taken for it, so that it is not tested there."""
    defining: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Parameters without which the name says nothing, each with the largest ratio of the ends of its interval."""
    family: ClassVar[type[Cause] | None] = None
    """What is reported instead where a defining parameter is not known that well."""
    values: Mapping[str, Value] = field(compare=False, kw_only=True, default_factory=dict)

    @property
    def defined(self) -> bool:
        """Whether its defining parameters are known well enough for a finding to name it."""
        return all(
            name not in self.values or 0.0 < self.values[name].upper <= ratio * self.values[name].lower
            for name, ratio in self.defining.items()
        )

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:  # noqa: ARG003
        """Test a channel for this cause alone; None where it cannot be tested, or shares its test with others."""
        return None

    def clean_samples(self, channel: Channel) -> Channel:
        """Return the channel with the effect subtracted from its samples; unchanged where it does not act on these."""
        return channel

    def columns(self, channel: Channel) -> FloatArray:
        """Return templates on the blocks, shape (M, p)."""
        return np.empty((channel.blocks, 0))

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:  # noqa: ARG002
        """Return its templates on the blocks of other samples of the unit, shape (M, p); 0 where it is an event.

        Parameters
        ----------
        channel : Channel
            Samples from the start of a record.
        same_record : bool
            Whether that is the record that the cause was found in.
        """
        return self.columns(channel)

    def gain(self, f: FloatArray, interval: float) -> FloatArray | float:  # noqa: ARG002
        """Return the factor on the spectrum of the white noise at frequencies `f`, Hz."""
        return 1.0

    def hides(self, f: FloatArray, interval: float) -> BoolArray | bool:  # noqa: ARG002
        """Return whether a filter leaves too little white noise at frequencies `f`, Hz, to tell its law from."""
        return False

    def power(self, f: FloatArray, interval: float) -> FloatArray | float:  # noqa: ARG002
        """Return the power added at frequencies `f`, Hz, scale²/Hz."""
        return 0.0

    def whiten(self, e: FloatArray) -> FloatArray:
        """Return residuals, shape (n,), whose law is closer to the standard normal one."""
        return e

    def terms(self, interval: float) -> tuple[Term, ...]:  # noqa: ARG002
        """Return what the extension adds to the noise model, in units of the scale."""
        return ()

    def white_noise_enlargement(
        self,
        before: FittedChannel,  # noqa: ARG002
        after: FittedChannel,  # noqa: ARG002
    ) -> tuple[float, str] | None:
        """Return the factor that a filter set from the model without the cause needs on its white noise, and why.

        Parameters
        ----------
        before, after : FittedChannel
            Fits without any and with all causes.
        """
        return None

    def enlarged_share(self, channel: Channel) -> float:  # noqa: ARG002
        """Return the share of a record, 0 … 1, in which the cause makes the noise larger than its rms over it."""
        return 1.0

    @property
    def consequence_as_found(self) -> str:
        """What it means for a filter, with the parameters that were found."""
        return self.consequence

    def in_motion(self, interval: float) -> str:  # noqa: ARG002
        """Return in words how it spoils motion that is sampled every `interval`, s; empty where it does not."""
        return ""

    def wrong_samples(self, channel: Channel) -> tuple[int, ...]:  # noqa: ARG002
        """Return the samples of a channel that are no measurement, where without them its noise is another."""
        return ()

    def refit(self, fitted: FittedChannel, index: int) -> Extension:  # noqa: ARG002
        """Return the extension, number `index` of a fitted channel that has it, with its parameters fitted again."""
        return self

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Extension:  # noqa: ARG002
        """Return the extension with its parameters from the joint fit of everything.

        Parameters
        ----------
        fitted : FittedChannel
            The final fit, which has the extension.
        index : int
            Its place there.
        size : Value
            Size of its first template in scales, with the 95 % interval at noise refitted.
        """
        return self


def gain_of(extensions: tuple[Extension, ...], f: FloatArray, interval: float) -> FloatArray:
    """Return the product of the gains of the extensions, shape of `f`."""
    out = np.ones_like(f)
    for extension in extensions:
        out *= extension.gain(f, interval)
    return out


def hidden_by(extensions: tuple[Extension, ...], f: FloatArray, interval: float) -> BoolArray:
    """Return whether a filter among the extensions hides the white noise, shape of `f`."""
    out = np.zeros(f.shape, dtype=bool)
    for extension in extensions:
        out |= extension.hides(f, interval)
    return out


def power_of(extensions: tuple[Extension, ...], f: FloatArray, interval: float) -> FloatArray:
    """Return the sum of the powers of the extensions, shape of `f`."""
    out = np.zeros_like(f)
    for extension in extensions:
        out += extension.power(f, interval)
    return out
