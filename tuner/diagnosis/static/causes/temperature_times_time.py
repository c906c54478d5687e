"""Ageing: a temperature slope that changes through the record, which the catalogue has no name for.

It counts only where it explains the record better than any named cause by `MIN_LEAD` nats. As a template it keeps
anything else from being made up for it; what it finds is reported as unexplained, not as a finding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.score_scan import scan
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult

UNNAMED = "unnamed"
"""Stands for the code of a cause where there is none."""
MIN_LEAD = 3.0
"""Nats by which it must be better than a cause with a name: those within them, a factor of 20, are alternatives."""


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
    price = MIN_LEAD

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return temperature times time on the blocks, both about their middle, K, shape (M,)."""
        return np.asarray(centred(channel) * (channel.block_time / channel.span - 0.5))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Test as a template; without gain where a transient explains nearly as much."""
        result = super().test(fitted)
        if result is None or result.gain <= 0.0:
            return result
        weak = 0.5 * (result.statistic - _transient_ratio(fitted)) < MIN_LEAD
        return replace(result, gain=NO_GAIN) if weak else result


def _transient_ratio(fitted: FittedChannel) -> float:
    """Return the likelihood ratio of a warm-up of the best time constant, which is sought beyond its grid."""
    if fitted.count("warmup"):
        return 0.0
    channel = fitted.channel
    tried = Warmup.candidates(channel)
    scores, _ = scan(fitted, np.stack([one.template(channel) for one in tried], axis=1))
    best = tried[scores.best].likeliest(fitted)
    template = block_transform(best.columns(channel), fitted.cleaned, fitted.track.singles)
    return 2.0 * (fitted.refit(template).log_likelihood - fitted.fit.log_likelihood)
