"""The cosine periodogram, its expectation, and the maximum-likelihood fit to it."""

import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz
from scipy.signal import butter, lfilter
from scipy.stats import multivariate_normal

from models.noise import (
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    White,
)
from tests.cramer_rao import spectral_bound
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.identify_channel import identify_channel
from tuner.identification.likelihood import fit, fit_periodogram
from tuner.identification.objective import Objective
from tuner.identification.periodogram import SINGLE_COEFFICIENTS, cosine_periodogram
from tuner.identification.sinusoids import about_lines
from tuner.types.records import Record

INTERVAL = 0.1
N = 256


def basis(n):
    return np.sqrt(INTERVAL) * dct(np.eye(n), axis=0, norm="ortho")[1:]


def covariance(term, n=N):
    """Covariance of n samples, up to a constant (which the basis removes) where there is none."""
    k = np.arange(n)
    if term.name == "random_walk":
        return term.density**2 * INTERVAL * np.minimum.outer(k, k)
    if term.name == "bias_instability":
        odd = np.concatenate(([0.0], np.cumsum(1.0 / (2.0 * k[1:] - 1.0))))
        return toeplitz(-2.0 / np.pi * term.level**2 * odd)
    return toeplitz(term.autocovariance(k * INTERVAL, interval=INTERVAL))


EXACT = [White(0.3), RandomWalk(0.2), Quantization(0.01)]
CLOSE = [
    BiasInstability(0.5),
    *(GaussMarkov(0.5, time) for time in (0.6, 4.0, 300.0)),
    *(LowPassWhite(0.5, cutoff) for cutoff in (0.3, 0.04)),
]
SMOOTH = [SecondOrderGaussMarkov(0.5, time) for time in (0.6, 4.0)]
"""Terms that fall like 1/f⁴: the ends of a record leak 1e-6 of their power into high frequencies."""


@pytest.mark.parametrize("term", EXACT + CLOSE + SMOOTH, ids=repr)
def test_expected_power_is_the_diagonal_of_the_covariance(term):
    data = cosine_periodogram([np.random.default_rng(0).standard_normal(N)], INTERVAL)
    d = basis(N)
    diagonal = np.einsum("ij,jk,ik->i", d, covariance(term), d)
    single = data.count == 1
    expected = expected_power(term, data)[0][single]
    rows = np.rint(data.order[single]).astype(int) - 1
    leak = 1e-6 * diagonal.max() if term in SMOOTH else 0.0
    np.testing.assert_allclose(expected, diagonal[rows], rtol=1e-9 if term in EXACT else 2e-3, atol=leak)


def test_white_noise_and_random_walk_are_diagonal():
    d = basis(N)
    for term in (White(0.3), RandomWalk(0.2)):
        full = d @ covariance(term) @ d.T
        scale = np.sqrt(np.outer(np.diag(full), np.diag(full)))
        assert np.abs(full / scale - np.eye(N - 1)).max() < 1e-9


@pytest.mark.parametrize("term", EXACT + CLOSE + SMOOTH, ids=repr)
def test_gradient_of_the_expectation(term):
    data = cosine_periodogram([np.random.default_rng(0).standard_normal(N)], INTERVAL)
    gradient = expected_power(term, data)[1]
    step = 1e-5
    for row, name in zip(gradient, term.PARAMETERS, strict=True):
        values = {p: getattr(term, p) for p in term.PARAMETERS}
        up, down = (type(term)(**values | {name: values[name] * np.exp(s)}) for s in (step, -step))
        numeric = (expected_power(up, data)[0] - expected_power(down, data)[0]) / (2.0 * step)
        np.testing.assert_allclose(row, numeric, rtol=1e-5, atol=1e-7 * np.abs(row).max())


def test_periodogram_keeps_every_coefficient_and_all_power():
    y = np.random.default_rng(1).standard_normal(5000)
    y -= np.polyval(np.polyfit(np.arange(5000), y, 1), np.arange(5000))
    data = cosine_periodogram([y[:3000], y[3000:]], INTERVAL)
    assert data.count.sum() == 5000 - 2
    centred = np.concatenate((y[:3000] - y[:3000].mean(), y[3000:] - y[3000:].mean()))
    assert data.count @ data.power == pytest.approx(INTERVAL * centred @ centred, rel=2e-3)
    assert np.all(data.frequency <= 0.5 / INTERVAL)


def test_a_line_has_the_coefficients_of_the_unit_ramp():
    t = np.arange(1000) * INTERVAL
    data = cosine_periodogram([3.0 - 2.0 * t], INTERVAL)
    np.testing.assert_allclose(
        data.amplitude[:SINGLE_COEFFICIENTS], -2.0 * data.line[:SINGLE_COEFFICIENTS], atol=1e-9
    )
    np.testing.assert_allclose(
        data.line[:SINGLE_COEFFICIENTS], (basis(1000) @ t)[:SINGLE_COEFFICIENTS], atol=1e-9
    )
    np.testing.assert_allclose(data.amplitude[SINGLE_COEFFICIENTS:], 0.0, atol=1e-9)


def test_likelihood_of_white_noise_and_random_walk_is_exact():
    model = NoiseModel((White(0.3), RandomWalk(0.2)))
    y = model.sample(SINGLE_COEFFICIENTS, INTERVAL, np.random.default_rng(2))
    objective = Objective.of(cosine_periodogram([y], INTERVAL), ["white", "random_walk"])
    d = basis(SINGLE_COEFFICIENTS)

    def exact(n, k):
        c = covariance(White(n), SINGLE_COEFFICIENTS) + covariance(RandomWalk(k), SINGLE_COEFFICIENTS)
        return multivariate_normal(np.zeros(SINGLE_COEFFICIENTS - 1), d @ c @ d.T).logpdf(d @ y)

    points = [(0.3, 0.2), (0.2, 0.5), (0.5, 0.01)]
    ours = [objective.log_likelihood(np.log(point)) for point in points]
    np.testing.assert_allclose(np.diff(ours), np.diff([exact(*p) for p in points]), rtol=1e-9)


@pytest.mark.parametrize(
    "terms",
    [
        ("quantization", "white", "bias_instability", "random_walk", "ramp"),
        ("white", "gauss_markov", "gauss_markov"),
        ("white", "low_pass_white"),
    ],
)
def test_gradient_of_the_likelihood(terms):
    rng = np.random.default_rng(3)
    y = NoiseModel((White(0.3), RandomWalk(0.1), Ramp(0.05))).sample(2000, INTERVAL, rng)
    objective = Objective.of(cosine_periodogram([y], INTERVAL), terms)
    theta = 0.7 * objective.upper + 0.3 * objective.lower + 0.3 * rng.standard_normal(len(objective.lower))
    _, gradient, information = objective(theta)
    numeric = [(objective(theta + h)[0] - objective(theta - h)[0]) / 2e-5 for h in 1e-5 * np.eye(len(theta))]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-3)
    assert np.linalg.eigvalsh(information).min() > -1e-9 * np.trace(information)


TRUTHS = [
    (White(0.3),),
    (White(0.3), RandomWalk(0.1)),
    (White(0.3), BiasInstability(0.4)),
    (White(0.3), GaussMarkov(0.4, 5.0)),
    (Quantization(0.05), White(0.3)),
    (White(0.3), BiasInstability(0.3), RandomWalk(0.2)),
]


@pytest.mark.parametrize("terms", TRUTHS, ids=lambda terms: "+".join(t.name for t in terms))
def test_parameters_are_found_within_five_standard_errors(terms):
    model = NoiseModel(terms)
    y = model.sample(20_000, INTERVAL, np.random.default_rng(4))
    found = fit([y], INTERVAL, [t.name for t in terms])
    truth = np.log([getattr(t, p) for t in terms for p in t.PARAMETERS])
    bound = spectral_bound(
        lambda f, *values: model.with_values(values).psd(f, interval=INTERVAL),
        tuple(np.exp(truth)),
        20_000,
        INTERVAL,
    )
    assert np.all(np.abs(found.estimate - truth) < 5.0 * bound)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), bound, rtol=0.3)
    for value, (low, high) in zip(np.exp(found.estimate), found.intervals, strict=True):
        assert 0.0 <= low < value < high
    assert found.terms == tuple(t.name for t in found.model.terms)
    assert len(found.names) == len(truth)


def test_units_scale_through():
    y = NoiseModel((White(0.3), BiasInstability(0.4))).sample(20_000, INTERVAL, np.random.default_rng(5))
    one = fit([y], INTERVAL, ["white", "bias_instability"])
    small = fit([1e-6 * y], INTERVAL, ["white", "bias_instability"])
    np.testing.assert_allclose(small.estimate, one.estimate + np.log(1e-6), atol=1e-4)
    np.testing.assert_allclose(small.intervals, 1e-6 * np.array(one.intervals), rtol=5e-3)


def test_segments_are_pooled():
    rng = np.random.default_rng(6)
    model = NoiseModel((White(0.3), RandomWalk(0.1)))
    pieces = [model.sample(n, INTERVAL, rng) + 100.0 * rng.standard_normal() for n in (6000, 9000, 10, 7000)]
    found = fit(pieces, INTERVAL, ["white", "random_walk"])
    alone = fit(pieces[:1], INTERVAL, ["white", "random_walk"])
    error = found.estimate - np.log([0.3, 0.1])
    assert np.all(np.abs(error) < 5.0 * np.sqrt(np.diag(found.covariance)))
    assert np.all(np.diag(found.covariance) < 0.5 * np.diag(alone.covariance))


def test_many_segments_stay_cheap_and_unbiased():
    rng = np.random.default_rng(12)
    model = NoiseModel((White(0.3), BiasInstability(0.4)))
    pieces = [model.sample(int(n), INTERVAL, rng) for n in rng.integers(20, 400, 300)]
    data = cosine_periodogram(pieces, INTERVAL)
    assert len(data.frequency) < 3000
    found = fit_periodogram(data, ["white", "bias_instability"])
    assert np.all(np.abs(found.estimate - np.log([0.3, 0.4])) < 5.0 * np.sqrt(np.diag(found.covariance)))


@pytest.mark.parametrize("rate", [-0.02, 0.02])
def test_a_ramp_has_its_sign_and_does_not_feed_the_random_walk(rate):
    y = NoiseModel((White(0.3),)).sample(20_000, INTERVAL, np.random.default_rng(7))
    y = y + rate * INTERVAL * np.arange(20_000)
    found = fit([y], INTERVAL, ["white", "random_walk", "ramp"])
    low, high = found.interval("ramp.rate")
    assert low < abs(found.slope) < high
    assert found.slope == pytest.approx(rate, rel=0.01)
    assert found.value("ramp.rate") == pytest.approx(abs(rate), rel=0.01)
    assert found.interval("random_walk.density")[0] == 0.0
    assert found.interval("random_walk.density")[1] < 0.05


def test_a_random_walk_makes_the_slope_uncertain():
    rng = np.random.default_rng(8)
    walk = NoiseModel((White(0.3), RandomWalk(0.2))).sample(20_000, INTERVAL, rng)
    found = fit([walk], INTERVAL, ["white", "random_walk", "ramp"])
    assert found.interval("ramp.rate")[1] > 0.2 / np.sqrt(2000.0)  # a walk of density K drifts by K √T in T


def test_an_absent_term_has_an_interval_from_zero():
    y = White(0.3).sample(20_000, INTERVAL, np.random.default_rng(9))
    found = fit([y], INTERVAL, ["white", "random_walk"])
    low, high = found.interval("random_walk.density")
    assert low == 0.0
    assert 0.0 < high < 0.05


def test_sinusoids_are_measured_and_leave_the_noise():
    rng = np.random.default_rng(11)
    n, lines = 20_000, ((0.1, 1.2345), (0.05, 0.02))
    t = np.arange(n) * INTERVAL
    y = NoiseModel((White(0.1), BiasInstability(0.02))).sample(n, INTERVAL, rng)
    y = y + sum(a * np.sin(2.0 * np.pi * f * t + f) for a, f in lines)
    found = fit([y[:12_000], y[12_500:]], INTERVAL, ["white", "bias_instability", "sinusoid", "sinusoid"])
    assert found.terms == ("white", "bias_instability", "sinusoid", "sinusoid")
    sd = np.sqrt(np.diag(found.covariance))
    measured = {round(found.value(f"{name}.frequency"), 1): name for name in ("sinusoid", "sinusoid_2")}
    for amplitude, frequency in lines:
        name = measured[round(frequency, 1)]
        for parameter, truth in (("amplitude", amplitude), ("frequency", frequency)):
            at = found.names.index(f"{name}.{parameter}")
            assert abs(found.estimate[at] - np.log(truth)) < 5.0 * sd[at]
            assert found.intervals[at][0] < found.value(f"{name}.{parameter}") < found.intervals[at][1]
    assert abs(found.value("white.density") / 0.1 - 1.0) < 5.0 * sd[0]


def test_an_exactly_periodic_record():
    found = fit([np.tile([1.0, -1.0, 0.0, 0.0], 500)], INTERVAL, ["quantization", "white", "random_walk"])
    assert np.all(np.isfinite(found.estimate))


@pytest.mark.parametrize("terms", [[], ["ramp"], ["white", "pink"]])
def test_terms_that_cannot_be_fitted(terms):
    with pytest.raises(ValueError, match="'terms'"):
        fit([np.random.default_rng(0).standard_normal(100)], INTERVAL, terms)


@pytest.mark.parametrize(
    "pieces",
    [[np.zeros(5)], [np.full(500, 0.1)], [np.full(50, np.nan)], [np.r_[0.0, np.inf, np.ones(50)]], []],
)
def test_pieces_without_information(pieces):
    with pytest.raises(ValueError, match="'pieces'"):
        fit(pieces, INTERVAL, ["white"])


def test_shortest_record():
    y = np.random.default_rng(10).standard_normal(16)
    found = fit_periodogram(cosine_periodogram([y], INTERVAL), ["white", "random_walk"])
    assert np.all(np.isfinite(found.estimate))


def test_lines_take_no_part_in_white_noise():
    n = 50_000
    t, white = INTERVAL * np.arange(n), np.random.default_rng(5).standard_normal(n)
    comb = sum(0.09 * np.cos(2.0 * np.pi * k * 0.039 / INTERVAL * t + k) for k in range(1, 12))
    alone, beside = (fit([y], INTERVAL, ["white"]) for y in (white, white + comb))
    assert cosine_periodogram([white], INTERVAL).count.sum() == n - 1
    assert cosine_periodogram([white], INTERVAL).lines == ()
    told = sorted(cosine_periodogram([white + comb], INTERVAL).lines)
    assert [f for f, _ in told] == pytest.approx(
        [k * 0.039 / INTERVAL for k in range(1, 12)], abs=1.0 / (n * INTERVAL)
    )
    assert [a for _, a in told] == pytest.approx([0.09] * 11, abs=5.0 * (2.0 / n) ** 0.5)
    assert "(11, the largest of " in about_lines(told, "1")[0]
    low, high = alone.interval("white.density")  # the comb has 4.5 % of the power, five half-widths
    assert beside.value("white.density") == pytest.approx(
        alone.value("white.density"), abs=0.2 * (high - low)
    )


@pytest.mark.parametrize("n", [*range(64, 80), 128])
def test_segments_with_few_cells_keep_their_coefficients(n):
    y = np.random.default_rng(n).standard_normal(n)
    assert cosine_periodogram([y], INTERVAL).count.sum() == n - 1


def test_a_line_is_no_matter_of_a_curve_in_octaves():
    """A slow wave contradicts the terms, which then come from the curve; that told a line of 237 Hz at 100 Hz."""
    rng, t = np.random.default_rng(1), 0.01 * np.arange(100_000)
    y = lfilter(*butter(1, 0.1), rng.normal(size=len(t))) + 0.05 * np.sin(2 * np.pi * 27.346 * t)
    y += 0.3 * np.sin(2 * np.pi * t / 150.0)
    record = Record("accel", t, y[:, None], ("accel_x",), "m/s^2", 0.01)
    found = identify_channel(record, "accel_x", further=("sinusoid",))
    assert "weighted least squares on the curve" in found.warnings[-1]
    assert all(term.name != "sinusoid" for term in found.terms)
