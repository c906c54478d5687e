"""Tails, quantiles and tests of a sample are those of scipy.stats, which takes half a second to load."""

import numpy as np
import pytest
from scipy import stats

from models.probability import (
    binomial_at_least,
    chi2_below,
    chi2_beyond,
    chi2_quantile,
    fisher_beyond,
    log_normal_density,
    negative_binomial_at_least,
    normal_below,
    normal_beyond,
    normal_density,
    normal_reach,
    normality,
    poisson_at_least,
    same_mean,
    student_beyond,
    student_quantile,
)


def test_tails_and_quantiles_are_those_of_scipy():
    assert normal_below(-1.3) == pytest.approx(stats.norm.cdf(-1.3), rel=1e-12)
    assert normal_beyond(9.0) == pytest.approx(stats.norm.sf(9.0), rel=1e-12)
    assert normal_reach(0.95) == pytest.approx(stats.norm.isf(0.025), rel=1e-12)
    assert chi2_beyond(30.0, 4) == pytest.approx(stats.chi2.sf(30.0, 4), rel=1e-12)
    assert chi2_beyond(-1.0, 4) == 1.0
    assert chi2_beyond(1.0, 0) == 1.0
    freedom = np.array([1.0, 2.5, 300.0])
    assert chi2_quantile(0.9, freedom) == pytest.approx(stats.chi2.ppf(0.9, freedom), rel=1e-12)
    assert normal_beyond(freedom) == pytest.approx(stats.norm.sf(freedom), rel=1e-12)
    assert normal_density(freedom, 2.0) == pytest.approx(stats.norm.pdf(freedom, 0.0, 2.0), rel=1e-12)
    assert normal_density(0.5) == pytest.approx(stats.norm.pdf(0.5), rel=1e-12)
    assert log_normal_density(freedom, 2.0) == pytest.approx(stats.norm.logpdf(freedom, 0.0, 2.0), rel=1e-12)
    assert chi2_below(freedom, 3) == pytest.approx(stats.chi2.cdf(freedom, 3), rel=1e-12)
    assert student_beyond(freedom, 2.5) == pytest.approx(stats.t.sf(freedom, 2.5), rel=1e-12)
    assert student_beyond(3.0, np.inf) == pytest.approx(stats.norm.sf(3.0), rel=1e-12)
    assert fisher_beyond(7.0, 2, 30) == pytest.approx(stats.f.sf(7.0, 2, 30), rel=1e-9)
    assert student_quantile(1e-7, 30) == pytest.approx(-stats.t.isf(1e-7, 30), rel=1e-9)
    assert student_quantile(0.975, 3) == pytest.approx(stats.t.ppf(0.975, 3), rel=1e-9)


@pytest.mark.parametrize("count", [0, 1, 7, 40])
def test_chances_of_counts_are_those_of_scipy(count):
    assert poisson_at_least(count, 2.5) == pytest.approx(stats.poisson.sf(count - 1, 2.5), rel=1e-11)
    assert binomial_at_least(count, 40, 0.1) == pytest.approx(stats.binom.sf(count - 1, 40, 0.1), rel=1e-11)
    law = stats.nbinom(1.0 / 0.3, 1.0 / (1.0 + 2.5 * 0.3))
    assert negative_binomial_at_least(count, 2.5, 0.3) == pytest.approx(law.sf(count - 1), rel=1e-11)


@pytest.mark.parametrize("count", [20, 1000])
def test_tests_of_a_sample_are_those_of_scipy(count):
    rng = np.random.default_rng(count)
    for x in (rng.standard_normal(count), rng.exponential(size=count), rng.standard_t(4, count)):
        found = normality(x)
        assert found.jarque_bera == pytest.approx(stats.jarque_bera(x).pvalue, rel=1e-8)
        assert found.dagostino == pytest.approx(stats.normaltest(x).pvalue, rel=1e-8)
        assert found.excess_kurtosis == pytest.approx(stats.kurtosis(x), rel=1e-10)
    groups = rng.standard_normal((5, count))
    assert same_mean(groups) == pytest.approx(tuple(stats.f_oneway(*groups)), rel=1e-9)
