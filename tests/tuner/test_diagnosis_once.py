"""What several tests ask of a residual is made once; what is told holds no residual."""

from __future__ import annotations

import numpy as np

from models.noise import NoiseModel, White
from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.causes.heavy_tails import HeavyTails
from tuner.diagnosis.channel import channel
from tuner.diagnosis.loudness import block_loudness, loudness
from tuner.diagnosis.residual import relabelled, residual
from tuner.diagnosis.rounding import moments
from tuner.simulation import Channel, simulate


def test_loudness_is_made_once_for_a_residual():
    record = simulate({"gyro_x": Channel(NoiseModel((White(1e-3),)))}, duration=60.0, rate=100.0, seed=1)[0][
        0
    ]
    found = residual(channel(record, "gyro_x"))
    assert loudness(found) is loudness(found)
    assert block_loudness(found) is block_loudness(found)
    assert loudness(relabelled(found, (HeavyTails(6.0),))) is not loudness(found)


def test_moments_between_places_are_on_straight_lines():
    law = moments(0.3)
    mean = np.random.default_rng(2).uniform(-0.4, 0.4, 1000)
    for told, known in zip(law.at(mean), (law.variance, law.scatter), strict=True):
        np.testing.assert_allclose(told, np.interp(np.interp(mean, law.mean, law.place), law.place, known))


def test_tails_are_mapped_evenly_and_in_order():
    e = np.linspace(-12.0, 12.0, 4001)
    mapped = HeavyTails(5.0).whiten(e)
    np.testing.assert_allclose(mapped, -mapped[::-1], atol=1e-12)
    assert np.all(np.diff(mapped) > 0.0)
    exact = HeavyTails(5.0)._deviate(np.abs(e))
    np.testing.assert_allclose(np.abs(mapped), exact, atol=1e-5)


def test_what_is_told_holds_no_residual():
    assert Alarm("line", 0.1, 1.0, 2.0, "peak", tuple).told.propose is None
