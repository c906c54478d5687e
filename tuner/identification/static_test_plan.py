"""The plan of a static test: how sure it will make every noise term of every axis of a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from tuner.identification.identify_source import identify_source
from tuner.identification.record_length import Plan, plan
from tuner.types import Identification
from tuner.types.public import public
from tuner.types.records import DataError
from tuner.types.shown import Shown


@dataclass(frozen=True, repr=False)
class StaticTestPlan(Shown, Mapping[str, Plan]):
    """The plan of a static test: a mapping of each axis to its `Plan`.

    Attributes
    ----------
    name : str
        Of the sensor, as far as its noise states one.
    axes : mapping of str to Plan
        Each axis.
    units : mapping of str to str
        Unit of the samples of each axis, SI.
    """

    name: str
    axes: Mapping[str, Plan]
    units: Mapping[str, str]

    def __getitem__(self, axis: str) -> Plan:
        return self.axes[axis]

    def __iter__(self) -> Iterator[str]:
        return iter(self.axes)

    def __len__(self) -> int:
        return len(self.axes)


@public("plan")
def plan_test(
    noise: Identification | str | Path, *, hours: float = 1.0, accuracy: float = 0.1
) -> StaticTestPlan:
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
    known = noise if isinstance(noise, Identification) else identify_source(noise, arma=None)
    try:
        plans = {
            axis: plan(channel.model, interval=channel.interval, hours=hours, accuracy=accuracy)
            for axis, channel in known.channels.items()
        }
    except ValueError as error:
        raise DataError(f"plan: {error}") from error
    units = {axis: channel.unit for axis, channel in known.channels.items()}
    name = str(known.source.get("name", "static test"))
    return StaticTestPlan(name, MappingProxyType(plans), MappingProxyType(units))
