"""Spikes: single samples far from those beside them.

Statistic: the number of residuals beyond five deviations against a Poisson law, and the largest one against the
normal law; the smaller chance, doubled. Gain: likelihood of a contaminated normal law.
Extension: the flagged samples are taken out, as a gate in front of a filter would do. Gross ones, hundreds of white
deviations from the samples beside them, go before any noise is fitted: one of them is more than all the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from models.arrays import LEAST_DIVISOR, FloatArray, SignedArray
from models.effects.static.events import Spikes as Effect
from models.probability import (
    MEDIAN_OVER_MEAN_SD,
    normal_beyond,
    normal_density,
    poisson_at_least,
    poisson_interval,
)
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import any_of, maximum
from tuner.diagnosis.static.outcome import WORTH_A_FIT, TestResult
from tuner.diagnosis.static.variance.histogram import Histogram, histogram
from tuner.limits import SHOWN_CHANGE

SPIKE_THRESHOLD = 5.0
"""Sds beyond which residuals are counted by the test: normal ones exceed it with a chance of 6e-7."""
SPIKE_GATE = 4.8
"""Sds beyond which a sample is taken out once there are spikes.

Slightly below the threshold, so that spikes just under it are taken out with the others.
"""
GROSS_THRESHOLD = 300.0
"""White sds beyond which a sample is no noise of any kind; chosen beyond any tail that a noise term could explain."""
MEDIAN_NEIGHBOURS = 4
"""Samples on either side whose median a gross spike is compared with; up to four spikes among them do no harm."""


@dataclass(frozen=True)
class Spikes(Extension):
    """Samples that are taken out: their places, shape (s,)."""

    cause = "spikes"
    effect = Effect
    group = "distribution"
    repeats = 2
    needs_fine_quantizer = True
    view = "histogram"
    meaning = "single samples far off (glitches of the wire or of the converter)"
    consequence = "a gate at five deviations in front of the filter; do not widen the white noise for them"
    places: tuple[int, ...]

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the spikes out."""
        missing = np.zeros(len(channel), dtype=bool)
        missing[list(self.places)] = True
        return channel.refilled(missing, np.random.default_rng(len(self.places)))

    def wrong_samples(self, channel: Channel) -> tuple[int, ...]:
        """Return the places where without them the white noise is smaller by `SHOWN_CHANGE`, else none."""
        clean, at = self.clean_samples(channel).y, list(self.places)
        noise = 0.5 * float(np.mean(np.square(np.diff(clean))))
        more = float(np.sum(np.square((channel.y - clean)[at]))) / (noise * len(clean))
        return self.places if np.sqrt(1.0 + more) >= 1.0 + SHOWN_CHANGE else ()

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Test the number of residuals beyond five sds, and the largest one."""
        size = np.abs(fitted.good)
        n = len(size)
        count = int(np.count_nonzero(size > SPIKE_THRESHOLD))
        expected = n * 2.0 * normal_beyond(SPIKE_THRESHOLD)
        many = poisson_at_least(count, expected) if count else 1.0
        largest = any_of(2.0 * normal_beyond(size.max()), n)
        p_value = min(1.0, 2.0 * min(many, largest))
        gain = 0.0
        if p_value < WORTH_A_FIT:
            bins = histogram(fitted.good)
            gain = mixture_gain(bins) - 1.5 * float(np.log(n))
        return TestResult(
            "spikes",
            p_value,
            gain,
            float(size.max()),
            f"largest residual; {count} beyond 5 deviations",
            lambda: (extension(fitted),),
        )


def mixture_gain(bins: Histogram) -> float:
    """Return the log likelihood that a contaminated normal law gains over the normal one."""

    def cost(x: FloatArray) -> float:
        share, core, wide = expit(x[0]), np.exp(x[1]), np.exp(x[1]) * (1.0 + np.exp(x[2]))
        density = (1.0 - share) * normal_density(bins.value, core) + share * normal_density(bins.value, wide)
        return -float(bins.count @ np.log(density + LEAST_DIVISOR))

    return bins.normal_cost() - maximum(cost, [[-9.0, 0.0, 2.0], [-5.0, 0.0, 1.0]], scale=0.5)[2]


def gross(channel: Channel) -> TestResult | None:
    """Return the test result of samples that are far from those beside them; None where there are none."""
    far = np.flatnonzero((np.abs(channel.y) > GROSS_THRESHOLD) & channel.valid)
    middle = np.clip(far, MEDIAN_NEIGHBOURS, len(channel) - 1 - MEDIAN_NEIGHBOURS)
    beside = middle[:, None] + np.arange(-MEDIAN_NEIGHBOURS, MEDIAN_NEIGHBOURS + 1)
    sizes = np.abs(channel.y[far] - np.median(channel.y[beside], axis=1))
    far, sizes = far[sizes > GROSS_THRESHOLD], sizes[sizes > GROSS_THRESHOLD]
    if not len(far):
        return None
    found = _taken_out(far, sizes, channel.span, 1.0, 0.0)
    name = "largest distance from the samples beside"
    return TestResult("spikes", 0.0, float(sizes.max()), float(sizes.max()), name, lambda: (found,))


def extension(fitted: FittedChannel) -> Spikes:
    """Return the samples to be taken out, with the rate and the typical size."""
    e, dt = fitted.e, fitted.channel.interval
    places = np.flatnonzero((np.abs(e) > SPIKE_GATE) & fitted.valid)
    by_chance = 2.0 * normal_beyond(SPIKE_GATE) * len(e)
    white = fitted.spread * float(np.sqrt(fitted.expected_power.fast / dt))
    sizes = np.abs(fitted.whitened()[places]) * white / fitted.spread  # as they are, whatever the law
    return _taken_out(places, sizes, len(e) * dt, white, by_chance)


def _taken_out(places: SignedArray, sizes: FloatArray, span: float, white: float, by_chance: float) -> Spikes:
    """Return spikes at these places, of these sizes in noise of a white sd; so many are there by chance."""
    count = len(places)
    low, high = poisson_interval(count)
    middle = float(np.median(sizes))
    spread = (MEDIAN_OVER_MEAN_SD * float(np.std(sizes)) + white) / float(np.sqrt(max(count, 1)))
    return Spikes(
        tuple(places.tolist()),
        values={
            "rate": Value((count - by_chance) / span, max(low - by_chance, 0.0) / span, high / span, "1/s"),
            "size": Value.of(middle, spread, "{u}"),
        },
    )
