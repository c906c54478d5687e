"""Noise terms: spectrum, variances, autocovariance and gradients agree with one another."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pytest

from models.noise import (
    POWER_LAW,
    TERMS,
    Arma,
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    White,
)
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tests.models.noise.terms import CONTINUOUS, EXAMPLES, INTERVAL, RANDOM, STATIONARY, named

NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def integrate(function, edges):
    """Gauss–Legendre between consecutive edges."""
    half = 0.5 * np.diff(edges)[:, None]
    centre = 0.5 * (edges[1:] + edges[:-1])[:, None]
    return float(np.sum(half * WEIGHTS * function(centre + half * NODES)))


def continuous_variance(term, tau, power):
    """4 ∫ S sin⁴/(πfτ)² or (16/3) ∫ S sin⁶/(πfτ)²: beyond 500 cycles with the mean of the sine."""
    factor, mean = {4: (4.0, 3.0 / 8.0), 6: (16.0 / 3.0, 5.0 / 16.0)}[power]
    edges = np.concatenate([[0.0], np.geomspace(1e-12, 0.25, 60), np.arange(2, 2001) / 4.0])
    near = integrate(lambda u: term.psd(u / tau) * np.sin(np.pi * u) ** power / (np.pi * u) ** 2, edges)
    far = integrate(lambda v: term.psd(1.0 / (v * tau)) * mean / np.pi**2, np.array([0.0, 0.001, 0.002]))
    return factor * (near + far) / tau


def sampled_variance(term, m, power):
    factor = {4: 4.0, 6: 16.0 / 3.0}[power]
    nyquist = 0.5 / INTERVAL
    fine = np.geomspace(1e-12, 1e-2 / m, 60)
    edges = nyquist * np.concatenate([[0.0], fine, np.linspace(1e-2 / m, 1.0, 2 * m + 10)[1:]])

    def integrand(f):
        kernel = np.sin(np.pi * f * m * INTERVAL) ** power / (m * np.sin(np.pi * f * INTERVAL)) ** 2
        return term.psd(f, interval=INTERVAL) * kernel

    return factor * integrate(integrand, edges)


@pytest.mark.parametrize("tau", [0.03, 1.0, 20.0])
@pytest.mark.parametrize("term", CONTINUOUS, ids=named)
def test_variances_are_integrals_of_the_spectrum(term, tau):
    assert continuous_variance(term, tau, 4) == pytest.approx(float(term.allan_variance(tau)), rel=1e-6)
    assert continuous_variance(term, tau, 6) == pytest.approx(float(term.hadamard_variance(tau)), rel=1e-6)


@pytest.mark.parametrize("m", [1, 2, 7, 100])
@pytest.mark.parametrize("term", RANDOM, ids=named)
def test_sampled_variances_are_integrals_of_the_sampled_spectrum(term, m):
    tau = m * INTERVAL
    allan = float(term.allan_variance(tau, interval=INTERVAL))
    hadamard = float(term.hadamard_variance(tau, interval=INTERVAL))
    assert sampled_variance(term, m, 4) == pytest.approx(allan, rel=1e-10)
    assert sampled_variance(term, m, 6) == pytest.approx(hadamard, rel=1e-10)


@pytest.mark.parametrize("term", CONTINUOUS, ids=named)
def test_sampling_does_not_matter_at_long_cluster_times(term):
    tau = np.array([3e5, 3e6]) * INTERVAL
    sampled, continuous = term.allan_variance(tau, interval=INTERVAL), term.allan_variance(tau)
    aliased = float(term.psd(0.0, interval=INTERVAL) / term.psd(0.0)) if term in STATIONARY else 1.0
    np.testing.assert_allclose(sampled, aliased * continuous, rtol=1e-4)


@pytest.mark.parametrize("term", STATIONARY, ids=named)
def test_sampled_spectrum_and_autocovariance_are_a_fourier_pair(term):
    n = 1 << 14
    f = np.fft.fftfreq(n, INTERVAL)
    covariance = np.fft.ifft(term.psd(f, interval=INTERVAL)).real / INTERVAL
    lags = np.arange(20)
    expected = term.autocovariance(lags * INTERVAL, interval=INTERVAL)
    np.testing.assert_allclose(covariance[lags], expected, atol=1e-10 * expected[0])


@pytest.mark.parametrize("term", [t for t in CONTINUOUS if t in STATIONARY and t.name != "white"], ids=named)
def test_continuous_spectrum_and_autocovariance_are_a_fourier_pair(term):
    slowest = 1.0 / term.exponentials()[1].real.min()
    edges = np.linspace(0.0, 60.0 * slowest, 400)
    for f in (0.0, 0.1 / slowest, 1.0 / slowest):
        cosine = 2.0 * integrate(lambda t, f=f: term.autocovariance(t) * np.cos(2.0 * np.pi * f * t), edges)
        assert cosine == pytest.approx(float(term.psd(f)), rel=1e-9)


@pytest.mark.parametrize(
    ("term", "interval"),
    [(t, dt) for t in EXAMPLES for dt in (None, INTERVAL) if dt or t.name != "quantization"],
    ids=lambda value: named(value) if hasattr(value, "name") else str(value),
)
def test_gradient_is_the_derivative_by_log_parameters(term, interval):
    f = np.geomspace(1e-4, 4.9, 30)
    model, step = NoiseModel([term]), 1e-5
    gradient = term.psd_gradient(f, interval=interval)
    assert gradient.shape == (len(term.PARAMETERS), f.size)
    for i, row in enumerate(gradient):
        shift = np.zeros(len(gradient))
        shift[i] = step
        above = model.with_values(model.values() * np.exp(shift)).psd(f, interval=interval)
        below = model.with_values(model.values() * np.exp(-shift)).psd(f, interval=interval)
        np.testing.assert_allclose(row, (above - below) / (2.0 * step), rtol=1e-6, atol=1e-9 * np.max(above))


@pytest.mark.parametrize("term", EXAMPLES, ids=named)
def test_scaling_the_data_scales_every_variance_by_the_square(term):
    tau = np.array([1, 3, 10]) * INTERVAL
    twin = term.scaled(-3.0)
    np.testing.assert_allclose(twin.allan_variance(tau), 9.0 * term.allan_variance(tau))
    np.testing.assert_allclose(twin.psd(1.0, interval=INTERVAL), 9.0 * term.psd(1.0, interval=INTERVAL))
    assert twin.as_dict().get("time_constant") == term.as_dict().get("time_constant")


@pytest.mark.parametrize(
    ("term", "ratio"),
    [
        (Quantization(1.0), 10.0 / 9.0),
        (White(1.0), 1.0),
        (BiasInstability(1.0), math.log(256.0 / 27.0) / (4.0 * math.log(2.0))),
        (RandomWalk(1.0), 0.5),
        (Ramp(1.0), 0.0),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_hadamard_to_allan_ratio(term, ratio):
    tau = np.array([0.5, 3.0])
    np.testing.assert_allclose(term.hadamard_variance(tau), ratio * term.allan_variance(tau), rtol=1e-14)


@pytest.mark.parametrize("interval", [None, 1e-3])
def test_long_gauss_markov_is_a_random_walk(interval):
    markov, walk = GaussMarkov(2.0, 1e9), RandomWalk(2.0 * math.sqrt(2e-9))
    tau = np.array([1e-3, 1.0, 100.0])
    for name in ("allan_variance", "hadamard_variance"):
        got, expected = (
            getattr(markov, name)(tau, interval=interval),
            getattr(walk, name)(tau, interval=interval),
        )
        np.testing.assert_allclose(got, expected, rtol=1e-6)
    np.testing.assert_allclose(
        markov.psd([0.1, 400.0], interval=interval), walk.psd([0.1, 400.0], interval=interval), rtol=1e-9
    )


def test_short_gauss_markov_is_white():
    markov, white = GaussMarkov(2.0, 1e-9), White(2.0 * math.sqrt(2e-9))
    tau = np.array([1.0, 100.0])
    np.testing.assert_allclose(markov.allan_variance(tau), white.allan_variance(tau), rtol=1e-8)
    independent = markov.allan_variance(tau, interval=0.5)
    np.testing.assert_allclose(independent, White(2.0 * math.sqrt(0.5)).allan_variance(tau), rtol=1e-12)


def test_low_pass_of_first_order_is_gauss_markov():
    low_pass = LowPassWhite(0.2, 3.0)
    markov = GaussMarkov(math.sqrt(low_pass.variance), 1.0 / (6.0 * math.pi))
    f = np.linspace(0.0, 5.0, 7)
    np.testing.assert_allclose(low_pass.psd(f), markov.psd(f), rtol=1e-13)
    np.testing.assert_allclose(low_pass.psd(f, interval=0.1), markov.psd(f, interval=0.1), rtol=1e-13)


@pytest.mark.parametrize("order", [1, 2])
def test_low_pass_far_above_the_band_is_white(order):
    tau = np.array([1.0, 10.0])
    low_pass = LowPassWhite(0.2, 1e5, order=order)
    np.testing.assert_allclose(low_pass.allan_variance(tau), White(0.2).allan_variance(tau), rtol=1e-5)


def test_deterministic_terms_match_the_variance_of_their_samples():
    m, interval, rng = 7, 0.25, np.random.default_rng(0)
    for term in (Ramp(0.3), Sinusoid(0.3, 0.37)):
        means = term.sample(7 * 40000, interval, rng).reshape(-1, m).mean(axis=1)
        allan = 0.5 * np.mean(np.diff(means) ** 2)
        hadamard = np.mean(np.diff(means, 2) ** 2) / 6.0
        tau = m * interval
        assert allan == pytest.approx(float(term.allan_variance(tau, interval=interval)), rel=1e-4)
        assert hadamard == pytest.approx(
            float(term.hadamard_variance(tau, interval=interval)), rel=1e-4, abs=1e-20
        )


def test_variance_of_sampled_flicker_keeps_its_digits_at_any_length():
    m = np.array([1e2, 1e5, 1e7])
    bound = (np.log(m) + 3.0) / m**2 + 1e-13
    flicker = BiasInstability(1.0)
    excess = flicker.allan_variance(m, interval=1.0) - flicker.allan_variance(m)
    assert np.all(np.abs(excess) < bound)
    hadamard = flicker.hadamard_variance(m, interval=1.0) - flicker.hadamard_variance(m)
    assert np.all(np.abs(hadamard) < bound)


def test_flat_sum_in_any_order():
    white, walk, markov, flicker = White(0.1), RandomWalk(0.2), GaussMarkov(1.0, 3.0), BiasInstability(0.3)
    models = {sum(order) for order in itertools.permutations([white, walk, markov, flicker])}
    models.add((white + walk) + (markov + flicker))
    models.add(white + (walk + (markov + flicker)))
    assert len(models) == 1
    model = models.pop()
    assert len(model.terms) == 4
    assert model != white + walk
    assert white + white != white + NoiseModel()


def test_sum_adds_spectra_and_variances():
    model = NoiseModel(RANDOM)
    f, tau = np.array([0.1, 1.0, 4.0]), np.array([1, 10]) * INTERVAL
    np.testing.assert_allclose(
        model.psd(f, interval=INTERVAL), np.sum([t.psd(f, interval=INTERVAL) for t in RANDOM], axis=0)
    )
    for name in ("allan_variance", "hadamard_variance"):
        parts = [getattr(t, name)(tau, interval=INTERVAL) for t in RANDOM]
        np.testing.assert_allclose(getattr(model, name)(tau, interval=INTERVAL), np.sum(parts, axis=0))
    assert model.parameters[:2] == ("quantization.increment_sd", "white.density")
    assert "gauss_markov_2.time_constant" in model.parameters


def test_empty_model_is_silence():
    silence = NoiseModel()
    assert np.array_equal(silence.psd([1.0, 2.0]), [0.0, 0.0])
    assert np.array_equal(silence.allan_variance([1.0]), [0.0])
    assert np.array_equal(silence.sample(3, 1.0, np.random.default_rng(0)), np.zeros(3))
    assert silence.state_space() is None
    assert silence == sum([], NoiseModel())


def test_the_power_laws_are_those_that_say_so():
    assert {kind for kind in TERMS.values() if kind.is_power_law} == set(POWER_LAW)


def test_dictionary_survives_json():
    model = NoiseModel(EXAMPLES)
    assert set(model.as_dict()) >= set(TERMS)
    assert isinstance(model.as_dict()["white"], dict)
    assert isinstance(model.as_dict()["gauss_markov"], list)
    with TERMS.added(SecondOrderGaussMarkov):
        assert NoiseModel.from_dict(json.loads(json.dumps(model.as_dict()))) == model


def test_units_of_parameters():
    assert White(1.0).units("rad/s") == ("rad/s^0.5",)
    assert Quantization(1.0).units("m/s^2") == ("m/s",)
    assert RandomWalk(1.0).units("rad/s") == ("rad/s^1.5",)
    assert Ramp(1.0).units("m/s^2") == ("m/s^3",)
    assert GaussMarkov(1.0, 1.0).units("rad/s") == ("rad/s", "s")
    assert Arma((), (), 1.0, 1.0).units("rad/s") == ("(rad/s)^2",)


@pytest.mark.parametrize("value", [-0.1, 0.0, math.nan, math.inf])
@pytest.mark.parametrize("term", [t for t in EXAMPLES if t.name != "arma"], ids=named)
def test_parameters_are_positive(term, value):
    for parameter in term.PARAMETERS:
        with pytest.raises(ValueError, match=f"'{parameter}' must be positive, got {value}"):
            type(term)(**{**term.as_dict(), parameter: value})


def test_errors_say_what_was_expected():
    with pytest.raises(ValueError, match="quantization noise has no spectrum without the sampling interval"):
        (White(1.0) + Quantization(1.0)).psd(1.0)
    for term in (RandomWalk(1.0), BiasInstability(1.0), Ramp(1.0)):
        with pytest.raises(ValueError, match="not stationary"):
            term.autocovariance(0.0)
    with pytest.raises(ValueError, match="'order' must be 1 or 2, got 3"):
        LowPassWhite(1.0, 1.0, order=3)
    with pytest.raises(ValueError, match="unknown noise term 'pink'; known are quantization, white"):
        NoiseModel.from_dict({"pink": {}})
    with pytest.raises(ValueError, match="noise term 'white'"):
        NoiseModel.from_dict({"white": {"densty": 1.0}})
    with pytest.raises(ValueError, match="'terms' must be noise terms, got float"):
        White(1.0) + 3.0
    with pytest.raises(ValueError, match=r"'values' must have shape \(1,\)"):
        NoiseModel([White(1.0)]).with_values([1.0, 2.0])
