"""Gauss–Markov: one correlated process more than the base noise has.

Statistic: likelihood ratio of a further term against the better of flicker and one Gauss–Markov process, each with
a random walk. Under the null the time constant is not identified: the chance is that of χ²₂ times the number of
decades it may lie in. Extension: the term joins the noise model and is fitted with the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.effects.static.spectral import CorrelatedDrift
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.slow_likelihood import Fit
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult


@dataclass(frozen=True)
class MoreMarkov(Extension):
    """A further Gauss–Markov process; its parameters are fitted with those of the other noise."""

    cause = "gauss_markov"
    effect = CorrelatedDrift
    group = "slow part"
    contained_in = ("telegraph",)
    meaning = (
        "a correlated process that flicker and a random walk do not explain: a local peak of the Allan curve"
    )
    consequence = "a Gauss–Markov bias state to add, with this sd and time constant"

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Test for a further Gauss–Markov process by a likelihood ratio."""
        name = "likelihood ratio of a further Gauss–Markov process"
        if not fitted.may_have_markov:
            return TestResult("gauss_markov", 1.0, NO_GAIN, 0.0, name)
        best = max(fitted.with_markov, key=lambda fit: fit.log_likelihood)
        ratio = max(0.0, 2.0 * (best.log_likelihood - fitted.fit.log_likelihood))
        decades = np.log10(fitted.channel.span / (20.0 * fitted.channel.interval))
        gain = 0.5 * ratio - float(np.log(fitted.channel.blocks))
        p_value = float(min(1.0, 2.0 * decades * chi2_beyond(ratio, 2)))
        return TestResult(
            "gauss_markov",
            p_value,
            gain,
            ratio,
            name,
            lambda: (MoreMarkov(values=parameters(best)),),
        )


def parameters(fit: Fit) -> dict[str, Value]:
    """Return sd and time constant of the last process of a fit, with intervals from its information."""
    sd, constant = np.exp(fit.theta[-2:]).tolist()
    spread = np.sqrt(np.diag(fit.covariance)[-2:]).tolist()
    return {"sd": Value.log(sd, spread[0], "{u}"), "time_constant": Value.log(constant, spread[1], "s")}
