"""Configurations that are tried on a drive: with factors by its first part, and variations of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from types import MappingProxyType

import numpy as np

from tuner.diagnosis.drive.configured_run import ConfiguredRun, configured_run, with_other_noise
from tuner.diagnosis.drive.noise_factors import (
    FACTORS,
    with_noise_factors,
)
from tuner.diagnosis.drive.predictive_score import PredictiveScore, predictive_score
from tuner.diagnosis.drive.staying_errors import (
    POSITION,
    STAYING,
    VELOCITY,
)
from tuner.formats.outage_words import PREDICTED_RATIOS
from tuner.stages import counted
from tuner.types import FilterConfig
from tuner.types.records import DataError, Drive

BEGINNING = "as it began"
"""Name of the configuration before the drive."""
UNIT = ("white", "bias")
"""Noise of the inertial unit as a whole, which is moved first: of an unknown unit both are unknown alike."""
STEPS = (3.0, 3.0**0.5)
"""Factors by which a setting is moved: a third of a decade is far, its root is what outages of a drive tell apart."""
MIN_GAIN = 3.0
"""Nats that a step must gain: a likelihood ratio of 20."""
MAX_MOVES = 3
"""Moves of one setting by one step size, at most: 27 times."""
FIRST_STAYING: Mapping[str, float] = MappingProxyType({POSITION: 1.0, VELOCITY: 1.0})
"""Errors of the receiver that stay, with which a candidate begins: their sds as the receiver reports them."""
NEARER_TO_FIXES = ((3.0, 1.0), (3.0**1.5, 1.0), (9.0, 1.0), (9.0, 1.0 / 3.0))
"""Factors on errors of velocities that stay, and on all sds of positions, for a filter that follows the fixes."""
SHORTER_MEMORIES = (3.0**-0.5, 3.0**-1.0, 3.0**-1.5)
"""Factors on the size of errors of positions that stay, their driving noise unchanged."""
DRIFT_FACTORS = (3.0**0.5, 3.0)
"""Factors on process noise that are tried where outages err otherwise than predicted."""
POSITIONS = (POSITION, "position_horizontal", "position_vertical")
"""Sds of positions."""
SDS_OF_INNOVATIONS = (
    ("position_horizontal", "position_vertical"),
    ("velocity_horizontal", "velocity_vertical"),
)
"""Sds of the fixes that the innovations of positions, and of velocities, show."""
SD_STEPS = 3
"""Steps to sds that innovations do not contradict: each halves what is left where half of an innovation is the fix."""
MAX_TRACKING_RATIO = 1.05
"""Position error with fixes, after ÷ before, above which it counts as worse: 5 % are lost in the scatter of a drive."""
SCATTER = float(np.log(MAX_TRACKING_RATIO))
"""Change of |ln| of an innovation ratio that says nothing."""


class Rank(IntEnum):
    """What a candidate does on a drive with a reference, the best first."""

    FOLLOWS_AND_PREDICTS = 0
    """Positions err no more than the fixes, errors in outages are predicted (`OutageErrors.predicted`), and so are
    innovations (`INNOVATION_RATIOS`)."""
    PREDICTS = 1
    """Outages and innovations are predicted, and positions err like the fixes, within `MAX_TRACKING_RATIO`."""
    NOT_REFUTED = 2
    """Innovations are predicted, positions err no more than the fixes, no errors in outages are shown to be off."""
    LIKE_FIXES = 3
    """The same with positions that err like the fixes, within `MAX_TRACKING_RATIO`."""
    CONTRADICTED = 4
    """Positions err no more than the fixes, no errors in outages are shown to be off, but innovations are."""
    FOLLOWS = 5
    """Positions err no more than the fixes."""
    NEITHER = 6
    """Positions err more than the fixes, or errors in outages are likely larger than before."""


@dataclass(frozen=True)
class Candidate:
    """A configuration with factors on its noise, and its score on the first part of a drive."""

    name: str
    config: FilterConfig
    factors: Mapping[str, float]
    first: PredictiveScore

    @property
    def best_rank(self) -> Rank:
        """The best rank that it can have by the first part; without a reference nobody errs more than the fixes."""
        if self.first.contradicted:
            return Rank.CONTRADICTED if self.first.follows() else Rank.NEITHER
        if self.first.follows():
            return Rank.FOLLOWS_AND_PREDICTS
        return Rank.PREDICTS if self.first.follows(MAX_TRACKING_RATIO) else Rank.NEITHER


@dataclass(frozen=True)
class Trial:
    """A drive on which configurations are scored; runs of configurations that differ in their noise share a name."""

    drive: Drive
    begin: float
    cut: float
    end: float
    runs: dict[str, ConfiguredRun] = field(default_factory=dict)

    def run_of(self, name: str, config: FilterConfig) -> ConfiguredRun:
        """Return the run of a configuration."""
        if name not in self.runs:
            self.runs[name] = configured_run(self.drive, config)
        return with_other_noise(self.runs[name], self.drive, config)

    def score(self, name: str, config: FilterConfig, begin: float, end: float) -> PredictiveScore | None:
        """Return its score between two times; None where a filter is lost, or no outage fits."""
        try:
            return predictive_score(self.run_of(name, config), begin, end)
        except (DataError, np.linalg.LinAlgError):
            return None

    def candidate(self, name: str, config: FilterConfig, factors: Mapping[str, float]) -> Candidate | None:
        """Return a configuration with factors, scored on the first part."""
        first = self.score(name, with_noise_factors(config, factors), self.begin, self.cut)
        return None if first is None else Candidate(name, config, factors, first)


def first_candidates(trial: Trial, fitted: Mapping[str, FilterConfig]) -> list[Candidate]:
    """Return the configurations as they are, and with errors that stay where those predict the first part better."""
    found: list[Candidate] = []
    for name, config in fitted.items():
        least = -np.inf
        for factors in (MappingProxyType({}), FIRST_STAYING):
            one = trial.candidate(name, config, factors)
            if one is not None and one.first.nats >= least:
                found.append(one)
                least = one.first.nats + len(FIRST_STAYING) * MIN_GAIN
    return found


def rounds_of(trial: Trial, candidates: Sequence[Candidate]) -> Iterator[Iterable[Candidate]]:
    """Yield candidates in the order of trial: as they are, wider, nearer to the fixes, from the other beginnings."""
    yield candidates
    best = candidates[0]
    tried = (_with_sds_of_innovations, _with_other_memory, _with_other_sizes)
    yield (more for one in candidates for vary in tried for more in vary(trial, one))
    yield _nearer_to_fixes(trial, best)
    names = dict.fromkeys(one.name for one in candidates if one.name != best.name)
    others = [max((one for one in candidates if one.name == name), key=by_nats) for name in names]
    again = [more for one in others for more in refined(trial, one)]
    yield again
    yield (more for one in again for vary in VARIATIONS for more in vary(trial, one))


def by_innovations(one: Candidate) -> tuple[float, float]:
    """Return what puts candidates in order: innovations as predicted first, then the larger log density."""
    return one.first.innovation_distance, -one.first.nats


def in_order(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates in order of trial, first of those within `MIN_GAIN` of the best the nearest to the start."""
    ranked = sorted(candidates, key=by_innovations)
    distance, nats = ranked[0].first.innovation_distance, ranked[0].first.nats
    ties = [
        one
        for one in ranked
        if one.first.innovation_distance == distance and one.first.nats > nats - MIN_GAIN
    ]
    nearest = min(ties, key=lambda one: (one.name != BEGINNING, len(one.factors)))
    return [nearest, *(one for one in ranked if one is not nearest)]


def by_nats(one: Candidate) -> float:
    """Return the log density of the first part."""
    return one.first.nats


def refined(trial: Trial, best: Candidate) -> list[Candidate]:
    """Return a candidate with factors that raise its log density; none where there is nothing to score."""
    factors = _fit_factors(best, lambda config: trial.score(best.name, config, trial.begin, trial.cut))
    found = trial.candidate(best.name, best.config, factors)
    return [] if found is None else [found]


def _nearer_to_fixes(trial: Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate with less and less trust in velocities, then also with more and more in positions."""
    for less, more in NEARER_TO_FIXES:
        factors = {**one.factors, VELOCITY: one.factors.get(VELOCITY, 1.0) * less}
        if more < 1.0:
            factors |= {name: one.factors.get(name, 1.0) * more for name in POSITIONS}
        if (found := trial.candidate(one.name, one.config, factors)) is not None:
            yield found


def _with_sds_of_innovations(trial: Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate that its innovations contradict with sds of the fixes times the ratio that innovations show.

    Innovations hold the prediction, too: what the first step leaves is taken out by further ones.
    """
    for _ in range(SD_STEPS):
        ratios = one.first.innovations
        if not one.first.contradicted or len(ratios) != len(SDS_OF_INNOVATIONS):
            return
        more = {
            name: one.factors.get(name, 1.0) * ratio
            for names, ratio in zip(SDS_OF_INNOVATIONS, ratios, strict=True)
            for name in names
        }
        found = trial.candidate(one.name, one.config, {**one.factors, **more})
        if found is None:
            return
        one = found
        yield one


def _with_other_memory(trial: Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate that errs more than the fixes with less wander of theirs, more of velocities', and more drift.

    Innovations show the driving noise 2σ²/T of a process that stays for minutes, and hardly how far it goes: σ and T
    are changed by factors f and f². Positions that wander less, and velocities that wander more, let the filter follow
    the fixes.
    """
    if POSITION not in one.factors or one.first.contradicted or one.first.follows():
        return
    for factor in SHORTER_MEMORIES:
        shorter = _wandering(one.factors, POSITION, factor)
        longer = _wandering(shorter, VELOCITY, 1.0 / factor)
        for factors in (shorter, longer, {**longer, "bias": one.factors.get("bias", 1.0) * DRIFT_FACTORS[0]}):
            if (found := trial.candidate(one.name, one.config, factors)) is not None:
                yield found


def _wandering(factors: Mapping[str, float], name: str, factor: float) -> Mapping[str, float]:
    """Return factors with another size of an error that stays, and the same driving noise."""
    time = STAYING[STAYING.index(name) + 1]
    return {**factors, name: factors.get(name, 1.0) * factor, time: factors.get(time, 1.0) * factor**2}


def _with_other_sizes(trial: Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate with larger settings where outages err more than it states, with smaller where they err less.

    Its likelihood allows for single large errors, which count in what a user reads. Long outages show the process
    noise, the shortest the positions from which they begin.
    """
    low, high = PREDICTED_RATIOS
    outages = one.first.outages
    ratios = [1.0 if outage.predicted else outage.ratio for outage in outages]
    changes: list[tuple[float, tuple[str, ...]]] = []
    if POSITION in one.factors and not low <= ratios[0] <= high:
        changes.append((DRIFT_FACTORS[0] if ratios[0] > high else 1.0 / DRIFT_FACTORS[0], (POSITION,)))
    if max(ratios) > high:
        changes += [(factor, UNIT) for factor in DRIFT_FACTORS]
    elif min(ratios) < low:
        changes += [(1.0 / factor, UNIT) for factor in DRIFT_FACTORS]
    for factor, names in changes:
        more = {name: one.factors.get(name, 1.0) * factor for name in names}
        if (found := trial.candidate(one.name, one.config, {**one.factors, **more})) is not None:
            yield found


VARIATIONS = (_with_other_memory, _with_other_sizes, _nearer_to_fixes)
"""What is tried where a candidate does not follow the fixes, or predict outages."""


def _fit_factors(
    best: Candidate, score: Callable[[FilterConfig], PredictiveScore | None]
) -> Mapping[str, float]:
    """Return the factors of a candidate after those moves that raise its log density, one after another.

    A move that takes innovations away from their prediction is refused: it would contradict what the fixes say of
    their own errors, for a few outages that chance decides. In the end each factor without which less than `MIN_GAIN`
    is lost goes back to where it began, so that small changes of a drive change few of them.
    """
    factors, nats = dict(best.factors), best.first.nats
    distance = best.first.innovation_distance
    gains: dict[tuple[str, ...], list[float]] = {}
    single = ((name,) for name in (*FACTORS, *(own for own in STAYING if POSITION in factors)))
    moves = UNIT, *single
    for step in STEPS:
        for names in counted(moves):
            if _top_of_parabola(gains.get(names, [])) < MIN_GAIN:
                continue
            gains[names] = []
            for direction in (step, 1.0 / step):
                moved = False
                for _ in range(MAX_MOVES):
                    trial = {**factors, **{name: factors.get(name, 1.0) * direction for name in names}}
                    found = score(with_noise_factors(best.config, trial))
                    gains[names].append(-np.inf if found is None else found.nats - nats)
                    if found is None or found.nats < nats + MIN_GAIN:
                        break
                    if found.innovation_distance > distance + SCATTER:
                        break
                    factors, nats, moved = trial, found.nats, True
                    distance = min(distance, found.innovation_distance)
                if moved:
                    gains[names] = []
                    break
    for name in reversed([name for name in factors if factors[name] != best.factors.get(name, 1.0)]):
        trial = {**factors, name: best.factors.get(name, 1.0)}
        found = score(with_noise_factors(best.config, trial))
        if found and found.nats > nats - MIN_GAIN and found.innovation_distance <= distance + SCATTER:
            factors = trial
    return {
        name: value for name, value in factors.items() if name in FIRST_STAYING or abs(np.log(value)) > 1e-6
    }


def _top_of_parabola(gains: Sequence[float]) -> float:
    """Return how much more a parabola through 0 and two gains, one to either side, gains at its top; ∞ without them.

    Where a far step lost to both sides, a near one is tried only where it may gain.
    """
    if len(gains) != 2:
        return np.inf
    more, less = gains
    if not np.isfinite(more + less) or more + less >= 0.0:
        return np.inf
    return -((more - less) ** 2) / (8.0 * (more + less))
