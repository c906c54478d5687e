"""Block means of samples whose white noise is not normal, as they would be if it were.

A law that is skew, or has heavy tails, is still seen in means over some tens of samples: there it looks like a level
that is visited now and then, or like noise that moves with the bias. Where such a law has been accepted the white part
of the samples is replaced by its normal deviates; slow noise and events, which move many samples by little, stay.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.causes.skewed_noise import SkewedNoise
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, once
from tuner.diagnosis.static.variance.local_variance import course


@once
def law_in_blocks(fitted: FittedChannel) -> FloatArray:
    """Return what the law of the white noise adds to the block means beside normal noise, shape (M,), in scales."""
    laws = [x for x in fitted.extensions if isinstance(x, HeavyTails | SkewedNoise)]
    if not laws:
        return np.zeros(fitted.channel.blocks)
    sd = np.sqrt(course(fitted))
    own = fitted.whitened() / sd
    normal = own
    for law in laws:
        normal = law.whiten(normal)
    valid = fitted.valid
    normal = (normal - normal[valid].mean()) * (float(np.std(own[valid])) / float(np.std(normal[valid])))
    white = np.sqrt(fitted.expected_power.fast / fitted.channel.interval)
    return fitted.channel.block_mean(np.where(valid, white * sd * (own - normal), 0.0))
