"""Causes that look like each other while only one of several is in the model: the right one in the end."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from tests.tuner.diagnosis.static.test_large_changes import COUNT, RATE, T, found, noise
from tests.tuner.diagnosis.static.test_spectrum_shapes import fitted
from tuner.diagnosis.static.causes.recovery import Recovery
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.outcome import Accepted, TestResult
from tuner.diagnosis.static.slow_shapes import settled
from tuner.diagnosis.static.spectrum.shape import few_shapes, many_shapes
from tuner.types import Diagnosis
from tuner.types.records import Record


def named(diagnosis: Diagnosis) -> list[str]:
    return [f.cause for f in diagnosis.findings]


def test_a_weak_filter_of_first_order_gains_as_much_as_the_recursion_that_it_is():
    """An exponential mean: its best cutoff without quantization was sought with quantization beside it."""
    y = lfilter([0.96], [1.0, -0.04], np.random.default_rng(4).standard_normal(60_000))
    tested = many_shapes(few_shapes(fitted(y)))
    assert tested.filter_gain > tested.gain(tested.colours[0]) - 0.5 > 10.0


def test_recoveries_that_explain_no_more_than_steps_are_steps():
    """A first step beside a second one that is not in the model yet looks as if it decayed: a law of both models."""
    y = noise(8) + 1.0 * (T >= 150.0) - 0.7 * (T >= 250.0)
    samples = channel(Record("gyro", T, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE), "gyro_x")
    decays = tuple(Recovery(0.8 * T[-1], int(at * RATE)) for at in (150.0, 250.0))
    before = fit_channel(samples, decays)
    taken = TestResult("recovery", 1e-9, 40.0, 100.0, "")
    after, accepted = settled(before, [Accepted(one, taken) for one in decays], 1e-4)
    assert [one.cause for one in after.extensions] == ["step", "step"]
    assert [one.extension for one in accepted] == list(after.extensions)
    assert after.fit.log_likelihood > before.fit.log_likelihood


def test_a_step_on_slow_noise_is_no_recovery_that_hardly_decays():
    """A time constant of a third of the record, beyond those that are sought, is worth some nats by chance."""
    y, at = noise(8), int(250.0 * RATE)
    y[at:] += 0.3 * np.exp(-(np.arange(at, COUNT) - at) / (0.33 * COUNT))
    samples = channel(Record("gyro", T, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE), "gyro_x")
    decay = Recovery(0.33 * T[-1], at)
    before = fit_channel(samples, (decay,))
    after, (one,) = settled(before, [Accepted(decay, TestResult("recovery", 1e-9, 40.0, 100.0, ""))], 1e-4)
    assert 3.0 < before.fit.log_likelihood - after.fit.log_likelihood < 10.0
    assert one.extension.cause == "step"
    assert [a.cause for a in one.alternatives] == ["recovery"]


def test_the_highest_ordinates_of_a_sharp_resonance_are_no_lines():
    """A peak as wide as seven ordinates."""
    r, turn = np.exp(-np.pi * 1.2 / 80.0 / RATE), 2.0 * np.pi * 1.2 / RATE
    shape = [1.0, -2.0 * r * np.cos(turn), r * r]
    peak = lfilter([0.005], shape, np.random.default_rng(2).standard_normal(COUNT + 9000))[9000:]
    assert named(found(noise(5) + peak)) == ["vibration"]


def test_a_comb_is_confirmed_by_samples_that_did_not_show_its_period():
    """0.4 · 24 000 / 30.37 pulses are worth ½ 1.35² nats each: 288; steps of a quarter of a bin lose some of that."""
    y = noise(6)
    y[np.arange(3.0, COUNT, 30.37).astype(int)] += 1.35
    (finding,) = found(y).findings
    assert finding.cause == "comb"
    assert 150.0 < finding.gain.nats < 288.0


def test_the_rest_of_a_record_does_not_contradict_a_rate_of_three_spikes():
    """None of three lies in the last 40 % in one record of five: that contradicts nothing."""
    y = noise(7)
    y[[2000, 5100, 9900]] += [14.0, -13.0, 15.0]
    (finding,) = found(y).findings
    assert finding.cause == "spikes"
    assert finding.gain.nats > 50.0
