"""Delays of a drive by its motion alone, from which the search for causes begins."""

from __future__ import annotations

from dataclasses import replace

from tuner.types import Coefficient, Compensation, FilterConfig, Parameter
from tuner.types.clock import Clock, Delay

OFFSET_DELAY, LAG_DELAY = Parameter("time_offset", "delay"), Parameter("velocity_lag", "delay")
RATE = Parameter("clock_drift", "rate")


def delays_of(clock: Clock, start: Compensation) -> dict[Parameter, float]:
    """Return the delays of a drive that are certain beside those that are compensated already, s."""
    return {p: start.get(p, 0.0) + one.value for p, one in _certain(clock, start).items()}


def clock_coefficients(clock: Clock, start: Compensation) -> dict[str, dict[str, Coefficient]]:
    """Return what a clock says of the parameters of its causes, by cause: the same whatever the filter's noise."""
    out = {}
    for p, one in _certain(clock, start).items():
        begun, (low, high) = start.get(p, 0.0), one.interval
        unit = "1" if p == RATE else "s"
        out[p.cause] = {p.name: Coefficient.known(begun + one.value, begun + low, begun + high, unit)}
    return out


def with_clock(config: FilterConfig, clock: Clock) -> FilterConfig:
    """Return a configuration whose delay and lag of the fixes are those of a clock, absent where not certain.

    Its drift is the clock's where that is certain: a filter may show one that windows do not.
    """
    known = (OFFSET_DELAY.cause, LAG_DELAY.cause, *[RATE.cause] * clock.drift.certain)
    compensation = config.compensation.without(known)
    return replace(config, compensation=compensation.with_values(delays_of(clock, Compensation())))


def _certain(clock: Clock, start: Compensation) -> dict[Parameter, Delay]:
    left = clock.beside(*(start.get(p, 0.0) for p in (OFFSET_DELAY, LAG_DELAY, RATE)))
    found = {OFFSET_DELAY: left.delay, LAG_DELAY: left.lag, RATE: left.drift}
    return {p: one for p, one in found.items() if one.certain}
