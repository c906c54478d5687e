"""Did a change make a filter worse? Its outputs before and after at the same epochs.

Squares a after and b before, |e|² or eᵀP⁻¹e, have the ratio R = Σ a/Σ b. Its logarithm varies as the mean of
d = a/ā − b/b̄, from which what both runs share is gone: the route, the sensors, the errors of the truth::

    var ln R = mean(d²)/N       N independent epochs by the autocorrelation of d

The interval is that of Student's t with N − 1 degrees of freedom. `WORSE_CHANCE` is the chance that any row of two
filters that are equally good is called worse. Where there is neither truth nor innovation, outputs are only said to
differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray, IntArray
from models.probability import student_quantile
from tuner.consistency.correlated_errors import independent_count, independent_means, whitened
from tuner.consistency.output_errors import output_errors
from tuner.consistency.output_scores import aided_rows, known_epochs
from tuner.consistency.score_output import OutputScore
from tuner.consistency.scores import OUTAGE_LENGTHS, outage_epochs
from tuner.formats.customary_units import digits, percent
from tuner.limits import HONEST_RATIO, LOST_SHARE, SHOWN_CHANGE, TOLERATED_RATIO
from tuner.types.filter_output import BLOCKS, FilterOutput
from tuner.types.judgement import Judgement, Reason, Use, judged
from tuner.types.records import DataError

WORSE_CHANCE = 1e-3
"""Chance that one of two filters that are equally good is called worse."""
LEAST_COUNT = 20.0
"""Independent epochs from which a change is shown: of 32 the level of 0.1 % is 0.3 %, of 12 it is 1 % (simulated)."""
LEAST_DIFFERENCE = 1e-9
"""Difference, SI, that double precision makes of one value."""
BLOCK_UNITS = ("m", "m/s", "rad", "rad/s", "m/s^2")
"""SI units of the blocks."""
Ratio = tuple[float, float, float]
"""A ratio, and the ends of its interval."""


@dataclass(frozen=True)
class PairedScore:
    """One quantity before and after, at the same epochs.

    Attributes
    ----------
    name, unit : str
        Which, and the SI unit of its errors.
    rms : (float, float)
        Rms error before and after.
    honesty : (float, float)
        True ÷ predicted before and after; NaN without sds.
    error, normalised : (float, float, float)
        Rms after ÷ before of the errors, and of the errors in their sds, with the ends of the interval.
    count : float
        Independent epochs.
    """

    name: str
    unit: str
    rms: tuple[float, float]
    honesty: tuple[float, float]
    error: Ratio
    normalised: Ratio
    count: float


@dataclass(frozen=True)
class Difference:
    """How far a block of two outputs is apart, where no truth says which is better.

    Attributes
    ----------
    name, unit : str
        Which, and its SI unit.
    rms : float
        Of the differences of the two outputs.
    largest, at : float
        Largest difference of a component in sds of the later output, and when, s.
    sds : float
        Sds after ÷ before, median.
    """

    name: str
    unit: str
    rms: float
    largest: float
    at: float
    sds: float


@dataclass(frozen=True)
class OutputChange:
    """What a change made of the output of a filter.

    Attributes
    ----------
    verdict : Judgement
        Whether it is worse.
    scores : tuple of PairedScore
        By errors against a truth, else by innovations.
    differences : tuple of Difference
        Where neither is known.
    """

    verdict: Judgement
    scores: tuple[PairedScore, ...] = ()
    differences: tuple[Difference, ...] = ()


def changed_scores(after: OutputScore, before: OutputScore) -> OutputChange:
    """Compare two scored outputs of one filter, run by run.

    Raises
    ------
    DataError
        Where the numbers of runs differ, or two runs share no times: one line.
    """
    _expect_pairs(after.outputs, before.outputs)
    rows = [*_of_errors(after, before), *_of_outages(after, before)] or list(_of_innovations(after, before))
    if not rows:
        raise DataError(f"{after.outputs[0].name}: expected times of {before.outputs[0].name}, found none")
    tail = 0.5 * WORSE_CHANCE / (2 * len(rows))
    scores = tuple(_paired(name, unit, runs, tail) for name, unit, runs in rows)
    reasons = [*_lost(after, before), *(reason for one in scores for reason in _reasons(one))]
    longest = max(one.count for one in scores)
    if not reasons and longest < LEAST_COUNT:
        text = f"{digits(longest, 2)} independent epochs, {LEAST_COUNT:g} are needed"
        return OutputChange(Judgement(Use.TOO_SHORT, (text,)), scores)
    best = Use.BETTER if any(map(_is_better, scores)) else Use.NOT_WORSE
    if not reasons and best is Use.NOT_WORSE:
        if all(one.error == one.normalised == (1.0, 1.0, 1.0) for one in scores):
            return OutputChange(Judgement(best, (ALL_SAME,)), scores)
        shown = [one for one in scores if one.error[2] < math.inf]
        most = max(shown, key=lambda one: one.error[2])
        text = f"no error grows, by the intervals by {digits(most.error[2])} × at most ({most.name.replace('_', ' ')})"
        return OutputChange(Judgement(best, (text,)), scores)
    return OutputChange(judged(best, reasons or map(_gain, filter(_is_better, scores))), scores)


def differences(after: Sequence[FilterOutput], before: Sequence[FilterOutput]) -> OutputChange:
    """Compare outputs that state neither innovations nor have a truth, run by run.

    Raises
    ------
    DataError
        Where the numbers of runs differ, or two runs share no times: one line.
    """
    _expect_pairs(after, before)
    runs = [output_errors(one, other) for one, other in zip(after, before, strict=True)]
    found = []
    for i, (name, unit) in enumerate(zip(BLOCKS, BLOCK_UNITS, strict=True)):
        own = slice(3 * i, 3 * i + 3)
        error, sd, other = (
            np.concatenate(parts)
            for parts in (
                [run.error[:, own] for run in runs],
                [_sds(run.estimate.covariance, own) for run in runs],
                [_sds(run.covariance - run.estimate.covariance, own) for run in runs],
            )
        )
        if not np.isfinite(error).any():
            continue
        size = np.where(sd > 0.0, np.abs(error) / np.where(sd > 0.0, sd, 1.0), 0.0)
        place = np.unravel_index(int(np.argmax(np.nan_to_num(size))), size.shape)
        at = float(np.concatenate([run.t for run in runs])[place[0]])
        both = (sd > 0.0) & (other > 0.0)
        ratio = float(np.median(sd[both] / other[both])) if both.any() else math.nan
        rms = float(np.sqrt(np.nanmean(np.sum(error**2, axis=1))))
        found.append(Difference(name, unit, rms, float(size[place]) if both.any() else math.nan, at, ratio))
    reasons = list(map(_difference, filter(_is_different, found)))
    if not reasons:
        exact = all(one.rms < LEAST_DIFFERENCE for one in found)
        return OutputChange(Judgement(Use.NOT_WORSE, (ALL_SAME if exact else NEARLY_SAME,)), (), tuple(found))
    more = Reason(Use.DIFFERENT, "only a truth (--truth) or innovations say which is better")
    return OutputChange(judged(Use.NOT_WORSE, [*reasons, more]), (), tuple(found))


ALL_SAME, NEARLY_SAME = (
    "every value is the same",
    f"no value differs by {percent(SHOWN_CHANGE)} of its sds or more",
)
"""What is said of outputs that differ in nothing, or in nothing that matters."""


def _is_different(one: Difference) -> bool:
    """Return whether values or sds of a block differ by a share of the sds that matters to a user."""
    return (
        one.largest >= SHOWN_CHANGE
        or abs(one.sds - 1.0) >= SHOWN_CHANGE
        or (math.isnan(one.sds) and one.rms > LEAST_DIFFERENCE)
    )


def _difference(one: Difference) -> Reason:
    """Return how far a block is apart."""
    if math.isnan(one.sds):
        return Reason(Use.DIFFERENT, f"{one.name.replace('_', ' ')}, which has no sds")
    sds = f", sds {digits(one.sds)} ×" if abs(one.sds - 1.0) >= SHOWN_CHANGE else ""
    words = f"by up to {digits(one.largest)} of its sds, at {digits(one.at)} s{sds}"
    return Reason(Use.DIFFERENT, f"{one.name.replace('_', ' ')} {words}")


@dataclass(frozen=True)
class _Pair:
    """Squared errors of one run before and after, shapes (2, n), plain and in their sds, and the independent epochs."""

    plain: FloatArray
    normal: FloatArray
    count: float


Row = tuple[str, str, list[_Pair]]
"""Name, unit and runs of one quantity."""


def _expect_pairs(after: Sequence[FilterOutput], before: Sequence[FilterOutput]) -> None:
    """Refuse outputs that are not paired."""
    if len(after) != len(before):
        raise DataError(
            f"--against: expected one output for each of {len(after)} estimates, found {len(before)}"
        )


def _common(after: FloatArray, before: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the rows of two clocks that are one epoch: the nearest within half of the longer interval."""
    if len(after) > len(before):
        second, first = _common(before, after)
        return first, second
    if not len(after):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    right = np.clip(np.searchsorted(before, after), 1, max(len(before) - 1, 1))
    nearest = np.where(after - before[right - 1] < before[right % len(before)] - after, right - 1, right)
    nearest = np.minimum(nearest, len(before) - 1)
    step = float(np.median(np.diff(after))) if len(after) > 1 else 0.0
    near = np.abs(before[nearest] - after) <= 0.5 * step + 1e-9
    return np.flatnonzero(near), nearest[near]


def _pair(errors: Sequence[FloatArray], covariances: Sequence[FloatArray]) -> _Pair:
    """Return the squares of errors, shapes (n, 3), before and after.

    An error that stays is one value, however many epochs have it: so those of both runs limit the independent ones.
    """
    w = [whitened(e[..., None], p)[..., 0] for e, p in zip(errors, covariances, strict=True)]
    plain, normal = (np.stack([np.mean(one**2, axis=1) for one in each]) for each in (errors, w))
    return _Pair(3.0 * plain, normal, min(map(independent_count, w)))


def _of_errors(after: OutputScore, before: OutputScore) -> Iterator[Row]:
    """Yield the blocks of the errors against a truth, while aided, that both know."""
    for i, (name, unit) in enumerate(zip(BLOCKS, BLOCK_UNITS, strict=True)):
        own, pairs = slice(3 * i, 3 * i + 3), []
        for pair in zip(before.runs, after.runs, strict=False):
            each = []
            for run in pair:
                rows = aided_rows(run.t, run.estimate.outages)
                each.append(rows[known_epochs(run, i)[rows]])
            second, first = _common(pair[1].t[each[1]], pair[0].t[each[0]])
            chosen = each[0][first], each[1][second]
            if len(first):
                pairs.append(
                    _pair(
                        [run.error[rows, own] for run, rows in zip(pair, chosen, strict=True)],
                        [run.covariance[rows, own, own] for run, rows in zip(pair, chosen, strict=True)],
                    )
                )
        if pairs:
            yield name, unit, pairs


def _of_outages(after: OutputScore, before: OutputScore) -> Iterator[Row]:
    """Yield the position after some time without fixes, of the windows that both have."""
    for seconds in OUTAGE_LENGTHS:
        pairs = []
        for pair in zip(before.runs, after.runs, strict=False):
            ends = [outage_epochs(run.t, run.estimate.outages, seconds) for run in pair]
            ends = [rows[known_epochs(run, 0)[rows]] for run, rows in zip(pair, ends, strict=True)]
            if len(ends[0]) and len(ends[0]) == len(ends[1]):
                pairs.append(
                    _pair(
                        [run.error[rows, :3] for run, rows in zip(pair, ends, strict=True)],
                        [run.covariance[rows, :3, :3] for run, rows in zip(pair, ends, strict=True)],
                    )
                )
        if pairs:
            yield f"position after {seconds:g} s", "m", pairs


def _of_innovations(after: OutputScore, before: OutputScore) -> Iterator[Row]:
    """Yield the innovations of positions and velocities at the fixes that both used."""
    for i, (name, unit) in enumerate((("position innovations", "m"), ("velocity innovations", "m/s"))):
        own, pairs = slice(3 * i, 3 * i + 3), []
        for pair in zip(before.outputs, after.outputs, strict=True):
            each = [
                np.flatnonzero(np.isfinite(one.innovation[:, own]).all(axis=1) & _stated(one, own))
                for one in pair
            ]
            second, first = _common(pair[1].t[each[1]], pair[0].t[each[0]])
            chosen = each[0][first], each[1][second]
            if len(first):
                pairs.append(
                    _pair(
                        [one.innovation[rows, own] for one, rows in zip(pair, chosen, strict=True)],
                        [
                            one.innovation_covariance[rows, own, own]
                            for one, rows in zip(pair, chosen, strict=True)
                        ],
                    )
                )
        if pairs:
            yield name, unit, pairs


def _stated(one: FilterOutput, own: slice) -> np.ndarray:
    """Return where the sds of innovations are stated, shape (n,)."""
    return np.asarray((_sds(one.innovation_covariance, own) > 0.0).all(axis=1))


def _sds(covariance: FloatArray, own: slice) -> FloatArray:
    """Return the sds of a block, shape (n, 3)."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, own])


def _paired(name: str, unit: str, runs: Sequence[_Pair], tail: float) -> PairedScore:
    """Return the comparison of a row."""
    most = sum(one.count for one in runs)
    plain, normal = ([one.plain for one in runs], [one.normal for one in runs])
    (error, count), (normalised, _) = (_ratio(squares, most, tail) for squares in (plain, normal))
    rms, honesty = (np.sqrt(np.concatenate(one, axis=1).mean(axis=1)).tolist() for one in (plain, normal))
    return PairedScore(name, unit, (rms[0], rms[1]), (honesty[0], honesty[1]), error, normalised, count)


def _ratio(runs: Sequence[FloatArray], most: float, tail: float) -> tuple[Ratio, float]:
    """Return the ratio of the rms after ÷ before, its interval, and how many epochs are independent, at most `most`."""
    mean = np.concatenate(runs, axis=1).mean(axis=1)
    course = [one[1] - one[0] for one in runs]
    if not (mean > 0.0).all() or not any(one.any() for one in course):
        same = 1.0 if mean[0] == mean[1] else math.inf
        return (same, same, same), LEAST_COUNT
    course = [one[1] / mean[1] - one[0] / mean[0] for one in runs]
    count = min(most, sum(map(independent_means, course)))
    if count < LEAST_COUNT:
        return (math.sqrt(mean[1] / mean[0]), 0.0, math.inf), count
    spread = float(np.mean(np.concatenate(course) ** 2))
    half = -student_quantile(tail, count - 1.0) * math.sqrt(spread / count)
    low, middle, high = np.sqrt(mean[1] / mean[0] * np.exp([-half, 0.0, half])).tolist()
    return (middle, low, high), count


def _honest_to(name: str) -> float:
    """Return the ratio of true to predicted up to which a filter is honest."""
    return TOLERATED_RATIO if name == "attitude" else HONEST_RATIO


def _reasons(one: PairedScore) -> Iterator[Reason]:
    """Yield why a row is worse: larger errors, or sds further from them."""
    words = one.name.replace("_", " ")
    if one.error[1] > 1.0 and one.error[0] > 1.0 + SHOWN_CHANGE:
        yield Reason(Use.WORSE, f"{words} errs {_times(one.error)} as much")
    before, after = (abs(math.log(ratio)) for ratio in one.honesty)
    if (
        after > max(before, math.log(_honest_to(one.name)))
        and not one.normalised[1] <= 1.0 <= one.normalised[2]
    ):
        change = " → ".join(digits(ratio) for ratio in one.honesty)
        yield Reason(Use.WORSE, f"true ÷ predicted of {words} {change}")


def _is_better(one: PairedScore) -> bool:
    """Return whether the errors of a row are shown to be smaller."""
    return one.error[2] < 1.0 and one.error[0] < 1.0 - SHOWN_CHANGE


def _gain(one: PairedScore) -> Reason:
    """Return by how much a row is better."""
    return Reason(Use.BETTER, f"{one.name.replace('_', ' ')} errs {_times(one.error)} as much")


def _times(ratio: Ratio) -> str:
    """Return a ratio with its interval in words."""
    return f"{digits(ratio[0])} ({digits(ratio[1])} to {digits(ratio[2])}) ×"


def _lost(after: OutputScore, before: OutputScore) -> Iterator[Reason]:
    """Yield what the output had before and has no more: finite numbers, times, blocks."""
    if after.consistency.diverged and not before.consistency.diverged:
        yield Reason(Use.WORSE, f"it diverges: {after.consistency.honesty.text}")
    for new, old in zip(after.outputs, before.outputs, strict=True):
        short, span = float(old.t[-1] - new.t[-1]), float(old.t[-1] - old.t[0])
        if short > LOST_SHARE * span:
            yield Reason(Use.WORSE, f"{new.name} ends {digits(short)} s earlier than {old.name}")
    blocks = [{name for name, one in score.consistency.errors.items() if one} for score in (before, after)]
    if missing := sorted(blocks[0] - blocks[1]):
        yield Reason(Use.WORSE, f"{', '.join(missing)} is missing")
