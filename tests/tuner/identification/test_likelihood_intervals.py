"""Coverage of intervals, also of terms that are hardly present."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm

from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, White
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.intervals import _deviate, interval
from tuner.identification.objective import Objective
from tuner.identification.periodogram import cosine_periodogram

INTERVAL = 0.1


@pytest.mark.parametrize("freedom", [1.0, 2.0, 5.0, 100.0])
@pytest.mark.parametrize("p", [0.001, 0.025, 0.3, 0.5, 0.9, 0.975, 0.999])
def test_saddle_point_of_one_chi_square(freedom, p):
    deviate = _deviate(np.ones(1), np.array([freedom]), float(chi2.ppf(p, freedom)))
    assert norm.cdf(deviate) == pytest.approx(p, rel=0.1, abs=0.007)


def test_saddle_point_of_a_difference_is_symmetric():
    weight, freedom = np.array([1.0, -1.0]), np.array([3.0, 3.0])
    assert _deviate(weight, freedom, 0.0) == pytest.approx(0.0, abs=1e-6)
    assert _deviate(weight, freedom, 7.0) == pytest.approx(-_deviate(weight, freedom, -7.0), abs=1e-6)


def draws(terms, n, seed, runs):
    """Periodograms of records, drawn in the cosine domain."""
    rng = np.random.default_rng(seed)
    blank = cosine_periodogram([rng.standard_normal(n)], INTERVAL)
    power = np.sum([expected_power(term, blank)[0] for term in terms], axis=0)
    for _ in range(runs):
        square = rng.chisquare(blank.count) / blank.count
        yield replace(blank, amplitude=np.sqrt(power * square))


def covered(terms, n, seed, runs, level):
    truth = [getattr(t, p) for t in terms for p in t.PARAMETERS]
    hits = np.zeros(len(truth), dtype=int)
    for data in draws(terms, n, seed, runs):
        objective = Objective.of(data, [t.name for t in terms])
        theta = objective.maximum()
        ends = [interval(objective, theta, j, level=level) for j in range(len(truth))]
        hits += [low <= value <= high for value, (low, high) in zip(truth, ends, strict=True)]
    return hits


WEAK = (White(0.3), RandomWalk(0.01))  # about two coefficients show the walk


@pytest.mark.parametrize("level", [0.5, 0.95])
def test_coverage_of_a_random_walk_in_few_coefficients(level):
    runs = 150
    hits = covered(WEAK, 8000, 1, runs, level)
    low, high = binom.ppf([2e-6, 1.0 - 2e-6], runs, level)
    assert np.all(hits >= low)
    assert np.all(hits[0] <= high)


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.5, 0.95])
@pytest.mark.parametrize(
    "terms",
    [
        WEAK,
        (White(0.3), RandomWalk(0.1)),
        (White(0.3), BiasInstability(0.2), RandomWalk(0.03)),
        (White(0.3), GaussMarkov(0.3, 10.0)),
    ],
    ids=lambda terms: "+".join(t.name for t in terms),
)
def test_coverage(terms, level):
    runs = 800
    hits = covered(terms, 20_000, 2, runs, level)
    slack = 0.035 if level == 0.5 else 0.02
    assert np.all(hits >= binom.ppf(1e-5, runs, level - slack))
    assert np.all(hits <= binom.ppf(1.0 - 1e-5, runs, level + slack))


def test_the_upper_end_never_collapses():
    # quieter than white noise alone at low frequency: still a limit that the record could have shown
    y = NoiseModel((White(0.3),)).sample(20_000, INTERVAL, np.random.default_rng(3))
    data = cosine_periodogram([y], INTERVAL)
    quiet = replace(data, amplitude=np.where(data.order < 10, 0.1, 1.0) * data.amplitude)
    objective = Objective.of(quiet, ["white", "random_walk"])
    low, high = interval(objective, objective.maximum(), 1)
    assert low == 0.0
    assert high > 0.3 * 0.3 * 2000.0**-1 * np.pi  # K whose first coefficient is a tenth of the white power
