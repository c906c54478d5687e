"""Diagnosis of static records: data quality, motion, search for causes in every channel, what channels share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.noise import NoiseModel
from tuner.diagnosis.data_quality import DataQualityTest, data_quality_tests, without_codes
from tuner.diagnosis.data_quality.causes import Frozen
from tuner.diagnosis.static import shared_shape
from tuner.diagnosis.static.causes import attitude, cross_axis, motion, mount_tilt
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.channel import MAX_GAP_SHARE, MIN_SAMPLES, Channel, fill
from tuner.diagnosis.static.channel_preparation import prepared, prepared_axis
from tuner.diagnosis.static.collinear_warming import collinear_warming
from tuner.diagnosis.static.findings import Single, findings, joins, singles, words
from tuner.diagnosis.static.held_out_gain import with_gains
from tuner.diagnosis.static.hypothesis_tests import threshold
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.position_drift import left_drifts, with_drifts
from tuner.diagnosis.static.posterior_predictive import covered
from tuner.diagnosis.static.reported_noise import noise_after, noise_before
from tuner.diagnosis.static.search import SearchResult, search_causes
from tuner.diagnosis.static.second_log import as_coarse, expect_comparable, second_channel
from tuner.diagnosis.static.sidebands import with_sidebands
from tuner.diagnosis.static.slow_shapes import smooth as smooth_shapes
from tuner.diagnosis.static.something_else import about, with_unknown
from tuner.diagnosis.static.spectrum import aliasing as sampling
from tuner.formats.customary_units import stamp
from tuner.formats.grouping import gathered
from tuner.jobs import each
from tuner.segments.conditions import without_knocks
from tuner.segments.stand_stills import inside
from tuner.segments.stationary import Segments
from tuner.stages import stage, task
from tuner.synthesis.findings import LEFT_OUT, without_stretches
from tuner.types import Coefficient, Diagnosis, Finding, Identification, Unexplained
from tuner.types.arguments import RECORDS, expect_records
from tuner.types.diagnosis import only_determined
from tuner.types.records import DataError, Record

MAX_MOVING_SHARE = 0.4
"""Share of a record that may move before only its longest stationary part is analysed.

Chosen so that the stationary parts are the majority of what is analysed.
"""
SEARCH_COLUMNS = 40
"""Columns of a record that the search in one axis takes: 10 where nothing is found, 41 with ten findings."""


@dataclass(frozen=True)
class _Diagnosed:
    """What the search of one channel found, what no cause explains, its last fit, its noise before and after.

    `outcome` is None where nothing smooth was found, which other channels may share.
    """

    singles: tuple[Single, ...]
    unexplained: tuple[Unexplained, ...]
    final: FittedChannel
    before: NoiseModel
    after: NoiseModel
    outcome: SearchResult | None


WANTED = f"the path of a log or drive, a Drive, or {RECORDS}"
"""What can be diagnosed."""
WHOLE_RECORD = "the whole record"
"""Where a misfit shows that no part of the record shows more than another."""


@task()
def diagnose(
    records: Record | Sequence[Record],
    *,
    holdout: Record | Sequence[Record] | None = None,
    identification: Identification | None = None,
    replicas: int = 0,
    seed: int = 0,
) -> Diagnosis:
    """Find what a simulation of the fitted noise gets wrong in static records, and why.

    Parameters
    ----------
    records : Record or sequence of Record
        Sensors of one log; a covariate ``temperature`` is used where there is one.
    holdout : Record or sequence of Record, optional
        A second log of the same unit, to measure gains on; without it they are measured on the last 40 %. Where one
        of the two is long and holds means of samples, the other is taken as such means, too.
    identification : Identification, optional
        Noise of the log as identified, which is what the findings are reported against; without it the log is
        identified here, by the same choice of terms.
    replicas : int
        Replicas of the model before and after, each fitted again, for the coverage of the curves; 0 for none.
    seed : int
        Seed of the noise that bridges gaps and of the replicas.

    Returns
    -------
    Diagnosis

    Raises
    ------
    DataError
        Where no channel can be analysed, or the second log lacks what the first one has.
    """
    given = expect_records(records, "diagnose", WANTED)
    second = [] if holdout is None else expect_records(holdout, "diagnose: holdout")
    first, codes = zip(*(without_codes(record) for record in given), strict=True)
    others = as_coarse([without_codes(record)[0] for record in second], first)
    sensors, resting, moving = without_knocks(as_coarse(first, others))
    if others:
        expect_comparable(sensors, others)
    width = sum(len(record.axes) for record in sensors)
    limit = threshold(width)
    found: list[Finding] = [_finding(test) for tests in codes for test in tests]
    notes = [
        f"{record.name}: means of {record.samples_a_mean} samples, as in the second log, which is long"
        for record, whole in zip(sensors, first, strict=True)
        if record.samples_a_mean > whole.samples_a_mean
    ]
    refused: list[str] = []
    ready: list[Channel] = []
    tests_of: dict[str, Sequence[DataQualityTest]] = {}
    stage("testing the samples", 0.1)
    still = [resting.get(record.axes[0], record.segments) for record in sensors]
    tested = each(lambda one: data_quality_tests(*one), list(zip(sensors, still, strict=True)))
    for record, tests in zip(sensors, tested, strict=True):
        found += [_finding(t) for t in tests if t.p_value < limit and not t.note]
        notes += [f"{', '.join(t.channels)}: {t.text}" for t in tests if t.note]
        tests_of |= dict.fromkeys(record.axes, tests)
        ready += prepared(record, tests, limit, seed, refused)
    if any(t.cause == "overflow" and t.p_value < limit for tests in tested for t in tests):
        moving = {}  # samples that wrap look like motion
    parts: list[tuple[Channel, tuple[motion.Motion, ...]]] = []
    left_out: list[tuple[float, float]] = []
    for group in _by_clock(ready):
        rest, motions = (_places(group[0], sensors, ranges) for ranges in (resting, moving))
        moved, kept, without = _motion(group, rest, motions)
        found += moved
        parts += kept
        left_out += without
    if not parts:
        raise DataError(_nothing_left(refused, found, sensors[0], resting))
    whole = {one.axis: one.without_samples for one in ready}
    order = list(whole)
    parts.sort(key=lambda part: order.index(part[0].axis))
    colour = {part.axis: _colour(part) for part, _ in parts}
    parts = [
        (part.without_samples, moves) for part, moves in parts
    ]  # each is made again where it is searched
    del ready, group, kept

    record_of = {axis: record for record in sensors for axis in record.axes}

    def diagnosed(given: tuple[Channel, tuple[motion.Motion, ...]]) -> _Diagnosed:
        part, moves = given
        again = prepared_axis(record_of[part.axis], part.axis, tests_of[part.axis], limit, seed)
        first = round(whole[part.axis].place(part.start))
        place = slice(first, first + len(part))
        y = fill(again.y[place], again.valid[place] & ~part.valid, 1.0, np.random.default_rng((seed, 79)))
        return judged(part, search_causes(replace(part, y=y), limit, moves))

    def judged(part: Channel, outcome: SearchResult) -> _Diagnosed:
        found = outcome if smooth_shapes(outcome.accepted) else None
        outcome = replace(outcome, accepted=with_gains(outcome, second_channel(others, part.axis, seed)))
        if replicas:
            outcome = covered(outcome, replicas, seed)
        before = noise_before(record_of[part.axis], part.axis, identification)
        mended = any(
            t.cause == "error_code" or (t.cause == "overflow" and t.p_value < limit)
            for t in (*tests_of[part.axis], *(test for tests in codes for test in tests))
            if part.axis in t.channels
        )
        after = noise_after(outcome.final, before, mended=mended)
        outcome = replace(outcome, accepted=with_unknown(outcome))
        unexplained = tuple(
            Unexplained(
                r.name,
                (part.axis,),
                r.p_value,
                r.nats,
                r.place or WHOLE_RECORD,
                about=about(r.cause)[0] or "",
            )
            for r in outcome.unexplained
        )
        final = outcome.final.beside_others(part)
        named = with_sidebands(singles(part.axis, outcome, before), 0.5 * part.interval * (len(part) - 1))
        return _Diagnosed(named, unexplained, final, before, after, found)

    stage("searching for causes", 0.9)
    longest_first = sorted(parts, key=lambda part: -colour[part[0].axis])
    found_in = dict(
        zip(
            (part.axis for part, _ in longest_first),
            each(
                diagnosed,
                longest_first,
                shared=[part for part, _ in parts],
                memory=SEARCH_COLUMNS * 8.0 * max(len(part) for part, _ in parts),
            ),
            strict=True,
        )
    )
    stage("comparing the axes", 1.0)
    for group in _by_clock([part for part, _ in parts]):
        smooth = {c.axis: one for c in group if (one := found_in[c.axis].outcome) is not None}
        changed = shared_shape.with_shared_shape(smooth)
        found_in |= {c.axis: judged(c, changed[c.axis]) for c in group if c.axis in changed}
    axes = [part.axis for part, _ in parts]
    every = [found_in[axis] for axis in axes]
    finals = {axis: one.final for axis, one in zip(axes, every, strict=True)}
    stretched = mount_tilt.stretched(finals, limit)
    grouped = findings([single for one in every for single in one.singles])
    reported = [f for f in grouped if not (stretched and f.cause == "attitude")]
    noise = {axis: one.before for axis, one in zip(axes, every, strict=True)}
    found += [*reported, *_common(finals, limit), *collinear_warming(finals, noise)]
    models = {axis: one.after for axis, one in zip(axes, every, strict=True)}
    unexplained = tuple(left for one in every for left in one.unexplained)
    at_rest = [without_stretches(record, left_out) for record in sensors]
    if unexplained:
        drifts = left_drifts(found, at_rest, models)
        unexplained = tuple(replace(left, drift=drifts.get(left.channels[0], {})) for left in unexplained)
    named, left = only_determined(with_drifts(found, at_rest), (*unexplained, *stretched))
    return Diagnosis(
        named,
        left,
        (*notes, *refused, *sampling.notes(finals)),
        models,
        noise,
        {part.axis: _times(part) for part, _ in parts if len(part) < len(whole[part.axis])},
        tuple(dict.fromkeys(left_out)),
    )


def _colour(channel: Channel) -> float:
    """Return how far samples are from white noise, the log of their sd ÷ that of their differences / √2.

    The search is longest where most is to be found, and this tells beforehand where that is likely.
    """
    return abs(float(np.log(np.std(channel.y))))


def _nothing_left(
    refused: Sequence[str], found: Sequence[Finding], record: Record, resting: Mapping[str, Segments]
) -> str:
    """Return why no channel can be analysed, in one line."""
    if refused or not any(one.cause == "motion" for one in found):
        why = "".join(f" ({one.statistic})" for one in found if one.cause == "duplicates")
        return (
            f"{refused[0]}{why}"
            if refused
            else "no channel to diagnose; give a record with at least one axis"
        )
    parts = [(b - a, float(record.t[a])) for a, b in resting.get(record.axes[0], ())]
    longest, begin = max(parts, default=(0, 0.0))
    end = begin + longest * record.interval
    return (
        f"the sensor moved: its longest stand-still, {stamp(begin)} to {stamp(end)} s, has "
        f"{longest} samples, expected {MIN_SAMPLES}: record one of {MIN_SAMPLES * record.interval:.3g} s or more"
    )


def _common(finals: Mapping[str, FittedChannel], limit: float) -> list[Finding]:
    """Return what channels share: noise, and a tilt of the triad."""
    found = []
    for shared in cross_axis.test(finals, limit):
        parameters = {"correlation": shared.correlation}
        text = words("cross_axis", shared.channels, cross_axis.CrossAxis.meaning, parameters)
        found.append(
            Finding(
                "cross_axis",
                shared.channels,
                "correlation of the residuals ÷ its deviation",
                shared.statistic,
                shared.p_value,
                parameters,
                text,
                cross_axis.CrossAxis.consequence,
                {"cause": "cross_axis", "joins": joins("cross_axis")},
                by_channel={pair: {"correlation": value} for pair, value in shared.pairs.items()},
            )
        )
    tilt = attitude.test(finals, limit)
    if tilt is not None:
        parameters = {"tilt": tilt.tilt}
        text = words("attitude", tilt.channels, attitude.MEANING, parameters)
        found.append(
            Finding(
                "attitude",
                tilt.channels,
                "likelihood ratio of a turning gravity",
                tilt.statistic,
                tilt.p_value,
                parameters,
                text,
                attitude.CONSEQUENCE,
                {"cause": "attitude", "joins": "preprocessing"},
            )
        )
    return found


def _by_clock(channels: Sequence[Channel]) -> list[list[Channel]]:
    """Return the channels in groups that were sampled together."""
    return list(gathered(((len(one), one.start, one.interval), one) for one in channels).values())


def _places(channel: Channel, records: Sequence[Record], ranges: Mapping[str, Segments]) -> Segments:
    """Return ranges of samples of a record, by axis, as samples of one of its channels."""
    record = next(record for record in records if channel.axis in record.axes)
    parts = []
    for start, stop in ranges.get(channel.axis, ()):
        first = round(channel.place(float(record.t[start])))
        last = first + round((stop - start) * record.interval / channel.interval)
        parts.append((max(first, 0), min(last, len(channel))))
    return tuple((first, last) for first, last in parts if last > first)


def _motion(
    channels: list[Channel], resting: Segments, moving: Segments
) -> tuple[list[Finding], list[tuple[Channel, tuple[motion.Motion, ...]]], Sequence[tuple[float, float]]]:
    """Return the findings of motion in channels of one clock, the channels with the stretches to leave out, and these.

    The findings say when the sensor moved. Left out, begin and end in s, is what is about a motion, too; where that is
    too much of the record, only its longest part at rest is left. Short motions that no stretch holds are bridged.
    """
    n, seen = len(channels[0]), motion.stretches(channels)
    missed = motion.missed(channels, seen, moving)
    long = [motion.Stretch(*part, *part) for part in missed if part[1] - part[0] > MAX_GAP_SHARE * n]
    stretches = motion.together([*seen, *long]) if long else seen
    found = _moved(channels, seen, [*missed, *motion.met(seen, moving)])
    if missed:
        still = ~inside(n, missed)
        channels = [replace(c, valid=c.valid & still) for c in channels]
    time = channels[0].time
    bridged = [(time(first - 0.5), time(last - 0.5)) for first, last in missed]
    if not stretches:
        return found, [(c, ()) for c in channels], bridged
    share = sum(stretch.last - stretch.first for stretch in stretches) / n
    between = _longest_still(stretches, n)
    used = max((between, *resting), key=lambda part: part[1] - part[0])
    if share > MAX_MOVING_SHARE:
        stretches = motion.outside(stretches, *used)
    extensions = tuple(motion.extension(channels[0], stretch) for stretch in stretches)
    times = [(one.values["start"].value, one.values["duration"].value) for one in extensions]
    left_out = [*bridged, *((begin, begin + duration) for begin, duration in times)]
    if share <= MAX_MOVING_SHARE:
        return found, [(c, extensions) for c in channels], left_out
    return found, [(part, ()) for c in channels if (part := c.part(*used)) is not None], left_out


def _moved(channels: list[Channel], seen: Sequence[motion.Stretch], moving: motion.Ranges) -> list[Finding]:
    """Return when channels of one clock moved: a finding a motion, or of many one, with the longest."""
    motions = motion.motions(channels[0], seen, moving)
    if len(motions) <= motion.MAX_STRETCHES:
        return [_motion_finding(channels, *one, {}) for one in motions]
    count, moved = float(len(motions)), sum(values["duration"].value for _, values in motions)
    many = {
        "count": Coefficient.known(count, count, count, "1"),
        "time_in_motion": Coefficient.known(moved, moved, moved, "s"),
    }
    return [_motion_finding(channels, *max(motions, key=lambda one: one[1]["duration"].value), many)]


def _motion_finding(
    channels: list[Channel],
    stretch: motion.Stretch,
    values: Mapping[str, Value],
    more: Mapping[str, Coefficient],
) -> Finding:
    """Return the finding of one motion of channels, with more of its parameters."""
    axes = tuple(c.axis for c in channels if motion.moved(c, stretch)) or tuple(c.axis for c in channels)
    when = {**more, **{name: value.coefficient("s", 1.0) for name, value in values.items()}}
    sds = {c.axis: motion.sway(c, stretch).coefficient(c.unit, c.scale) for c in channels if c.axis in axes}
    by_channel = {axis: {**when, "sd": sd} for axis, sd in sds.items()}
    parameters = max(by_channel.values(), key=lambda one: one["sd"].value or 0.0)
    text = words("motion", axes, motion.Motion.meaning, parameters, by_channel) + _first_sample(channels[0])
    return Finding(
        "motion",
        axes,
        "steps between short means ÷ their deviation",
        motion.STEP_THRESHOLD,
        1e-10,
        parameters,
        text,
        motion.Motion.consequence,
        by_channel=by_channel,
    )


def _first_sample(channel: Channel) -> str:
    """Return the time of the first sample in words, where it is not zero."""
    late = abs(channel.start) > channel.interval
    return f"; the first sample is of {channel.start:.5g} s" if late else ""


def _times(part: Channel) -> tuple[float, float]:
    return part.start, part.time(len(part))


def _longest_still(stretches: Sequence[motion.Stretch], n: int) -> tuple[int, int]:
    """Return the longest range of samples between the stretches."""
    edges = [0, *(edge for stretch in stretches for edge in stretch[:2]), n]
    gaps = list(zip(edges[::2], edges[1::2], strict=True))
    return max(gaps, key=lambda gap: gap[1] - gap[0])


def _finding(test: DataQualityTest) -> Finding:
    cause = Frozen if test.cause == "duplicates" and test.stretches else CAUSES[test.cause]
    return Finding(
        test.cause,
        test.channels,
        test.text,
        test.statistic,
        test.p_value,
        test.parameters,
        f"{test.cause} in {', '.join(test.channels)}: {cause.meaning} ({test.text})",
        cause.consequence,
        {"cause": test.cause, "joins": joins(test.cause)}
        | ({"level": test.level} if test.level is not None else {})
        | ({LEFT_OUT: True} if test.cause == "spikes" else {}),
    )
