"""Which built-in grade keeps the position without fixes within a limit, and what noise is just enough."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_identification, grade_names, load_gnss, load_grade
from tuner.consistency.outage_drift import outage_drift
from tuner.stages import counted, stage, task
from tuner.synthesis import synthesize
from tuner.synthesis.sufficient import lacking_slow_bias
from tuner.types import FilterConfig
from tuner.types.public import public
from tuner.types.records import DataError
from tuner.types.shown import Shown

MAX_NOISE_FACTOR = 100.0
"""Factor on all noise of a grade within which one that just keeps the limit is looked for: grades span as much."""
FACTOR_ACCURACY = 0.02
"""Relative accuracy of that factor: grades are known less well."""


@dataclass(frozen=True)
class RankedGrade:
    """A built-in grade with the predicted horizontal error, m, after the outage."""

    name: str
    config: FilterConfig
    error: float


@dataclass(frozen=True, repr=False)
class GradeChoice(Shown):
    """The built-in grades by the error of the position after an outage, the best first.

    Attributes
    ----------
    outage : float
        Time without fixes, s.
    limit : float
        Wanted horizontal error, rms, m.
    receiver : str
        Built-in receiver that aids before.
    wheels : bool
        Whether wheels that do not slip sideways are used.
    ranking : tuple of RankedGrade
        Every grade that states the six axes with a slow bias.
    nearest : RankedGrade
        The noisiest grade that keeps the limit, or the best where none does.
    factor : float or None
        Factor on all noise and biases of `nearest` with which the limit is just kept; None where no factor within 100
        does: other errors than the sensor's decide.
    """

    outage: float
    limit: float
    receiver: str
    wheels: bool
    ranking: tuple[RankedGrade, ...]
    nearest: RankedGrade
    factor: float | None

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the grades that keep the limit."""
        return tuple(one.name for one in self.ranking if one.error <= self.limit)


@public("choose")
@task()
def choose(
    outage: float = 60.0, error: float = 2.0, *, gnss: str = DEFAULT_RECEIVER, wheels: bool = False
) -> GradeChoice:
    """Rank the built-in grades by their predicted error after an outage.

    Parameters
    ----------
    outage : float
        Time without fixes, s; at most 300.
    error : float
        Wanted horizontal error, rms, m.
    gnss : str
        Built-in receiver.
    wheels : bool
        Whether wheels do not slip sideways.

    Raises
    ------
    DataError
        For an unknown receiver, or an outage or error out of range.
    """
    if not error > 0.0:
        raise DataError(f"choose: error: expected metres above 0, found {error:g}")
    receiver = load_gnss(gnss)

    def drift(config: FilterConfig) -> float:
        found = outage_drift(config, (outage,))
        return (found.wheels if wheels else found.free)[outage]

    ranking = []
    stage("predicting the drift of every grade", 0.75)
    for name in counted(grade_names()):
        config = synthesize(grade_identification(load_grade(name)), gnss=receiver)
        if len(config.channels) == 6 and not lacking_slow_bias(config):
            ranking.append(RankedGrade(name, config, drift(config)))
    ranking.sort(key=lambda one: one.error)
    kept = [one for one in ranking if one.error <= error]
    stage("finding the noise that is just enough", 1.0)
    nearest = kept[-1] if kept else ranking[0]
    low, high = (1.0, MAX_NOISE_FACTOR) if kept else (1.0 / MAX_NOISE_FACTOR, 1.0)
    at_low, at_high = (drift(scaled(nearest.config, factor)) <= error for factor in (low, high))
    while at_low != at_high and high > (1.0 + FACTOR_ACCURACY) * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if drift(scaled(nearest.config, middle)) <= error else (low, middle)
    return GradeChoice(
        outage, error, gnss, wheels, tuple(ranking), nearest, low if at_low != at_high else None
    )


def scaled(config: FilterConfig, factor: float) -> FilterConfig:
    """Return a configuration with all noise and biases of its sensors multiplied by a factor."""
    channels = {
        axis: replace(
            noise.scaled(factor, factor),
            constant_sd=factor * noise.constant_sd,
            ramp_sd=factor * noise.ramp_sd,
        )
        for axis, noise in config.channels.items()
    }
    return replace(config, channels=channels)
