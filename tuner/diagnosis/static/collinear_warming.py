"""A drift beside a temperature that changes evenly, too: temperature or warm-up, which such a log does not tell apart.

The base noise holds a ramp, which takes up what follows a temperature that is a line over time, so that no test of the
temperature sees it. The ramp is said as what it may be where its whole interval is beyond `ODD_DRIFT` Allan deviations
at 10 s and no smooth shape was found in the axis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from models.noise import NoiseModel
from models.probability import REACH_95, chi2_beyond
from tuner.diagnosis.static.causes.temperature import COVARIATE, Temperature
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.findings import joins, words
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.slow_shapes import SMOOTH
from tuner.formats.customary_units import amount, digits
from tuner.limits import COLLINEAR_SHARE, ODD_DRIFT
from tuner.segments.conditions import MIN_TEMPERATURE_RANGE
from tuner.types import Alternative, Coefficient, Finding

CONSEQUENCE = (
    "record again after it has warmed up, or while the temperature goes up and down, which tells the two apart; until "
    "then neither a calibration nor a decaying bias is known"
)
"""What to do about it, in one sentence."""


def collinear_warming(finals: Mapping[str, FittedChannel], noise: Mapping[str, NoiseModel]) -> list[Finding]:
    """Return a finding an axis whose ramp comes with a temperature that is collinear with time.

    Parameters
    ----------
    finals : mapping of str to FittedChannel
        Last fit of each axis.
    noise : mapping of str to NoiseModel
        Noise of each axis as identified, SI.
    """
    found = []
    for axis, final in finals.items():
        channel = final.channel
        celsius = channel.covariates.get(COVARIATE, np.zeros(channel.blocks))
        if (
            any(isinstance(one, SMOOTH) for one in final.extensions)
            or np.ptp(celsius) < MIN_TEMPERATURE_RANGE
        ):
            continue
        if np.corrcoef(channel.block_time, celsius)[0, 1] ** 2 < COLLINEAR_SHARE:
            continue
        warmth = channel.span * float(np.polyfit(channel.block_time, celsius, 1)[0])
        ramp, sd = float(final.fit.beta[0]), float(np.sqrt(final.fit.beta_covariance[0, 0]))
        change, half = channel.scale * ramp, REACH_95 * channel.scale * sd
        if abs(change) - half < ODD_DRIFT * float(np.sqrt(noise[axis].allan_variance(10.0))):
            continue
        low, high = sorted(((change - half) / warmth, (change + half) / warmth))
        slope = {"slope": Coefficient.known(change / warmth, low, high, f"{channel.unit}/K")}
        size = amount(Coefficient.known(change, change - half, change + half, channel.unit))
        beside = f"{size} over the log, while the temperature changes by {digits(warmth)} K evenly in time"
        found.append(
            Finding(
                Temperature.cause,
                (axis,),
                "ramp ÷ its deviation",
                abs(ramp) / sd,
                chi2_beyond((ramp / sd) ** 2, 1),
                slope,
                f"{words(Temperature.cause, (axis,), Temperature.meaning, slope)}; {beside}: it may be warm-up as well",
                CONSEQUENCE,
                {"cause": Temperature.cause, "joins": joins(Temperature.cause)},
                alternatives=(Alternative(Warmup.cause, 1.0),),
            )
        )
    return found
