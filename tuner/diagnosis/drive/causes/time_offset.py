"""The clocks of a drive coarsely: whether fixes come at the time of their stamps, and how late they are.

Only the first minutes in motion are searched, and only where a pass with the stamps as they are goes badly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tuner.diagnosis.drive.hypothesis import Hypothesis, Pass, settings_of
from tuner.diagnosis.drive.score_tests import wandering
from tuner.navigation.compensation import compensated
from tuner.navigation.drive.alignment import standing_until
from tuner.navigation.drive.run import prepare
from tuner.types import Unexplained
from tuner.types.records import Drive

MEDIAN = 0.455
"""Median of χ²₁."""
BAD = 3.0
"""Ratio of a typical squared innovation to its prediction from which the clocks are looked at."""
REFUSED = 0.03
"""Share of refused fixes from which they are."""
SPAN = 300.0
"""Length of the motion that is searched, s."""
DELAY = "time_offset.delay"
COARSE = 0.1
"""Delay that the sensitivities find by themselves, s."""


def suspicious(found: Pass) -> bool:
    """Whether the innovations of a pass are so large that the fixes may come at another time."""
    record = found.record
    rows = record.available & record.scored[:, None]
    if not rows.any():
        return True
    spread = np.concatenate([np.diagonal(s.innovation_covariance, axis1=1, axis2=2) for s in found.solutions])
    ratio = record.innovation[rows] ** 2 / spread[rows]
    refused = float(np.mean(~record.used[rows]))
    return refused > REFUSED or float(np.median(ratio)) > BAD * MEDIAN


def drifting(found: Pass, accepted: tuple[str, ...], threshold: float) -> tuple[Unexplained, ...]:
    """Return what is said of a delay that does not stay: no number compensates it, a common clock is missing.

    Parameters
    ----------
    found : Pass
        The last pass.
    accepted : tuple of str
        Shifts that it compensates.
    threshold : float
        Chance below which it is said.
    """
    if DELAY.partition(".")[0] not in accepted:
        return ()
    names = found.record.parameters
    told = wandering(found.whitened, names, accepted, DELAY)
    if told.p_value >= threshold:
        return ()
    low, high = (1e3 * (told.rate + side * 1.96 * told.sd) for side in (-1.0, 1.0))
    text = (
        f"the delay of the fixes changes by {1e3 * told.rate:.3g} ({low:.3g} … {high:.3g}) ms/s: the clocks run at "
        "different rates, what is missing is a common clock"
    )
    return (Unexplained(text, ("drive",), told.p_value),)


def coarse_clocks(drive: Drive, start: Hypothesis) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the values of delay and lag that a coarse search finds, and what it says; empty where they are small.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    start : Hypothesis
        What is held true already.
    """
    seen = compensated(drive, start.values)
    end = standing_until(seen.gnss) + SPAN
    imu, fixes = seen.imu_t < end, seen.gnss.t < end
    part = replace(seen, imu_t=seen.imu_t[imu], rates=seen.rates[imu], gnss=seen.gnss.rows(fixes))
    stretches, notes = prepare(part, settings_of(part, start))
    delay, lag = stretches[0].alignment.delay, stretches[0].lag
    if abs(delay) < COARSE and lag == 0.0:
        return {}, ()
    values = {"time_offset.delay": start.values.get("time_offset.delay", 0.0) + delay}
    if lag:
        values["velocity_lag.delay"] = start.values.get("velocity_lag.delay", 0.0) + lag
    return values, tuple(f"coarsely: {note}" for note in notes)
