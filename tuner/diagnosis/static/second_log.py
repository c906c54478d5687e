"""A second log of the same unit, on which the gains of findings are measured."""

from __future__ import annotations

from collections.abc import Sequence

from tuner.diagnosis.static.causes.temperature import COVARIATE as TEMPERATURE
from tuner.diagnosis.static.channel import Channel, channel
from tuner.types.records import DataError, Record

MAX_INTERVAL_DIFFERENCE = 0.01
"""Relative difference of two sampling intervals up to which they are one; clocks differ by far less, rates by more."""


def expect_comparable(sensors: Sequence[Record], others: Sequence[Record]) -> None:
    """Raise `DataError` for a second log that lacks what the gain of the findings is measured on."""
    pairs = [(one, other) for one in sensors for other in others if set(one.axes) & set(other.axes)]
    if not pairs:
        msg = (
            f"second log: expected an axis of the first, {' '.join(a for r in sensors for a in r.axes)}, "
            f"got {' '.join(a for r in others for a in r.axes)}"
        )
        raise DataError(msg)
    for one, other in pairs:
        if abs(other.interval - one.interval) > MAX_INTERVAL_DIFFERENCE * one.interval:
            msg = (
                f"second log: expected the rate of the first, {1.0 / one.interval:.6g} Hz, "
                f"got {1.0 / other.interval:.6g} Hz"
            )
            raise DataError(msg)
        if TEMPERATURE in one.covariates and TEMPERATURE not in other.covariates:
            msg = f"second log: expected the column '{TEMPERATURE}' that the first one has, found none"
            raise DataError(msg)


def second_channel(records: Sequence[Record], axis: str, seed: int) -> Channel | None:
    """Return the same axis of the second log, or None where it has none."""
    record = next((r for r in records if axis in r.axes), None)
    return None if record is None else channel(record, axis, seed=seed)
