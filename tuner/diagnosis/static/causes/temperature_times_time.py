"""Ageing: a temperature slope that changes through the record, which the catalogue has no name for.

It counts only where it explains the record better than any named cause by `ALTERNATIVE_NATS` nats. As a template it
keeps anything else from being made up for it; what it finds is reported as unexplained, not as a finding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.outcome import ALTERNATIVE_NATS

UNNAMED = "unnamed"
"""Stands for the code of a cause where there is none."""


@dataclass(frozen=True)
class Ageing(Template):
    """Bias in proportion to temperature times time."""

    cause = UNNAMED
    named = False
    meaning = "the bias follows temperature × time: its temperature slope changes"
    consequence = "no calibration of one slope serves the whole record"
    covariate = COVARIATE
    size = ("slope", "{u}/K")
    statistic = meaning
    price = ALTERNATIVE_NATS + Warmup.price

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return temperature times time on the blocks, both about their middle, K, shape (M,)."""
        return np.asarray(centred(channel) * (channel.block_time / channel.span - 0.5))
