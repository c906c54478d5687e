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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.arrays import FloatArray, IntArray
from models.probability import student_quantile
from tuner.consistency.correlated_errors import independent_count, independent_means, whitened
from tuner.consistency.output_errors import OutputErrors, output_errors
from tuner.consistency.output_scores import aided_rows, known_epochs
from tuner.consistency.score_output import OutputScore
from tuner.consistency.scores import BLOCKS, OUTAGE_LENGTHS, outage_epochs
from tuner.formats.customary_units import digits, percent
from tuner.limits import HONEST_RATIO, LOST_SHARE, SHOWN_CHANGE, TOLERATED_RATIO
from tuner.types.filter_output import FilterOutput
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
    rows = _shared([*_of_errors(after, before), *_of_outages(after, before)])
    rows = rows or _shared(_of_innovations(after, before))
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
    for (name, own), unit in zip(BLOCKS.items(), BLOCK_UNITS, strict=True):
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


class _Errors(NamedTuple):
    """Errors of one quantity in one run, s, shapes (n,), (n, 3), (n, 3, 3)."""

    t: FloatArray
    error: FloatArray
    covariance: FloatArray


Rows = Iterable[tuple[str, str, list[tuple[_Errors, _Errors]]]]
"""Names, units and runs, before and after, of quantities."""


def _shared(rows: Rows) -> list[tuple[str, str, list[tuple[_Errors, _Errors]]]]:
    """Return quantities without runs that share no epochs, and none without runs."""
    found = [(name, unit, [run for run in runs if len(run[0].t)]) for name, unit, runs in rows]
    return [row for row in found if row[2]]


def _expect_pairs(after: Sequence[FilterOutput], before: Sequence[FilterOutput]) -> None:
    """Refuse outputs that are not paired."""
    if len(after) != len(before):
        raise DataError(
            f"--against: expected one output for each of {len(after)} estimates, found {len(before)}"
        )


def _common(before: _Errors, after: _Errors) -> tuple[_Errors, _Errors]:
    """Return errors at the epochs that two clocks have in common."""
    second, first = _same_epochs(after.t, before.t)
    return _Errors(*(each[first] for each in before)), _Errors(*(each[second] for each in after))


def _same_epochs(after: FloatArray, before: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the rows of two clocks that are one epoch: the nearest within half of the longer interval."""
    if len(after) > len(before):
        second, first = _same_epochs(before, after)
        return first, second
    nearest = np.searchsorted(0.5 * (before[1:] + before[:-1]), after, side="right")
    step = float(np.median(np.diff(after))) if len(after) > 1 else 0.0
    near = np.flatnonzero(np.abs(before[nearest] - after) <= 0.5 * step + 1e-9)
    return near, nearest[near]


def _of_errors(after: OutputScore, before: OutputScore) -> Rows:
    """Yield the blocks of the errors against a truth, while aided, that both know."""
    pairs = list(zip(before.runs, after.runs, strict=False))
    for (name, own), unit in zip(BLOCKS.items(), BLOCK_UNITS, strict=True):
        yield name, unit, [_common(*(_known(run, aided_rows(run), own) for run in pair)) for pair in pairs]


def _of_outages(after: OutputScore, before: OutputScore) -> Rows:
    """Yield the position after some time without fixes, of the windows that both have."""
    for seconds in OUTAGE_LENGTHS:
        first, second = (
            [
                _known(run, outage_epochs(run.t, run.estimate.outages, seconds), BLOCKS["position"])
                for run in score.runs
            ]
            for score in (before, after)
        )
        pairs = [pair for pair in zip(first, second, strict=False) if len(pair[0].t) == len(pair[1].t)]
        yield f"position after {seconds:g} s", "m", pairs


def _known(run: OutputErrors, rows: IntArray, own: slice) -> _Errors:
    """Return the errors of a block at those of some epochs at which they are known."""
    rows = rows[known_epochs(run, own)[rows]]
    return _Errors(run.t[rows], run.error[rows, own], run.covariance[rows, own, own])


def _of_innovations(after: OutputScore, before: OutputScore) -> Rows:
    """Yield the innovations of positions and velocities at the fixes that both used."""
    pairs = list(zip(before.outputs, after.outputs, strict=True))
    for name, unit, own in (
        ("position innovations", "m", slice(0, 3)),
        ("velocity innovations", "m/s", slice(3, 6)),
    ):
        yield name, unit, [_common(*(_innovations(one, own) for one in pair)) for pair in pairs]


def _innovations(one: FilterOutput, own: slice) -> _Errors:
    """Return the innovations with sds of one measurement."""
    z, s = one.innovation[:, own], one.innovation_covariance[:, own, own]
    rows = np.isfinite(z).all(axis=1) & (_sds(one.innovation_covariance, own) > 0.0).all(axis=1)
    return _Errors(one.t[rows], z[rows], s[rows])


def _sds(covariance: FloatArray, own: slice) -> FloatArray:
    """Return the sds of a block, shape (n, 3)."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, own])


def _paired(name: str, unit: str, runs: Sequence[tuple[_Errors, _Errors]], tail: float) -> PairedScore:
    """Return the comparison of a row.

    An error that stays is one value, however many epochs have it: so those of both runs limit the independent ones.
    """
    w = [[whitened(one.error[..., None], one.covariance)[..., 0] for one in run] for run in runs]
    most = sum(min(map(independent_count, run)) for run in w)
    plain = [np.stack([np.sum(one.error**2, axis=1) for one in run]) for run in runs]
    normal = [np.stack([np.mean(one**2, axis=1) for one in run]) for run in w]
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


def _reasons(one: PairedScore) -> Iterator[Reason]:
    """Yield why a row is worse: larger errors, or sds further from them."""
    words = one.name.replace("_", " ")
    if one.error[1] > 1.0 and one.error[0] > 1.0 + SHOWN_CHANGE:
        yield Reason(Use.WORSE, f"{words} errs {_times(one.error)} as much")
    before, after = (abs(math.log(ratio)) for ratio in one.honesty)
    if (
        after > max(before, math.log(TOLERATED_RATIO if one.name == "attitude" else HONEST_RATIO))
        and not one.normalised[1] <= 1.0 <= one.normalised[2]
    ):
        change = " → ".join(digits(ratio) for ratio in one.honesty)
        yield Reason(Use.WORSE, f"true ÷ predicted of {words} {change}")


def _is_better(one: PairedScore) -> bool:
    """Return whether the errors of a row are shown to be smaller."""
    return one.error[2] < 1.0 and one.error[0] < 1.0 - SHOWN_CHANGE


def _gain(one: PairedScore) -> Reason:
    """Say how much smaller the errors of a row are after the change."""
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
