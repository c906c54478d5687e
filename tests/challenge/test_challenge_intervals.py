"""Coverage of the 95 % intervals of one effect in the generator's noise, fitted alone.

Of n figures the number outside a 95 % interval is binomial.
"""

from __future__ import annotations

import numpy as np
import pytest
from challenge.generator.effect import Effect, UnreachableError
from challenge.generator.files import log
from challenge.generator.items import Item, _hide
from challenge.generator.laws import Burst, HeavyTails, VarianceDrift
from challenge.generator.means import Motion
from challenge.generator.scene import log_uniform
from scipy.stats import binom

from tuner.diagnosis.data_quality import data_quality_tests
from tuner.diagnosis.static.causes import burst, heavy_tails, motion, variance_drift
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.channel import Channel, channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.readers import read

LAWS = {
    Burst: burst.Burst.test,
    HeavyTails: heavy_tails.HeavyTails.test,
    VarianceDrift: variance_drift.VarianceDrift.test,
}


def hidden(effect: type[Effect], seed: int, samples: int) -> Item:
    """Return a set with one effect of 50 … 500 nats, without a thermometer: a drift follows time."""
    rng = np.random.default_rng([seed, 5])
    while True:
        try:
            place, effects = _hide(rng, seed, (effect,), lambda: log_uniform(rng, 50.0, 500.0), samples, 1)
        except UnreachableError:
            continue
        return Item(f"{seed}", "single", seed, place, effects)


def ready(item: Item, folder) -> Channel:
    """Return the axis as the diagnosis sees it."""
    path = folder / "log.npz"
    np.savez(path, **log(item))
    (record,) = read(path, assume="si")
    steps = [
        t.parameters["step"].value
        for t in data_quality_tests(record)
        if t.cause == "lattice" and t.parameters
    ]
    return channel(record, record.axes[0], quantizer_step=steps[0] if steps else 0.0)


def told(effect: type[Effect], one: Channel) -> dict[str, Value]:
    """Return what the fit of the effect's own cause tells."""
    if effect is Motion:
        (stretch,) = motion.stretches([one])
        return dict(motion.extension(one, stretch).values)
    one = Channel(one.axis, one.unit, one.y, one.valid, one.scale, one.level, one.interval, one.clock, one.block,
                  quantizer_step=one.quantizer_step)  # fmt: skip
    return dict(LAWS[effect](fit_channel(one)).propose()[0].values)


def outside(effect: type[Effect], seeds: range, samples: int, folder) -> tuple[int, int]:
    """Return how many figures lie outside their interval, of how many."""
    missed, number = 0, 0
    for seed in seeds:
        item = hidden(effect, seed, samples)
        one = ready(item, folder)
        truth = item.truth()["effects"][0]["parameters"][one.axis]
        for name, value in told(effect, one).items():
            factor = one.scale if "{u}" in value.unit else 1.0
            missed += not factor * value.lower <= truth[name] <= factor * value.upper
            number += 1
    return missed, number


def test_intervals_of_laws(tmp_path):
    """At least 90 % in truth, up to a chance of 1e-5."""
    counts = [outside(effect, range(4), 30_000, tmp_path) for effect in LAWS]
    missed, number = (sum(column) for column in zip(*counts, strict=True))
    assert number == 4 * 5
    assert binom.sf(missed - 1, number, 0.10) > 1e-5


def test_bounds_of_motion(tmp_path):
    missed, number = outside(Motion, range(6), 60_000, tmp_path)
    assert binom.sf(missed - 1, number, 0.05) > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("effect", LAWS)
def test_intervals_of_one_law(effect, tmp_path):
    """60 records of a cause: neither below 92 % nor, for figures of regular likelihoods, above 98 %, but for 1e-4."""
    missed, number = outside(effect, range(1000, 1060), 120_000, tmp_path)
    assert binom.sf(missed - 1, number, 0.08) > 1e-4
    if effect is not Burst:  # edges lie on samples, and the length owes the doubt of both
        assert binom.cdf(missed, number, 0.02) > 1e-4
