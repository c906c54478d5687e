"""Which configuration to write for a drive: fitted on its first 60 %, kept where it predicts the last 40 % better.

Candidates are the configuration as it began, the same with the sds of the fixes as found, and the one with all
findings, each as it is and with errors of the receiver that stay (`staying_errors`). The one that predicts outages of
the first part best (`predictive_score`) also gets factors on its noise: innovations a tenth of a second ahead do not
show what adds up over a minute, such as vibration that turns into bias. Factors are found one after another, by steps
of 3 and then of √3, each kept where it gains `MIN_GAIN`.

On the last part a candidate replaces the beginning only where its log density is larger and nothing that a user reads
is worse: positions with fixes, and errors in outages of the whole drive, compared in pairs (`outage_pairs`). Candidates
are tried in the order of their log density on the first part; where none passes, the configuration stays as it began.
Where a reference shows that positions err more than the fixes alone, or outages other than predicted, those of
`NEARER_TO_FIXES` are tried, then the other beginnings and theirs. Written is the first whose positions do not and
whose errors in outages are predicted (`CONSISTENT_RATIOS`); else one that predicts them and errs like the fixes, within
`MAX_TRACKING_RATIO`; else one whose positions err no more. Where there is none, the note says that the fixes are
better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

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
    PredictiveScore,
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
from tuner.navigation.drive.clock import clock_of_drive
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


def choose_config(
    drive: Drive, examined: ExaminedDrive, before: FilterConfig, after: FilterConfig, progress: Progress
) -> HeldOutChoice:
    """Choose the configuration of a drive by its last part.

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
    cut = begin + FITTED_SHARE * (end - begin)

    runs: dict[str, ConfiguredRun] = {}

    def run_of(name: str, config: FilterConfig) -> ConfiguredRun:
        """Return the run of a configuration that differs from that of a name in its noise only."""
        if name not in runs:
            runs[name] = configured_run(drive, config, clock)
        return with_other_noise(runs[name], drive, config, clock)

    def score(name: str, config: FilterConfig, first: float, last: float) -> PredictiveScore | None:
        try:
            return predictive_score(run_of(name, config), first, last)
        except (DataError, np.linalg.LinAlgError):
            return None

    def on_first_part(name: str) -> Callable[[FilterConfig], PredictiveScore | None]:
        return lambda config: score(name, config, begin, cut)

    progress("fitting the noise to outages of the first part of the drive")
    written = {"as it began": before, "with the findings": after}
    fitted = dict(written)
    if after is not before and examined.search.accepted:
        try:
            part = fitted_before(examined.drive, examined.search, cut)
        except DataError:
            del fitted["with the findings"]
        else:
            fitted["with the findings"] = replace(part.config, compensation=part.compensation)
            if {one.cause for one in examined.search.accepted} - {GNSS_NOISE_SCALE}:
                written[SDS_FOUND] = with_sds_of(before, after)
                fitted[SDS_FOUND] = with_sds_of(before, fitted["with the findings"])
    else:
        del fitted["with the findings"]
    candidates: list[Candidate] = []
    for name, config in fitted.items():
        least = -np.inf
        for factors in (MappingProxyType({}), FIRST_STAYING):
            first = score(name, with_noise_factors(config, factors), begin, cut)
            if first is not None and first.nats >= least:
                candidates.append(Candidate(name, config, factors, first))
                least = first.nats + len(FIRST_STAYING) * MIN_GAIN
    begun = score("as it began", before, cut, end)
    if begun is None or not candidates:
        if after == before:
            return HeldOutChoice(before, "as it began", note=f"{TOO_SHORT}: they stay as they began")
        return HeldOutChoice(after, "with the findings", note=NOT_JUDGED)
    best = max(candidates, key=_nats)
    candidates += _refined(best, on_first_part(best.name))
    progress("judging the configurations on the last part of the drive")
    began = run_of("as it began", before)

    def judged(one: Candidate) -> HeldOutChoice | None:
        config = with_noise_factors(one.config, one.factors)
        late = score(one.name, config, cut, end)
        if late is None or not is_better(begun, late):
            return None
        pairs = outage_pairs(began, run_of(one.name, config), begin, end)
        if any(change_interval(pair, 2.0 * WORSE_PROBABILITY - 1.0)[0] > 0.0 for pair in pairs.values()):
            return None
        kept = f"{one.name}, factors for outages" if one.factors else one.name
        chosen, note = with_recorded_factors(written[one.name], one.factors), _note(kept, begun, late, pairs)
        return HeldOutChoice(chosen, kept, one.factors, begun, late, pairs, note)

    def follows(found: HeldOutChoice, ratio: float) -> bool:
        """Whether positions err no more than the fixes, times a ratio, by the settings as fitted and as written."""
        if found.after is None or not found.after.follows(ratio):
            return False
        name = "as it began" if found.kept.startswith("as it began") else f"{found.kept}, as written"
        stored = score(name, found.config, cut, end)
        return stored is not None and stored.follows(ratio)

    passing = None
    for one in sorted(candidates, key=_nats, reverse=True):
        passing = judged(one)
        if passing is not None:
            break
    if passing is None:
        return HeldOutChoice(
            before, "as it began", {}, begun, begun, note=_note("as it began", begun, begun, {})
        )
    nearer = passing if drive.reference is None or follows(passing, 1.0) else None
    if nearer is not None and (drive.reference is None or passing.is_predicted):
        return passing
    alike = passing if passing.is_predicted and follows(passing, MAX_TRACKING_RATIO) else None

    def tried(chosen: Sequence[Candidate]) -> HeldOutChoice | None:
        """Return the first that follows the fixes and predicts outages; keep the first that does either."""
        nonlocal nearer, alike
        for other in chosen:
            found = judged(other)
            if found is None or not follows(found, MAX_TRACKING_RATIO):
                continue
            strictly = follows(found, 1.0)
            if strictly and found.is_predicted:
                return found
            nearer = found if strictly and nearer is None else nearer
            alike = found if found.is_predicted and alike is None else alike
        return None

    best_of_all = tried(_nearer_to_fixes(one))
    if best_of_all is None and alike is None:
        others = []
        for name in dict.fromkeys(other.name for other in sorted(candidates, key=_nats, reverse=True)):
            if name != one.name:
                next_best = max((other for other in candidates if other.name == name), key=_nats)
                others += _refined(next_best, on_first_part(name))
        best_of_all = tried([*others, *(near for it in others for near in _nearer_to_fixes(it))])
    return best_of_all or alike or nearer or passing


def _nats(one: Candidate) -> float:
    """Return the log density of the first part."""
    return one.first.nats


def _refined(best: Candidate, score: Callable[[FilterConfig], PredictiveScore | None]) -> list[Candidate]:
    """Return a candidate with factors that raise its log density; none where there is nothing to score."""
    factors = _fit_factors(best, score)
    first = score(with_noise_factors(best.config, factors))
    return [] if first is None else [replace(best, factors=factors, first=first)]


def is_better(before: PredictiveScore, after: PredictiveScore) -> bool:
    """Whether one score is larger than another and positions with fixes are not worse."""
    return after.nats > before.nats and after.tracking_rms <= MAX_TRACKING_RATIO * before.tracking_rms


def _nearer_to_fixes(one: Candidate) -> list[Candidate]:
    """Return a candidate with less and less trust in velocities, then also with more and more in positions."""
    found = []
    for less, more in NEARER_TO_FIXES:
        factors = {**one.factors, VELOCITY: one.factors.get(VELOCITY, 1.0) * less}
        if more < 1.0:
            factors |= {name: one.factors.get(name, 1.0) * more for name in POSITIONS}
        found.append(replace(one, factors=factors))
    return found


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
