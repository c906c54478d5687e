"""A temperature slope that changes through the record: what the catalogue has no name for.

Statistic: likelihood ratio of (T − T̄)(t − t̄), the noise refitted; χ²₁. It counts only where it explains the record
better than any named cause by `LEAD` nats. Extension: a template, so that nothing else is made up for it; what it finds
is told as unexplained, not as a finding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes import warmup
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.score_scan import judge, scan
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

UNNAMED = "unnamed"
"""Stands for the code of a cause where there is none."""
LEAD = 3.0
"""Nats by which it must be better than a cause with a name."""


@dataclass(frozen=True)
class Ageing(Extension):
    """Bias in proportion to temperature times time."""

    cause: ClassVar[str] = UNNAMED
    named: ClassVar[bool] = False
    meaning: ClassVar[str] = "the bias follows temperature × time: its temperature slope changes"
    consequence: ClassVar[str] = "no calibration of one slope serves the whole record"

    def columns(self, channel: Channel) -> FloatArray:
        """Return the product on the blocks, shape (M, 1)."""
        return product(channel)[:, None]


def product(channel: Channel) -> FloatArray:
    """Return temperature times time on the blocks, both about their middle, K, shape (M,)."""
    return np.asarray(centred(channel) * (channel.block_time / channel.span - 0.5))


def test(found: Residual) -> Alarm | None:
    """Test temperature times time as a template; None where no temperature was measured."""
    if COVARIATE not in found.channel.covariates:
        return None
    scores, templates = scan(found, product(found.channel)[:, None])
    if not scores.promising:
        return Alarm(UNNAMED, 1.0, -9.0, float(scores.score[0] ** 2), Ageing.meaning)
    result = judge(found, templates[:, 0], np.empty(0), price=LEAD)
    gain = result.gain
    if gain > 0.0 and 0.5 * (result.ratio - _transient_ratio(found)) < LEAD:
        gain = -9.0
    return Alarm(UNNAMED, result.p_value, gain, result.ratio, Ageing.meaning, lambda: (Ageing(),))


def _transient_ratio(found: Residual) -> float:
    """Return the likelihood ratio of a warm-up of the best time constant, which is sought beyond its grid."""
    if found.found("warmup"):
        return 0.0
    channel = found.channel
    grid = warmup.constants(channel)
    scores, _ = scan(found, np.stack([warmup.transient(channel, t) for t in grid], axis=1))
    best = warmup.extension(found, float(grid[scores.best]))
    template = block_transform(best.columns(channel), found.repaired, found.track.singles)
    return 2.0 * (found.refit(template).log_likelihood - found.fit.log_likelihood)
