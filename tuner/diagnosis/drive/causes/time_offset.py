"""Coarse search for the clock offset of a drive, and the test of a clock drift.

Only the first minutes in motion are searched, and only where a run with the stamps as they are fits badly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis, filter_settings_of
from tuner.diagnosis.drive.score_tests import linear_trend
from tuner.navigation.compensation import compensate
from tuner.navigation.drive.alignment import stationary_until
from tuner.navigation.drive.run import prepare
from tuner.types import Parameter, Unexplained
from tuner.types.records import Drive

MEDIAN_CHI2_1 = 0.455
"""Median of χ²₁."""
SUSPICIOUS_SQUARE_RATIO = 3.0
"""Ratio of the median squared innovation to its prediction from which the clocks are searched.

An sd 1.7 times too large; chosen because smaller offsets are within reach of the score test.
"""
SUSPICIOUS_REFUSED_SHARE = 0.03
"""Share of fixes rejected by the gate from which the clocks are searched; chosen above that of usual outliers."""
SEARCHED_MOTION = 300.0
"""Length of the motion that is searched, s; chosen to hold several turns, which show the offset, at bounded cost."""
OFFSET_DELAY, LAG_DELAY = Parameter("time_offset", "delay"), Parameter("velocity_lag", "delay")
MIN_COARSE_DELAY = 0.1
"""Delay from which the linear model is not accurate enough, s; smaller ones are found by the score test."""


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


def clock_drift(run: FilterRun, accepted: tuple[str, ...], threshold: float) -> tuple[Unexplained, ...]:
    """Return a note on a delay that changes with time: no constant compensates it, a common clock is missing.

    Parameters
    ----------
    run : FilterRun
        The last run.
    accepted : tuple of str
        Constant causes that it compensates.
    threshold : float
        p value below which it is reported.
    """
    if OFFSET_DELAY.cause not in accepted:
        return ()
    names = run.linearized.parameters
    trend = linear_trend(run.whitened, names, accepted, OFFSET_DELAY)
    if trend.p_value >= threshold:
        return ()
    low, high = (1e3 * (trend.rate + side * 1.96 * trend.sd) for side in (-1.0, 1.0))
    text = (
        f"the delay of the fixes changes by {1e3 * trend.rate:.3g} ({low:.3g} … {high:.3g}) ms/s: the clocks run at "
        "different rates, what is missing is a common clock"
    )
    return (Unexplained(text, ("drive",), trend.p_value),)


def coarse_clock_search(drive: Drive, start: Hypothesis) -> tuple[dict[Parameter, float], tuple[str, ...]]:
    """Return the delay and lag of a coarse search, with notes; empty where they are small.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    start : Hypothesis
        What is compensated already.
    """
    corrected = compensate(drive, start.compensation)
    end = stationary_until(corrected.gnss) + SEARCHED_MOTION
    imu, fixes = corrected.imu_t < end, corrected.gnss.t < end
    part = replace(
        corrected, imu_t=corrected.imu_t[imu], rates=corrected.rates[imu], gnss=corrected.gnss.rows(fixes)
    )
    stretches, notes = prepare(part, filter_settings_of(part, start))
    delay, lag = stretches[0].alignment.delay, stretches[0].lag
    if abs(delay) < MIN_COARSE_DELAY and lag == 0.0:
        return {}, ()
    values = {OFFSET_DELAY: start.compensation.get(OFFSET_DELAY, 0.0) + delay}
    if lag:
        values[LAG_DELAY] = start.compensation.get(LAG_DELAY, 0.0) + lag
    return values, tuple(f"coarsely: {note}" for note in notes)
