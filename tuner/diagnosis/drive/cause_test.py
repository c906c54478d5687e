"""What one family of causes says of a record: how surely, what it makes of the noise, and in which figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from tuner.diagnosis.drive.linear_model.likelihood import NoiseHypothesis
from tuner.diagnosis.static.outcome import Alarm
from tuner.types import Coefficient


@dataclass(frozen=True)
class CauseTest:
    """Outcome of one family.

    Attributes
    ----------
    alarm : Alarm
        How surely; its `gain` is the log likelihood gained less ½ ln n a parameter, nats.
    noise : NoiseHypothesis
        With the cause: to go on from. The same as before where the family has nothing to say.
    describe : callable
        () → parameters of the finding, with intervals; costs some refits.
    law : mapping of str to float
        Names of a compensation that stand for the sds of the noise, factors on what it has already; empty where one
        factor on each group of rows does.
    """

    alarm: Alarm
    noise: NoiseHypothesis
    describe: Callable[[], Mapping[str, Coefficient]]
    law: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def is_significant(self, threshold: float) -> bool:
        """Whether the p value is below a threshold and the cause gains likelihood."""
        return self.alarm.p_value < threshold and self.alarm.gain > MIN_GAIN


MIN_GAIN = 1.0
"""Gain from which a cause is named, nats: a Bayes factor of e."""
NO_GAIN = -9.0
"""Gain of a family that has nothing to say, nats."""


def not_significant(
    cause: str, noise: NoiseHypothesis, p_value: float, statistic: float, name: str
) -> CauseTest:
    """Return the outcome of a family that has nothing to say."""
    return CauseTest(Alarm(cause, p_value, NO_GAIN, statistic, name), noise, dict)


MIN_FACTOR = 0.02
"""Least factor that is put into a filter: beside correlated errors the white part of smoothed fixes may be nothing, and
a filter configured so refuses every fix once it is off."""


def scaled_factor(values: Mapping[str, float], key: str, more: float) -> float:
    """Return a factor of a compensation times another one, `MIN_FACTOR` at least."""
    return max(MIN_FACTOR, values.get(key, 1.0) * more)
