"""Weighted least squares of an Allan curve: exact curves, coverage, constraints."""

import numpy as np
import pytest

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, Ramp, RandomWalk, White
from tuner.identification.allan_leastsquares import fit, misfit
from tuner.identification.allan_octaves import OctaveCurve
from tuner.types.records import DataError

INTERVAL = 0.01
MIXED = NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.06)))


def exact_curve(model, n=360_000):
    m = 2 ** np.arange(int(np.log2(n // 4)) + 1)
    return OctaveCurve(m, model.allan_variance(m * INTERVAL, interval=INTERVAL), (n,), INTERVAL)


def simulated(model, seed, n=60_000, segments=1):
    rng = np.random.default_rng(seed)
    return OctaveCurve.of([model.sample(n, INTERVAL, rng) for _ in range(segments)], INTERVAL)


@pytest.mark.parametrize("generalised", [False, True])
@pytest.mark.parametrize(
    "model",
    [
        MIXED,
        NoiseModel((Quantization(0.05), White(1.0), RandomWalk(0.06), Ramp(0.002))),
        NoiseModel((White(1.0), GaussMarkov(0.3, 100.0))),
    ],
    ids=["flicker", "ramp", "markov"],
)
def test_a_curve_without_noise_gives_its_terms_back(model, generalised):
    # only the bias of the logarithm separates an exact curve from its own model
    found = fit(exact_curve(model, 3_600_000), model.scaled(3.0), generalised=generalised)
    truth = [np.log(getattr(t, name)) for t in model.terms for name in t.PARAMETERS]
    sd = np.sqrt(np.diag(found.covariance))
    assert found.estimate == pytest.approx(truth, abs=0.15)
    assert np.all(np.abs(found.estimate - truth) < sd + 1e-9)
    assert all(low <= np.exp(x) <= high for (low, high), x in zip(found.intervals, truth, strict=True))


def test_intervals_of_a_hidden_term_reach_zero():
    found = fit(simulated(NoiseModel((White(1.0),)), 1), NoiseModel((White(1.0), RandomWalk(0.1))))
    (low, high), (zero, top) = found.intervals
    assert 0.5 * (low + high) == pytest.approx(1.0, abs=2.0 * (high - low))  # ± 8 standard errors
    assert high - low < 0.05
    assert zero == 0.0
    assert 0.0 < top < 0.1


def test_scaling_the_data_scales_the_amplitudes():
    curve = simulated(MIXED, 2)
    larger = OctaveCurve(curve.m, 9.0 * curve.variance, curve.lengths, curve.interval)
    one, three = fit(curve, MIXED), fit(larger, MIXED)
    assert three.estimate - one.estimate == pytest.approx(np.log(3.0), abs=1e-5)
    assert three.covariance == pytest.approx(one.covariance, rel=1e-4)


def test_degrees_of_freedom_follow_the_model():
    # flicker and walk leave fewer than white noise does, at the same τ
    white, walk = (
        fit(exact_curve(model), model).dof[-3:]
        for model in (NoiseModel((White(1.0),)), NoiseModel((RandomWalk(1.0),)))
    )
    assert np.all(walk < white)


def test_segments_are_pooled():
    curve = simulated(MIXED, 3, n=30_000, segments=3)
    assert curve.lengths == (30_000, 30_000, 30_000)
    found = fit(curve, MIXED)
    assert np.exp(found.estimate[0]) == pytest.approx(1.0, abs=0.02)
    alone = fit(simulated(MIXED, 3, n=30_000), MIXED)
    assert found.covariance[0, 0] == pytest.approx(alone.covariance[0, 0] / 3.0, rel=0.1)


def test_p_value_is_uniform_under_the_model():
    rng = np.random.default_rng(4)
    model = NoiseModel((White(1.0), RandomWalk(0.2)))
    p = [
        fit(OctaveCurve.of([model.sample(4000, INTERVAL, rng)], INTERVAL), model, generalised=True).p_value
        for _ in range(40)
    ]
    # each of 40 lies below 0.3 with probability about 0.3: 12 ± 2.9, five sigma above, four below
    assert 1 <= np.sum(np.array(p) < 0.3) <= 26


def test_an_effect_that_is_no_term_is_noticed():
    n = 60_000
    y = MIXED.sample(n, INTERVAL, np.random.default_rng(5))
    clean = OctaveCurve.of([y], INTERVAL)
    assert misfit(clean, MIXED).p_value > 1e-4
    line = OctaveCurve.of([y + 3.0 * np.sin(2.0 * np.pi * 2.0 * np.arange(n) * INTERVAL)], INTERVAL)
    found = misfit(line, MIXED)
    assert found.p_value < 1e-6
    assert found.tau == pytest.approx(0.37 / 2.0, rel=1.0)
    assert found.ratio > 1.1


def test_tolerance_grants_a_relative_deviation():
    curve = exact_curve(MIXED)
    assert misfit(curve, MIXED.scaled(1.02)).p_value < 1e-6
    assert misfit(curve, MIXED.scaled(1.02), tolerance=0.02).p_value > 0.05


@pytest.mark.parametrize("pieces", [[np.zeros(7)], [], [np.full(100, 2.5)]])
def test_records_without_a_curve_are_refused(pieces):
    with pytest.raises(DataError):
        OctaveCurve.of(pieces, INTERVAL)


def test_more_parameters_than_points_are_refused():
    curve = OctaveCurve.of([np.random.default_rng(6).standard_normal(9)], INTERVAL)
    with pytest.raises(ValueError, match="3 parameters"):
        fit(curve, MIXED)
