"""The plan of a static test: how sure it will make every noise term of every axis of a sensor."""

from __future__ import annotations

from pathlib import Path

from tuner.identification.identify_source import identify_source
from tuner.identification.record_length import Plan, plan
from tuner.types import Identification
from tuner.types.arguments import expect_number
from tuner.types.records import DataError


def plan_test(
    noise: Identification | str | Path, *, hours: float = 1.0, accuracy: float = 0.1
) -> dict[str, Plan]:
    """Plan a static test of a sensor whose noise is known from elsewhere, channel by channel.

    Parameters
    ----------
    noise : Identification, str or Path
        Noise to expect: an identification, the name of a built-in grade, or the path of a datasheet or an earlier log.
    hours : float
        Length of the test, h.
    accuracy : float
        Wanted relative standard deviation, such as 0.1.

    Raises
    ------
    DataError
        If `hours` or `accuracy` is out of its range, or the noise cannot be had from its source.
    """
    expect_number(hours, "plan: hours", "hours, such as 1.0")
    expect_number(accuracy, "plan: accuracy", "a relative standard deviation between 0 and 1, such as 0.1")
    known = noise if isinstance(noise, Identification) else identify_source(noise, arma=None)
    try:
        return {
            axis: plan(channel.model, interval=channel.interval, hours=hours, accuracy=accuracy)
            for axis, channel in known.channels.items()
        }
    except ValueError as error:
        msg = f"plan: {error}"
        raise DataError(msg) from error
