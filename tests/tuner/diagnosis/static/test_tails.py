"""Heavy tails are one cause where one distribution makes them; spikes beside them are found as well.

Seeds are fixed and are the first that were tried; every effect has a hundred nats and more.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest, norm

from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.heavy_tails import (
    HeavyTails,
    beside_spikes,
    rounded_kurtosis,
    student,
    whole,
)
from tuner.diagnosis.static.causes.skewed_noise import SkewedNoise
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.variance.histogram import histogram
from tuner.diagnosis.static.variance.normal_scores import NormalScores
from tuner.types.records import Record

INTERVAL, N = 0.01, 100_000
NORMAL, PURE, MIXED = HeavyTails(1e9), HeavyTails(5.0), HeavyTails(5.0, 0.3, 1.5)


def causes(y: np.ndarray) -> list[str]:
    record = Record("gyro", INTERVAL * np.arange(len(y)), y[:, None], ("gyro_x",), "rad/s", INTERVAL)
    diagnosis = diagnose(record)
    assert diagnosis.unexplained == ()
    return [finding.cause for finding in diagnosis.findings]


@pytest.mark.parametrize(
    ("added", "mixed"),
    [
        (0.5, 0.0),
        (0.0, 0.02),
        *(pytest.param(*shares, marks=pytest.mark.slow) for shares in ((2.0, 0.0), (0.0, 0.3))),
    ],
)
def test_normal_noise_with_student_noise_added_or_mixed_in_has_one_cause(added, mixed):
    rng = np.random.default_rng(1)
    normal, heavy = rng.standard_normal(N), rng.standard_t(5, N)
    assert causes(np.where(rng.random(N) < mixed, heavy, normal + added * heavy)) == ["heavy_tails"]


@pytest.mark.parametrize(("nu", "named"), [(np.inf, ["spikes"]), (20.0, ["heavy_tails", "spikes"])])
def test_spikes_of_one_size_are_spikes_beside_any_law(nu, named):
    rng = np.random.default_rng(3)
    y = rng.standard_normal(N) if np.isinf(nu) else rng.standard_t(nu, N)
    y[rng.choice(N, 30, replace=False)] += 10.0 * np.sign(rng.standard_normal(30))
    assert causes(y) == named


def test_student_noise_alone_keeps_its_law():
    for nu in (4.0, 8.0, 20.0):
        bins = histogram(np.random.default_rng(int(nu)).standard_t(nu, N))
        law = whole(bins)
        assert law.share == 1.0
        assert law.nu == pytest.approx(nu, rel=0.15)
        assert law == student(bins)


def test_spikes_are_likelier_than_one_law_where_there_are_some():
    rng = np.random.default_rng(4)
    y = rng.standard_t(10, N)
    assert whole(histogram(y)).share == 1.0
    y[:100] += 12.0
    bins = histogram(y)
    assert beside_spikes(bins) > student(bins).gain + 100.0
    assert whole(bins).share == 1.0


def test_the_kurtosis_of_rounded_noise_grows_without_bound_and_without_a_warning():
    named = [rounded_kurtosis(step) for step in (0.5, 2.0, 3.0, 6.0, 30.0, 100.0)]
    assert named == sorted(named)
    assert named[0] < 0.0 < named[2]
    assert named[-1] == np.inf


@pytest.mark.parametrize("law", [NORMAL, PURE, MIXED])
def test_a_law_is_one_of_unit_variance_and_is_mapped_to_the_normal_one(law):
    """Its density has unit area and variance, its samples are mapped to normal ones (p > 1e-5)."""
    reach = 2000.0
    area, _ = quad(
        lambda x: float(np.exp(law.log_density(np.array([x]))[0])), -reach, reach, points=[0.0], limit=500
    )
    square, _ = quad(
        lambda x: x * x * float(np.exp(law.log_density(np.array([x]))[0])),
        -reach,
        reach,
        points=[0.0],
        limit=500,
    )
    assert area == pytest.approx(1.0, abs=1e-6)
    assert square == pytest.approx(1.0, abs=1e-3)
    e = law.sample(100_000, np.random.default_rng(5))
    assert kstest(law.whiten(e), norm.cdf).pvalue > 1e-5


def skewed(law: str, n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    y = rng.lognormal(0.0, 0.7, n) if law == "lognormal" else -rng.gamma(0.5, size=n)
    return (y - y.mean()) / y.std()


@pytest.mark.parametrize(
    ("law", "seed"), [("lognormal", 2), pytest.param("gamma", 1, marks=pytest.mark.slow)]
)
def test_independent_samples_of_a_skewed_law_have_that_cause_alone(law, seed):
    assert causes(skewed(law, 20_000, seed)) == ["skewed_noise"]


@pytest.mark.parametrize("effect", ["spikes", pytest.param("telegraph", marks=pytest.mark.slow)])
def test_what_happens_in_skewed_noise_is_found_beside_its_law(effect):
    y, rng = skewed("lognormal", 20_000, 3), np.random.default_rng(5)
    if effect == "spikes":
        y[rng.choice(len(y), 8, replace=False)] -= 25.0
    else:
        y += 0.7 * (np.cumsum(rng.random(len(y)) < 1.0 / 2000.0) % 2)
    assert sorted(causes(y)) == sorted(["skewed_noise", effect])


@pytest.mark.parametrize("law", ["lognormal", "gamma"])
def test_normal_scores_are_normal_and_have_the_density_of_the_law(law):
    y = skewed(law, 200_000, 6)
    scores = NormalScores.of(y)
    assert kstest(scores.shuffled(y), "norm").statistic < 0.005
    x = np.linspace(np.quantile(y, 0.001), np.quantile(y, 0.9999), 200_001)
    density = np.exp(norm.logpdf(scores(x)) + scores.log_slope(x))
    assert np.trapezoid(density, x) == pytest.approx(0.9989, abs=2e-3)
    far = scores(np.array([np.max(np.abs(y)) * 3.0]) * np.sign(y.mean() - np.median(y)))
    assert 6.0 < abs(far[0]) < 35.0


def test_codes_are_no_law_of_their_own():
    # 0.4 sds, and the mean not midway between two: quantiles of residuals lie on the codes
    y, rng = np.empty(60_000), np.random.default_rng(7)
    y[:] = rng.standard_gamma(2000.0, len(y))  # skewness 0.045
    y = 0.4 * np.round(((y - y.mean()) / y.std() + 0.13) / 0.4)
    record = Record("gyro", INTERVAL * np.arange(len(y)), y[:, None], ("gyro_x",), "rad/s", INTERVAL)
    found = SkewedNoise.test(fit_channel(channel(record, "gyro_x", quantizer_step=0.4)))
    assert found is not None
    assert found.gain < 50.0
