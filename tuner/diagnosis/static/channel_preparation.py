"""Channels from records: what the data-quality tests reject is left out, bridged or dropped.

Frozen stretches are gaps of their axis. A few repeated samples are bridged, as if they had not come; where they are
many they are dropped, and the rest is taken for even samples at the mean rate of what is new. Samples that wrapped
around the range of a register are put back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.arrays import BoolArray
from tuner.diagnosis.data_quality import DataQualityTest, without_frozen
from tuner.diagnosis.data_quality.overflow import without_overflow
from tuner.diagnosis.static.channel import Channel, channel
from tuner.types.records import DataError, Record

MAX_BRIDGED_SHARE = 0.3
"""Share of repeated samples up to which they are bridged; beyond, they are dropped and the rate is corrected.

Chosen so that gaps stay the minority in which the filling noise, which has the level but not the colour of the
neighbours, does not shape the spectrum.
"""


def prepared(
    record: Record, tests: Sequence[DataQualityTest], limit: float, seed: int, refused: list[str]
) -> list[Channel]:
    """Return the axes of a record as channels, without frozen stretches, repeated samples bridged or dropped.

    Parameters
    ----------
    record : Record
        Samples of one sensor.
    tests : sequence of DataQualityTest
        What is wrong with them.
    limit : float
        Chance below which a test counts.
    seed : int
        Seed of the noise that bridges gaps.
    refused : list of str
        Takes why axes were left out.
    """
    ready = []
    for axis in record.axes:
        try:
            ready.append(prepared_axis(record, axis, tests, limit, seed))
        except DataError as error:
            refused.append(str(error))
    return ready


def prepared_axis(
    record: Record, axis: str, tests: Sequence[DataQualityTest], limit: float, seed: int
) -> Channel:
    """Return one axis of a record as `prepared` does.

    Raises
    ------
    DataError
        Where it cannot be analysed.
    """
    stuck = [t for t in tests if t.stretches and (t.cause == "duplicates" or t.p_value < limit)]
    others = [t for t in tests if not t.stretches and axis in t.channels]
    mine = {t.cause: t for t in others if t.p_value < limit or t.note}
    codes = mine["lattice"].parameters if "lattice" in mine else {}
    step, dead = (float(codes[name].value or 0.0) if name in codes else 0.0 for name in ("step", "deadband"))
    rounded_means = record.samples_a_mean > 1 and "lattice" in mine and not mine["lattice"].note
    source = without_frozen(record, (axis,), stuck)
    if "overflow" in mine:
        source = without_overflow(source, {axis: mine["overflow"].statistic})
    repeated = None
    if "duplicates" in mine:
        test = mine["duplicates"]
        repeated = _repeated(without_frozen(record, test.channels, stuck), test, seed)
    if repeated is not None and repeated.mean() > MAX_BRIDGED_SHARE:
        source, repeated = _thinned(source, ~repeated), None
    even = channel(source, axis, quantizer_step=step / record.samples_a_mean, repeated=repeated, seed=seed)
    holes = "lattice" in mine and not mine["lattice"].note and not dead
    even = replace(
        even,
        interpolated="interpolated" in mine or rounded_means,
        clipped="clipping" in mine,
        missing_codes=holes,
    )
    return replace(even, deadband=dead / even.scale)


def _repeated(record: Record, test: DataQualityTest, seed: int) -> BoolArray:
    """Return which samples count as repetitions in all channels of a record, those of a test, shape (n,).

    Of those that repeat the one before as many are drawn as chance does not account for: the noise, whose own
    repetitions are among them, keeps its law.
    """
    if test.copies is not None:
        return test.copies
    inside = _inside(record)
    pairs = inside[1:] & inside[:-1]
    same = np.all(np.diff(record.y, axis=0) == 0.0, axis=1) & pairs
    fraction = test.parameters["fraction"].value
    share = 1.0 if fraction is None else fraction * int(pairs.sum()) / max(int(same.sum()), 1)
    drawn = np.random.default_rng((seed, 78)).random(len(same)) < share
    return np.concatenate(([False], same & drawn))


def _inside(record: Record) -> BoolArray:
    """Return which samples are in segments, shape (n,)."""
    inside = np.zeros(len(record), dtype=bool)
    for start, stop in record.segments:
        inside[start:stop] = True
    return inside


def _thinned(record: Record, kept: BoolArray) -> Record:
    """Return a record of the kept samples of its segments, even at their mean interval."""
    inside = _inside(record)
    kept = kept & inside
    n = int(kept.sum())
    interval = record.interval * int(inside.sum()) / n
    return replace(
        record,
        t=record.t[kept],
        y=record.y[kept],
        interval=interval,
        segments=((0, n),),
        covariates={name: values[kept] for name, values in record.covariates.items()},
    )
