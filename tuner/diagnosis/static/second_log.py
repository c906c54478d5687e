"""A second log of the same unit, on which the gains of findings are measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.causes.temperature import COVARIATE as TEMPERATURE
from tuner.diagnosis.static.channel import Channel, channel
from tuner.types.records import DataError, Record

MAX_INTERVAL_DIFFERENCE = 0.01
"""Relative difference of two sampling intervals up to which they are one; clocks differ by far less, rates by more."""


def as_coarse(records: Sequence[Record], others: Sequence[Record]) -> tuple[Record, ...]:
    """Return records, as means where that of each sample of others, of long logs, holds more samples than theirs."""
    coarsest = max((one.samples_a_mean for one in others), default=1)
    return tuple(
        _means(one, coarsest // one.samples_a_mean) if coarsest > one.samples_a_mean else one
        for one in records
    )


def _means(record: Record, size: int) -> Record:
    """Return a record of the means of `size` samples each; incomplete ones at ends of segments are left out."""
    cuts = [(start, stop - (stop - start) % size) for start, stop in record.segments]
    ends = np.cumsum([0, *((stop - start) // size for start, stop in cuts)])

    def mean(x: FloatArray) -> FloatArray:
        return np.concatenate([x[a:b].reshape(-1, size, *x.shape[1:]).mean(axis=1) for a, b in cuts])

    return replace(
        record,
        t=mean(record.t),
        y=mean(record.y),
        interval=size * record.interval,
        segments=tuple((int(a), int(b)) for a, b in pairwise(ends) if b > a),
        covariates={name: mean(column) for name, column in record.covariates.items()},
        samples_a_mean=size * record.samples_a_mean,
        short_clusters={},
    )


def expect_comparable(sensors: Sequence[Record], others: Sequence[Record]) -> None:
    """Raise `DataError` for a second log that lacks what the gain of the findings is measured on."""
    pairs = [(one, other) for one in sensors for other in others if set(one.axes) & set(other.axes)]
    if not pairs:
        raise DataError(
            f"second log: expected an axis of the first, {' '.join(a for r in sensors for a in r.axes)}, "
            f"got {' '.join(a for r in others for a in r.axes)}"
        )
    for one, other in pairs:
        if abs(other.interval - one.interval) > MAX_INTERVAL_DIFFERENCE * one.interval:
            raise DataError(
                f"second log: expected the rate of the first, {1.0 / one.interval:.6g} Hz, "
                f"got {1.0 / other.interval:.6g} Hz"
            )
        if TEMPERATURE in one.covariates and TEMPERATURE not in other.covariates:
            raise DataError(
                f"second log: expected the column '{TEMPERATURE}' that the first one has, found none"
            )


def second_channel(records: Sequence[Record], axis: str, seed: int) -> Channel | None:
    """Return the same axis of the second log, or None where it has none."""
    record = next((r for r in records if axis in r.axes), None)
    return None if record is None else channel(record, axis, seed=seed)
