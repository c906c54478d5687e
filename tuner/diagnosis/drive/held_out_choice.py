"""Which configuration to write for a drive: fitted on its first 60 %, kept where it predicts the last 40 % better.

Candidates are the configuration as it began, the same with the sds of the fixes as found, and the one with all
findings, each as it is and with errors of the receiver that stay (`staying_errors`). The one that predicts outages of
the first part best (`predictive_score`), and the one whose innovations fit best, also get factors on their noise:
innovations a tenth of a second ahead do not show what adds up over a minute, such as vibration that turns into bias.
Factors are found one after another, by steps of 3 and then of √3, each kept where it gains `MIN_GAIN`.

On the last part a candidate replaces the beginning only where its log density is larger and nothing that a user reads
is worse: positions with fixes, and errors in outages of the whole drive, compared in pairs (`outage_pairs`). Candidates
are tried in the order of their log density on the first part, those whose innovations are as large as predicted before
the others, of alike ones (`MIN_GAIN`) the nearest to the beginning first; where none passes, it is written.
Without a reference the first that passes is written. With one (`trusted_reference`) the best `Rank` is: positions of
both parts err no more than the fixes, innovations are as large as predicted, and so are errors in outages of the whole
drive, one after another (`all_outages`). Further candidates are tried until one does: errors of the receiver that
wander less, more or less process noise, less trust in velocities, the other beginnings. Settings whose innovations
contradict them are written only where no others come near the fixes. So the last part decides what is refused, and
little of what is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.reference_check import with_trusted_reference
from tuner.diagnosis.drive.candidates import (
    BEGINNING,
    MAX_TRACKING_RATIO,
    Candidate,
    Rank,
    Trial,
    by_nats,
    first_candidates,
    in_order,
    refined,
    rounds_of,
)
from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES
from tuner.diagnosis.drive.causes.time_offset import with_clock
from tuner.diagnosis.drive.config_after_drive import as_estimated, with_records
from tuner.diagnosis.drive.diagnose import ExaminedDrive
from tuner.diagnosis.drive.held_out_gain import change_interval, fitted_before
from tuner.diagnosis.drive.noise_factors import (
    with_noise_factors,
    with_recorded_factors,
    with_sds_of,
)
from tuner.diagnosis.drive.outage_errors import OutageErrors, all_outages, outage_pairs
from tuner.diagnosis.drive.predictive_score import PredictiveScore
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.stages import stage, task
from tuner.types import FilterConfig
from tuner.types.progress import Progress
from tuner.types.records import DataError, Drive

WORSE_LEVEL = 0.8
"""Level of an interval above zero with which errors in outages are likely larger: such settings come last."""
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
        By how much the noise of that configuration was multiplied; names are those of `FACTORS`.
    before, after : PredictiveScore or None
        On the last part: as it began, and as written; None where the drive is too short.
    outages : mapping of float to ndarray, shape (w, 2)
        Squared errors in outages of the whole drive, m², as it began and as written, by length, s.
    note : str
        What was decided, and why, in words.
    despite : str
        Why it is written although innovations contradict it, in words; empty where they do not.
    """

    config: FilterConfig
    kept: str
    factors: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    before: PredictiveScore | None = None
    after: PredictiveScore | None = None
    outages: Mapping[float, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    note: str = ""
    despite: str = ""

    def settles(self, cause: str) -> bool:
        """Return whether what is found of a cause is in its settings: what joins the noise or states of a filter."""
        return self.kept != BEGINNING and DRIVE_CAUSES[cause].joins != "preprocessing"


@task()
def choose_config(
    drive: Drive, examined: ExaminedDrive, before: FilterConfig, after: FilterConfig, progress: Progress
) -> HeldOutChoice:
    """Choose the configuration of a drive by its first part, and keep it where the last is predicted better.

    Parameters
    ----------
    drive : Drive
        As examined.
    examined : ExaminedDrive
        Its diagnosis.
    before, after : FilterConfig
        As it began, and with all findings.
    progress : callable
        Called with what is being done.
    """
    before, after = with_clock(before, drive.clock), with_clock(after, drive.clock)
    begin, end = float(drive.gnss.t[0]), float(drive.gnss.t[-1])
    drive = with_trusted_reference(drive)
    trial = Trial(drive, begin, begin + FITTED_SHARE * (end - begin), end)

    progress("fitting the noise to outages of the first part of the drive")
    stage("fitting the noise to outages of the first part of the drive", 0.5)
    written = _written(examined, before, with_clock(_refitted(examined, after), drive.clock))
    candidates = first_candidates(trial, _fitted(examined, written, trial.cut))
    begun = trial.score(BEGINNING, before, trial.cut, end)
    if begun is None or not candidates:
        if after == before:
            return HeldOutChoice(before, BEGINNING, note=f"{TOO_SHORT}: they stay as they began")
        return HeldOutChoice(after, "with the findings", note=NOT_JUDGED)
    first, best = in_order(candidates)[0], max(candidates, key=by_nats)
    starts = (first,) if first is best else (first, best)
    candidates = in_order([*candidates, *(more for one in starts for more in refined(trial, one))])
    progress("judging the configurations on the last part of the drive")

    stage("judging the settings on the last part of the drive", 1.0)
    outages = all_outages(trial.run_of(BEGINNING, before), begin, end)

    known: dict[tuple[str, tuple[tuple[str, float], ...]], tuple[HeldOutChoice, Rank] | None] = {}

    def judged(one: Candidate) -> tuple[HeldOutChoice, Rank] | None:
        key = one.name, tuple(sorted(one.factors.items()))
        if key not in known:
            known[key] = _judged(examined, trial, begun, outages, written[one.name], one)
        return known[key]

    chosen = first_of_best(rounds_of(trial, candidates), judged, has_reference=drive.reference is not None)
    if chosen is None:
        late = _since(outages, trial.cut)
        note = _note(BEGINNING, begun, begun, {}, late)
        return HeldOutChoice(before, BEGINNING, {}, begun, begun, note=note)
    rivals = [each[0] for each in known.values() if each is not None]
    despite = _despite(chosen, rivals)
    return replace(chosen, despite=despite, note=f"{chosen.note}; {despite}" if despite else chosen.note)


@task()
def first_of_best(
    rounds: Iterable[Iterable[Candidate]],
    judged: Callable[[Candidate], tuple[HeldOutChoice, Rank] | None],
    *,
    has_reference: bool,
) -> HeldOutChoice | None:
    """Return the first choice of the best rank, candidates that the last part refuses left out; None for none.

    Without a reference no ranks differ in what they say of the fixes: the first is taken that neither innovations nor
    outages contradict, and after the second round whatever is best.

    Parameters
    ----------
    rounds : iterable of iterables of Candidate
        In the order of trial; after the second, a round is looked at only where no earlier one has a candidate that
        predicts outages and errs like the fixes.
    judged : callable
        What is written of a candidate, and its rank; None where the last part refuses it.
    has_reference : bool
        Whether the drive has a reference.
    """
    chosen, rank = None, None
    for number, candidates in enumerate(rounds):
        stage("", 1.0 - 0.5 ** (number + 1))
        for one in candidates:
            if rank is not None and one.best_rank >= rank:
                continue
            found = judged(one)
            if found is None or (rank is not None and found[1] >= rank):
                continue
            chosen, rank = found
            if rank == Rank.FOLLOWS_AND_PREDICTS or (not has_reference and rank <= Rank.LIKE_FIXES):
                return chosen
        if number > 0 and rank is not None and (rank <= Rank.LIKE_FIXES or not has_reference):
            return chosen
    return chosen


def _refitted(examined: ExaminedDrive, after: FilterConfig) -> FilterConfig:
    """Return the configuration with all findings, their values fitted together to the whole drive.

    The search fits each as it is found; candidates are fitted together, and so is what is written of them.
    """
    if not examined.search.accepted:
        return after
    try:
        found = fitted_before(examined.drive, examined.search, np.inf)
    except DataError:
        return after
    return as_estimated(examined, replace(after, compensation=examined.search.determined(found.compensation)))


def _written(examined: ExaminedDrive, before: FilterConfig, after: FilterConfig) -> dict[str, FilterConfig]:
    """Return the configurations that may be written, by name, the one as it began first."""
    written = {BEGINNING: before}
    if after is not before and examined.search.accepted:
        written["with the findings"] = after
        if {one.cause for one in examined.search.accepted} - {GNSS_NOISE_SCALE}:
            written[SDS_FOUND] = with_records(examined, with_sds_of(before, after))
    return written


def _fitted(
    examined: ExaminedDrive, written: Mapping[str, FilterConfig], cut: float
) -> dict[str, FilterConfig]:
    """Return the same configurations with values fitted before a time, s; without those that cannot be fitted."""
    fitted = {BEGINNING: written[BEGINNING]}
    if len(written) == 1:
        return fitted
    try:
        part = fitted_before(examined.drive, examined.search, cut)
    except DataError:
        return fitted
    compensation = examined.search.determined(part.compensation)
    found = with_clock(replace(written["with the findings"], compensation=compensation), examined.drive.clock)
    fitted["with the findings"] = found
    if SDS_FOUND in written:
        fitted[SDS_FOUND] = with_sds_of(written[BEGINNING], found)
    return fitted


def _judged(
    examined: ExaminedDrive,
    trial: Trial,
    begun: PredictiveScore,
    before: Mapping[float, OutageErrors],
    written: FilterConfig,
    one: Candidate,
) -> tuple[HeldOutChoice, Rank] | None:
    """Return a candidate as it is written; None where the last part, or errors in outages, speak against it.

    Written are values of the whole drive, or those of the first part where these predict the last better: a fit to more
    of a drive that predicts that less has failed. Its rank is that of the worst of all parts, the last where its errors
    in outages are likely larger.
    """
    name, config = one.name, with_noise_factors(one.config, one.factors)
    late, base = trial.score(name, config, trial.cut, trial.end), one.config
    if late is None or not is_better(begun, late):
        return None
    parts = [one.first, late]
    if name != BEGINNING:
        whole, of_whole = f"{name}, of the whole drive", with_noise_factors(written, one.factors)
        again = trial.score(whole, of_whole, trial.cut, trial.end)
        if again is not None and again.nats >= late.nats:
            name, config, base, late = whole, of_whole, written, again
            parts.append(again)
    after = all_outages(trial.run_of(name, config), trial.begin, trial.end)
    pairs = outage_pairs(before, after)
    if any(change_interval(pair)[0] > 0.0 for pair in pairs.values()):
        return None
    kept = f"{one.name}, factors for outages" if one.factors else one.name
    blind = _since(after, trial.cut)
    chosen = with_recorded_factors(with_records(examined, base), one.factors)
    note = _note(kept, begun, late, pairs, blind)
    likely = any(change_interval(pair, WORSE_LEVEL)[0] > 0.0 for pair in pairs.values())
    rank = Rank.NEITHER if likely else rank_of(parts, list(after.values()))
    return HeldOutChoice(chosen, kept, one.factors, begun, late, pairs, note), rank


def _since(outages: Mapping[float, OutageErrors], t: float) -> tuple[OutageErrors, ...]:
    """Return the outages that begin at a time, s, or later."""
    late = [one.since(t) for one in outages.values()]
    return tuple(one for one in late if len(one.square))


def rank_of(parts: Sequence[PredictiveScore], outages: Sequence[OutageErrors]) -> Rank:
    """Return the rank of a candidate from its scores on both parts, and its errors in outages of the whole drive."""
    follows = all(part.follows() for part in parts)
    near = all(part.follows(MAX_TRACKING_RATIO) for part in parts)
    refuted = any(one.refuted for one in outages)
    if near and not refuted and not any(part.contradicted for part in parts):
        if all(one.predicted for one in outages):
            return Rank.FOLLOWS_AND_PREDICTS if follows else Rank.PREDICTS
        return Rank.NOT_REFUTED if follows else Rank.LIKE_FIXES
    if follows:
        return Rank.FOLLOWS if refuted else Rank.CONTRADICTED
    return Rank.NEITHER


def _despite(chosen: HeldOutChoice, rivals: Sequence[HeldOutChoice]) -> str:
    """Return why settings are written that innovations contradict, beside the best that they do not."""
    if chosen.after is None or not chosen.after.contradicted:
        return ""
    own = " and ".join(f"{one:.2f}" for one in chosen.after.innovations)
    right = [one for one in rivals if one.after is not None and not one.after.contradicted]
    if not right:
        return f"innovations are {own} × predicted, and no settings that were tried have them as predicted"
    best = min(right, key=_tracking)
    return (
        f"innovations are {own} × predicted: settings that have them as predicted err {_tracking(best):.3g} m "
        f"with fixes instead of {_tracking(chosen):.3g} m"
    )


def _tracking(one: HeldOutChoice) -> float:
    """Return the position error with fixes, m."""
    return np.inf if one.after is None else one.after.tracking_rms


def is_better(before: PredictiveScore, after: PredictiveScore) -> bool:
    """Whether one score is larger than another and positions with fixes are not worse."""
    return after.nats > before.nats and after.tracking_rms <= MAX_TRACKING_RATIO * before.tracking_rms


def _note(
    kept: str,
    before: PredictiveScore,
    after: PredictiveScore,
    pairs: Mapping[float, FloatArray],
    late: Sequence[OutageErrors],
) -> str:
    """Return in words what was kept and what it does."""
    alone = "" if after.fixes_rms is None else f" (fixes alone {after.fixes_rms:.3g} m)"
    if not after.follows(MAX_TRACKING_RATIO):
        alone += ", so that where there are fixes they are better than this filter"
    elif not after.follows():
        alone += ", a difference within the scatter of a drive"
    if kept == BEGINNING:
        outages = "; ".join(one.text for one in late)
        return (
            "the configuration stays as it began: no change predicts the last 40 % of the drive better without "
            f"larger errors; position with fixes {after.tracking_rms:.3g} m{alone}; without them for {outages}"
        )
    ratios = "; ".join(one.text for one in late)
    errors = ", ".join(_change_text(seconds, pair) for seconds, pair in pairs.items())
    return (
        f"trial of whole configurations, kept: {kept}; on the last 40 % of the drive position with fixes "
        f"{before.tracking_rms:.3g} → {after.tracking_rms:.3g} m{alone}; without them for {ratios}; "
        f"errors in outages of the whole drive {errors}"
    )


def _change_text(seconds: float, pairs: FloatArray) -> str:
    """Return in words how errors in outages of a length change, with the 95 % interval of the change."""
    before, after = np.sqrt(pairs.mean(axis=0))
    low, high = (1.0 + end / before for end in change_interval(pairs))
    return f"{seconds:.0f} s × {after / before:.2f} ({low:.2f} … {high:.2f}, {len(pairs)} of them)"
