"""The plan of a static test: how sure it will make every noise term of every axis of a sensor."""

from __future__ import annotations

from tuner.identification.record_length import Plan, plan
from tuner.types import Identification
from tuner.types.records import DataError


def plan_test(identification: Identification, *, hours: float, accuracy: float) -> dict[str, Plan]:
    """Plan a static test of a sensor whose noise is known from elsewhere, channel by channel.

    Parameters
    ----------
    identification : Identification
        Noise to expect, of a grade, a datasheet or an earlier log.
    hours : float
        Length of the test, h.
    accuracy : float
        Wanted relative standard deviation, such as 0.1.

    Raises
    ------
    DataError
        If `hours` or `accuracy` is out of its range.
    """
    try:
        return {
            axis: plan(channel.model, interval=channel.interval, hours=hours, accuracy=accuracy)
            for axis, channel in identification.channels.items()
        }
    except ValueError as error:
        msg = f"plan: {error}"
        raise DataError(msg) from error
