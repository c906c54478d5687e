"""Which configuration to write for a drive: fitted on its first 60 %, kept where it predicts the last 40 % better.

Candidates are the configuration as it began, the same with the sds of the fixes as found, and the one with all
findings, each as it is and with errors of the receiver that stay (`staying_errors`). The one that predicts outages of
the first part best (`predictive_score`) also gets factors on its noise: innovations a tenth of a second ahead do not
show what adds up over a minute, such as vibration that turns into bias. Factors are found one after another, by steps
of 3 and then of √3, each kept where it gains `MIN_GAIN`.

On the last part a candidate replaces the beginning only where its log density is larger and nothing that a user reads
is worse: positions with fixes, and errors in outages of the whole drive, compared in pairs (`outage_pairs`). Candidates
are tried in the order of their log density on the first part; where none passes, the configuration stays as it began.
Without a reference the first that passes is written. With one (`trusted_reference`) the best `Rank` is: positions of
both parts err no more than the fixes, and errors in the outages of the whole drive, and in as many half a window later,
are predicted. Further candidates are tried until one does: more or less process noise, less trust in velocities, the
other beginnings. So the last part decides what is refused, and little of what is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tuner.consistency.reference_check import trusted_reference
from tuner.diagnosis.drive.causes.time_offset import with_clock
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.held_out_gain import change_interval, fitted_before
from tuner.diagnosis.drive.noise_factors import (
    FACTORS,
    with_noise_factors,
    with_recorded_factors,
    with_sds_of,
)
from tuner.diagnosis.drive.predictive_score import (
    ConfiguredRun,
    OutageErrors,
    PredictiveScore,
    all_outages,
    configured_run,
    outage_pairs,
    predictive_score,
    with_other_noise,
)
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.diagnosis.drive.staying_errors import (
    POSITION,
    STAYING,
    VELOCITY,
)
from tuner.navigation.drive.axis_checks import with_axes_found
from tuner.navigation.drive.clock import Clock, clock_of_drive
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.types import FilterConfig
from tuner.types.progress import Progress
from tuner.types.records import DataError, Drive

FloatArray = NDArray[np.float64]

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
DRIFT_FACTORS = (3.0**0.5, 3.0)
"""Factors on process noise that are tried where outages err otherwise than predicted."""
POSITIONS = (POSITION, "position_horizontal", "position_vertical")
"""Sds of positions."""
WORSE_PROBABILITY = 0.9
"""Probability from which errors in outages count as larger: a user loses more by them than by a change not made."""
MAX_TRACKING_RATIO = 1.05
"""Position error with fixes, after ÷ before, above which it counts as worse: 5 % are lost in the scatter of a drive."""
CONSISTENT_RATIOS = (0.7, 1.4)
"""True ÷ predicted error in outages between which a prediction is taken for right: what few windows can tell."""
SDS_FOUND = "as it began, sds of the fixes as found"
"""Name of the configuration that takes only that from the findings: solution classes may report anything."""
TOO_SHORT = "the drive is too short to try settings on its last part"
NOT_JUDGED = f"{TOO_SHORT}: those with the findings are written"
"""Note of a drive without outages in either part."""


@dataclass(frozen=True)
class HeldOutChoice:
    """The configuration that a drive keeps.

    Attributes
    ----------
    config : FilterConfig
        To be written.
    kept : str
        ``as it began``, `SDS_FOUND`, ``with the findings``, or one of these with ``, factors for outages``.
    factors : mapping of str to float
        On the noise of that configuration, by name of `FACTORS`.
    before, after : PredictiveScore or None
        On the last part: as it began, and as written; None where the drive is too short.
    outages : mapping of float to ndarray, shape (w, 2)
        Squared errors in outages of the whole drive, m², as it began and as written, by length, s.
    note : str
        What was decided, and why, in words.
    """

    config: FilterConfig
    kept: str
    factors: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    before: PredictiveScore | None = None
    after: PredictiveScore | None = None
    outages: Mapping[float, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    note: str = ""

    @property
    def is_predicted(self) -> bool:
        """Whether errors in outages of the last part are within `CONSISTENT_RATIOS` of those predicted."""
        low, high = CONSISTENT_RATIOS
        return self.after is not None and all(low <= one.ratio <= high for one in self.after.outages)


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
        if self.first.follows():
            return Rank.FOLLOWS_AND_PREDICTS
        return Rank.PREDICTS if self.first.follows(MAX_TRACKING_RATIO) else Rank.NEITHER


class Rank(IntEnum):
    """What a candidate does on a drive with a reference, the best first."""

    FOLLOWS_AND_PREDICTS = 0
    """Positions err no more than the fixes, and errors in outages are predicted (`CONSISTENT_RATIOS`)."""
    PREDICTS = 1
    """Errors in outages are predicted, and positions err like the fixes, within `MAX_TRACKING_RATIO`."""
    FOLLOWS = 2
    """Positions err no more than the fixes."""
    NEITHER = 3


@dataclass(frozen=True)
class _Trial:
    """A drive on which configurations are scored; runs of configurations that differ in their noise share a name."""

    drive: Drive
    clock: Clock
    begin: float
    cut: float
    end: float
    runs: dict[str, ConfiguredRun] = field(default_factory=dict)

    def run_of(self, name: str, config: FilterConfig) -> ConfiguredRun:
        """Return the run of a configuration."""
        if name not in self.runs:
            self.runs[name] = configured_run(self.drive, config, self.clock)
        return with_other_noise(self.runs[name], self.drive, config, self.clock)

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


def choose_config(
    drive: Drive, examined: ExaminedDrive, before: FilterConfig, after: FilterConfig, progress: Progress
) -> HeldOutChoice:
    """Choose the configuration of a drive by its first part, and keep it where the last is predicted better.

    Parameters
    ----------
    drive : Drive
        As read.
    examined : ExaminedDrive
        Its diagnosis.
    before, after : FilterConfig
        As it began, and with all findings.
    progress : callable
        Called with what is being done.
    """
    gnss, _, _ = without_gross_outliers(with_axes_found(drive.gnss)[0])
    drive = replace(drive, gnss=gnss)
    clock = (not before.compensation and examined.clock) or clock_of_drive(drive)
    before, after = with_clock(before, clock), with_clock(after, clock)
    begin, end = float(gnss.t[0]), float(gnss.t[-1])
    drive = _with_trusted_reference(drive, before, clock)
    trial = _Trial(drive, clock, begin, begin + FITTED_SHARE * (end - begin), end)

    progress("fitting the noise to outages of the first part of the drive")
    written = _written(examined, before, after)
    candidates = _candidates(trial, _fitted(examined, written, trial.cut))
    begun = trial.score("as it began", before, trial.cut, end)
    if begun is None or not candidates:
        if after == before:
            return HeldOutChoice(before, "as it began", note=f"{TOO_SHORT}: they stay as they began")
        return HeldOutChoice(after, "with the findings", note=NOT_JUDGED)
    best = max(candidates, key=_nats)
    candidates = sorted([*candidates, *_refined(trial, best)], key=_nats, reverse=True)
    progress("judging the configurations on the last part of the drive")

    outages = all_outages(trial.run_of("as it began", before), begin, end)

    def judged(one: Candidate) -> tuple[HeldOutChoice, Rank] | None:
        return _judged(trial, begun, outages, written[one.name], one)

    chosen = first_of_best(_rounds(trial, candidates), judged, has_reference=drive.reference is not None)
    if chosen is None:
        note = _note("as it began", begun, begun, {})
        return HeldOutChoice(before, "as it began", {}, begun, begun, note=note)
    return chosen


def first_of_best(
    rounds: Iterable[Iterable[Candidate]],
    judged: Callable[[Candidate], tuple[HeldOutChoice, Rank] | None],
    *,
    has_reference: bool,
) -> HeldOutChoice | None:
    """Return the first choice of the best rank, candidates that the last part refuses left out; None for none.

    Without a reference no ranks differ in what they say of the fixes: the first that is not refused is taken.

    Parameters
    ----------
    rounds : iterable of iterables of Candidate
        In the order of trial; a later round is looked at only where no earlier one has a candidate that predicts
        outages and errs like the fixes.
    judged : callable
        What is written of a candidate, and its rank; None where the last part refuses it.
    has_reference : bool
        Whether the drive has a reference.
    """
    chosen, rank = None, None
    for candidates in rounds:
        for one in candidates:
            if rank is not None and one.best_rank >= rank:
                continue
            found = judged(one)
            if found is None or (rank is not None and found[1] >= rank):
                continue
            chosen, rank = found
            if not has_reference or rank == Rank.FOLLOWS_AND_PREDICTS:
                return chosen
        if rank is not None and rank <= Rank.PREDICTS:
            return chosen
    return chosen


def _with_trusted_reference(drive: Drive, config: FilterConfig, clock: Clock) -> Drive:
    """Return a drive without those times of its reference at which it is wrong."""
    if drive.reference is None:
        return drive
    try:
        run = configured_run(drive, config, clock)
        return replace(drive, reference=trusted_reference(drive.reference, run.stretches, run.settings)[0])
    except DataError:
        return drive


def _written(examined: ExaminedDrive, before: FilterConfig, after: FilterConfig) -> dict[str, FilterConfig]:
    """Return the configurations that may be written, by name, the one as it began first."""
    written = {"as it began": before}
    if after is not before and examined.search.accepted:
        written["with the findings"] = after
        if {one.cause for one in examined.search.accepted} - {GNSS_NOISE_SCALE}:
            written[SDS_FOUND] = with_sds_of(before, after)
    return written


def _fitted(
    examined: ExaminedDrive, written: Mapping[str, FilterConfig], cut: float
) -> dict[str, FilterConfig]:
    """Return the same configurations with values fitted before a time, s; without those that cannot be fitted."""
    fitted = {"as it began": written["as it began"]}
    if len(written) == 1:
        return fitted
    try:
        part = fitted_before(examined.drive, examined.search, cut)
    except DataError:
        return fitted
    found = fitted["with the findings"] = replace(part.config, compensation=part.compensation)
    if SDS_FOUND in written:
        fitted[SDS_FOUND] = with_sds_of(written["as it began"], found)
    return fitted


def _candidates(trial: _Trial, fitted: Mapping[str, FilterConfig]) -> list[Candidate]:
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


def _rounds(trial: _Trial, candidates: Sequence[Candidate]) -> Iterator[Iterable[Candidate]]:
    """Yield candidates in the order of trial: as they are, wider, nearer to the fixes, from the other beginnings."""
    yield candidates
    best = candidates[0]
    yield _with_other_drift(trial, best)
    yield _nearer_to_fixes(trial, best)
    names = dict.fromkeys(one.name for one in candidates if one.name != best.name)
    others = [max((one for one in candidates if one.name == name), key=_nats) for name in names]
    refined = [more for one in others for more in _refined(trial, one)]
    yield refined
    yield (more for one in refined for tried in VARIATIONS for more in tried(trial, one))


def _judged(
    trial: _Trial,
    begun: PredictiveScore,
    before: Mapping[float, OutageErrors],
    written: FilterConfig,
    one: Candidate,
) -> tuple[HeldOutChoice, Rank] | None:
    """Return a candidate as it is written; None where the last part, or errors in outages, speak against it."""
    config = with_noise_factors(one.config, one.factors)
    late = trial.score(one.name, config, trial.cut, trial.end)
    if late is None or not is_better(begun, late):
        return None
    after = all_outages(trial.run_of(one.name, config), trial.begin, trial.end)
    pairs = outage_pairs(before, after)
    if any(change_interval(pair, 2.0 * WORSE_PROBABILITY - 1.0)[0] > 0.0 for pair in pairs.values()):
        return None
    kept = f"{one.name}, factors for outages" if one.factors else one.name
    chosen, note = with_recorded_factors(written, one.factors), _note(kept, begun, late, pairs)
    low, high = CONSISTENT_RATIOS
    rank = rank_of([one.first, late], predicts=all(low <= each.ratio <= high for each in after.values()))
    return HeldOutChoice(chosen, kept, one.factors, begun, late, pairs, note), rank


def rank_of(parts: Sequence[PredictiveScore], *, predicts: bool) -> Rank:
    """Return the rank of a candidate from its scores on both parts, and whether it predicts errors in outages."""
    if all(part.follows() for part in parts):
        return Rank.FOLLOWS_AND_PREDICTS if predicts else Rank.FOLLOWS
    near = all(part.follows(MAX_TRACKING_RATIO) for part in parts)
    return Rank.PREDICTS if predicts and near else Rank.NEITHER


def _nats(one: Candidate) -> float:
    """Return the log density of the first part."""
    return one.first.nats


def _refined(trial: _Trial, best: Candidate) -> list[Candidate]:
    """Return a candidate with factors that raise its log density; none where there is nothing to score."""
    factors = _fit_factors(best, lambda config: trial.score(best.name, config, trial.begin, trial.cut))
    found = trial.candidate(best.name, best.config, factors)
    return [] if found is None else [found]


def is_better(before: PredictiveScore, after: PredictiveScore) -> bool:
    """Whether one score is larger than another and positions with fixes are not worse."""
    return after.nats > before.nats and after.tracking_rms <= MAX_TRACKING_RATIO * before.tracking_rms


def _nearer_to_fixes(trial: _Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate with less and less trust in velocities, then also with more and more in positions."""
    for less, more in NEARER_TO_FIXES:
        factors = {**one.factors, VELOCITY: one.factors.get(VELOCITY, 1.0) * less}
        if more < 1.0:
            factors |= {name: one.factors.get(name, 1.0) * more for name in POSITIONS}
        if (found := trial.candidate(one.name, one.config, factors)) is not None:
            yield found


def _with_other_drift(trial: _Trial, one: Candidate) -> Iterator[Candidate]:
    """Yield a candidate with more process noise where outages err more than it states; with less where they err less.

    Its likelihood allows for single large errors, which count in what a user reads.
    """
    low, high = CONSISTENT_RATIOS
    ratios = [outage.ratio for outage in one.first.outages]
    for factor in (
        DRIFT_FACTORS if max(ratios) > high else [1.0 / f for f in DRIFT_FACTORS if min(ratios) < low]
    ):
        factors = {name: one.factors.get(name, 1.0) * factor for name in ("white", "bias")}
        if (found := trial.candidate(one.name, one.config, {**one.factors, **factors})) is not None:
            yield found


VARIATIONS = (_with_other_drift, _nearer_to_fixes)
"""What is tried where a candidate does not follow the fixes, or predict outages."""


def _fit_factors(
    best: Candidate, score: Callable[[FilterConfig], PredictiveScore | None]
) -> Mapping[str, float]:
    """Return the factors of a candidate after those moves that raise its log density, one after another."""
    factors, nats = dict(best.factors), best.first.nats
    gains: dict[str, list[float]] = {}
    for step in STEPS:
        for name in (*FACTORS, *(own for own in STAYING if POSITION in factors)):
            if _top_of_parabola(gains.get(name, [])) < MIN_GAIN:
                continue
            gains[name] = []
            for direction in (step, 1.0 / step):
                moved = False
                for _ in range(MAX_MOVES):
                    trial = {**factors, name: factors.get(name, 1.0) * direction}
                    found = score(with_noise_factors(best.config, trial))
                    gains[name].append(-np.inf if found is None else found.nats - nats)
                    if found is None or found.nats < nats + MIN_GAIN:
                        break
                    factors, nats, moved = trial, found.nats, True
                if moved:
                    gains[name] = []
                    break
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


def _note(
    kept: str, before: PredictiveScore, after: PredictiveScore, pairs: Mapping[float, FloatArray]
) -> str:
    """Return in words what was kept and what it does."""
    alone = "" if after.fixes_rms is None else f" (fixes alone {after.fixes_rms:.3g} m)"
    if not after.follows(MAX_TRACKING_RATIO):
        alone += ", so that where there are fixes they are better than this filter"
    elif not after.follows():
        alone += ", a difference within the scatter of a drive"
    if kept == "as it began":
        outages = "; ".join(
            f"{b.seconds:.0f} s without fixes {b.rms:.3g} m, true ÷ predicted {b.ratio:.2f}"
            for b in before.outages
        )
        return (
            "the configuration stays as it began: no change predicts the last 40 % of the drive better without "
            f"larger errors; position with fixes {after.tracking_rms:.3g} m{alone}; {outages}"
        )
    ratios = ", ".join(
        f"{b.ratio:.2f} → {a.ratio:.2f} ({a.seconds:.0f} s, {len(a.square)} of them)"
        for b, a in zip(before.outages, after.outages, strict=False)
    )
    errors = ", ".join(_change_text(seconds, pair) for seconds, pair in pairs.items())
    return (
        f"kept: {kept}; on the last 40 % of the drive position with fixes {before.tracking_rms:.3g} → "
        f"{after.tracking_rms:.3g} m{alone}, outages true ÷ predicted {ratios}; errors in outages of the whole drive "
        f"{errors}"
    )


def _change_text(seconds: float, pairs: FloatArray) -> str:
    """Return in words how errors in outages of a length change, with the 95 % interval of the change."""
    before, after = np.sqrt(pairs.mean(axis=0))
    low, high = change_interval(pairs)
    return (
        f"{seconds:.0f} s {before:.3g} → {after:.3g} m (by {low:+.2g} … {high:+.2g} m, {len(pairs)} of them)"
    )
