"""Template causes: a known function of time or of a covariate, regressed on the slow part of a channel.

A subclass of `Template` says what it is a function of (`template`) and what its size is called; that is tested,
estimated and extrapolated here. Statistic: likelihood ratio of the template, the noise refitted; χ²₁, and over the
candidates of a scan Davies' bound. A subclass of `TimeConstantTemplate` has a free time constant besides: a scan
over a grid, the likeliest value, and an interval by the profile of the likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.profile_likelihood import MIN_LOG_CHANGE, best_constant, profile
from tuner.diagnosis.static.model.score_scan import judge, likeliest, scan
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult


@dataclass(frozen=True)
class Template(Extension):
    """A bias in proportion to a known function on the blocks."""

    group = "slow part"
    size: ClassVar[tuple[str, str]]
    """Name and unit of the factor; ``{u}`` stands for the unit of the channel."""
    statistic: ClassVar[str]
    """What the statistic is, in words."""
    price: ClassVar[float] = 0.0
    """Nats that the choice among the candidates costs: the log of how many of them differ."""
    covariate: ClassVar[str | None] = None
    """The measured quantity that it is a function of."""

    def template(self, channel: Channel) -> FloatArray:
        """Return the function on the blocks, shape (M,)."""
        raise NotImplementedError

    @classmethod
    def candidates(cls, channel: Channel) -> Sequence[Self]:  # noqa: ARG003
        """Return the candidates of a scan."""
        return (cls(),)

    @classmethod
    def candidates_in_pairs(cls, channel: Channel) -> Sequence[Self]:  # noqa: ARG003
        """Return the candidates for pairs of causes that mask each other; none where it is not tried in them."""
        return ()

    @classmethod
    def choice(cls, channel: Channel) -> float:  # noqa: ARG003
        """Return the nats that the choice among the candidates costs in a channel."""
        return cls.price

    def cost(self, channel: Channel) -> float:
        """Return the price of its free numbers, nats; for a size half a log of √M, as many as count of M blocks."""
        sizes = int(self.columns(channel).shape[1])
        return self.choice(channel) + 0.25 * sizes * float(np.log(channel.blocks))

    @classmethod
    def applies(cls, channel: Channel) -> bool:
        """Return whether the channel has the covariate that it is a function of."""
        return cls.covariate is None or cls.covariate in channel.covariates

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Scan the candidates and test the best one by a likelihood ratio."""
        channel = fitted.channel
        if not cls.applies(channel):
            return None
        tried = cls.candidates(channel)
        scores, templates = scan(fitted, np.stack([one.template(channel) for one in tried], axis=1))
        best = scores.best
        if not scores.promising:
            return TestResult(cls.cause, 1.0, NO_GAIN, float(scores.score[best] ** 2), cls.statistic)
        result = judge(fitted, templates[:, best], scores.correlation, price=cls.choice(channel))
        return TestResult(
            cls.cause, result.p_value, result.gain, result.ratio, cls.statistic,
            lambda: (tried[best].likeliest(fitted),),
        )  # fmt: skip

    def likeliest(self, fitted: FittedChannel) -> Self:  # noqa: ARG002
        """Return the extension near a candidate that explains a fitted channel best."""
        return self

    def columns(self, channel: Channel) -> FloatArray:
        """Return the function on the blocks, shape (M, 1)."""
        return self.template(channel)[:, None]

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:  # noqa: ARG002
        """Take the factor from the joint fit."""
        name, unit = self.size
        return replace(self, values={**self.values, name: replace(size, unit=unit)})


@dataclass(frozen=True)
class TimeConstantTemplate(Template):
    """A bias in proportion to a function with a free time constant, s."""

    time_constant: float

    @classmethod
    def time_constants(cls, channel: Channel) -> FloatArray:
        """Return the grid of time constants, s."""
        raise NotImplementedError

    @classmethod
    def candidates(cls, channel: Channel) -> Sequence[Self]:
        """Return one extension a time constant of the grid."""
        return [cls(constant) for constant in cls.time_constants(channel).tolist()]

    def at(self, time_constant: float) -> Self:
        """Return the extension with another time constant, s."""
        return replace(self, time_constant=time_constant)

    def likeliest(self, fitted: FittedChannel) -> Self:
        """Return the extension whose time constant, within a factor of two, scores most."""
        return self.at(likeliest(fitted, lambda x: self.at(x).template(fitted.channel), self.time_constant))

    def refit(self, fitted: FittedChannel, index: int) -> Self:
        """Fit the time constant again, with the noise that is left beside the template."""
        constant = best_constant(
            fitted, index, lambda x: self.at(x).columns(fitted.channel), self.time_constant
        )
        close = abs(np.log(constant / self.time_constant)) < MIN_LOG_CHANGE
        return self if close else self.at(constant)

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:
        """Take factor and time constant from the joint fit; an uncertain constant widens the interval of the factor."""
        reach = profile(fitted, index, lambda x: self.at(x).columns(fitted.channel), self.time_constant, size)
        name, unit = self.size
        values = {"time_constant": reach.constant, name: replace(size, unit=unit).widened_by(reach.drift)}
        return replace(self, values=values)
