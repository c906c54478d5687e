"""Clock offset of a drive by its motion alone, from which the search for causes begins."""

from __future__ import annotations

from dataclasses import replace

from tuner.diagnosis.drive.hypothesis import Hypothesis
from tuner.navigation.compensation import compensate
from tuner.navigation.drive.clock import Clock, remaining_clock
from tuner.types import Coefficient, Compensation, FilterConfig, Parameter
from tuner.types.records import Drive

OFFSET_DELAY, LAG_DELAY = Parameter("time_offset", "delay"), Parameter("velocity_lag", "delay")


def coarse_clock_search(drive: Drive, start: Hypothesis) -> tuple[dict[Parameter, float], Clock]:
    """Return delay and lag by the motion alone, and their clock; empty where clocks that agree are not refuted.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    start : Hypothesis
        What is compensated already.
    """
    clock = remaining_clock(compensate(drive, start.compensation), start.compensation)
    found = {OFFSET_DELAY: clock.delay, LAG_DELAY: clock.lag}
    values = {p: start.compensation.get(p, 0.0) + value for p, value in found.items() if value}
    return values, clock


def clock_coefficients(clock: Clock, start: Compensation) -> dict[str, dict[str, Coefficient]]:
    """Return what a clock says of the parameters of its causes, by cause: the same whatever the filter's noise."""
    measured = {OFFSET_DELAY: (clock.delay, clock.delay_interval), LAG_DELAY: (clock.lag, clock.lag_interval)}
    out = {}
    for parameter, (value, (low, high)) in measured.items():
        if value:
            begun = start.get(parameter, 0.0)
            coefficient = Coefficient.known(begun + value, begun + low, begun + high, "s")
            out[parameter.cause] = {parameter.name: coefficient}
    return out


def with_clock(config: FilterConfig, clock: Clock) -> FilterConfig:
    """Return a configuration whose delay and lag of the fixes are those of a clock, absent where not significant."""
    compensation = config.compensation.without(("time_offset", "velocity_lag"))
    values = {Parameter("time_offset", "delay"): clock.delay, Parameter("velocity_lag", "delay"): clock.lag}
    described = {parameter: value for parameter, value in values.items() if value}
    return replace(config, compensation=compensation.with_values(described))
