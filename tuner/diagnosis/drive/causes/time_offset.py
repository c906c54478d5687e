"""Coarse search for the clock offset of a drive.

Only the first minutes in motion are searched, and only where a run with the stamps as they are fits badly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.navigation.compensation import compensate
from tuner.navigation.drive.clock import Clock, remaining_clock
from tuner.types import Coefficient, Compensation, FilterConfig, Parameter
from tuner.types.records import Drive

MEDIAN_CHI2_1 = 0.455
"""Median of χ²₁."""
SUSPICIOUS_SQUARE_RATIO = 3.0
"""Ratio of the median squared innovation to its prediction from which the clocks are searched.

An sd 1.7 times too large; chosen because smaller offsets are within reach of the score test.
"""
SUSPICIOUS_REFUSED_SHARE = 0.03
"""Share of fixes rejected by the gate from which the clocks are searched; chosen above that of usual outliers."""
OFFSET_DELAY, LAG_DELAY = Parameter("time_offset", "delay"), Parameter("velocity_lag", "delay")


def clocks_are_suspicious(run: FilterRun) -> bool:
    """Whether the innovations of a run are so large that the stamps of the fixes may be wrong."""
    linearized = run.linearized
    rows = linearized.available & linearized.scored[:, None]
    if not rows.any():
        return True
    spread = np.concatenate([np.diagonal(s.innovation_covariance, axis1=1, axis2=2) for s in run.solutions])
    ratio = linearized.innovation[rows] ** 2 / spread[rows]
    refused = float(np.mean(~linearized.used[rows]))
    return (
        refused > SUSPICIOUS_REFUSED_SHARE
        or float(np.median(ratio)) > SUSPICIOUS_SQUARE_RATIO * MEDIAN_CHI2_1
    )


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
